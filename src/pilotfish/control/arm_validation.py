"""The doors of arm control: limits and springs that a user gives are checked here once."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.kernels import ArmLimits, ImpedanceParameters
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_number

MAX_JOINTS = 16  # the compiled kernel keeps room for so many
POSITIVE_FIELDS = ("force_limit", "moment_limit", "min_singular_value")  # nothing is divided by the others

# Baxter's tool feels like 0.3 to 5 kg and 0.02 to 0.1 kg m^2, by direction. With friction and damping at its
# joints, a simulated one comes within 3 mm of a target 50 mm away in 0.2 s; more damping is slower.
STIFFNESS = (1000.0, 40.0)  # N/m, N m/rad
DAMPING = (60.0, 3.0)  # N s/m, N m s/rad


def arm_limits(lower: object, upper: object, velocity: object, torque: object) -> ArmLimits:
    """The door for limits of joints: [rad], [rad], [rad/s], [N m]; one number each.

    Raises: InvalidInput, when they are not for as many joints, a range is empty, or a limit is not positive.
    """
    lower_limits = _joint_vector("lower", lower)
    upper_limits, velocity_limits, torque_limits = (
        finite_array(value, name, (len(lower_limits),))
        for name, value in (("upper", upper), ("velocity", velocity), ("torque", torque))
    )
    if (empty := np.flatnonzero(~(lower_limits < upper_limits))).size:
        j = int(empty[0])
        raise InvalidInput(
            f"joint {j} goes from {lower_limits[j]:g} to {upper_limits[j]:g} rad, expected lower below upper"
        )
    _require_positive("velocity", velocity_limits)
    _require_positive("torque", torque_limits)
    return ArmLimits(lower_limits, upper_limits, velocity_limits, torque_limits)


def impedance(  # noqa: PLR0913 - one argument for each field, all but the first with a default
    posture: object,
    *,
    stiffness: object = STIFFNESS,
    damping: object = DAMPING,
    posture_stiffness: float = 10.0,
    joint_damping: float = 1.0,
    force_limit: float = 60.0,
    moment_limit: float = 12.0,
    min_singular_value: float = 0.05,
    limit_margin: float = 0.1,
    limit_stiffness: float = 100.0,
) -> ImpedanceParameters:
    """The door for springs and dampers, units as Impedance tells; six numbers, or one for the translations
    and one for the rotations. The defaults suit Baxter.

    Raises: InvalidInput, when a number is not finite or negative, or zero where that has no meaning.
    """
    diagonals = _cartesian_diagonal("stiffness", stiffness), _cartesian_diagonal("damping", damping)
    numbers = {
        "posture_stiffness": posture_stiffness,
        "joint_damping": joint_damping,
        "force_limit": force_limit,
        "moment_limit": moment_limit,
        "min_singular_value": min_singular_value,
        "limit_margin": limit_margin,
        "limit_stiffness": limit_stiffness,
    }
    for name, value in numbers.items():
        require = _require_positive if name in POSITIVE_FIELDS else _require_not_negative
        require(name, np.array([require_number(value, name)]))
    return ImpedanceParameters(*diagonals, _joint_vector("posture", posture), *map(float, numbers.values()))


def _cartesian_diagonal(name: str, value: object) -> Float[Array, " 6"]:
    numbers = finite_array(value, name)
    if numbers.shape == (2,):
        numbers = np.repeat(numbers, 3)
    numbers = finite_array(numbers, name, (6,))
    _require_not_negative(name, numbers)
    return numbers


def _joint_vector(name: str, value: object) -> Float[Array, " n"]:
    numbers = finite_array(value, name)
    if numbers.ndim != 1 or not 1 <= len(numbers) <= MAX_JOINTS:
        raise InvalidInput(
            f"{name} has shape {numbers.shape}, expected (n,): one for each of 1 to {MAX_JOINTS} joints"
        )
    return numbers


def _require_positive(name: str, numbers: Float[Array, " n"]) -> None:
    if not (numbers > 0.0).all():
        raise InvalidInput(f"{name} is {numbers.min():g}, expected more than zero")


def _require_not_negative(name: str, numbers: Float[Array, " n"]) -> None:
    if not (numbers >= 0.0).all():
        raise InvalidInput(
            f"{name} is {numbers.min():g}, expected zero or more: a negative one drives the arm away"
        )
