"""Record demonstrations: a leader guides the robot's arm through a task in physics.

Rows of a recording hold the pose that the leader's tool commands, not the pose that the arm reaches. In
contact the command goes further than the tool, and so does a reproduction.

All randomness comes from (seed, split, number, attempt): a recording does not depend on those before it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np

from pilotfish.control import inverse_kinematics
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
from pilotfish.environments.human import (
    DemonstrationPlan,
    HumanModel,
    HumanState,
    Observation,
    initial_state,
    step_human,
)
from pilotfish.environments.robots import ROBOTS, Robot, chain_with_tool
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

S = TypeVar("S")
PERIOD, OBSERVATION_PERIOD = 0.1, 0.02  # s between rows of a recording; between observations of the leader
ARM_LAG = 0.25  # s, at most, from a movement of the hand to that of the tool, which follows by two springs
STEPS_PER_OBSERVATION = round(OBSERVATION_PERIOD / Workcell.timestep)
OBSERVATIONS_PER_ROW = round(PERIOD / OBSERVATION_PERIOD)
EXTRA_TIME_PER_DELAY = 40.0  # s for each second of delay: the number of observations that a task may need
TIME_TOLERANCE = 1e-9  # s
REACH_TOLERANCE = 1e-3  # m, rad: a goal farther from the nearest posture is out of reach
MAX_ATTEMPTS = 5  # of one demonstration
SPLITS = {"demonstration": 1, "test": 2, "selection": 3}  # independent streams of situations
DEFAULT_HUMAN = HumanModel()
BAXTER = ROBOTS["baxter"]

Leader = Callable[[float, Observation], tuple[Pose, float, bool]]
"""Function (time [s], observation) that returns the commanded tool pose, the grip, and whether it ends."""


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RecordedDemonstration:
    """Demonstration recorded in physics.

    Attributes:
        demonstration: Commanded poses and the frames of the task.
        outcome: Whether the task was done.
        peak_forces: Largest contact forces [N].
        duration: Simulated duration [s].
    """

    demonstration: Demonstration
    outcome: Outcome
    peak_forces: dict[str, float]
    duration: float


def task_layout(task: Task[S]) -> Layout:
    """Return the columns of a recording: tool pose, then the grip, 0 (open) to 1, if the tool has one."""
    grip = (Part("grip", Quantity.SCALAR, 1, "1"),) if task.has_gripper else ()
    return Layout(pose_layout().parts + grip)


def require_columns_and_frames(
    names: tuple[str, ...],
    frame_names: tuple[str, ...],
    task: Task[S],
    expected: Sequence[tuple[str, ...]],
) -> None:
    """Raise InvalidInput unless a skill has columns and frames of a task.

    Args:
        names: Names of the columns of the skill.
        frame_names: Names of its frames.
        task: Task from `TASKS`.
        expected: Names of columns that the task can have, the usual ones first.
    """
    if names not in expected:
        raise InvalidInput(
            f"the skill has the columns {', '.join(names)}, task {task.name!r} needs "
            f"{', '.join(expected[0])}; learn it from pilotfish record {task.name}"
        )
    if sorted(frame_names) != sorted(task.frames):
        raise InvalidInput(
            f"the skill has the frames {list(frame_names)}, task {task.name!r} has {list(task.frames)}; "
            f"learn it from pilotfish record {task.name}"
        )


def situation_from_seed(
    task: Task[S], split: Literal["demonstration", "test", "selection"], seed: int, number: int
) -> S:
    """Return a sampled situation; the splits are independent.

    Args:
        task: Task from `TASKS`.
        split: "demonstration" for those of `record_demonstrations`, "selection" for those that choose a
            model, "test" for others.
        seed: Seed of the situations, at least 0.
        number: Index of the situation in the split.
    """
    return task.sample_situation(np.random.default_rng([seed, SPLITS[split], number]))


def record(
    task: Task[S],
    situation: S,
    leader: Leader,
    name: str,
    *,
    time_limit: float | None = None,
    robot: Robot = BAXTER,
) -> RecordedDemonstration:
    """Record a leader who guides the robot until the task is over.

    The leader guides Baxter's left arm, whose motion the right arm follows. A robot without a second arm has
    a virtual leader: impedance control draws the tool to the leader's hand itself, and the rows hold the
    pose of the hand. Objects that move become moving frames.

    Args:
        task: Task from `TASKS`.
        situation: Situation of the task.
        leader: Who guides the arm.
        name: Name of the demonstration.
        time_limit: Longest duration [s]; None takes that of the task.
        robot: Robot from `ROBOTS`, or from `robot_from_file`.

    Returns:
        The demonstration, which may have failed; see its outcome.
    """
    cell = Workcell(task, situation, robot=robot, guided=True)
    rows, poses_by_row, done = [], [], False
    for n in range(round((time_limit or task.time_limit) / OBSERVATION_PERIOD)):
        poses = cell.frames()
        if n % OBSERVATIONS_PER_ROW == 0:
            rows.append(pose_row(task, cell.target, cell.grip))
            poses_by_row.append(poses)
            if done:
                break
        target, grip, is_last = leader(cell.time, Observation(cell.arm.tool, poses))
        cell.step_guidance(target, grip, STEPS_PER_OBSERVATION)
        done = done or is_last
    layout = task_layout(task)
    x = unwrap_orientations(np.array(rows), layout)
    recorded = demonstration(x, PERIOD, layout, recorded_frames(task, layout, poses_by_row), name)
    return RecordedDemonstration(recorded, cell.outcome(), dict(cell.peak_forces), cell.time)


def pose_row(task: Task[S], tool: Pose, grip: float) -> Float[Array, " D"]:
    """Return a row of a recording."""
    return np.concatenate([tool.position, tool.quaternion, [grip] * task.has_gripper])


def recorded_frames(
    task: Task[S], layout: Layout, poses_by_row: list[dict[str, Pose]]
) -> list[Frame | MovingFrame]:
    """Return the frames of a recording: fixed at their first pose, or moving if objects of the task move."""
    if task.actuate_scene is None:
        return [frame_from_pose(name, layout, poses_by_row[0][name]) for name in task.frames]
    return [
        moving_frame_from_poses(name, layout, [poses[name] for poses in poses_by_row]) for name in task.frames
    ]


def simulated_leader(
    task: Task[S],
    situation: S,
    human_model: HumanModel,
    rng: np.random.Generator,
    *,
    delay: float = 0.0,
) -> Leader:
    """Return a leader that simulates a person who follows the task's script and knows the delay.

    Args:
        task: Task from `TASKS`.
        situation: Situation of the task.
        human_model: Parameters of the person.
        rng: Generator of the motor noise.
        delay: Delay of the observations [s]; `delay_observations` makes them late.
    """
    plan = DemonstrationPlan(human_model, task.demonstration_script(situation), ARM_LAG + delay)
    state: HumanState | None = None

    def lead(time: float, observation: Observation) -> tuple[Pose, float, bool]:
        nonlocal state
        state = step_human(plan, state or initial_state(observation.tool, time), time, observation, rng)
        return state.hand, state.grip, state.done

    return lead


def delay_observations(leader: Leader, delay: float) -> Leader:
    """Return a leader that gets each observation late, and the first one until then.

    Args:
        leader: Leader that acts on the late observations.
        delay: Delay [s].
    """
    observations: list[tuple[float, Observation]] = []

    def lead(time: float, observation: Observation) -> tuple[Pose, float, bool]:
        observations.append((time, observation))
        while len(observations) > 1 and observations[1][0] <= time - delay + TIME_TOLERANCE:
            observations.pop(0)
        return leader(time, observations[0][1])

    return lead


def record_demonstrations(
    task: Task[S],
    number: int,
    seed: int,
    human_model: HumanModel = DEFAULT_HUMAN,
    *,
    delay: float = 0.0,
    robot: Robot = BAXTER,
) -> Iterator[tuple[RecordedDemonstration, int]]:
    """Yield successful demonstrations of a simulated person, each with its number of attempts.

    The names of demonstrations, which folders and skills keep, end with the robot unless it is Baxter. With a
    delay the person moves and waits, and gets more time.

    Args:
        task: Task from `TASKS`.
        number: Number of demonstrations.
        seed: Seed of situations and motor noise, at least 0.
        human_model: Parameters of the person.
        delay: Delay of the observations [s].
        robot: Robot from `ROBOTS`, or from `robot_from_file`.

    Raises:
        SkillError: If a demonstration fails repeatedly.
        InvalidInput: If the robot does not reach the start of a situation.
    """
    time_limit = task.time_limit + EXTRA_TIME_PER_DELAY * delay
    suffix = "" if robot is BAXTER else f", {robot.name}"
    for m in range(number):
        situation = situation_from_seed(task, "demonstration", seed, m)
        for attempt in range(MAX_ATTEMPTS):
            rng = np.random.default_rng([seed, SPLITS["demonstration"], m, attempt])
            leader = simulated_leader(task, situation, human_model, rng, delay=delay)
            recorded = record(
                task,
                situation,
                delay_observations(leader, delay),
                f"{task.name} {m}{suffix}",
                time_limit=time_limit,
                robot=robot,
            )
            if recorded.outcome.success:
                yield recorded, attempt + 1
                break
        else:
            fix = describe_unreached_goal(task, situation, robot) or "a human model with less noise"
            raise SkillError(
                f"demonstration {m} of {task.name!r} failed {MAX_ATTEMPTS} times, the last time because "
                f"{recorded.outcome.reason}; choose another seed or {fix}"
            )


def describe_unreached_goal(task: Task[S], situation: S, robot: Robot) -> str:
    """Return which goal of a demonstration a robot does not reach, and what to change; empty if none.

    Args:
        task: Task from `TASKS`.
        situation: Situation of the task; objects are where they are at the start.
        robot: Robot from `ROBOTS`, or from `robot_from_file`.
    """
    cell = Workcell(task, situation, robot=robot)
    chain, frames = chain_with_tool(robot, cell.mounted_tool.length), cell.frames()
    q = posture = cell.arm.q.copy()
    for subtask in task.demonstration_script(situation):
        goal = subtask.goal(frames)
        q, distance, angle, _ = inverse_kinematics(chain, goal, q, robot.limits, posture=posture)
        if distance > REACH_TOLERANCE or angle > REACH_TOLERANCE:
            return (
                f"another robot or base: {robot.name} does not reach the goal of {subtask.name!r} at "
                f"{np.round(goal.position, 3).tolist()} m, and stays {distance:.3g} m and {angle:.3g} rad "
                "away"
            )
    return ""
