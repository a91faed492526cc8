"""Reference of linear quadratic tracking: targets and their weights."""

from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """One target and one weight per step; from a skill, means and precision matrices.

    Attributes:
        targets: Target of the state at each step.
        weights: Symmetric positive semidefinite weight of the error [1 / unit of x squared]; zero leaves the
            step free.
        period: Time between two targets [s]. A system of another period is refused; None accepts any.
    """

    targets: Float[Array, "T n"]
    weights: Float[Array, "T n n"]
    period: float | None = None


def unique_weights(arrays: Float[Array, "T ..."]) -> tuple[list[int], Int[Array, " T"]]:
    """Return the first index of each distinct array, and for every array the number of its equal.

    As `numpy.unique` with its inverse, in order of appearance. A step-wise reference has few distinct
    weights.
    """
    number_by_value: dict[bytes, int] = {}
    first_indices: list[int] = []
    inverse: list[int] = []
    for t, array in enumerate(arrays):
        key = array.tobytes()
        if key not in number_by_value:
            number_by_value[key] = len(first_indices)
            first_indices.append(t)
        inverse.append(number_by_value[key])
    return first_indices, np.array(inverse)
