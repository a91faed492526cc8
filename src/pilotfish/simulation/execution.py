"""Closing the loop: a skill plans, a tracker follows, an arm of springs and dampers does it, in physics."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from pilotfish.demonstrations import Layout, Quantity, frame_from_pose
from pilotfish.environments import Outcome, Task, VisualMesh, Workcell
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, normalise
from pilotfish.models import Skill, adapt
from pilotfish.planning import (
    CONTROL_COST,
    COVARIANCE_REGULARISATION,
    mean_demonstration_length,
    moving_frames,
    plan_states,
    reproduce,
    reproduce_step,
    tangent_chart,
)
from pilotfish.simulation.recording import task_layout
from pilotfish.types import Array, Float

S = TypeVar("S")
STEPS_PER_SECOND = 1000
SETTLING_TIME = 1.0  # s, for the arm to come to rest at the end of the plan
HORIZON_STEPS = 30  # steps that are planned at once while objects move
POSE = 7

PeriodCallback = Callable[[Workcell[S]], None]  # called after every period of the skill


@dataclass(frozen=True, slots=True)
class ExecutionSettings:
    """How a plan is made and followed.

    Attributes:
        control_cost: R, the cost of squared acceleration.
        covariance_regularisation: Variance added to every variance before it becomes a weight
            [unit of x squared].
        horizon: Number of steps; None takes the mean length of the demonstrations.
    """

    control_cost: float = CONTROL_COST
    covariance_regularisation: float = COVARIANCE_REGULARISATION
    horizon: int | None = None


DEFAULT_SETTINGS = ExecutionSettings()


@dataclass(frozen=True, slots=True, eq=False)
class ExecutionResult:
    """What came of a skill in one situation.

    Rows are a period [s] apart: the pose that was asked of the tool and the one that it had (position, then
    quaternion), the force on the tool [N]. peaks are the largest forces; seconds is how long it took.
    """

    outcome: Outcome
    commanded: Float[Array, "T 7"]
    measured: Float[Array, "T 7"]
    forces: Float[Array, " T"]
    peak_forces: dict[str, float]
    seconds: float
    frames: dict[str, Pose]  # at the beginning


def execute(
    skill: Skill,
    task: Task[S],
    situation: S,
    *,
    settings: ExecutionSettings = DEFAULT_SETTINGS,
    on_period: PeriodCallback[S] | None = None,
    visual_meshes: Sequence[VisualMesh] = (),
) -> ExecutionResult:
    """The skill at work in a situation: adapted to where the objects stand, planned, tracked, carried out.

    The plan starts from the arm's home; where objects move, it is made again each period for where they are
    and where they are going. Impedance follows it at 1 kHz. watch is called after each period; in its
    pictures the robot wears surfaces, if any.
    Raises: InvalidInput, when the skill's columns or frames are not those of the task, or it does not say how
    long its demonstrations were and no horizon is given.
    """
    _validate_skill(skill, task)
    steps = mean_demonstration_length(skill) if settings.horizon is None else settings.horizon
    cell = Workcell(task, situation, visual_meshes=visual_meshes)
    initial_poses = cell.frames()
    follow = _plan_once if task.actuate_scene is None else _plan_each_period
    commanded, measured, forces = [], [], []
    for pose, grip in follow(skill, cell, settings, steps):
        cell.step_impedance(pose, grip, round(skill.period * STEPS_PER_SECOND))
        tool = cell.arm.tool
        commanded.append(np.append(pose.position, pose.quaternion))
        measured.append(np.append(tool.position, tool.quaternion))
        forces.append(cell.forces["tool"])
        if on_period:
            on_period(cell)
    rows = np.array(commanded), np.array(measured), np.array(forces)
    return ExecutionResult(cell.outcome(), *rows, dict(cell.peak_forces), cell.time, initial_poses)


def _validate_skill(skill: Skill, task: Task[S]) -> None:
    expected = task_layout(task).differentiate()
    if skill.layout.names not in (expected.names, _on_sphere(task_layout(task)).differentiate().names):
        raise InvalidInput(
            f"the skill has the columns {', '.join(skill.layout.names)}, task {task.name!r} needs "
            f"{', '.join(expected.names)}; learn it from pilotfish record {task.name}"
        )
    if sorted(skill.frame_names) != sorted(task.frames):
        raise InvalidInput(
            f"the skill knows the frames {list(skill.frame_names)}, task {task.name!r} has "
            f"{list(task.frames)}; learn it from pilotfish record {task.name}"
        )


def _on_sphere(layout: Layout) -> Layout:
    """The same columns, their quaternions points of S^3."""
    kinds = {Quantity.QUATERNION: Quantity.ORIENTATION}
    return Layout(
        tuple(replace(part, quantity=kinds.get(part.quantity, part.quantity)) for part in layout.parts)
    )


def _tool_target(x: Float[Array, " D"], has_gripper: bool) -> tuple[Pose, float]:
    grip = float(np.clip(x[POSE], 0.0, 1.0)) if has_gripper else 0.0
    return Pose(x[:3].copy(), normalise(x[3:POSE])), grip


def _start(skill: Skill, cell: Workcell[S]) -> Float[Array, " D"]:
    """The arm at rest at its home, in the skill's columns."""
    begin = np.zeros(skill.layout.width)
    begin[:POSE] = np.append(cell.target.position, cell.target.quaternion)
    return begin


def _plan_once(
    skill: Skill, cell: Workcell[S], settings: ExecutionSettings, horizon: int
) -> Iterator[tuple[Pose, float]]:
    """Yield the pose and grip of each period, all planned at the beginning."""
    frames = [frame_from_pose(name, skill.layout, pose) for name, pose in cell.frames().items()]
    x = reproduce(
        skill,
        frames,
        _start(skill, cell),
        horizon=horizon,
        control_cost=settings.control_cost,
        covariance_regularisation=settings.covariance_regularisation,
    ).motion.x
    for row in [*x[1:], *[x[-1]] * round(SETTLING_TIME / skill.period)]:
        yield _tool_target(row, cell.task.has_gripper)


def _plan_each_period(
    skill: Skill, cell: Workcell[S], settings: ExecutionSettings, horizon: int
) -> Iterator[tuple[Pose, float]]:
    """Yield the pose and grip of each period, planned again each period for where the objects move.

    The next plan starts from the last commanded state, so that the command is continuous. The states are chosen
    at the beginning.
    """
    x, before = _start(skill, cell), cell.frames()
    adapted = adapt(skill, moving_frames(skill, before, before, x))
    chart = tangent_chart(adapted) if skill.layout.orientation_starts else None
    states = (
        plan_states(chart.skill, chart.to_tangent(x), horizon=horizon)[1]
        if chart
        else plan_states(adapted, x, horizon=horizon)[1]
    )
    for t in range(len(states) - 1 + round(SETTLING_TIME / skill.period)):
        now = cell.frames()
        coming = states[np.minimum(np.arange(t, t + HORIZON_STEPS), len(states) - 1)]
        x = reproduce_step(
            skill,
            before,
            now,
            x,
            coming,
            control_cost=settings.control_cost,
            covariance_regularisation=settings.covariance_regularisation,
        )
        before = now
        yield _tool_target(x, cell.task.has_gripper)
