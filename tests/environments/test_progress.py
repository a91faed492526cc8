"""A failure is explained by the first phase of the task that the recorded physics shows as not passed."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from pilotfish.environments import (
    TASKS,
    Failure,
    Outcome,
    Phase,
    Workcell,
    explain_failure,
    stack_measurements,
)
from pilotfish.environments.tasks.plate import PLATE, goal_pose, situation_for_level
from pilotfish.environments.tasks.valve import FACING, VALVE, ValveSituation, handle_pose
from pilotfish.geometry import Pose

pytestmark = pytest.mark.usefixtures("unchecked")

FAILED = Outcome(False, 1.0, "the tea is cold")
STEPS = 10
# Quantities of an attempt that passes every phase, from first to last period.
DONE = {
    "plate": {
        "lift": [0.0, 0.0, 0.0, 0.05, 0.2, 0.2, 0.05, 0.0, 0.0, 0.0],
        "to cross": [0.4, 0.4, 0.4, 0.4, 0.3, 0.1, 0.0, 0.0, 0.0, 0.0],
        "rotation": [0.0] * STEPS,
        "tilt": [0.0] * STEPS,
        "cup above": [0.1, 0.05, 0.002, 0.002, 0.002, 0.002, 0.002, 0.002, 0.03, 0.1],
        "cup beside": [0.0] * STEPS,
        "suction": [0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0],
        "obstacle force": [0.0] * STEPS,
    },
    "valve": {
        "turned": [0.0, 0.0, 0.0, 0.3, 0.6, 0.9, 1.0, 1.0, 1.0, 1.0],
        "goal": [1.0] * STEPS,
        "grip": [0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
        "distance": [0.2, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.15],
    },
    "screwdriver": {
        "aside": [0.05, 0.02, 0.005, 0.002, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0],
        "height": [0.1, 0.07, 0.03, 0.018, 0.012, 0.005, 0.001, 0.0, 0.0, 0.0],
        "distance": [0.12, 0.08, 0.03, 0.02, 0.012, 0.005, 0.001, 0.0, 0.0, 0.0],
        "tilt": [0.0] * STEPS,
        "twist": [0.0] * STEPS,
    },
    "carabiner": {
        "distance": [0.2, 0.15, 0.1, 0.07, 0.05, 0.03, 0.01, 0.0, 0.0, 0.0],
        "inside": [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0],
        "gate": [0.0, 0.0, 0.0, 0.1, 0.6, 0.5, 0.0, 0.0, 0.0, 0.0],
    },
    "stab": {
        "depth": [-0.1, -0.05, -0.01, 0.01, 0.03, 0.05, 0.07, 0.07, 0.07, 0.07],
        "aside": [0.1, 0.03, 0.01, 0.005, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0],
        "angle": [0.0] * STEPS,
    },
}
LIFT, FLAT = DONE["plate"]["lift"], [0.0] * STEPS
CASES = [
    ("plate", {"lift": FLAT, "suction": [0.3] * STEPS}, "never picked up", "suction never exceeded 0.30"),
    ("plate", {"lift": FLAT, "cup above": [0.03] * STEPS}, "never picked up", "stayed 30 mm above the plate"),
    ("plate", {"lift": FLAT, "cup beside": [0.02] * STEPS}, "never picked up", "20 mm beside the plate"),
    (
        "plate",
        {"cup above": [0.1, 0.05, 0, 0, 0, 0.3, 0.3, 0.3, 0.3, 0.3]},
        "dropped on the way",
        "200 mm above the table, 300 mm from the cross: it was torn off with suction on",
    ),
    (
        "plate",
        {"cup above": [0.1, 0.05, 0, 0, 0, 0.3, 0.3, 0.3, 0.3, 0.3], "suction": [1.0] * 5 + [0.0] * 5},
        "dropped on the way",
        "suction was switched off",
    ),
    ("plate", {"cup above": [0.002] * STEPS}, "not released", "hangs on the cup"),
    ("plate", {"to cross": [0.034] * STEPS}, "put down aside", "34 mm beside the cross"),
    ("plate", {"tilt": [0.1] * STEPS}, "put down tilted", "5.7 degrees"),
    ("plate", {"rotation": [0.3] * STEPS}, "put down turned", "17 degrees, at most 10 degrees"),
    ("plate", {"obstacle force": [3.2] * STEPS}, "hit the obstacle", "3.2 N"),
    ("valve", {"turned": FLAT, "grip": [0.4] * STEPS}, "never gripped", "closed to 0.40 at most"),
    (
        "valve",
        {"turned": FLAT, "distance": [0.045] * STEPS},
        "never gripped",
        "no closer to the handle",
    ),
    ("valve", {"turned": [0.01] * STEPS}, "gripped but not turned", "turned by only 0.6 degrees"),
    ("valve", {"turned": [0.0] * 5 + [0.5] * 5}, "turned too little", "only 29 degrees of 57 degrees"),
    (
        "valve",
        {"turned": [0.0] * 5 + [1.0] * 3 + [0.7] * 2},
        "turned back while letting go",
        "back to 40",
    ),
    ("valve", {"turned": [0.0] * 5 + [1.3] * 5}, "turned too far", "74 degrees instead of 57 degrees"),
    (
        "valve",
        {"distance": [0.05] * 2 + [0.0] * 6 + [0.05] * 2},
        "hand not withdrawn",
        "50 mm from",
    ),
    ("screwdriver", {"height": [0.05] * STEPS}, "stopped above the recess", "50 mm above the bottom"),
    ("screwdriver", {"aside": [0.02] * STEPS}, "missed the recess", "20 mm beside the middle"),
    ("screwdriver", {"distance": [0.02] * 5 + [0.001] * 4 + [0.02]}, "left the recess again", "20 mm away"),
    ("screwdriver", {"distance": [0.008] * STEPS}, "not inserted to the bottom", "8.0 mm from the bottom"),
    ("screwdriver", {"tilt": [0.2] * STEPS}, "inserted tilted", "11 degrees"),
    ("screwdriver", {"twist": [0.3] * STEPS}, "blade turned", "17 degrees"),
    (
        "carabiner",
        {"inside": FLAT, "gate": FLAT, "distance": [0.1] * STEPS},
        "never reached the rod",
        "48 mm away",
    ),
    ("carabiner", {"inside": FLAT, "gate": FLAT}, "pushed beside the gate", "by only 0.0 degrees"),
    ("carabiner", {"inside": FLAT, "distance": [0.04] * STEPS}, "rod not pushed in", "40 mm from its goal"),
    ("carabiner", {"inside": [0.0] * 5 + [1.0] * 4 + [0.0]}, "rod slipped out", "was inside"),
    ("carabiner", {"gate": [0.5] * STEPS}, "gate not closed", "29 degrees"),
    ("stab", {"depth": [-0.03] * STEPS}, "never reached the receptacle", "30 mm before the mouth"),
    ("stab", {"aside": [0.04] * STEPS}, "missed the funnel", "40 mm beside the axis"),
    ("stab", {"depth": [-0.01] * 5 + [0.01] * 5}, "stuck in the funnel", "10 mm deep"),
    ("stab", {"depth": [-0.01] * 4 + [0.07] * 5 + [0.02]}, "pulled out again", "is 20 mm deep at the end"),
    ("stab", {"depth": [-0.01] * 5 + [0.04] * 5}, "not pushed in far enough", "40 mm deep, expected 60 mm"),
    ("stab", {"angle": [0.1] * STEPS}, "tilted in the bore", "5.7 degrees"),
]


def explain(name: str, changes: Mapping[str, list[float]]) -> Failure:
    history = {key: np.array(values, dtype=float) for key, values in (DONE[name] | changes).items()}
    failure = explain_failure(TASKS[name].progress, history, FAILED)
    assert failure is not None
    return failure


@pytest.mark.parametrize(("name", "changes", "summary", "detail"), CASES)
def test_failed_phase_is_explained(name: str, changes: dict[str, list[float]], summary: str, detail: str):
    failure = explain(name, changes)
    assert failure.summary == summary
    assert detail in failure.detail
    assert failure.phase != Phase.OTHER


@pytest.mark.parametrize("name", sorted(TASKS))
def test_other_failure_is_explained_by_outcome(name: str):
    """An attempt that passes every phase, but whose outcome is a failure, keeps the outcome's reason."""
    assert explain(name, {}) == Failure(Phase.OTHER, "not done", "the tea is cold")


@pytest.mark.parametrize("name", sorted(TASKS))
def test_success_has_no_failure(name: str):
    history = {key: np.array(values) for key, values in DONE[name].items()}
    assert explain_failure(TASKS[name].progress, history, Outcome(True, 0.0)) is None


@pytest.mark.parametrize("name", sorted(TASKS))
def test_measured_quantities_are_those_of_the_explanation(name: str):
    """The physics provides each quantity, and an attempt without motion fails in its first phase."""
    task = TASKS[name]
    cell = Workcell(task, task.sample_situation(np.random.default_rng(0)))
    history = stack_measurements([cell.measure_progress() for _ in range(3)])
    assert history.keys() == DONE[name].keys()
    assert all(np.isfinite(values).all() for values in history.values())
    failure = explain_failure(task.progress, history, cell.outcome())
    assert failure is not None
    assert failure.phase in (Phase.APPROACH, Phase.GRASP)
    assert task.progress is not None
    assert 0 < len(task.progress.describe(cell.measure_progress())) < 40


def test_task_without_progress_is_explained_by_outcome():
    assert explain_failure(None, {}, FAILED) == Failure(Phase.OTHER, "not done", "the tea is cold")
    assert stack_measurements([]) == {}


def follow(cell: Workcell, *moves: tuple[Pose, float, int], callback: Callable[[], None]) -> None:
    """Follow poses with a grip and a duration [ms] in periods of 100 ms."""
    for pose, grip, duration in moves:
        start = cell.target
        for n in range(1, duration // 100 + 1):
            share = min(1.5 * n * 100 / duration, 1.0)
            position = start.position + share * (pose.position - start.position)
            cell.step_impedance(Pose(position, pose.quaternion), grip, 100)
            callback()


def test_plate_released_in_the_air_is_dropped_in_physics():
    cell = Workcell(PLATE, situation_for_level(0, np.random.default_rng(1)))
    at_plate = PLATE.demonstration_script(cell.situation)[2].goal(cell.frames())
    lifted = Pose(at_plate.position + np.array([0.0, 0.0, 0.15]), at_plate.quaternion)
    above = Pose(at_plate.position + np.array([0.0, 0.0, 0.04]), at_plate.quaternion)
    rows, said = [], []

    def measure() -> None:
        rows.append(cell.measure_progress())
        said.append(PLATE.progress.describe(rows[-1]))

    moves = ((above, 0.0, 1500), (at_plate, 0.0, 600), (at_plate, 1.0, 500), (lifted, 1.0, 1500))
    follow(cell, *moves, (lifted, 0.0, 800), callback=measure)
    failure = explain_failure(PLATE.progress, stack_measurements(rows), cell.outcome())
    assert (failure.phase, failure.summary) == (Phase.RELEASE, "dropped on the way")
    assert "suction was switched off" in failure.detail
    aside = np.linalg.norm((cell.situation.plate.position - goal_pose().position)[:2])
    assert f"{1000 * aside:.0f} mm from the cross" in failure.detail
    assert [said[n] for n in (0, 23, 35, -1)] == ["moving", "suction on", "picked up", "moving"]


def test_valve_turned_half_is_turned_too_little_in_physics():
    cell = Workcell(VALVE, VALVE.sample_situation(np.random.default_rng(0)))
    situation: ValveSituation = cell.situation
    rows: list[Mapping[str, float]] = []

    def at(angle: float, distance: float) -> Pose:
        return handle_pose(situation, angle) @ Pose(np.array([-distance, 0.0, 0.0]), FACING)

    start, middle = situation.start_angle, 0.5 * (situation.start_angle + situation.goal_angle)
    turn = [(at(angle, 0.0), 1.0, 200) for angle in np.linspace(start, middle, 12)]
    moves = [(at(start, 0.13), 0.0, 1500), (at(start, 0.0), 0.0, 1000), (at(start, 0.0), 1.0, 500), *turn]
    moves += [(at(middle, 0.0), 0.0, 400), (at(middle, 0.13), 0.0, 800)]
    follow(cell, *moves, callback=lambda: rows.append(cell.measure_progress()))
    failure = explain_failure(VALVE.progress, stack_measurements(rows), cell.outcome())
    assert failure.summary == "turned too little"
    total = np.degrees(situation.goal_angle - start)
    turned = np.degrees(rows[-1]["turned"])
    assert failure.detail == f"turned by only {turned:.0f} degrees of {total:.0f} degrees"
    assert turned == pytest.approx(total / 2, abs=5.0)
