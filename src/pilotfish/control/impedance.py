"""Impedance control of an arm: springs and dampers at its tool, or at its joints."""

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.kernels import ArmCommand, ArmLimits, ArmState, ImpedanceParameters, ToolTarget
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_number

MAX_JOINTS = 16  # the compiled kernel reserves memory for this number
POSITIVE_FIELDS = ("force_limit", "moment_limit", "min_singular_value")  # the others may be zero

# With these the tool of Baxter has an apparent inertia of 0.3 to 5 kg and 0.02 to 0.1 kg m^2, by direction.
# With
# joint friction and damping, a simulated arm comes within 3 mm of a target 50 mm away in 0.2 s.
STIFFNESS = (1000.0, 40.0)  # N/m, N m/rad
DAMPING = (60.0, 3.0)  # N s/m, N m s/rad


def impedance_torque(
    impedance: ImpedanceParameters, limits: ArmLimits, reading: ArmState, target: ToolTarget
) -> ArmCommand:
    """Compute the torques that hold the tool at its target by springs and dampers.

    tau = bias + J' F + (I - J' J^+') k_q (q_neutral - q) - k_v q' + limit_stiffness * depth

    with F = K e - D (J q' - twist). Here e is the pose error in world axes, the shorter way round, and depth
    is how far a joint is inside limit_margin of a limit. K e, and then F, is limited to force_limit and
    moment_limit, so that the spring alone moves the tool no faster than limit / damping. Torques are clipped
    joint by joint, so that a joint that can hardly carry its own weight does not stop the others.

    The result is always finite. If target or reading is not finite, F and the posture term are zero. What
    remains damps the joints, keeps them off their limits, and compensates the bias.

    Args:
        impedance: Stiffness, damping and limits, from `impedance`.
        limits: Limits of the joints, from `arm_limits`.
        reading: Present state of the arm.
        target: Pose and twist of the tool.

    Returns:
        Torques [N m], the wrench F, and the smallest fraction of the torque beyond the bias that a joint
        gives.

    Source:
        Tanwani 2018, eq. 6.11, with the orientation error on S^3; Chiaverini 1997 for J^+ near singular
        postures, as in the kernel `impedance_torque`.
    """
    return kernels.impedance_torque(impedance, limits, reading, target)


def posture_torque(
    stiffness: float | Float[Array, " n"],
    damping: float | Float[Array, " n"],
    limits: ArmLimits,
    reading: ArmState,
    posture: Float[Array, " n"],
) -> ArmCommand:
    """Compute the torques that hold the joints at a posture by springs and dampers.

    tau = bias + stiffness (posture - q) - damping q', clipped to the limits. Terms that are not finite are
    zero.

    Args:
        stiffness: Stiffness of each joint [N m/rad].
        damping: Damping of each joint [N m s/rad].
        limits: Limits of the joints; a posture outside them is clipped.
        reading: Present state of the arm.
        posture: Desired joint angles [rad].

    Returns:
        Torques [N m], as in `impedance_torque`; the wrench is zero.
    """
    with np.errstate(all="ignore"):
        clipped_posture = np.minimum(np.maximum(posture, limits.lower), limits.upper)
        spring = kernels.zero_non_finite(stiffness * (clipped_posture - reading.q))
        feedback_torque = kernels.zero_non_finite(
            spring - kernels.zero_non_finite(damping * reading.velocity)
        )
        torque, torque_fraction = kernels.clip_torque(
            limits.torque, kernels.zero_non_finite(reading.bias), feedback_torque
        )
    return ArmCommand(torque, np.zeros(6), torque_fraction)


def arm_limits(lower: object, upper: object, velocity: object, torque: object) -> ArmLimits:
    """Create the limits of an arm, one number per joint.

    Args:
        lower: Smallest joint angles [rad].
        upper: Largest joint angles [rad], above the smallest.
        velocity: Largest speeds [rad/s], positive.
        torque: Largest torques [N m], positive.

    Raises:
        InvalidInput: If the numbers of joints differ, a range is empty, or a limit is not positive.
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
    """Create the parameters of an impedance controller; the defaults suit Baxter.

    Args:
        posture: Joint angles q_neutral that the null space prefers [rad].
        stiffness: Six numbers, or one for translations [N/m] and one for rotations [N m/rad].
        damping: Six numbers, or one for translations [N s/m] and one for rotations [N m s/rad].
        posture_stiffness: k_q, stiffness in the null space [N m/rad].
        joint_damping: k_v, damping of every joint [N m s/rad].
        force_limit: Largest force [N], positive.
        moment_limit: Largest moment [N m], positive.
        min_singular_value: Singular value of J below which a direction fades into the null space, positive.
        limit_margin: Distance to a joint limit at which a spring begins to push back [rad].
        limit_stiffness: Stiffness of that spring [N m/rad].

    Raises:
        InvalidInput: If a number is not finite or negative, or zero where it must be positive.
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
        raise InvalidInput(f"{name} is {numbers.min():g}, expected zero or more: a negative one is unstable")
