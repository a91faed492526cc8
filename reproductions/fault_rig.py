"""Robot with a perfect arm and its operators on a virtual clock, watched by invariants at every step.

The arm is at its target one step later; there is no physics. The skill is learned from synthetic
demonstrations. The operator's hand plays a demonstration forward and back once the session is active, and
operates the session without the time of a click.

Invariants that are checked at every step of the robot:

    number of the applied command   increases strictly under one lease
    motion outside ACTIVE and CONTINUING   is a controlled stop: the speed falls, by at most 2 m/s^2
    speed                           at most its limit
    holder                          changes with the lease only
    stop                            stops the robot in the step in which it arrives
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

import pilotfish as pf
from pilotfish import assistance, teleop
from pilotfish.demonstrations import Demonstration
from pilotfish.geometry import Pose, normalise, quaternion_from_rotation_matrix
from pilotfish.io import decode_assisted_skill, encode_assisted_skill
from pilotfish.teleop import SessionState
from pilotfish.types import Array, Float

PERIOD, PERIOD_NS, SECOND = 0.02, 20_000_000, 1_000_000_000
ANY_MODE = teleop.ContractLimits(
    max_budget=60.0, max_jitter=5.0, mode_budgets=dict.fromkeys(teleop.MODES, 60.0)
)
MOVING = (SessionState.ACTIVE, SessionState.CONTINUING)
LATCHED = (SessionState.HOLD, SessionState.STOPPED)
ALIGNING_STEP = 0.08 * PERIOD  # m
ROUNDING = 1e-9


@cache
def demonstrations() -> tuple[Demonstration, ...]:
    """Return synthetic demonstrations of opening a valve."""
    return tuple(pf.io.synthetic_valve(np.random.default_rng(0)))


@cache
def skill_bytes() -> bytes:
    """Return the skill of six of them, with its virtual fixture."""
    training, rng = list(demonstrations()[:6]), np.random.default_rng(0)
    skill = pf.learn(training, states=7, rng=rng).skill
    return encode_assisted_skill(skill, fixture=assistance.learn_virtual_fixture(training, rng=rng))


@cache
def object_poses(number: int) -> Mapping[str, Pose]:
    """Return the poses of the objects of a demonstration."""
    return {
        frame.name: Pose(frame.b[:3], quaternion_from_rotation_matrix(frame.A[:3, :3]))
        for frame in demonstrations()[number].frames
    }


@cache
def path(number: int) -> Float[Array, "T 7"]:
    """Return the poses of a demonstration, one per command."""
    x = demonstrations()[number].x[:, :7]
    rows = np.arange(0.0, len(x) - 1, PERIOD / demonstrations()[number].period)
    low = rows.astype(int)
    share = (rows - low)[:, None]
    between = (1.0 - share) * x[low] + share * x[low + 1]
    between[:, 3:] = normalise(between[:, 3:])
    return np.asarray(between)


@dataclass(slots=True)
class Pilot:
    """Operator who plays a demonstration while the session is active.

    Attributes:
        mode: Mode of the commands.
        number: Number of the operator.
        demonstration: Number of the demonstration.
        envelope: What is authorised when control begins.
        speed: Rows of the path per step.
        is_arming: Whether the operator takes control, arms and clears holds.
        is_pressed: Whether the dead-man switch is pressed.
        offset: Displacement of the hand [m].
        actions: What the operator asks for in the next step, besides.
        is_stopping: Whether the operator stops the robot in the next step.
        hand: Pose of the hand.
        row: Place on the path.
    """

    mode: str = "shared"
    number: int = 1
    demonstration: int = 6
    envelope: teleop.Envelope = teleop.NO_ENVELOPE
    speed: float = 1.0
    is_arming: bool = True
    is_pressed: bool = True
    offset: Float[Array, " 3"] = field(default_factory=lambda: np.zeros(3))
    actions: tuple[teleop.Action, ...] = ()
    is_stopping: bool = False
    hand: Float[Array, " 7"] = field(default_factory=lambda: path(6)[0].copy())
    row: float = 0.0
    authorised_lease: int = 0

    def act(self, view: teleop.OperatorView) -> teleop.OperatorInput:
        """Return what the operator does."""
        report, rows = view.report, path(self.demonstration)
        if report and report.state is SessionState.ACTIVE and self.mode != "autonomous":
            self.row += self.speed
            turn = int(self.row) % (2 * len(rows) - 2)
            self.hand = rows[min(turn, 2 * len(rows) - 2 - turn)].copy()
        elif report and report.state is not SessionState.ACTIVE and report.holder == self.number:
            self._approach(np.array(report.target))
        actions = (*self.actions, *self._operate(view)) if self.is_arming else self.actions
        stopping, self.actions, self.is_stopping = self.is_stopping, (), False
        hand = self.hand.copy()
        hand[:3] += self.offset
        return teleop.OperatorInput(
            hand,
            mode=self.mode,
            is_dead_man_pressed=self.is_pressed,
            actions=actions,
            envelope=self.envelope,
            is_stopping=stopping,
        )

    def _approach(self, target: Float[Array, " 7"]) -> None:
        way = target[:3] - self.hand[:3]
        self.hand[:3] += way * min(1.0, ALIGNING_STEP / max(float(np.linalg.norm(way)), 1e-12))
        self.hand[3:] = target[3:] / np.linalg.norm(target[3:])

    def _operate(self, view: teleop.OperatorView) -> tuple[teleop.Action, ...]:
        report = view.report
        if report is None or view.waiting:
            return ()
        is_holder = report.holder == self.number
        if is_holder and self.envelope.duration and self.authorised_lease != report.lease:
            self.authorised_lease = report.lease
            return (teleop.Action.AUTHORISE,)
        is_assisted = self.mode != "direct"
        needs_skill = is_assisted or self.envelope.duration > 0.0
        action = teleop.next_action(view, self.number, needs_skill=needs_skill)
        lacks_skill = is_assisted and any(s is not teleop.SkillState.READY for s in view.skills)
        if action is None or (action is teleop.Action.ARM and lacks_skill):
            return ()
        return (action,)


@dataclass(frozen=True, slots=True)
class Row:
    """What happened in one step of the robot."""

    time: float
    state: SessionState
    reason: teleop.Reason
    mode: str
    command: int
    lease: int
    holder: int
    pose: Float[Array, " 7"]
    velocity: Float[Array, " 3"]
    authority: float


class Rig:
    """Robot, operators and invariants.

    Attributes:
        pilots: Operators by number.
        rows: What happened in each step of the robot.
        broken: Statements that did not hold.
        inputs: Time, messages and what the robot sensed in each step, for a replay.
        frames: Poses of the objects; None if the robot does not perceive them.
        time_ns: True time [ns].
    """

    def __init__(
        self,
        rng: np.random.Generator,
        pilots: Sequence[Pilot] = (),
        *,
        forward: teleop.LinkSettings | None = None,
        backward: teleop.LinkSettings | None = None,
        budget: float = 0.5,
        jitter: float = 0.25,
        skills: tuple[bytes, ...] | None = None,
        clocks: tuple[teleop.VirtualClock, teleop.VirtualClock] | None = None,
        **robot_settings: object,
    ) -> None:
        self.pilots = {pilot.number: pilot for pilot in pilots or (Pilot(),)}
        self.views = {number: teleop.start_view() for number in self.pilots}
        self.rows: list[Row] = []
        self.broken: list[str] = []
        self.inputs: list[tuple[int, tuple[teleop.ReceivedMessage, ...], teleop.RobotState]] = []
        self.frames: Mapping[str, Pose] | None = object_poses(6)
        self.time_ns = 0
        robot_clock, operator_clock = clocks or (teleop.VirtualClock(), teleop.VirtualClock())
        self.settings = teleop.RobotSettings(
            decode_assisted_skill,
            **{"contract": ANY_MODE, "operators": tuple(self.pilots), **robot_settings},  # type: ignore[arg-type]
        )
        connections = [
            teleop.OperatorConnection(
                teleop.OperatorSettings(
                    decode_assisted_skill,
                    (skill_bytes(),) if skills is None else skills,
                    number,
                    budget=budget,
                    jitter=jitter,
                    piece_steps=1,
                ),
                forward or teleop.LinkSettings(),
                backward or teleop.LinkSettings(),
                operator_clock,
            )
            for number in self.pilots
        ]
        self.pose, self.twist = path(6)[0].copy(), np.zeros(6)
        self.session = teleop.VirtualSession(self.settings, connections, self.sense(), rng, clock=robot_clock)

    def sense(self) -> teleop.RobotState:
        """Return what the robot senses: the arm is where its target was."""
        return teleop.RobotState(self.pose, self.twist, 0.0, self.frames)

    @property
    def time(self) -> float:
        """True time [s]."""
        return self.time_ns / SECOND

    @property
    def control(self) -> teleop.SessionState:
        """State of the session."""
        return self.session.site.control.state

    def step(self, injected: Sequence[bytes] = (), robot: teleop.RobotState | None = None) -> None:
        """Simulate one period of both sites.

        Args:
            injected: Datagrams of others that arrive at the robot.
            robot: What the robot senses instead.
        """
        self.step_robot(injected, robot)
        self.step_operators()
        self.time_ns += PERIOD_NS

    def step_robot(self, injected: Sequence[bytes] = (), robot: teleop.RobotState | None = None) -> None:
        """Simulate one step of the robot, and check the invariants."""
        sensed = robot or self.sense()
        before = self.session.site
        step = self.session.step_robot(self.time_ns, sensed, injected)
        self.inputs.append((self.session.time, self.session.received, sensed))
        pose = step.target.pose
        self.twist = np.append((pose[:3] - self.pose[:3]) / PERIOD, np.zeros(3))
        self.pose = pose.copy()
        self._check(before, step)
        control, last = step.site.control, step.site.motion.last
        self.rows.append(
            Row(
                self.time,
                control.state,
                control.reason,
                step.site.motion.assistance.mode,
                step.site.commands.number,
                control.lease,
                control.holder,
                self.pose,
                step.target.velocity[:3].copy(),
                last.authority if last else 0.0,
            )
        )

    def step_operators(self) -> None:
        """Simulate one step of every operator."""
        for number, pilot in self.pilots.items():
            given = pilot.act(self.views[number])
            self.views[number] = self.session.operators[number].step(self.time_ns, given)

    def run(self, seconds: float, before_step: Callable[["Rig"], Sequence[bytes]] | None = None) -> None:
        """Simulate some time.

        Args:
            seconds: Time [s].
            before_step: Function of the rig that is called before every step; it returns datagrams of others.
        """
        for _ in range(round(seconds / PERIOD)):
            self.step(before_step(self) if before_step else ())

    def run_until_active(self, limit: float = 60.0) -> None:
        """Simulate until the operator's hand moves the robot."""
        end = self.time + limit
        while self.control is not SessionState.ACTIVE and self.time < end:
            self.step()
        if self.control is not SessionState.ACTIVE:
            control = self.session.site.control
            self.broken.append(f"not active within {limit} s: {control.state.name}, {control.reason.name}")

    def require(self, condition: bool, statement: str) -> None:
        """Note a statement that does not hold."""
        if not condition:
            self.broken.append(f"{self.time:.2f} s: {statement}")

    def _check(self, before: teleop.RobotSite, step: teleop.RobotStep) -> None:
        after, limits = step.site, self.settings.limits
        speed = float(np.linalg.norm(step.target.velocity[:3]))
        speed_before = float(np.linalg.norm(before.motion.target.velocity[:3]))
        self.require(bool(np.isfinite(step.target.pose).all()), "the target is not finite")
        self.require(speed <= limits.speed + ROUNDING, f"the target moves at {speed:.3f} m/s")
        if after.control.state not in MOVING:
            dt = min((after.time - before.time) / SECOND, self.settings.max_step)
            change = float(np.linalg.norm(step.target.velocity[:3] - before.motion.target.velocity[:3]))
            self.require(speed <= speed_before + ROUNDING, f"the robot moves in {after.control.state.name}")
            self.require(change <= 2.0 * dt + ROUNDING, "the controlled stop is too hard")
        same_lease = after.control.lease == before.control.lease
        is_applied = after.commands.is_new
        increases = after.commands.number > before.commands.number or not same_lease
        self.require(not is_applied or increases, "an old command was applied")
        self.require(same_lease or after.control.lease > before.control.lease, "the lease went back")
        self.require(
            not same_lease or after.control.holder == before.control.holder, "two holders of a lease"
        )
        stopped = any(isinstance(each.message, teleop.Stop) for each in self.session.received)
        new_stop = after.control.stops != before.control.stops
        self.require(
            not (stopped and new_stop) or after.control.state is SessionState.STOPPED, "a stop had no effect"
        )


def replay(
    rig: Rig, inputs: Sequence[tuple[int, tuple[teleop.ReceivedMessage, ...], teleop.RobotState]]
) -> list[bytes]:
    """Return the bytes of the targets of a robot's site that is given these inputs from its start."""
    first_time, _, first = inputs[0]
    site, targets = teleop.start_robot(rig.settings, first_time, first), []
    for time, received, robot in inputs:
        step = teleop.step_robot(rig.settings, site, time, received, robot)
        site = step.site
        targets.append(target_bytes(step.target, site))
    return targets


def target_bytes(target: teleop.RobotTarget, site: teleop.RobotSite) -> bytes:
    """Return target and state of a step as bytes, to compare bit for bit."""
    control = site.control
    return (
        target.pose.tobytes()
        + target.velocity.tobytes()
        + bytes([control.state, control.reason])
        + site.motion.assistance.mode.encode()
    )


def decisions(rig: Rig) -> list[bytes]:
    """Return the decisions of a run as bytes, without the time."""
    return [
        row.pose.tobytes()
        + row.velocity.tobytes()
        + bytes([row.state, row.reason])
        + row.mode.encode()
        + row.command.to_bytes(4, "little")
        for row in rig.rows
    ]


def with_outage(settings: teleop.LinkSettings, start: float, duration: float) -> teleop.LinkSettings:
    """Return a link with one outage."""
    return replace(settings, outages=((start, duration),))
