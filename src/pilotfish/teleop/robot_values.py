"""Settings of the robot site, what it senses, and what it commands."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import NoneType

import numpy as np

from pilotfish.assistance import AssistedSkill, Limits
from pilotfish.demonstrations import Layout, pose_layout
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.teleop.controlled_stop import Braking
from pilotfish.teleop.delay_contract import ContractLimits
from pilotfish.teleop.messages import ROBOT
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, require_type, shorten_repr

DEFAULT_SPEED = 0.25  # m/s
MAX_PEER, MAX_PEERS = 65535, 16
MIN_PERIOD, MAX_PERIOD = 1e-3, 1.0  # s
MAX_NUMBER, UNIT_TOLERANCE = 1e6, 1e-3  # m, m/s, rad/s; of the norm of a quaternion


def _limits() -> Limits:
    return Limits(speed=DEFAULT_SPEED)


@dataclass(frozen=True, slots=True)
class Alignment:
    """How near the hand must be to the robot before motion begins.

    Attributes:
        distance: Largest distance between the robot and where the hand would move it [m].
        angle: Largest angle [rad].
        hand_speed: Largest speed of the hand [m/s].
    """

    distance: float = 0.05
    angle: float = 0.35
    hand_speed: float = 0.1

    def __post_init__(self) -> None:
        for name in ("distance", "angle", "hand_speed"):
            require_number(getattr(self, name), name, 1e-6, 1e3)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RobotSettings:
    """Settings of a robot site.

    Attributes:
        decode_skill: Function from the bytes of a skill to the prepared skill; it raises SkillError.
        layout: Columns of a command: a pose, with or without one scalar, the grip.
        operators: Peers that may take control.
        observers: Peers that receive reports and may stop the robot.
        contract: What the robot agrees to.
        limits: Limits of the target.
        braking: Decelerations of a controlled stop.
        alignment: How near the hand must be before motion begins.
        command_period: Time between two commands [s].
        report_period: Time between two reports [s].
        max_envelope: Longest time without an operator that can be authorised [s].
        max_step: Longest time that the target moves in one step [s]; after a longer pause of the process it
            continues from where it was.
        max_frame_age: Time without frames after which the robot does not continue alone [s].
        lease_timeout: Silence of a holder after which another operator may take control of a robot at rest
            [s].

    Raises:
        InvalidInput: If a number is out of range, a peer has two roles, or layout is not a pose.
    """

    decode_skill: Callable[[bytes], AssistedSkill]
    layout: Layout = field(default_factory=pose_layout)
    operators: tuple[int, ...] = (1,)
    observers: tuple[int, ...] = ()
    contract: ContractLimits = field(default_factory=ContractLimits)
    limits: Limits = field(default_factory=_limits)
    braking: Braking = field(default_factory=Braking)
    alignment: Alignment = field(default_factory=Alignment)
    command_period: float = 0.02
    report_period: float = 0.05
    max_envelope: float = 120.0
    max_step: float = 0.05
    max_frame_age: float = 1.0
    lease_timeout: float = 5.0

    def __post_init__(self) -> None:
        for name in ("command_period", "report_period", "max_step"):
            require_number(getattr(self, name), name, MIN_PERIOD, MAX_PERIOD)
        for name in ("max_envelope", "max_frame_age", "lease_timeout"):
            require_number(getattr(self, name), name, 0.0, 1e6)
        require_type(self.layout, "layout", Layout, "pose_layout() makes one")
        if self.layout.names[: len(pose_layout().names)] != pose_layout().names or self.layout.width > 8:
            raise InvalidInput(
                f"layout has {', '.join(self.layout.names)}, expected a pose, with or without a grip"
            )
        peers = self.peers
        if not self.operators or len(set(peers)) != len(peers) or len(peers) > MAX_PEERS:
            raise InvalidInput(
                f"operators are {self.operators} and observers {self.observers}, expected one operator or "
                f"more, each peer once, and {MAX_PEERS} peers at most"
            )
        if not all(ROBOT < peer <= MAX_PEER for peer in peers):
            raise InvalidInput(f"peers are {peers}, expected numbers from 1 to {MAX_PEER}")

    @property
    def peers(self) -> tuple[int, ...]:
        """All peers."""
        return (*self.operators, *self.observers)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RobotState:
    """What the robot senses at one step.

    Attributes:
        pose: Pose of the tool: position [m], quaternion.
        twist: Its linear [m/s] and angular velocity [rad/s].
        grip: Grip, 0 to 1.
        frames: Poses of the objects by name; None if they are stale.
        reported: Poses that the operator is given, where another camera sees the objects for the operator;
            None for the same.
    """

    pose: Float[Array, " 7"]
    twist: Float[Array, " 6"]
    grip: float
    frames: Mapping[str, Pose] | None
    reported: Mapping[str, Pose] | None = None

    def __post_init__(self) -> None:
        for name, size in (("pose", 7), ("twist", 6)):
            value = getattr(self, name)
            require_type(value, name, np.ndarray, f"pass an array of {size} numbers")
            if value.shape != (size,) or value.dtype.kind not in "fiu":
                raise InvalidInput(f"{name} has shape {value.shape}, expected {size} numbers")
        require_type(self.grip, "grip", (float, int), "pass a number from 0 to 1")
        for name in ("frames", "reported"):
            require_type(getattr(self, name), name, (Mapping, NoneType), "pass {name: pose}, or None")

    @property
    def is_usable(self) -> bool:
        """Whether the robot's own numbers are finite, not absurd, and hold a unit quaternion."""
        numbers = np.array([*self.pose, *self.twist, self.grip])
        if not (np.isfinite(numbers).all() and (np.abs(numbers) < MAX_NUMBER).all()):
            return False
        return abs(float(np.sqrt(self.pose[3:] @ self.pose[3:])) - 1.0) < UNIT_TOLERANCE


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RobotTarget:
    """What the arm controller shall do until the next step.

    Attributes:
        pose: Pose of the tool: position [m], quaternion.
        velocity: Its velocity [m/s] and angular velocity in body axes [rad/s].
        grip: Grip, 0 to 1.
    """

    pose: Float[Array, " 7"]
    velocity: Float[Array, " 6"]
    grip: float
