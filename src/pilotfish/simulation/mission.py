"""A mission on a virtual clock: physics, the robot's site, a bad network, the operator's site and a person.

Both sites are the steps of `teleop`, over real sealed datagrams that a seeded link delays, loses and
shuffles. Every 20 ms of simulated time the robot receives, steps and moves the arm. Then the operator
receives, acts and sends. One arm is simulated, under impedance control at 1 kHz.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from typing import TypeVar

import numpy as np

from pilotfish.environments import (
    Failure,
    Outcome,
    Task,
    Workcell,
    explain_failure,
    stack_measurements,
)
from pilotfish.environments.human import HumanModel
from pilotfish.geometry import Pose, normalise
from pilotfish.io import decode_assisted_skill
from pilotfish.simulation.recording import OBSERVATION_PERIOD, PERIOD, STEPS_PER_OBSERVATION, task_layout
from pilotfish.simulation.remote_operator import (
    RemoteOperatorState,
    make_remote_operator,
    step_remote_operator,
)
from pilotfish.simulation.teleoperation import Link, Poses, displace_view
from pilotfish.teleop import (
    NO_ENVELOPE,
    ContractLimits,
    Envelope,
    LinkSettings,
    OperatorConnection,
    OperatorInput,
    OperatorSettings,
    OperatorView,
    RobotRecorder,
    RobotSettings,
    RobotState,
    RobotStep,
    SessionState,
    VirtualSession,
    start_view,
)
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number, require_type, shorten_repr

S = TypeVar("S")
NUMBER = 1  # of the operator
SETTLING_TIME = 0.5  # s after the operator knows that the motion has ended
PROCESSING_TIME = 0.15  # s of a round trip in both sites: periods of commands and reports
MAX_BUDGET = 65.0  # s
EXTRA_TIME, EXTRA_ROUND_TRIPS = 30.0, 60.0  # s, and round trips, beyond the time limit of the task
STEP_NS = round(OBSERVATION_PERIOD * 1e9)
DEFAULT_HUMAN = HumanModel()
PERFECT_LINK, TRUE_VIEW = LinkSettings(), Link()


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class MissionSettings:
    """Link, operator and agreement of a mission.

    Attributes:
        mode: Mode of the commands.
        forward: Link to the robot.
        backward: Link from the robot.
        view: How far the operator's view of the objects is off; its delay is not used.
        human_model: Parameters of the person.
        budget: Budget of the round trip [s]; None for the delays and jitters of the links and the periods of
            both sites.
        jitter: Jitter J [s], after which the link is lost.
        contract: What the robot agrees to.
        envelope: What is authorised when control begins.
        aside: Displacement of everything that the person aims at [m]; None for none.
        piece_steps: Steps of 20 ms between two pieces of the skill.
    """

    mode: str = "shared"
    forward: LinkSettings = PERFECT_LINK
    backward: LinkSettings = PERFECT_LINK
    view: Link = TRUE_VIEW
    human_model: HumanModel = DEFAULT_HUMAN
    budget: float | None = None
    jitter: float = 0.25
    contract: ContractLimits = ContractLimits()  # noqa: RUF009 - frozen
    envelope: Envelope = NO_ENVELOPE
    aside: Float[Array, " 3"] | None = None
    piece_steps: int = 5

    def __post_init__(self) -> None:
        require_type(self.forward, "forward", LinkSettings, "LinkSettings(delay=...) makes one")
        require_type(self.backward, "backward", LinkSettings, "LinkSettings(delay=...) makes one")
        require_count(self.piece_steps, "piece_steps", 1000, minimum=1)
        if self.budget is not None:
            require_number(self.budget, "budget", 0.0, MAX_BUDGET)

    @property
    def round_trip(self) -> float:
        """Delay of both links [s]."""
        return self.forward.delay + self.backward.delay

    @property
    def agreed_budget(self) -> float:
        """Budget that the operator asks for [s]."""
        if self.budget is not None:
            return self.budget
        return self.round_trip + self.forward.jitter + self.backward.jitter + PROCESSING_TIME


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class MissionResult:
    """Result of a mission in one situation; rows are 20 ms apart, from the first motion on.

    Attributes:
        outcome: Whether the task was done.
        is_completed: Whether the operator knew in time that the motion had ended.
        duration: Time from the first active report to that moment [s].
        targets: Target of the arm.
        measured: Pose of the tool.
        hands: Pose of the operator's hand.
        authority: Authority of the assistance.
        frames: Poses of the objects at the end.
        submovements: Movements of the hand that were begun without feedback.
        effort: Length of the path of the hand [m].
        alignments: How often control became active again after the robot had held.
        stale: Number of commands that the robot refused as stale.
        bytes_forward: Bytes to the robot, headers included.
        bytes_backward: Bytes from the robot.
        peak_forces: Largest contact forces [N].
        failure: First phase of the task that was not passed, and why; None on success.
    """

    outcome: Outcome
    is_completed: bool
    duration: float
    targets: Float[Array, "T 7"]
    measured: Float[Array, "T 7"]
    hands: Float[Array, "T 7"]
    authority: Float[Array, " T"]
    frames: Poses
    submovements: int
    effort: float
    alignments: int
    stale: int
    bytes_forward: int
    bytes_backward: int
    peak_forces: dict[str, float]
    failure: Failure | None


StepCallback = Callable[[Workcell[S], RobotStep, OperatorView, OperatorInput], None]
"""Function that is called after every step with the workcell, the robot's step, view and input."""


def run_mission(
    skill: bytes,
    task: Task[S],
    situation: S,
    rng: np.random.Generator,
    settings: MissionSettings,
    *,
    on_step: StepCallback[S] | None = None,
    recorder: RobotRecorder | None = None,
) -> MissionResult:
    """Simulate a mission: an operator does a task with a remote robot over a bad network.

    Args:
        skill: Bytes of the skill, from `io.encode_assisted_skill`; the operator's site sends them.
        task: Task from `TASKS`.
        situation: Situation of the task.
        rng: Generator of motor noise, of the direction in which the view is off, of links and keys.
        settings: Link, operator and agreement.
        on_step: Function that is called after every step.
        recorder: Recorder of the robot's site, such as `SessionRecorder`; None for none.

    Returns:
        The outcome, and what was commanded and reached.

    Raises:
        SkillError: If the skill cannot be used for the task.
    """
    human_rng, view_rng, session_rng = rng.spawn(3)
    cell = Workcell(task, situation)
    displace = displace_view(cell.frames(), settings.view, view_rng)
    sense = _Senses(cell, displace)
    session = _start_session(skill, task, sense.read(), settings, session_rng, recorder)
    operator = make_remote_operator(
        task,
        situation,
        human_model=settings.human_model,
        mode=settings.mode,
        round_trip=settings.round_trip + PROCESSING_TIME / 2,
        envelope=settings.envelope,
        aside=settings.aside,
    )
    state, view, rows = RemoteOperatorState(None), start_view(), _Rows()
    limit = 2.0 * task.time_limit + EXTRA_TIME + EXTRA_ROUND_TRIPS * settings.round_trip
    step_ns = 0
    while cell.time < min(limit, state.ended + SETTLING_TIME):
        step = session.step_robot(step_ns, sense.read())
        cell.step_impedance(_tool(step), step.target.grip, STEPS_PER_OBSERVATION)
        state, given = step_remote_operator(operator, state, cell.time, view, human_rng)
        view = session.operators[NUMBER].step(step_ns, given)
        step_ns += STEP_NS
        if state.began < inf:
            rows.append(step, given, cell)
        if on_step:
            on_step(cell, step, view, given)
    return rows.result(cell, state, session)


def _start_session(
    skill: bytes,
    task: Task[S],
    robot: RobotState,
    settings: MissionSettings,
    rng: np.random.Generator,
    recorder: RobotRecorder | None,
) -> VirtualSession:
    """Return the session of one operator with one skill."""
    layout = task_layout(task)
    operator = OperatorSettings(
        decode_assisted_skill,
        (skill,),
        NUMBER,
        budget=settings.agreed_budget,
        jitter=settings.jitter,
        layout=layout,
        piece_steps=settings.piece_steps,
        is_predicting=settings.mode == "shared",
    )
    connection = OperatorConnection(operator, settings.forward, settings.backward)
    site = RobotSettings(decode_assisted_skill, layout, contract=settings.contract)
    return VirtualSession(site, [connection], robot, rng, recorder=recorder)


def _tool(step: RobotStep) -> Pose:
    return Pose(step.target.pose[:3].copy(), normalise(step.target.pose[3:7]))


class _Senses:
    """What the robot senses; the poses of moving objects are updated at 10 Hz."""

    def __init__(self, cell: Workcell[S], displace: Callable[[Poses], Mapping[str, Pose]]) -> None:
        self._cell, self._displace = cell, displace
        self._frames, self._time = cell.frames(), cell.time
        self._reported = dict(displace(self._frames))

    def read(self) -> RobotState:
        cell = self._cell
        if cell.task.actuate_scene and cell.time > self._time + PERIOD - 1e-9:
            self._frames, self._time = cell.frames(), cell.time
            self._reported = dict(self._displace(self._frames))
        tool = cell.arm.tool
        pose = np.append(tool.position, tool.quaternion)
        return RobotState(pose, cell.arm.twist, min(max(cell.grip, 0.0), 1.0), self._frames, self._reported)


class _Rows:
    """What happened in each step."""

    def __init__(self) -> None:
        self._rows: list[tuple[Float[Array, " 7"], Float[Array, " 7"], Float[Array, " 7"], float]] = []
        self._progress: list[Mapping[str, float]] = []
        self._was_active, self._alignments = True, 0

    def append(self, step: RobotStep, given: OperatorInput, cell: Workcell[S]) -> None:
        tool, last = cell.arm.tool, step.site.motion.last
        measured = np.append(tool.position, tool.quaternion)
        self._rows.append((step.target.pose, measured, given.hand, last.authority if last else 0.0))
        self._progress.append(cell.measure_progress())
        is_active = step.site.control.state is SessionState.ACTIVE
        self._alignments += is_active and not self._was_active
        self._was_active = is_active

    def result(self, cell: Workcell[S], state: RemoteOperatorState, session: VirtualSession) -> MissionResult:
        columns = zip(*self._rows, strict=True) if self._rows else ([np.empty(7)[:0]],) * 4
        targets, measured, hands, authority = map(np.array, columns)
        outcome, link = cell.outcome(), session.operators[NUMBER]
        failure = None
        if self._progress:
            failure = explain_failure(cell.task.progress, stack_measurements(self._progress), outcome)
        return MissionResult(
            outcome=outcome,
            is_completed=state.ended < inf,
            duration=min(state.ended, cell.time) - min(state.began, cell.time),
            targets=targets.reshape(-1, 7),
            measured=measured.reshape(-1, 7),
            hands=hands.reshape(-1, 7),
            authority=authority.reshape(-1),
            frames=cell.frames(),
            submovements=state.human.n_submovements if state.human else 0,
            effort=state.human.path_length if state.human else 0.0,
            alignments=self._alignments,
            stale=session.site.commands.stale,
            bytes_forward=link.forward.counters.bytes_sent,
            bytes_backward=link.backward.counters.bytes_sent,
            peak_forces=dict(cell.peak_forces),
            failure=failure,
        )
