"""Operate a remote robot in physics: a simulated person, a link with delay, and assistance at the robot.

The operator guides the left arm by hand, in a local scene. There the objects stand where the robot last
reported them: late by the delay of the link, and displaced if its perception is off. The pose of the left
tool reaches the robot as a command, late by the same delay, with the object poses that the operator saw. The
assistance there knows the actual poses, at 10 Hz if objects move. The right arm follows its target under
impedance control at 1 kHz.

The operator follows the script of the task with the parameters of `HumanModel()`. The local scene has no
contact and does not show the motion of the right arm, so that the operator does not notice a miss.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import TypeVar

import numpy as np

from pilotfish.assistance import (
    Assistant,
    Command,
    Target,
    initial_state,
    step_assistance,
)
from pilotfish.demonstrations import Frame, frame_from_pose
from pilotfish.environments import Failure, Outcome, Task, Workcell, explain_failure, stack_measurements
from pilotfish.environments.baxter import VisualMesh
from pilotfish.environments.human import (
    DemonstrationPlan,
    HumanState,
    Observation,
    step_human,
)
from pilotfish.environments.human import initial_state as initial_human_state
from pilotfish.geometry import Pose, from_rotation_vector, normalise
from pilotfish.simulation.recording import (
    ARM_LAG,
    DEFAULT_HUMAN,
    OBSERVATION_PERIOD,
    PERIOD,
    STEPS_PER_OBSERVATION,
    TIME_TOLERANCE,
    pose_row,
    require_columns_and_frames,
    task_layout,
)
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, shorten_repr

S = TypeVar("S")
SETTLING_TIME = 1.0  # s after the operator's last command has reached the robot
MAX_DELAY, MAX_DISTANCE = 60.0, 1.0  # s, m
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])

Poses = Mapping[str, Pose]
StepCallback = Callable[[Workcell[S], Command, Target], None]
"""Function that is called after every step with the workcell, the command and the target."""


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class TeleoperationResult:
    """Result of an operator in one situation; rows are 20 ms apart.

    Attributes:
        outcome: Whether the task was done.
        hands: Commanded pose that reached the robot: position [m], quaternion.
        targets: Target of the robot.
        measured: Pose of the tool.
        authority: Authority of the assistance.
        forces: Contact force on the tool [N].
        peak_forces: Largest contact forces [N].
        duration: Simulated duration [s].
        progress: Quantities that the task measures.
        failure: First phase of the task that was not passed, and why; None on success.
    """

    outcome: Outcome
    hands: Float[Array, "T 7"]
    targets: Float[Array, "T 7"]
    measured: Float[Array, "T 7"]
    authority: Float[Array, " T"]
    forces: Float[Array, " T"]
    peak_forces: dict[str, float]
    duration: float
    progress: dict[str, Float[Array, " T"]]
    failure: Failure | None


@dataclass(frozen=True, slots=True)
class Link:
    """Link between operator and robot, and how far the operator's view of the objects is off.

    Attributes:
        delay: Delay in each direction [s].
        view_distance: Horizontal distance by which the objects are displaced together [m].
        view_angle: Angle by which they are turned together about the vertical [rad].

    Raises:
        InvalidInput: If delay is not from 0 to 60 s, view_distance to 1 m or view_angle to pi.
    """

    delay: float = 0.0
    view_distance: float = 0.0
    view_angle: float = 0.0

    def __post_init__(self) -> None:
        require_number(self.delay, "delay", 0.0, MAX_DELAY)
        require_number(self.view_distance, "view_distance", 0.0, MAX_DISTANCE)
        require_number(self.view_angle, "view_angle", 0.0, np.pi)


DIRECT_LINK = Link()


@dataclass(frozen=True, slots=True, eq=False)
class _Message:
    """Command on its way to the robot, with what the operator saw."""

    time: float
    tool: Pose
    grip: float
    frames: Sequence[Frame]


def displace_view(poses: Poses, link: Link, rng: np.random.Generator) -> Callable[[Poses], dict[str, Pose]]:
    """Return a function that displaces all objects together, as a camera does that is off.

    Args:
        poses: Poses of the objects at the start; the turn is about the vertical through their middle.
        link: Distance and angle; the direction of the one and the sense of the other are random.
        rng: Generator of direction and sense.
    """
    direction, sense = rng.uniform(0.0, 2.0 * np.pi), rng.choice([-1.0, 1.0])
    shift = link.view_distance * np.array([np.cos(direction), np.sin(direction), 0.0])
    middle = np.mean([pose.position for pose in poses.values()], axis=0)
    turn = from_rotation_vector(np.array([0.0, 0.0, sense * link.view_angle]))
    displacement = Pose(middle + shift, turn) @ Pose(-middle, IDENTITY)
    return lambda present: {name: displacement @ pose for name, pose in present.items()}


def teleoperate(
    assistant: Assistant,
    task: Task[S],
    situation: S,
    rng: np.random.Generator,
    *,
    mode: str | Callable[[float], str] = "shared",
    link: Link = DIRECT_LINK,
    on_step: StepCallback[S] | None = None,
    visual_meshes: Sequence[VisualMesh] = (),
) -> TeleoperationResult:
    """Simulate an operator who does a task with a remote robot.

    Args:
        assistant: Assistance at the robot; its first skill was learned from recordings of the task.
        task: Task from `TASKS`.
        situation: Situation of the task.
        rng: Generator of motor noise and of the direction in which the view is off.
        mode: Mode of every command, or a function from the time [s] to the mode.
        link: Delay, and how far the operator's view is off.
        on_step: Function that is called after every step.
        visual_meshes: Meshes of the robot in images, from `baxter_meshes`.

    Returns:
        The outcome, and what was commanded, corrected and reached.

    Raises:
        InvalidInput: If the skill has other columns or frames than the task, or a number cannot be used.
    """
    names, frame_names = assistant.layout.names, assistant.skills[0].skill.frame_names
    require_columns_and_frames(names, frame_names, task, [task_layout(task).names])
    cell = Workcell(task, situation, guided=True, visual_meshes=visual_meshes)
    displace = displace_view(cell.frames(), link, rng)
    operator = _Operator(task, situation, rng, cell.target)
    robot = _Robot(assistant, cell, displace(cell.frames()), mode)
    reports = [(cell.time, cell.frames())]
    messages: list[_Message] = []
    rows = _Rows()
    time_limit, end = 2.0 * (task.time_limit + 2.0 * link.delay), inf
    while cell.time < min(end, time_limit):
        if task.actuate_scene and cell.time > reports[-1][0] + PERIOD - TIME_TOLERANCE:
            reports.append((cell.time, cell.frames()))
        observed = displace(_latest(reports, cell.time - link.delay, key=lambda report: report[0])[1])
        hand, grip = operator.act(cell.time, cell.guided_tool, observed)
        messages.append(_Message(cell.time, cell.guided_tool, grip, robot.frames_of(observed)))
        message = _latest(messages, cell.time - link.delay, key=lambda each: each.time)
        command, target = robot.step(message, hand, reports[-1][1])
        rows.append(command, target, cell)
        if on_step:
            on_step(cell, command, target)
        if end == inf and operator.done and not robot.is_moving:
            end = cell.time + link.delay + SETTLING_TIME
    return rows.result(cell)


class _Operator:
    """Person who follows the script of the task in a local scene."""

    def __init__(self, task: Task[S], situation: S, rng: np.random.Generator, tool: Pose) -> None:
        self._plan = DemonstrationPlan(DEFAULT_HUMAN, task.demonstration_script(situation), ARM_LAG)
        self._state: HumanState = initial_human_state(tool, 0.0)
        self._rng = rng

    @property
    def done(self) -> bool:
        return self._state.done

    def act(self, time: float, tool: Pose, observed: Poses) -> tuple[Pose, float]:
        """Return the pose of the hand that guides the left arm, and the grip."""
        self._state = step_human(self._plan, self._state, time, Observation(tool, observed), self._rng)
        return self._state.hand, self._state.grip


class _Robot:
    """Robot with its assistance."""

    def __init__(
        self,
        assistant: Assistant,
        cell: Workcell[S],
        observed: Poses,
        mode: str | Callable[[float], str],
    ) -> None:
        self._assistant, self._cell, self._mode = assistant, cell, mode
        self._frames: dict[tuple[float, ...], Sequence[Frame]] = {}
        start = pose_row(cell.task, cell.target, cell.grip)
        frames = self.frames_of(cell.frames())
        self._state = initial_state(assistant, start, self.frames_of(observed), frames)

    def frames_of(self, poses: Poses) -> Sequence[Frame]:
        """Return the frames of object poses; the same object for the same poses."""
        layout = self._assistant.skills[0].layout
        key = tuple(np.concatenate([[*p.position, *p.quaternion] for p in poses.values()]).tolist())
        if key not in self._frames:
            self._frames[key] = [frame_from_pose(name, layout, pose) for name, pose in poses.items()]
        return self._frames[key]

    @property
    def is_moving(self) -> bool:
        """Whether an autonomous motion has not come to its end."""
        plan = self._state.plan
        return plan is not None and plan.is_moving

    def step(self, message: _Message, hand: Pose, poses: Poses) -> tuple[Command, Target]:
        """Assist for one step; both arms follow, the left one the hand and the right one the target."""
        mode = self._mode if isinstance(self._mode, str) else self._mode(self._cell.time)
        command = Command(pose_row(self._cell.task, message.tool, message.grip), mode)
        self._state, target = step_assistance(
            self._assistant,
            self._state,
            command,
            message.frames,
            self.frames_of(poses),
            OBSERVATION_PERIOD,
        )
        grip = float(np.clip(target.pose[7], 0.0, 1.0)) if self._cell.task.has_gripper else 0.0
        tool = Pose(target.pose[:3].copy(), normalise(target.pose[3:7]))
        self._cell.step_teleoperation(hand, tool, grip, STEPS_PER_OBSERVATION)
        return command, target


class _Rows:
    """What happened in each step."""

    def __init__(self) -> None:
        self._rows: list[tuple[Float[Array, " 7"], Float[Array, " 7"], Float[Array, " 7"], float, float]] = []
        self._progress: list[Mapping[str, float]] = []

    def append(self, command: Command, target: Target, cell: Workcell[S]) -> None:
        tool = cell.arm.tool
        self._rows.append(
            (
                command.hand[:7],
                target.pose[:7],
                np.append(tool.position, tool.quaternion),
                target.authority,
                cell.forces["tool"],
            )
        )
        self._progress.append(cell.measure_progress())

    def result(self, cell: Workcell[S]) -> TeleoperationResult:
        hands, targets, measured, authority, forces = map(np.array, zip(*self._rows, strict=True))
        outcome, progress = cell.outcome(), stack_measurements(self._progress)
        return TeleoperationResult(
            outcome,
            hands,
            targets,
            measured,
            authority,
            forces,
            dict(cell.peak_forces),
            cell.time,
            progress,
            explain_failure(cell.task.progress, progress, outcome),
        )


M = TypeVar("M")


def _latest(items: list[M], time: float, *, key: Callable[[M], float]) -> M:
    """Return the last item not later than a time, or the first; drop those before it."""
    while len(items) > 1 and key(items[1]) <= time + TIME_TOLERANCE:
        items.pop(0)
    return items[0]
