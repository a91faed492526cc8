"""Messages between the operators and the robot; `codec` gives their bytes.

Positions are in metres, velocities in m/s and rad/s, quaternions w x y z, times in seconds. Poses are those
of the tool in the robot's world. Numbers are sent in single precision.

An operator's command names the last report that was displayed to the operator. The robot measures the age of
a command on its own clock, from the moment when it sent that report. No message carries a time of the
sender's clock.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from pilotfish.teleop.session import Action, Reason, SessionState
from pilotfish.validation import require_type, shorten_repr

VERSION = 1
ROBOT = 0  # number of the robot as a sender; peers have 1 to 65535
MAX_FRAMES, MAX_MISSION, PIECE_SIZE, MAX_PIECES = 6, 8, 960, 1024
HASH_SIZE = 32
MODES = ("direct", "shared", "autonomous", "fixture")  # their numbers in messages

Numbers = tuple[float, ...]


class Refusal(IntEnum):
    """Why a request, or the mode of a command, was refused; NONE if it was not.

    Attributes:
        NONE: Not refused.
        NOT_HOLDER: Another peer has control, or nobody.
        NOT_OPERATOR: The peer may observe and stop only.
        HELD: Another operator has control.
        WRONG_STATE: The request has no effect in this state.
        BUDGET: The budget or the jitter is beyond what the robot allows.
        MODE_NOT_ALLOWED: The mode is not allowed with this budget.
        SKILL_MISSING: The skill is not at the robot, or arrived in part.
        SKILL_UNUSABLE: The skill has a wrong hash, another version, or other columns or frames.
        DEAD_MAN_OPEN: The dead-man switch is not pressed.
        ENVELOPE: The envelope is empty, or beyond what the robot allows.
        FRAMES_STALE: The robot does not perceive the objects that the skill needs.
        NOT_POSSIBLE: The skill has no such mode, such as a plan or a fixture.
        STATE_UNKNOWN: The operator cannot know the present state yet: no command names a report of it.
    """

    NONE = 0
    NOT_HOLDER = 1
    NOT_OPERATOR = 2
    HELD = 3
    WRONG_STATE = 4
    BUDGET = 5
    MODE_NOT_ALLOWED = 6
    SKILL_MISSING = 7
    SKILL_UNUSABLE = 8
    DEAD_MAN_OPEN = 9
    ENVELOPE = 10
    FRAMES_STALE = 11
    NOT_POSSIBLE = 12
    STATE_UNKNOWN = 13


class SkillState(IntEnum):
    """State of a skill at the robot.

    Attributes:
        MISSING: No piece arrived.
        PARTIAL: Some pieces are missing.
        READY: All pieces arrived, the hash is right, and the skill can be used.
        WRONG_HASH: All pieces arrived, and the content is another than its name.
        UNREADABLE: The content is not a skill of this version.
        UNSUITABLE: The skill has other columns or frames than the robot.
    """

    MISSING = 0
    PARTIAL = 1
    READY = 2
    WRONG_HASH = 3
    UNREADABLE = 4
    UNSUITABLE = 5


@dataclass(frozen=True, slots=True)
class Hello:
    """First message of a peer; the challenge is in the header."""


@dataclass(frozen=True, slots=True)
class Welcome:
    """Answer to a hello.

    Attributes:
        boot: Random number of this start of the robot site, 64 bits.
        connection: Number of the connection, which increases with every hello.
        max_budget: Longest round-trip budget [s].
        max_jitter: Largest jitter [s].
    """

    boot: int
    connection: int
    max_budget: float
    max_jitter: float


@shorten_repr
@dataclass(frozen=True, slots=True)
class CommandMessage:
    """What the operator's hand commands; a newer one replaces an older one.

    Attributes:
        number: Increases by one with every command; a gap is a loss.
        report: Number of the last report that was displayed to the operator.
        lease: Lease under which the operator commands.
        valid: Time after that report, on the robot's clock, within which the command may be applied [s]; sent
            in milliseconds, up to 65.535 s.
        pose: Position and quaternion of the hand, seven numbers.
        twist: Velocity of the hand, six numbers.
        grip: Grip, 0 to 1.
        is_clutch_closed: Whether the robot follows the hand.
        is_dead_man_pressed: Whether the dead-man switch is pressed.
        mode: One of `MODES`.
        skill: Index of the skill in the mission.
    """

    number: int
    report: int
    lease: int
    valid: float
    pose: Numbers
    twist: Numbers
    grip: float
    is_clutch_closed: bool
    is_dead_man_pressed: bool
    mode: str
    skill: int


@shorten_repr
@dataclass(frozen=True, slots=True)
class Envelope:
    """What the robot may do without the operator.

    Attributes:
        duration: Longest time [s]; 0 permits nothing.
        lower: Lower corner of the volume [m], three numbers.
        upper: Upper corner of the volume [m].
        max_distance: Largest distance from the demonstrations, as in `assistance.Gate`: the likelihood floor.
        modes: Modes from which the robot may continue.
    """

    duration: float = 0.0
    lower: Numbers = (0.0, 0.0, 0.0)
    upper: Numbers = (0.0, 0.0, 0.0)
    max_distance: float = 0.0
    modes: tuple[str, ...] = ()


NO_ENVELOPE = Envelope()


@shorten_repr
@dataclass(frozen=True, slots=True)
class Request:
    """What a peer asks for; it is repeated until a report names its number.

    Attributes:
        number: Increases by one with every request of the peer, from 1.
        action: What is asked for.
        budget: Round-trip budget, with ACQUIRE [s].
        jitter: Jitter, with ACQUIRE [s].
        envelope: Envelope, with AUTHORISE.
    """

    number: int
    action: Action
    budget: float = 0.0
    jitter: float = 0.0
    envelope: Envelope = NO_ENVELOPE


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop of any peer; it is repeated until a report names its number.

    Attributes:
        number: Increases by one with every stop of the peer, from 1.
    """

    number: int


@shorten_repr
@dataclass(frozen=True, slots=True)
class Mission:
    """Skills of a mission, in their order.

    Attributes:
        number: Increases by one with every mission of the peer, from 1.
        skills: Content hash of each skill, up to eight.
    """

    number: int
    skills: tuple[bytes, ...]


@shorten_repr
@dataclass(frozen=True, slots=True)
class SkillPiece:
    """One piece of a skill's bytes.

    Attributes:
        hash: SHA-256 of all bytes of the skill.
        size: Number of all bytes.
        index: Number of the piece, from 0; each but the last has `PIECE_SIZE` bytes.
        data: Bytes of the piece.
    """

    hash: bytes
    size: int
    index: int
    data: bytes


@shorten_repr
@dataclass(frozen=True, slots=True)
class SkillStatus:
    """State of one skill of the mission at the robot.

    Attributes:
        hash: SHA-256 of the skill.
        state: Its state.
        received: One bit per piece, the first piece in the lowest bit.
    """

    hash: bytes
    state: SkillState
    received: int


@dataclass(frozen=True, slots=True)
class ReportedFrame:
    """Pose of an object as the robot reported it.

    Attributes:
        name: CRC-32 of the name of the frame.
        pose: Position and quaternion.
    """

    name: int
    pose: Numbers


@shorten_repr
@dataclass(frozen=True, slots=True)
class Report:
    """State of the robot and of the session; a newer one replaces an older one.

    Attributes:
        number: Increases by one with every report.
        state: State of the session.
        reason: Reason that is latched.
        mode: Mode in effect.
        refusal: Why the mode or the skill of the last command is not in effect.
        skill: Index of the skill in effect; `MAX_MISSION` for direct control without a skill.
        is_link_lost: Whether commands do not arrive.
        is_authorised: Whether the robot may continue alone if the link drops now.
        is_plan_moving: Whether an autonomous motion has not come to its end.
        is_clutch_closed: Whether the robot follows the hand.
        is_limited: Whether limits keep the target from the pose that was asked for.
        holder: Number of the peer that has control; 0 for none.
        lease: Lease, which increases with every change of the holder.
        request: Last request of the receiver that was handled.
        request_refusal: Why it was refused.
        stop: Last stop of the receiver that was handled.
        mission: Last mission of the holder that arrived.
        command: Last command that was applied.
        command_age: Time since that command arrived [s].
        loop_age: Measured age of that command [s].
        budget: Round-trip budget [s].
        jitter: Jitter [s].
        stale: Number of commands that were refused as stale.
        pose: Pose of the tool.
        twist: Its velocity.
        grip: Its grip.
        target: Pose that is commanded to the arm.
        covariance: Upper triangle of the covariance of the desired pose, 21 numbers.
        authority: Authority of the assistance, 0 to 1.
        misalignment: Distance [m] and angle [rad] from the robot to the hand, or to where it would move it.
        envelope_left: Time left of an envelope in use [s].
        skill_state: Most probable state of the skill.
        probability: Its probability.
        frames: Frames of the objects; empty if they are stale.
    """

    number: int
    state: SessionState
    reason: Reason
    mode: str
    refusal: Refusal
    skill: int
    is_link_lost: bool
    is_authorised: bool
    is_plan_moving: bool
    is_clutch_closed: bool
    is_limited: bool
    holder: int
    lease: int
    request: int
    request_refusal: Refusal
    stop: int
    mission: int
    command: int
    command_age: float
    loop_age: float
    budget: float
    jitter: float
    stale: int
    pose: Numbers
    twist: Numbers
    grip: float
    target: Numbers
    covariance: Numbers
    authority: float
    misalignment: Numbers
    envelope_left: float
    skill_state: int
    probability: float
    frames: tuple[ReportedFrame, ...]


Message = Hello | Welcome | CommandMessage | Request | Stop | Mission | SkillPiece | SkillStatus | Report


@dataclass(frozen=True, slots=True)
class ReceivedMessage:
    """Message that arrived, from an authenticated peer.

    Attributes:
        sender: Number of the peer.
        message: Message.
        connection: Number of the connection, which increases when the peer starts again. Numbers of requests,
            stops, missions and commands begin at 1 in every connection.
    """

    sender: int
    message: Message
    connection: int = 0


def require_received(received: Sequence[ReceivedMessage]) -> None:
    """Raise InvalidInput unless this is a sequence of messages that arrived.

    Args:
        received: Messages of authenticated peers.
    """
    require_type(received, "received", Sequence, "receive_at_robot and receive_at_operator return it")
    for each in received:
        require_type(each, "a message", ReceivedMessage, "ReceivedMessage(sender, message) makes one")


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
    """Message to be sent.

    Attributes:
        receiver: Number of the peer.
        message: Message.
    """

    receiver: int
    message: Message
