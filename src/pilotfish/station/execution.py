"""Closing the loop: a skill plans, a tracker follows, an arm of springs and dampers does it, in physics."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from pilotfish.control import double_integrator, track
from pilotfish.demonstrations import (
    Frame,
    Layout,
    MovingFrame,
    Quantity,
    demonstration,
    frame_from_pose,
    moving_frame_from_poses,
    with_derivatives,
)
from pilotfish.environments import Surface, Task, Verdict, Workcell, turn_between
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, exp, multiply, normalise
from pilotfish.models import AdaptedSkill, Skill, adapt, on_the_half_of
from pilotfish.planning import chart, moving_reference, plan, planned_states
from pilotfish.station.following import Setting, coordinates_with_speeds, setting, steps_shown
from pilotfish.station.recorder import task_layout
from pilotfish.types import Array, Float

S = TypeVar("S")
TICKS_A_SECOND = 1000
SETTLE = 1.0  # s, for the arm to come to rest at the end of the plan
AHEAD = 30  # steps that are planned at once while objects move
POSE = 7

Watch = Callable[[Workcell[S]], None]  # called after every period of the skill


@dataclass(frozen=True, slots=True)
class Pursuit:
    """How a plan is made and followed.

    effort   price of acceleration
    slack    added to every variance before it becomes a weight [unit of x squared]
    horizon  how many steps; None stands for as many as demonstrations had on average
    """

    effort: float = 0.1
    slack: float = 1e-5
    horizon: int | None = None


PURSUIT = Pursuit()


@dataclass(frozen=True, slots=True, eq=False)
class Execution:
    """What came of a skill in one situation.

    Rows are a period [s] apart: the pose that was asked of the tool and the one that it had (position, then
    quaternion), the force on the tool [N]. peaks are the largest forces; seconds is how long it took.
    """

    verdict: Verdict
    asked: Float[Array, "T 7"]
    made: Float[Array, "T 7"]
    forces: Float[Array, " T"]
    peaks: dict[str, float]
    seconds: float
    frames: dict[str, Pose]  # at the beginning


def execute(
    skill: Skill,
    task: Task[S],
    where: S,
    *,
    pursuit: Pursuit = PURSUIT,
    watch: Watch[S] | None = None,
    surfaces: Sequence[Surface] = (),
) -> Execution:
    """The skill at work in a situation: adapted to where the objects stand, planned, tracked, carried out.

    The plan starts from the arm's home; where objects move, it is made again each period for where they are
    and where they are going. Impedance follows it at 1 kHz. watch is called after each period; in its
    pictures the robot wears surfaces, if any.
    Raises: InvalidInput, when the skill's columns or frames are not those of the task, or it does not say how
    long its demonstrations were and no horizon is given.
    """
    _refuse_another(skill, task)
    steps = steps_shown(skill) if pursuit.horizon is None else pursuit.horizon
    cell = Workcell(task, where, surfaces=surfaces)
    began = cell.frames()
    follow = _planned_once if task.stir is None else _planned_again
    asked, made, forces = [], [], []
    for pose, grip in follow(skill, cell, pursuit, steps):
        cell.follow(pose, grip, round(skill.period * TICKS_A_SECOND))
        tool = cell.arm.tool
        asked.append(np.append(pose.position, pose.quaternion))
        made.append(np.append(tool.position, tool.quaternion))
        forces.append(cell.forces["tool"])
        if watch:
            watch(cell)
    rows = np.array(asked), np.array(made), np.array(forces)
    return Execution(cell.verdict(), *rows, dict(cell.peaks), cell.time, began)


def _refuse_another(skill: Skill, task: Task[S]) -> None:
    expected = task_layout(task).differentiated()
    if skill.layout.names not in (expected.names, _on_sphere(task_layout(task)).differentiated().names):
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


def _wanted(x: Float[Array, " D"], grips: bool) -> tuple[Pose, float]:
    grip = float(np.clip(x[POSE], 0.0, 1.0)) if grips else 0.0
    return Pose(x[:3].copy(), normalise(x[3:POSE])), grip


def _start(skill: Skill, cell: Workcell[S]) -> Float[Array, " D"]:
    """The arm at rest at its home, in the skill's columns."""
    begin = np.zeros(skill.layout.width)
    begin[:POSE] = np.append(cell.target.position, cell.target.quaternion)
    return begin


def _planned_once(
    skill: Skill, cell: Workcell[S], pursuit: Pursuit, horizon: int
) -> Iterator[tuple[Pose, float]]:
    """The pose and grip of each period, all planned at the beginning."""
    frames = [frame_from_pose(name, skill.layout, pose) for name, pose in cell.frames().items()]
    here = setting(adapt(skill, frames))
    start = here.inward(_start(skill, cell))
    reference = plan(here.flat, start, horizon=horizon, slack=pursuit.slack)
    system = double_integrator(coordinates_with_speeds(skill.layout), skill.period)
    motion = here.outward(track(system, reference, pursuit.effort).rollout(start).x)
    for x in [*motion[1:], *_held(motion[-1], skill.period)]:
        yield _wanted(x, cell.task.grips)


def _held(x: Float[Array, " D"], period: float) -> list[Float[Array, " D"]]:
    return [x] * round(SETTLE / period)


def _planned_again(
    skill: Skill, cell: Workcell[S], pursuit: Pursuit, horizon: int
) -> Iterator[tuple[Pose, float]]:
    """The same, planned anew each period for where the objects are and where they are going.

    What was asked last is where the next plan starts, so that nothing jumps; the states to come were decided
    at the beginning.
    """
    system = double_integrator(coordinates_with_speeds(skill.layout), skill.period)
    x, before = _start(skill, cell), cell.frames()
    here = setting(adapt(skill, going_frames(skill, before, before, x)))
    states = planned_states(here.flat, here.inward(x), horizon=horizon)
    for t in range(len(states) - 1 + round(SETTLE / skill.period)):
        now = cell.frames()
        coming = states[np.minimum(np.arange(t, t + AHEAD), len(states) - 1)]
        here, later = _now_and_later(skill, (before, now), x)
        reference = moving_reference(here.flat, later, coming, pursuit.slack)
        x = here.outward(track(system, reference, pursuit.effort).rollout(here.inward(x)).x[1])
        before = now
        yield _wanted(x, cell.task.grips)


def _now_and_later(
    skill: Skill, seen: tuple[dict[str, Pose], dict[str, Pose]], x: Float[Array, " D"]
) -> tuple[Setting, AdaptedSkill]:
    """The skill where objects are and, in the same flat columns, where they will be at the plan's end."""
    before, now = seen
    here = setting(adapt(skill, going_frames(skill, before, now, x)))
    nearly, then = (
        {name: _gone_on(before[name], now[name], steps) for name in now} for steps in (AHEAD - 2, AHEAD - 1)
    )
    later = adapt(skill, going_frames(skill, nearly, then, x))
    if not here.map:
        start = on_the_half_of(x, here.adapted)
        return Setting(start, None), later
    base = here.adapted.means[0].copy()
    for first, quaternion in zip(skill.layout.turns, here.map.bases, strict=True):
        base[first : first + 4] = quaternion
    return here, chart(later, at=base).skill


def going_frames(
    skill: Skill, before: dict[str, Pose], now: dict[str, Pose], x: Float[Array, " D"]
) -> list[Frame]:
    """The frames of objects that were there a period before and are here now, with their speeds.

    x is where the robot is: on S^3 the speed of a turning frame depends on it.
    """
    layout = Layout(tuple(part for part in skill.layout.parts if part.derivative == 0))
    ahead = {name: _gone_on(before[name], now[name], 1) for name in now}
    moving = [moving_frame_from_poses(name, layout, (now[name], ahead[name])) for name in now]
    here = np.tile(x[: layout.width], (2, 1))
    for columns in layout.quaternions:  # as four numbers they are steered to unit length, not kept at it
        here[:, columns] = normalise(here[:, columns])
    seen = with_derivatives(demonstration(here, skill.period, layout, moving)).frames
    return [frame.at(0) if isinstance(frame, MovingFrame) else frame for frame in seen]


def _gone_on(before: Pose, now: Pose, steps: int) -> Pose:
    """Where an object will be in so many periods if it goes on as it did in the last."""
    turn = steps * turn_between(before.quaternion, now.quaternion)
    move = steps * (now.position - before.position)
    return Pose(now.position + move, multiply(exp(0.5 * turn), now.quaternion))
