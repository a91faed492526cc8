"""Perform a skill in physics: adapt, plan, track, and follow the motion by impedance control at 1 kHz."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from pilotfish.demonstrations import Frame, Layout, Quantity, frame_from_pose
from pilotfish.environments import Failure, Outcome, Task, Workcell, explain_failure, stack_measurements
from pilotfish.environments.baxter import VisualMesh
from pilotfish.environments.robots import ROBOTS, Robot
from pilotfish.errors import FramesNotVisible
from pilotfish.geometry import Pose, normalise
from pilotfish.models import Skill, adapt
from pilotfish.planning import (
    Reproduction,
    mean_demonstration_length,
    moving_frames,
    plan_states,
    reproduce,
    reproduce_step,
    tangent_chart,
)
from pilotfish.simulation.recording import require_columns_and_frames, task_layout
from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr

S = TypeVar("S")
SETTLING_TIME = 1.0  # s after the end of the plan, for the arm to come to rest
MAX_HOLD = 3.0  # s for which the command is held while the frames of moving objects are not visible
HORIZON_STEPS = 30  # steps of each plan while objects move
POSE = 7
BAXTER = ROBOTS["baxter"]

PeriodCallback = Callable[[Workcell[S]], None]
"""Function that is called after every period of the skill."""


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ExecutionResult:
    """Result of a skill in one situation; rows are one period of the skill apart.

    Attributes:
        outcome: Whether the task was done.
        commanded: Commanded pose of the tool: position [m], quaternion.
        measured: Pose of the tool.
        forces: Contact force on the tool [N].
        peak_forces: Largest contact forces [N].
        duration: Simulated duration [s].
        frames: Pose of each frame at the start.
        progress: Quantities that the task measures, such as the height of an object above its support.
        failure: First phase of the task that was not passed, and why; None on success.
    """

    outcome: Outcome
    commanded: Float[Array, "T 7"]
    measured: Float[Array, "T 7"]
    forces: Float[Array, " T"]
    peak_forces: dict[str, float]
    duration: float
    frames: dict[str, Pose]
    progress: dict[str, Float[Array, " T"]]
    failure: Failure | None


def perform(  # noqa: PLR0913 - all but three have a default
    skill: Skill,
    task: Task[S],
    situation: S,
    *,
    horizon: int | None = None,
    control_cost: float | None = None,
    covariance_regularisation: float | None = None,
    on_period: PeriodCallback[S] | None = None,
    visual_meshes: Sequence[VisualMesh] = (),
    robot: Robot = BAXTER,
) -> ExecutionResult:
    """Perform a skill in physics from the task's start pose.

    Where objects move, the motion is planned again in each period for their extrapolated poses.

    Args:
        skill: Skill learned from recordings of the task, with derivatives.
        task: Task from `TASKS`.
        situation: Situation of the task.
        horizon: Number of steps; None takes the mean length of the demonstrations.
        control_cost: R, the cost of squared acceleration; None derives it from the scales of the skill.
        covariance_regularisation: Variance added to every variance before it becomes a weight
            [unit of x squared]; None derives it from the scales of the skill.
        on_period: Function that is called with the workcell after every period, such as a `FilmRecorder`.
        visual_meshes: Meshes of Baxter in images, from `baxter_meshes`.
        robot: Robot from `ROBOTS`, or from `robot_from_file`; the skill may come from another one.

    Returns:
        The outcome with commanded and measured poses.

    Raises:
        InvalidInput: If the skill has other columns or frames than the task, no horizon is known, or the
            robot does not reach the start pose.
    """
    _validate_skill(skill, task)
    n_steps = mean_demonstration_length(skill) if horizon is None else horizon
    cell = Workcell(task, situation, robot=robot, visual_meshes=visual_meshes)
    initial_frames = cell.frames()
    plan = _plan_once if task.actuate_scene is None else _plan_each_period
    targets = plan(
        skill, cell, n_steps, control_cost=control_cost, covariance_regularisation=covariance_regularisation
    )
    commanded, measured, forces, progress = [], [], [], []
    for pose, grip in targets:
        cell.step_impedance(pose, grip, round(skill.period / cell.timestep))
        tool = cell.arm.tool
        commanded.append(np.append(pose.position, pose.quaternion))
        measured.append(np.append(tool.position, tool.quaternion))
        forces.append(cell.forces["tool"])
        progress.append(cell.measure_progress())
        if on_period:
            on_period(cell)
    rows = np.array(commanded), np.array(measured), np.array(forces)
    outcome, history = cell.outcome(), stack_measurements(progress)
    failure = explain_failure(task.progress, history, outcome)
    peak_forces = dict(cell.peak_forces)
    return ExecutionResult(outcome, *rows, peak_forces, cell.time, initial_frames, history, failure)


def plan_in_situation(
    skill: Skill,
    task: Task[S],
    situation: S,
    *,
    horizon: int | None = None,
    control_cost: float | None = None,
    covariance_regularisation: float | None = None,
    robot: Robot = BAXTER,
) -> tuple[Reproduction, tuple[Frame, ...]]:
    """Plan the motion of a skill from the task's start pose, for objects where they are at the start.

    Args:
        skill: Skill learned from recordings of the task, with derivatives.
        task: Task from `TASKS`.
        situation: Situation of the task.
        horizon: As `perform`.
        control_cost: As `perform`.
        covariance_regularisation: As `perform`.
        robot: As `perform`.

    Returns:
        The motion, and the frames of the objects.

    Raises:
        InvalidInput: As `perform`.
    """
    _validate_skill(skill, task)
    return _reproduce_in_cell(
        skill,
        Workcell(task, situation, robot=robot),
        horizon,
        control_cost=control_cost,
        covariance_regularisation=covariance_regularisation,
    )


def _reproduce_in_cell(
    skill: Skill,
    cell: Workcell[S],
    horizon: int | None,
    *,
    control_cost: float | None,
    covariance_regularisation: float | None,
) -> tuple[Reproduction, tuple[Frame, ...]]:
    """Return the motion from the pose of the arm, and the present frames of the objects."""
    frames = tuple(frame_from_pose(name, skill.layout, pose) for name, pose in cell.frames().items())
    reproduction = reproduce(
        skill,
        frames,
        _start_state(skill, cell),
        horizon=horizon,
        control_cost=control_cost,
        covariance_regularisation=covariance_regularisation,
    )
    return reproduction, frames


def _validate_skill(skill: Skill, task: Task[S]) -> None:
    layout = task_layout(task)
    expected = [each.differentiate().names for each in (layout, _layout_on_sphere(layout))]
    require_columns_and_frames(skill.layout.names, skill.frame_names, task, expected)


def _layout_on_sphere(layout: Layout) -> Layout:
    """Return the layout with its quaternions as points of S^3."""
    quantities = {Quantity.QUATERNION: Quantity.ORIENTATION}
    return Layout(
        tuple(replace(part, quantity=quantities.get(part.quantity, part.quantity)) for part in layout.parts)
    )


def _tool_target(x: Float[Array, " D"], has_gripper: bool) -> tuple[Pose, float]:
    grip = float(np.clip(x[POSE], 0.0, 1.0)) if has_gripper else 0.0
    return Pose(x[:3].copy(), normalise(x[3:POSE])), grip


def _start_state(skill: Skill, cell: Workcell[S]) -> Float[Array, " D"]:
    """Return the state of the arm at rest, in the skill's columns."""
    start = np.zeros(skill.layout.width)
    start[:POSE] = np.append(cell.target.position, cell.target.quaternion)
    return start


def _plan_once(
    skill: Skill,
    cell: Workcell[S],
    horizon: int,
    *,
    control_cost: float | None,
    covariance_regularisation: float | None,
) -> Iterator[tuple[Pose, float]]:
    """Yield pose and grip of each period from one plan."""
    x = _reproduce_in_cell(
        skill,
        cell,
        horizon,
        control_cost=control_cost,
        covariance_regularisation=covariance_regularisation,
    )[0].motion.x
    for row in [*x[1:], *[x[-1]] * round(SETTLING_TIME / skill.period)]:
        yield _tool_target(row, cell.task.has_gripper)


def _plan_each_period(
    skill: Skill,
    cell: Workcell[S],
    horizon: int,
    *,
    control_cost: float | None,
    covariance_regularisation: float | None,
) -> Iterator[tuple[Pose, float]]:
    """Yield pose and grip of each period from a plan of the next steps for the objects' present motion.

    Each plan starts from the last commanded state, so that the command is continuous. The states are chosen
    once, at the start. While a frame is not visible the command is held, and FramesNotVisible is raised after
    MAX_HOLD.
    """
    plan_next = partial(
        reproduce_step, control_cost=control_cost, covariance_regularisation=covariance_regularisation
    )
    x, start = _start_state(skill, cell), cell.frames()
    states = _plan_states(skill, start, x, horizon)
    before: dict[str, Pose] | None = start
    t = held = 0
    while t < len(states) - 1 + round(SETTLING_TIME / skill.period):
        try:
            now = cell.frames()
        except FramesNotVisible:
            if held * skill.period >= MAX_HOLD:
                raise
            held += 1
            x, before = _at_rest(x, skill), None
            yield _tool_target(x, cell.task.has_gripper)
            continue
        held, before = 0, before or now  # after a hold the speed of the objects is unknown
        next_states = states[np.minimum(np.arange(t, t + HORIZON_STEPS), len(states) - 1)]
        x = plan_next(skill, before, now, x, next_states)
        t, before = t + 1, now
        yield _tool_target(x, cell.task.has_gripper)


def _at_rest(x: Float[Array, " D"], skill: Skill) -> Float[Array, " D"]:
    """Return the state with all derivatives 0."""
    x = x.copy()
    for part, columns in zip(skill.layout.parts, skill.layout.slices, strict=True):
        if part.derivative:
            x[columns] = 0.0
    return x


def _plan_states(
    skill: Skill, poses: dict[str, Pose], x: Float[Array, " D"], horizon: int
) -> Int[Array, " T"]:
    adapted = adapt(skill, moving_frames(skill, poses, poses, x))
    if not skill.layout.orientation_starts:
        return plan_states(adapted, x, horizon=horizon)[1]
    chart = tangent_chart(adapted)
    return plan_states(chart.skill, chart.to_tangent(x), horizon=horizon)[1]
