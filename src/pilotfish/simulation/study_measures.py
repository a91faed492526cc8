"""One run of the study: the mission, and what is measured in it."""

from collections.abc import Sequence
from math import radians
from time import process_time
from typing import Any, TypeVar

import numpy as np

from pilotfish.environments import TASKS, Task
from pilotfish.environments.human import Subtask
from pilotfish.geometry import Pose, rotation_vector_in_world
from pilotfish.simulation.mission import MissionResult, MissionSettings, run_mission
from pilotfish.simulation.recording import OBSERVATION_PERIOD, situation_from_seed
from pilotfish.simulation.study import StudyRun, mission_settings
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_type

S = TypeVar("S")
NEAR, NEAR_ANGLE = 0.01, radians(5.0)  # m, rad: so near to the operator's goal counts as reached
NOISE_STREAM = 4  # beside those of `situation_from_seed`
MAX_SEED = 2**32
GOAL_SUBTASKS = {"valve": "turn"}  # at which success aside is measured; otherwise at the last one


def perform_study_run(run: StudyRun, skill: bytes, seed: int = 0) -> dict[str, Any]:
    """Run a mission and return its measures, as values of JSON.

    Success includes that the operator knew in time that the motion had ended. In the arm "aside" it means
    that the tool was within 1 cm and 5 degrees of the operator's own goal, wherever the objects are: at the
    end, or for the valve at the end of the turn, since afterwards the hand only withdraws.

    Args:
        run: Run of the study.
        skill: Bytes of the skill of its condition.
        seed: Seed of the study.

    Returns:
        run, the key; success; time [s]; path of the tool [m] and path_ratio, to straight lines through the
        operator's goals; error in the unit of the task, or distance from the goal in the arm "aside" [m];
        submovements; effort, the path of the hand [m]; disagreement, the mean distance from hand to target
        [m], None in autonomous control; bytes_forward and bytes_backward; alignments; stale commands;
        limit_events, how often limits began to hold the target back; peak_force [N]; failure; cpu [s].

    Raises:
        InvalidInput: If the skill or seed cannot be used.
    """
    require_type(run, "run", StudyRun, "study_runs() returns them")
    require_count(seed, "seed", MAX_SEED)
    began, task, settings = process_time(), TASKS[run.condition.task], mission_settings(run)
    situation = situation_from_seed(task, "test", seed, run.number)
    rng, counter = np.random.default_rng([seed, NOISE_STREAM, run.number]), _LimitCounter()
    result = run_mission(skill, task, situation, rng, settings, on_step=counter)
    goals = _goals(task, situation, result, settings)
    success, error = result.outcome.success, float(result.outcome.error)
    if settings.aside is not None:
        success, error = reach_goal(result.measured, goals, GOAL_SUBTASKS.get(task.name))
    path = path_length(result.measured[:, :3])
    places = [goal.position for _, goal in goals]
    return {
        "run": run.key,
        "success": bool(success and result.is_completed),
        "time": round(result.duration, 3),
        "path": path,
        "path_ratio": path / path_length(np.array([*result.measured[:1, :3], *places])),
        "error": error,
        "submovements": result.submovements,
        "effort": float(result.effort),
        "disagreement": _disagreement(result, settings),
        "bytes_forward": result.bytes_forward,
        "bytes_backward": result.bytes_backward,
        "alignments": result.alignments,
        "stale": result.stale,
        "limit_events": counter.events,
        "peak_force": float(result.peak_forces["tool"]),
        "failure": "" if success and result.is_completed else _explain(result, settings),
        "cpu": round(process_time() - began, 2),
    }


def path_length(positions: Float[Array, "T 3"]) -> float:
    """Return the length of a path through positions [m].

    Args:
        positions: Positions in their order [m].
    """
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())


def reach_goal(
    measured: Float[Array, "T 7"], goals: Sequence[tuple[Subtask, Pose]], name: str | None
) -> tuple[bool, float]:
    """Return whether the tool reached the goal of a subtask, and its distance [m].

    Args:
        measured: Pose of the tool at each step.
        goals: Subtasks of the operator, with their goals.
        name: Name of the subtask, whose goal may be reached at any time; None for the last one, at whose goal
            the tool must be at the end.
    """
    goal = next((goal for subtask, goal in goals if subtask.name == name), goals[-1][1])
    rows = measured if name else measured[-1:]
    distances = np.linalg.norm(rows[:, :3] - goal.position, axis=1)
    angles = np.array([np.linalg.norm(rotation_vector_in_world(row[3:], goal.quaternion)) for row in rows])
    is_turned = angles <= NEAR_ANGLE
    nearest = float(distances[is_turned].min()) if is_turned.any() else float(distances[-1])
    return bool(is_turned.any() and nearest <= NEAR), nearest


class _LimitCounter:
    """Counts how often the limits begin to hold back the target."""

    def __init__(self) -> None:
        self.events, self._was_limited = 0, False

    def __call__(self, cell: Any, step: Any, view: Any, given: Any) -> None:
        is_limited = step.site.motion.is_limited
        self.events += is_limited and not self._was_limited
        self._was_limited = is_limited


def _goals(
    task: Task[S], situation: S, result: MissionResult, settings: MissionSettings
) -> list[tuple[Subtask, Pose]]:
    """Return the goals of the operator relative to the objects where they are at the end."""
    offset = np.zeros(3) if settings.aside is None else settings.aside
    frames = {name: Pose(pose.position + offset, pose.quaternion) for name, pose in result.frames.items()}
    return [(subtask, subtask.goal(frames)) for subtask in task.demonstration_script(situation)]


def _disagreement(result: MissionResult, settings: MissionSettings) -> float | None:
    """Return the mean distance from the hand, when its command was sent, to the target of that command."""
    if settings.mode == "autonomous":
        return None
    delay = round(settings.forward.delay / OBSERVATION_PERIOD)
    hands, targets = result.hands[: len(result.hands) - delay], result.targets[delay:]
    return float(np.linalg.norm(hands[:, :3] - targets[:, :3], axis=1).mean())


def _explain(result: MissionResult, settings: MissionSettings) -> str:
    if settings.aside is not None:
        return "not where the operator aimed"
    if result.failure is not None:
        return result.failure.summary
    return "the operator did not learn in time that the motion had ended"
