"""Imprecision of the operator: how closely a command is meant."""

from dataclasses import dataclass

import numpy as np

from pilotfish.assistance.coordinates import pose_width
from pilotfish.demonstrations import Layout
from pilotfish.types import Array, Float
from pilotfish.validation import require_number

MIN_DEVIATION, MAX_DEVIATION = 1e-6, 1e3


@dataclass(frozen=True, slots=True)
class OperatorNoise:
    """Standard deviations of the operator, sigma_op.

    A state whose demonstrations agree more closely than this corrects the operator; one whose demonstrations
    vary more follows the operator.

    Attributes:
        position: Of each axis of the position [m].
        orientation: Of each axis of the rotation vector [rad].
        scalar: Of scalars such as a grip, in their unit. It serves to recognise the state only.

    Raises:
        InvalidInput: If a deviation is not from 1e-6 to 1e3.
    """

    position: float = 0.01
    orientation: float = 0.05
    scalar: float = 0.2

    def __post_init__(self) -> None:
        for name in ("position", "orientation", "scalar"):
            require_number(getattr(self, name), name, MIN_DEVIATION, MAX_DEVIATION)

    def deviations(self, layout: Layout) -> Float[Array, " E"]:
        """Return the standard deviation of each tangent column.

        Args:
            layout: Layout from `coordinate_layout`.
        """
        width, pose = layout.tangent.width, pose_width(layout)
        deviations = np.full(width, float(self.scalar))
        deviations[:pose] = self.orientation
        deviations[:3] = self.position
        return deviations


DEFAULT_NOISE = OperatorNoise()
