"""Commands, targets and the state of the assistance between two steps."""

from dataclasses import dataclass

import numpy as np

from pilotfish.assistance.autonomous import AutonomousPlan
from pilotfish.assistance.grip import HeldScalars
from pilotfish.assistance.identification import Identification
from pilotfish.assistance.limits import TargetMotion
from pilotfish.assistance.mapping import Clutch
from pilotfish.assistance.situation import Situation
from pilotfish.assistance.transition import Transition
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_type, shorten_repr

MODES = ("direct", "shared", "autonomous")
MAX_SKILLS = 10**6


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """What the operator wants at one step.

    Attributes:
        hand: Pose of the hand and scalars such as the grip, in the coordinates of the skill.
        mode: "direct", "shared" or "autonomous".
        clutch: Whether the robot follows the hand.
        skill: Index of the skill in use.

    Raises:
        InvalidInput: If the mode is unknown, or a field has another type; a bad hand is not refused.
    """

    hand: Float[Array, " D"]
    mode: str = "shared"
    clutch: bool = True
    skill: int = 0

    def __post_init__(self) -> None:
        require_type(self.hand, "hand", np.ndarray, "pass np.array(pose)")
        require_type(self.mode, "mode", str, "pass one of " + ", ".join(MODES))
        if self.mode not in MODES:
            raise InvalidInput(f"mode is {self.mode!r}, expected one of {', '.join(MODES)}")
        require_type(self.clutch, "clutch", bool, "pass True while the robot follows the hand")
        require_count(self.skill, "skill", MAX_SKILLS)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """What the robot shall do.

    Attributes:
        pose: Pose and scalars.
        velocity: Velocity [m/s] and angular velocity in body axes [rad/s], then zeros for scalars.
        covariance: Covariance of the desired pose; that of the operator without assistance.
        mode: Mode in effect.
        authority: Authority of the assistance, 0 to 1.
        probabilities: Probability of each state of the skill.
    """

    pose: Float[Array, " D"]
    velocity: Float[Array, " E"]
    covariance: Float[Array, "E E"]
    mode: str
    authority: float
    probabilities: Float[Array, " K"]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class AssistanceState:
    """State of the assistance between two steps; `initial_state` makes the first one.

    Attributes:
        command: Last valid command, mapped to the robot.
        clutch: Clutch.
        following: Whether the last step followed the hand.
        mode: Mode in effect.
        skill: Index of the skill in use.
        situation: The skill in the frames observed and the actual ones.
        identification: Filter of the states.
        authority: Authority of the assistance.
        transition: Blend to the desired pose.
        motion: Target and its velocity.
        scalars: Scalars that hold until the operator takes them over.
        plan: Plan of autonomous control, if it has begun.
        tracked: Pose and velocity of the LQR of the literal variant.
    """

    command: Float[Array, " D"]
    clutch: Clutch
    following: bool
    mode: str
    skill: int
    situation: Situation
    identification: Identification
    authority: float
    transition: Transition
    motion: TargetMotion
    scalars: HeldScalars
    plan: AutonomousPlan | None
    tracked: tuple[Float[Array, " D"], Float[Array, " E"]] | None
