"""Settings of the operator's site, what the operator does at one step, and what is displayed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pilotfish.assistance import AssistedSkill, Limits
from pilotfish.demonstrations import Layout, pose_layout
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.teleop.messages import (
    MAX_MISSION,
    MAX_PIECES,
    MODES,
    NO_ENVELOPE,
    PIECE_SIZE,
    Envelope,
    Report,
    SkillState,
)
from pilotfish.teleop.robot_values import DEFAULT_SPEED, MAX_PEER
from pilotfish.teleop.session import CLEARING_ACTIONS, Action, Reason, SessionState
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number, require_type, shorten_repr

MAX_SKILL_BYTES = PIECE_SIZE * MAX_PIECES


def _limits() -> Limits:
    return Limits(speed=DEFAULT_SPEED)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class OperatorSettings:
    """Settings of an operator's site.

    Attributes:
        decode_skill: Function from the bytes of a skill to the prepared skill, the same as at the robot.
        skills: Bytes of each skill of the mission, in their order.
        number: Number of this operator.
        budget: Budget of the round trip that the operator asks for [s].
        jitter: Jitter that the operator asks for [s].
        layout: Columns of a command, the same as at the robot.
        limits: Limits of the predicted robot, the same as at the robot.
        command_period: Time between two commands [s]; one step sends one.
        repeat_steps: Steps after which a request is repeated.
        piece_steps: Steps between two pieces of a skill.
        is_predicting: Whether the robot is predicted; otherwise it stands at the reported target.

    Raises:
        InvalidInput: If a number is out of range, or a skill is too long.
    """

    decode_skill: Callable[[bytes], AssistedSkill]
    skills: tuple[bytes, ...] = ()
    number: int = 1
    budget: float = 0.5
    jitter: float = 0.25
    layout: Layout = field(default_factory=pose_layout)
    limits: Limits = field(default_factory=_limits)
    command_period: float = 0.02
    repeat_steps: int = 10
    piece_steps: int = 5
    is_predicting: bool = True

    def __post_init__(self) -> None:
        require_count(self.number, "number", MAX_PEER, minimum=1)
        for name in ("budget", "jitter", "command_period"):
            require_number(getattr(self, name), name, 0.0, 600.0)
        for name in ("repeat_steps", "piece_steps"):
            require_count(getattr(self, name), name, 1000, minimum=1)
        if len(self.skills) > MAX_MISSION:
            raise InvalidInput(f"skills has {len(self.skills)} skills, expected at most {MAX_MISSION}")
        for n, data in enumerate(self.skills):
            require_type(data, f"skills[{n}]", bytes, "pass the bytes of a skill: io.encode_skill(skill)")
            if not 0 < len(data) <= MAX_SKILL_BYTES:
                raise InvalidInput(
                    f"skills[{n}] has {len(data)} bytes, expected 1 to {MAX_SKILL_BYTES}; learn the skill "
                    "with fewer states"
                )


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class OperatorInput:
    """What the operator does at one step.

    Attributes:
        hand: Position [m] and quaternion of the hand.
        grip: Grip, 0 to 1.
        mode: "direct", "shared", "autonomous" or "fixture".
        is_clutch_closed: Whether the robot follows the hand.
        is_dead_man_pressed: Whether the dead-man switch is pressed.
        skill: Index of the skill in the mission.
        actions: What the operator asks for now.
        envelope: What is authorised, with `Action.AUTHORISE`.
        is_stopping: Whether the operator stops the robot now.

    Raises:
        InvalidInput: If a number is not finite or out of range, or the mode is unknown.
    """

    hand: Float[Array, " 7"]
    grip: float = 0.0
    mode: str = "shared"
    is_clutch_closed: bool = True
    is_dead_man_pressed: bool = True
    skill: int = 0
    actions: tuple[Action, ...] = ()
    envelope: Envelope = NO_ENVELOPE
    is_stopping: bool = False

    def __post_init__(self) -> None:
        require_type(self.hand, "hand", np.ndarray, "pass np.array(pose)")
        if self.hand.shape != (7,) or not np.isfinite(self.hand).all():
            raise InvalidInput(
                f"hand is {self.hand}, expected seven finite numbers: position, then quaternion"
            )
        if abs(float(np.linalg.norm(self.hand[3:])) - 1.0) > 1e-3:
            raise InvalidInput(f"hand has the quaternion {self.hand[3:]}, expected a unit quaternion")
        require_number(self.grip, "grip", 0.0, 1.0)
        if self.mode not in MODES:
            raise InvalidInput(f"mode is {self.mode!r}, expected one of {', '.join(MODES)}")
        require_count(self.skill, "skill", MAX_MISSION - 1)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class OperatorView:
    """What is displayed to the operator.

    Attributes:
        report: Last report of the robot; None before the first.
        report_age: Time since it arrived, on the operator's clock [s].
        round_trips: Measured round-trip times, the last hundred at most [s].
        lost_reports: Number of reports that did not arrive.
        frames: Poses of the objects as the robot reported them.
        predicted: Predicted pose of the robot, where its commands of now will bring it: position, quaternion.
        predicted_authority: Authority of the assistance in the prediction.
        skills: State of each skill of the mission at the robot.
        waiting: Number of requests that the robot has not answered.
        command: Number of the command of this step.
        is_mission_known: Whether the robot knows the skills of the mission, which it accepts at rest only.
    """

    report: Report | None
    report_age: float
    round_trips: tuple[float, ...]
    lost_reports: int
    frames: Mapping[str, Pose]
    predicted: Float[Array, " 7"]
    predicted_authority: float
    skills: tuple[SkillState, ...]
    waiting: int
    command: int
    is_mission_known: bool


def start_view() -> OperatorView:
    """Return the view before anything was received."""
    pose = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    return OperatorView(None, 0.0, (), 0, {}, pose, 0.0, (), 0, 0, is_mission_known=False)


def next_action(view: OperatorView, number: int, *, needs_skill: bool = True) -> Action | None:
    """Return the one action that brings the operator nearer to control; None if there is nothing to do.

    If a skill is needed, the robot is not armed before it knows the mission. It would not accept the skill
    while it moves, and so could neither assist nor continue alone.

    Args:
        view: What is displayed to the operator.
        number: Number of the operator.
        needs_skill: Whether assistance, or to continue through an outage, is wanted.

    Raises:
        InvalidInput: If an argument has another type.
    """
    require_type(view, "view", OperatorView, "step_operator returns it")
    require_type(needs_skill, "needs_skill", bool, "pass True or False")
    require_count(number, "number", MAX_PEER, minimum=1)
    report = view.report
    if report is None or view.waiting or report.state in (SessionState.ACTIVE, SessionState.ALIGNING):
        return None
    if report.holder != number:
        return None if report.state is SessionState.CONTINUING else Action.ACQUIRE
    if report.state is SessionState.CONTINUING:
        return None if report.is_link_lost else Action.ARM
    if report.reason is not Reason.NONE:
        return CLEARING_ACTIONS[report.reason]
    return Action.ARM if view.is_mission_known or not needs_skill else None


def describe_link_drop(report: Report) -> str:
    """Return what the robot would do if the link dropped now.

    Args:
        report: Last report of the robot.

    Raises:
        InvalidInput: If it is something else.
    """
    require_type(report, "report", Report, "an OperatorView holds one")
    if report.state not in (SessionState.ACTIVE, SessionState.CONTINUING):
        return "the robot stays at rest"
    if not report.is_authorised:
        return "the robot stops and holds"
    left = f" for {report.envelope_left:.0f} s at most" if report.envelope_left else ""
    return f"the robot continues alone{left}, inside the envelope, then stops and holds"
