"""State of the robot site between two steps, and its parts."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pilotfish.assistance import (
    AssistanceState,
    Assistant,
    Target,
    direct_skill,
    initial_state,
    make_assistant,
)
from pilotfish.demonstrations import Frame, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.teleop.controlled_stop import TargetMotion
from pilotfish.teleop.delay_contract import DelayContract, nanoseconds
from pilotfish.teleop.messages import NO_ENVELOPE, CommandMessage, Envelope, Mission, Refusal
from pilotfish.teleop.robot_values import RobotSettings, RobotState
from pilotfish.teleop.session import Reason, SessionState
from pilotfish.teleop.skill_transfer import SkillStore
from pilotfish.validation import require_count, require_type, shorten_repr

MAX_TIME_NS = 2**62
NOBODY = 0
NO_MISSION = Mission(0, ())


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Control:
    """Who has control, and what was agreed.

    Attributes:
        state: State of the session.
        reason: Reason that is latched.
        holder: Peer that has control; 0 for none.
        lease: Number of the lease, which increases with every change of the holder.
        contract: Agreed times.
        envelope: What the robot may do without the operator.
        requests: Last request of each peer, and why it was refused.
        stops: Last stop of each peer.
        connections: Connection of each peer, in which these numbers count.
        is_rearmed: In CONTINUING, whether the holder armed again.
        since: When the state began [ns].
        first_report: Number of the first report of the state.
    """

    state: SessionState
    reason: Reason
    holder: int
    lease: int
    contract: DelayContract
    envelope: Envelope = NO_ENVELOPE
    requests: Mapping[int, tuple[int, Refusal]] = field(default_factory=dict)
    stops: Mapping[int, int] = field(default_factory=dict)
    connections: Mapping[int, int] = field(default_factory=dict)
    is_rearmed: bool = False
    since: int = 0
    first_report: int = 0


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class AcceptedCommands:
    """Commands of the holder so far.

    Attributes:
        last: Last command that was accepted; None under a new lease.
        number: Largest number that was accepted in the connection of the holder.
        arrived: When it arrived, or when the lease began [ns].
        age: Its measured age [ns].
        late: Number of reports that the last commands named, all of them older than the budget.
        stale: Number of commands that were refused as too old.
        is_new: Whether the last step accepted one.
    """

    last: CommandMessage | None
    number: int
    arrived: int
    age: int = 0
    late: int = 0
    stale: int = 0
    is_new: bool = False


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class SentReport:
    """Report that a command may name.

    Attributes:
        number: Number of the report.
        time: When it was sent [ns].
        frames: Frames that it named; None if they were stale.
    """

    number: int
    time: int
    frames: tuple[Frame, ...] | None


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Frames at the robot; the same objects until a pose changes.

    Attributes:
        actual: Frames of the objects; None if they are stale.
        reported: Frames as the operator is given them.
        state: Poses from which they were made.
        perceived: When the objects were perceived last [ns].
    """

    actual: tuple[Frame, ...] | None
    reported: tuple[Frame, ...] | None
    state: RobotState
    perceived: int


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Skills:
    """Skills of the mission at the robot.

    Attributes:
        mission: Mission of the holder.
        store: Pieces and decoded skills.
        assistant: Direct control, then every skill that was prepared, in the order of arrival.
        prepared: Hash of each prepared skill, and its index in the assistant.
    """

    mission: Mission
    store: SkillStore
    assistant: Assistant
    prepared: Mapping[bytes, int] = field(default_factory=dict)

    def index(self, number: int) -> int | None:
        """Return the index of a skill of the mission in the assistant; None if it is not there."""
        if number >= len(self.mission.skills):
            return None
        return self.prepared.get(self.mission.skills[number])


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Motion of the target.

    Attributes:
        assistance: State of the assistance.
        target: Pose and velocity of the target.
        last: What the assistance computed last; None before.
        misalignment: Distance [m] and angle [rad] from the robot to the hand, or to where it would move it.
        refusal: Why the mode or the skill of the last command is not in effect.
        is_limited: Whether limits keep the target from the pose that was asked for.
    """

    assistance: AssistanceState
    target: TargetMotion
    last: Target | None = None
    misalignment: tuple[float, float] = (0.0, 0.0)
    refusal: Refusal = Refusal.NONE
    is_limited: bool = False


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RobotSite:
    """State of the robot site; `start_robot` makes the first one.

    Attributes:
        time: Time of the last step on the robot's clock [ns].
        control: Who has control.
        commands: Commands of the holder.
        skills: Skills of the mission.
        scene: Frames at the robot.
        motion: Motion of the target.
        reports: Reports that a command may name, oldest first.
        next_report: When the next report is due [ns].
        next_status: When the state of the skills is due [ns].
    """

    time: int
    control: Control
    commands: AcceptedCommands
    skills: Skills
    scene: Scene
    motion: Motion
    reports: tuple[SentReport, ...]
    next_report: int
    next_status: int


def start_robot(settings: RobotSettings, time_ns: int, robot: RobotState) -> RobotSite:
    """Return the state before the first step: disarmed, nobody in control, at the present pose.

    Args:
        settings: Settings.
        time_ns: Time on the robot's monotonic clock [ns].
        robot: What the robot senses.

    Raises:
        InvalidInput: If the pose is not usable, or a setting is not.
    """
    require_type(settings, "settings", RobotSettings, "RobotSettings(decode_skill) makes one")
    require_count(time_ns, "time_ns", MAX_TIME_NS)
    require_type(robot, "robot", RobotState, "RobotState(pose, twist, grip, frames) makes one")
    if not robot.is_usable:
        raise InvalidInput("the robot's pose, twist or grip is not finite, expected numbers")
    assistant = make_assistant([direct_skill(settings.layout)], limits=settings.limits)
    pose = np.append(robot.pose, [robot.grip] * (assistant.layout.width - 7)).astype(float)
    world = (world_frame(assistant.layout.width),)
    contract = DelayContract(0, 0, nanoseconds(settings.command_period))
    return RobotSite(
        time=time_ns,
        control=Control(SessionState.DISARMED, Reason.NONE, NOBODY, 0, contract),
        commands=AcceptedCommands(None, 0, time_ns),
        skills=Skills(NO_MISSION, SkillStore(), assistant),
        scene=Scene(None, None, robot, time_ns),
        motion=Motion(
            initial_state(assistant, pose, world, world),
            TargetMotion(pose, np.zeros(assistant.layout.tangent.width)),
        ),
        reports=(),
        next_report=time_ns,
        next_status=time_ns,
    )


def find_report(site: RobotSite, number: int) -> SentReport | None:
    """Return the report of a number; None if it was never sent, or so long ago that it is forgotten.

    Args:
        site: State of the robot site.
        number: Number of the report.
    """
    if not site.reports:
        return None
    index = number - site.reports[0].number
    return site.reports[index] if 0 <= index < len(site.reports) else None
