"""Commands, targets and the state of the assistance between two steps."""

from dataclasses import dataclass

import numpy as np

from pilotfish.assistance.autonomous import AutonomousPlan
from pilotfish.assistance.situation import Situation
from pilotfish.assistance.virtual_fixture import FixtureState
from pilotfish.errors import InvalidInput
from pilotfish.kernels import AssistanceMemory, HandMap, StateFilter
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_type, shorten_repr

MODES = ("direct", "shared", "autonomous", "fixture")
MAX_SKILLS = 10**6


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """What the operator wants at one step.

    Attributes:
        hand: Pose of the hand and scalars such as the grip, in the coordinates of the skill.
        mode: "direct", "shared", "autonomous" or "fixture".
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
        memory: Command, filter, authority, transition and target.
        hand_map: Map from the hand to the command, with the displacement of the clutch.
        is_clutch_closed: Whether the robot follows the hand.
        mode: Mode in effect.
        skill: Index of the skill in use.
        situation: The skill in the frames observed and the actual ones.
        plan: Plan of autonomous control, if it has begun.
        cart: Cart on the virtual fixture, in the mode "fixture".
        joint: Filter of the joint skill of the literal variant.
        tracked: Pose and velocity of its LQR.
    """

    memory: AssistanceMemory
    hand_map: HandMap
    is_clutch_closed: bool
    mode: str
    skill: int
    situation: Situation
    plan: AutonomousPlan | None
    cart: FixtureState | None
    joint: StateFilter | None
    tracked: tuple[Float[Array, " D"], Float[Array, " E"]] | None
