"""Recording demonstrations: someone leads the robot's arm through a task, and what they asked for is kept."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    Layout,
    MovingFrame,
    Part,
    Quantity,
    continuous_quaternions,
    demonstration,
    frame_from_pose,
    moving_frame_from_poses,
    pose_layout,
)
from pilotfish.environments import Task, Verdict, Workcell, people
from pilotfish.errors import SkillError
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float

S = TypeVar("S")
PERIOD, LOOK = 0.1, 0.02  # s between rows of a recording; between looks of whoever leads
LAG = 0.25  # s, at most, from a move of the hand to that of the tool: two arms on springs lie between
TICKS, LOOKS = round(LOOK * 1000), round(PERIOD / LOOK)
PATIENCE = 40.0  # s more for each second of delay: so many looks a task may need
ROUNDING = 1e-9  # s
TRIES = 5  # of one demonstration, before something must be wrong
SHOWN, UNSEEN = 1, 2  # streams of situations that never meet

PERSON = people.Person()

Leader = Callable[[float, people.Seen], people.Wish]  # time [s] and picture -> what their hand asks for


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One showing: what was asked for, whether it did the work, largest forces [N], how long it took [s]."""

    demonstration: Demonstration
    verdict: Verdict
    peaks: dict[str, float]
    seconds: float


def task_layout(task: Task[S]) -> Layout:
    """The columns of a recording: the tool's pose, and the grip where there is one, from 0, open, to 1."""
    grip = (Part("grip", Quantity.SCALAR, 1, "1"),) if task.grips else ()
    return Layout(pose_layout().parts + grip)


def situation(task: Task[S], stream: int, seed: int, number: int) -> S:
    """The situation of that number, among those to be shown or those unseen; every number its own."""
    return task.draw(np.random.default_rng([seed, stream, number]))


def record(task: Task[S], where: S, leader: Leader, name: str, *, longest: float | None = None) -> Recording:
    """What the leader asks of the right arm by leading the left one, until they are done or time is up.

    That is after the task's own time, or the longest [s] that is given.

    Rows hold the pose that the leader's tool asks for, not the one that the arm reached: it goes further
    where it presses, and so does a replay. A task in which things move has frames that move.
    """
    cell = Workcell(task, where, lead=True)
    rows, seen, done = [], [], False
    for look in range(round((longest or task.seconds) / LOOK)):
        poses = cell.frames()
        if look % LOOKS == 0:
            rows.append(row(task, cell.target, cell.grip))
            seen.append(poses)
            if done:
                break
        wish = leader(cell.time, people.Seen(cell.arm.tool, poses))
        cell.led(wish.pose, wish.grip, TICKS)
        done = done or wish.done
    layout = task_layout(task)
    x = continuous_quaternions(np.array(rows), layout)
    frames = recorded_frames(task, layout, seen)
    shown = demonstration(x, PERIOD, layout, frames, name)
    return Recording(shown, cell.verdict(), dict(cell.peaks), cell.time)


def row(task: Task[S], tool: Pose, grip: float) -> Float[Array, " D"]:
    """A row of a recording."""
    return np.concatenate([tool.position, tool.quaternion, [grip] * task.grips])


def recorded_frames(task: Task[S], layout: Layout, seen: list[dict[str, Pose]]) -> list[Frame | MovingFrame]:
    """The task's frames where they stood; those of a task in which things move, row by row."""
    if task.stir is None:
        return [frame_from_pose(name, layout, seen[0][name]) for name in task.frames]
    return [moving_frame_from_poses(name, layout, [poses[name] for poses in seen]) for name in task.frames]


def simulated(
    task: Task[S], where: S, person: people.Person, rng: np.random.Generator, *, delay: float = 0.0
) -> Leader:
    """A simulated person who performs the task's script and knows how late the picture is [s]."""
    errand = people.Errand(person, task.script(where), LAG + delay)
    doing: people.Doing | None = None

    def lead(time: float, seen: people.Seen) -> people.Wish:
        nonlocal doing
        doing, wish = people.act_step(errand, doing or people.begin(seen.tool, time), time, seen, rng)
        return wish

    return lead


def delayed(leader: Leader, delay: float) -> Leader:
    """A leader who sees every picture so many seconds late, and the first one until then."""
    pictures: list[tuple[float, people.Seen]] = []

    def lead(time: float, seen: people.Seen) -> people.Wish:
        pictures.append((time, seen))
        while len(pictures) > 1 and pictures[1][0] <= time - delay + ROUNDING:
            pictures.pop(0)
        return leader(time, pictures[0][1])

    return lead


def shown(
    task: Task[S], number: int, seed: int, person: people.Person = PERSON, *, delay: float = 0.0
) -> Iterator[tuple[Recording, int]]:
    """So many showings that did the work, and how many tries each took: who fails, shows it again.

    delay is how late the person sees what the tool does [s]; they then move and wait, and have more time.
    Raises: SkillError, when one fails again and again.
    """
    longest = task.seconds + PATIENCE * delay
    for m in range(number):
        where = situation(task, SHOWN, seed, m)
        for attempt in range(TRIES):
            rng = np.random.default_rng([seed, SHOWN, m, attempt])
            leader = delayed(simulated(task, where, person, rng, delay=delay), delay)
            made = record(task, where, leader, f"{task.name} {m}", longest=longest)
            if made.verdict.success:
                yield made, attempt + 1
                break
        else:
            raise SkillError(
                f"showing {m} of {task.name!r} failed {TRIES} times, the last because {made.verdict.why}; "
                "choose another seed, or a steadier person"
            )
