"""What a controller is asked to follow."""

from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Float, Int


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Where to be at each step, and how much it matters.

    Weights are symmetric, positive semidefinite, in one over the square of the state's unit: the precision of
    the target, when it comes from a Gaussian. A zero weight leaves the step free. period is the time from one
    target to the next [s], if they were planned for one: a system of another period then refuses to follow.
    """

    targets: Float[Array, "T n"]
    weights: Float[Array, "T n n"]
    period: float | None = None


def unique_weights(arrays: Float[Array, "T ..."]) -> tuple[list[int], Int[Array, " T"]]:
    """Where each value is met first, and which of these every array equals: few in a step-wise reference."""
    positions_by_value: dict[bytes, int] = {}
    first_indices: list[int] = []
    inverse: list[int] = []
    for t, array in enumerate(arrays):
        key = array.tobytes()
        if key not in positions_by_value:
            positions_by_value[key] = len(first_indices)
            first_indices.append(t)
        inverse.append(positions_by_value[key])
    return first_indices, np.array(inverse)
