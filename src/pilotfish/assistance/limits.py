"""Limits of the target, applied after fusion: workspace, speed and acceleration.

Two safe inputs may blend into one that is not; the limits therefore stand at the end. How the target follows
the desired pose within them is stated in `kernels/reference/target_motion.py`.
"""

from dataclasses import dataclass, field

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_number, shorten_repr

MIN_LIMIT, MAX_LIMIT = 1e-6, 1e6


def _corner(value: float) -> Float[Array, " 3"]:
    return np.full(3, value)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Limits of the target.

    Attributes:
        lower: Lower corner of the workspace [m].
        upper: Upper corner of the workspace [m].
        speed: Largest speed [m/s].
        acceleration: Largest acceleration [m/s^2].
        angular_speed: Largest angular speed [rad/s].
        angular_acceleration: Largest angular acceleration [rad/s^2].

    Raises:
        InvalidInput: If a number is not finite or not positive, or a corner is not below the other.
    """

    lower: Float[Array, " 3"] = field(default_factory=lambda: _corner(-10.0))
    upper: Float[Array, " 3"] = field(default_factory=lambda: _corner(10.0))
    speed: float = 0.5
    acceleration: float = 5.0
    angular_speed: float = 2.0
    angular_acceleration: float = 20.0

    def __post_init__(self) -> None:
        lower, upper = finite_array(self.lower, "lower", (3,)), finite_array(self.upper, "upper", (3,))
        if not (lower < upper).all():
            raise InvalidInput(
                f"lower is {lower.tolist()} and upper {upper.tolist()}, expected lower below upper"
            )
        for name in ("speed", "acceleration", "angular_speed", "angular_acceleration"):
            require_number(getattr(self, name), name, MIN_LIMIT, MAX_LIMIT)
