"""Arguments and results of one step of the assistance.

A pose has D columns: a position of three axes, then a unit quaternion if E = D - 1, then S scalars such as a
grip. A deviation has E columns, in which a rotation vector stands for the quaternion. A skill has K states.
"""

from dataclasses import dataclass
from typing import NamedTuple

from pilotfish.kernels.occupancy import StateFilter
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

DIRECT, SHARED, AUTONOMOUS = 0, 1, 2


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class CarriedModel:
    """A skill adapted to the scene that the operator sees and to the actual one.

    Attributes:
        observed_means: Means in the scene observed.
        whitening: Lower triangular W with W' W = (Sigma + S)^-1 in the scene observed.
        actual_means: Means in the actual scene.
        offsets: Corrected deviation of a command at the mean observed.
        gains: From deviations observed to what they add to it.
        fused_covariances: Covariance of the corrected command in each state.
    """

    observed_means: Float[Array, "K D"]
    whitening: Float[Array, "K E E"]
    actual_means: Float[Array, "K D"]
    offsets: Float[Array, "K E"]
    gains: Float[Array, "K E E"]
    fused_covariances: Float[Array, "K E E"]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class AssistanceSettings:
    """Settings of the step.

    Attributes:
        variances: Variance of the operator in each tangent column.
        lower: Lower corner of the workspace [m].
        upper: Upper corner of the workspace [m].
        full: Largest distance from the demonstrations with full authority.
        none: Smallest distance without authority, above `full`.
        speed: Largest speed [m/s].
        acceleration: Largest acceleration [m/s^2].
        angular_speed: Largest angular speed [rad/s].
        angular_acceleration: Largest angular acceleration [rad/s^2].
        period: Period of the skill [s].
    """

    variances: Float[Array, " E"]
    lower: Float[Array, " 3"]
    upper: Float[Array, " 3"]
    full: float
    none: float
    speed: float
    acceleration: float
    angular_speed: float
    angular_acceleration: float
    period: float


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class AssistanceMemory:
    """What one step leaves for the next.

    Attributes:
        filter: Filter of the states.
        command: Last valid command, mapped to the robot.
        offset: Deviation of the target from the desired pose at the last change; zero for scalars.
        pose: Target: pose and scalars.
        velocity: Its velocity [m/s] and angular velocity in body axes [rad/s], then zeros for scalars.
        desired: Desired pose of the last step, within the workspace.
        held_values: Value of each scalar that holds; NaN for one that follows the hand or the plan.
        held_commands: Scalars of the hand or the plan at the last change.
        authority: Authority of the assistance, 0 to 1.
        blend_time: Time since the last change [s].
        blend_duration: Time after which the offset is zero [s].
        is_following: Whether the last step followed the hand.
        has_left: Whether authority came to zero because the operator left what the skill covers.
    """

    filter: StateFilter
    command: Float[Array, " D"]
    offset: Float[Array, " E"]
    pose: Float[Array, " D"]
    velocity: Float[Array, " E"]
    desired: Float[Array, " D"]
    held_values: Float[Array, " S"]
    held_commands: Float[Array, " S"]
    authority: float
    blend_time: float
    blend_duration: float
    is_following: bool
    has_left: bool = False


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class AssistanceInput:
    """What a step is given.

    Attributes:
        hand: Pose and scalars of the operator's hand, of any value; a bad one holds the command.
        given_pose: Pose of the plan in autonomous control, or the corrected command of another form of shared
            control; None computes the correction here.
        given_covariance: Its covariance.
        dt: Time since the step before [s].
        mode: DIRECT, SHARED or AUTONOMOUS.
        is_closed: Whether the clutch is closed, so that the robot follows the hand.
        is_current: Whether the frames are; without them authority goes to zero.
        has_changed: Whether mode or skill are others than in the step before.
    """

    hand: Float[Array, " D"]
    given_pose: Float[Array, " D"] | None
    given_covariance: Float[Array, "E E"] | None
    dt: float
    mode: int
    is_closed: bool
    is_current: bool
    has_changed: bool


@shorten_repr
class AssistanceStep(NamedTuple):
    """Result of a step.

    Attributes:
        memory: For the next step, with the target.
        covariance: Covariance of the desired pose.
        probabilities: Probability of each state.
    """

    memory: AssistanceMemory
    covariance: Float[Array, "E E"]
    probabilities: Float[Array, " K"]
