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
    demonstration,
    frame_from_pose,
    moving_frame_from_poses,
    pose_layout,
    unwrap_orientations,
)
from pilotfish.environments import Outcome, Task, Workcell
from pilotfish.environments import human as human
from pilotfish.errors import SkillError
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float

S = TypeVar("S")
PERIOD, OBSERVATION_PERIOD = 0.1, 0.02  # s between rows of a recording; between looks of whoever leads
ARM_LAG = 0.25  # s, at most, from a move of the hand to that of the tool: two arms on springs lie between
STEPS_PER_OBSERVATION, OBSERVATIONS_PER_ROW = (
    round(OBSERVATION_PERIOD * 1000),
    round(PERIOD / OBSERVATION_PERIOD),
)
EXTRA_TIME_PER_DELAY = 40.0  # s more for each second of delay: so many looks a task may need
TIME_TOLERANCE = 1e-9  # s
MAX_ATTEMPTS = 5  # of one demonstration, before something must be wrong
DEMONSTRATION_STREAM, TEST_STREAM = 1, 2  # streams of situations that never meet

DEFAULT_HUMAN = human.HumanModel()

Leader = Callable[
    [float, human.Observation], human.HandCommand
]  # time [s] and picture -> what their hand asks for


@dataclass(frozen=True, slots=True, eq=False)
class RecordedDemonstration:
    """One showing: what was asked for, whether it did the work, largest forces [N], how long it took [s]."""

    demonstration: Demonstration
    outcome: Outcome
    peak_forces: dict[str, float]
    seconds: float


def task_layout(task: Task[S]) -> Layout:
    """The columns of a recording: the tool's pose, and the grip where there is one, from 0, open, to 1."""
    grip = (Part("grip", Quantity.SCALAR, 1, "1"),) if task.has_gripper else ()
    return Layout(pose_layout().parts + grip)


def situation_from_seed(task: Task[S], stream: int, seed: int, number: int) -> S:
    """The situation of that number, among those to be shown or those unseen; every number its own."""
    return task.sample_situation(np.random.default_rng([seed, stream, number]))


def record(
    task: Task[S], situation: S, leader: Leader, name: str, *, time_limit: float | None = None
) -> RecordedDemonstration:
    """What the leader asks of the right arm by leading the left one, until they are done or time is up.

    That is after the task's own time, or the longest [s] that is given.

    Rows hold the pose that the leader's tool asks for, not the one that the arm reached: it goes further
    where it presses, and so does a replay. A task in which things move has frames that move.
    """
    cell = Workcell(task, situation, lead=True)
    rows, observation, done = [], [], False
    for n in range(round((time_limit or task.time_limit) / OBSERVATION_PERIOD)):
        poses = cell.frames()
        if n % OBSERVATIONS_PER_ROW == 0:
            rows.append(pose_row(task, cell.target, cell.grip))
            observation.append(poses)
            if done:
                break
        command = leader(cell.time, human.Observation(cell.arm.tool, poses))
        cell.step_guidance(command.pose, command.grip, STEPS_PER_OBSERVATION)
        done = done or command.done
    layout = task_layout(task)
    x = unwrap_orientations(np.array(rows), layout)
    frames = recorded_frames(task, layout, observation)
    recorded = demonstration(x, PERIOD, layout, frames, name)
    return RecordedDemonstration(recorded, cell.outcome(), dict(cell.peak_forces), cell.time)


def pose_row(task: Task[S], tool: Pose, grip: float) -> Float[Array, " D"]:
    """A row of a recording."""
    return np.concatenate([tool.position, tool.quaternion, [grip] * task.has_gripper])


def recorded_frames(
    task: Task[S], layout: Layout, observation: list[dict[str, Pose]]
) -> list[Frame | MovingFrame]:
    """The task's frames where they stood; those of a task in which things move, row by row."""
    if task.actuate_scene is None:
        return [frame_from_pose(name, layout, observation[0][name]) for name in task.frames]
    return [
        moving_frame_from_poses(name, layout, [poses[name] for poses in observation]) for name in task.frames
    ]


def simulated_leader(
    task: Task[S],
    situation: S,
    human_model: human.HumanModel,
    rng: np.random.Generator,
    *,
    delay: float = 0.0,
) -> Leader:
    """A simulated person who performs the task's script and knows how late the picture is [s]."""
    plan = human.DemonstrationPlan(human_model, task.demonstration_script(situation), ARM_LAG + delay)
    state: human.HumanState | None = None

    def lead(time: float, observation: human.Observation) -> human.HandCommand:
        nonlocal state
        state, command = human.step_human(
            plan, state or human.initial_state(observation.tool, time), time, observation, rng
        )
        return command

    return lead


def delay_observations(leader: Leader, delay: float) -> Leader:
    """A leader who sees every picture so many seconds late, and the first one until then."""
    pictures: list[tuple[float, human.Observation]] = []

    def lead(time: float, observation: human.Observation) -> human.HandCommand:
        pictures.append((time, observation))
        while len(pictures) > 1 and pictures[1][0] <= time - delay + TIME_TOLERANCE:
            pictures.pop(0)
        return leader(time, pictures[0][1])

    return lead


def record_demonstrations(
    task: Task[S],
    number: int,
    seed: int,
    human_model: human.HumanModel = DEFAULT_HUMAN,
    *,
    delay: float = 0.0,
) -> Iterator[tuple[RecordedDemonstration, int]]:
    """So many showings that did the work, and how many tries each took: who fails, shows it again.

    delay is how late the person sees what the tool does [s]; they then move and wait, and have more time.
    Raises: SkillError, when one fails again and again.
    """
    time_limit = task.time_limit + EXTRA_TIME_PER_DELAY * delay
    for m in range(number):
        situation = situation_from_seed(task, DEMONSTRATION_STREAM, seed, m)
        for attempt in range(MAX_ATTEMPTS):
            rng = np.random.default_rng([seed, DEMONSTRATION_STREAM, m, attempt])
            leader = delay_observations(
                simulated_leader(task, situation, human_model, rng, delay=delay), delay
            )
            made = record(task, situation, leader, f"{task.name} {m}", time_limit=time_limit)
            if made.outcome.success:
                yield made, attempt + 1
                break
        else:
            raise SkillError(
                f"showing {m} of {task.name!r} failed {MAX_ATTEMPTS} times, the last because {made.outcome.reason}; "
                "choose another seed, or a steadier person"
            )
