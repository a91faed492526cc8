"""Skills performed from the frames of a simulated camera; a covered marker holds or stops the robot."""

from typing import Any

import numpy as np
import pytest
from drawing import needs_renderer

from pilotfish.environments import TASKS, Workcell
from pilotfish.errors import FramesNotVisible, InvalidInput
from pilotfish.geometry import Pose, angle
from pilotfish.simulation import (
    MARKED_TASKS,
    CameraObserver,
    CameraSimulation,
    camera_scene,
    execution,
    marked_task,
    situation_from_seed,
)
from pilotfish.simulation.camera_execution import _PeriodLog

pytestmark = [needs_renderer, pytest.mark.usefixtures("unchecked")]


def observe_start(name: str, simulation: CameraSimulation) -> tuple[dict[str, Pose], dict[str, Pose]]:
    """Return the frames that the camera sees at the start, and the true ones."""
    task = TASKS[name]
    situation = situation_from_seed(task, "test", 0, 1)
    scene = camera_scene(task, situation)
    observer = CameraObserver(scene, simulation)
    try:
        cell = Workcell(marked_task(task, scene, observer), situation)
        return cell.frames(), task.observe_frames(cell.model, cell.data, situation)
    finally:
        observer.close()


@pytest.mark.parametrize("name", MARKED_TASKS)
def test_camera_sees_the_frames_of_the_task(name: str):
    found, true = observe_start(name, CameraSimulation())
    assert list(found) == list(TASKS[name].frames)
    for frame, pose in found.items():
        assert np.linalg.norm(pose.position - true[frame].position) < 0.002
        assert float(angle(pose.quaternion, true[frame].quaternion)) < np.radians(0.5)


def test_markers_have_no_mass_and_no_contacts():
    task = TASKS["valve"]
    situation = situation_from_seed(task, "test", 0, 0)
    scene = camera_scene(task, situation)
    plain = Workcell(task, situation).model
    marked = Workcell(marked_task(task, scene, CameraObserver(scene)), situation).model
    np.testing.assert_array_equal(marked.body_mass, plain.body_mass)
    np.testing.assert_array_equal(marked.body_inertia, plain.body_inertia)
    for printed in scene.printed:
        geom = marked.geom(printed.name)
        assert (geom.contype[0], geom.conaffinity[0]) == (0, 0)


def test_covered_camera_names_frame_and_reason():
    black = CameraSimulation(image_filter=lambda image, time: np.zeros_like(image))
    with pytest.raises(FramesNotVisible, match=r"'before' at 0\.00 s \(marker not found\)"):
        observe_start("valve", black)


def test_task_without_markers_is_invalid_input():
    task = TASKS["carabiner"]
    with pytest.raises(InvalidInput, match="no markers, expected one of"):
        camera_scene(task, situation_from_seed(task, "test", 0, 0))


def test_stopped_result_keeps_what_was_measured():
    task = TASKS["stab"]
    situation = situation_from_seed(task, "test", 0, 0)
    cell, log = Workcell(task, situation), _PeriodLog(None)
    before = log.stopped_result("covered", cell)
    assert before.commanded.shape == (0, 7)
    assert not before.outcome.success
    assert before.failure is not None
    assert before.failure.phase == "approach"
    for _ in range(2):
        cell.step_impedance(cell.target, 0.0, 1)
        log.record(cell)
    after = log.stopped_result("covered", cell)
    assert after.measured.shape == (2, 7)
    assert after.failure is not None
    assert (after.failure.phase, after.failure.detail) == ("motion", "covered")


class BlinkingCell:
    """Workcell whose frame is hidden in some periods; the frame moves at 1 mm per period."""

    def __init__(self, task: Any, hidden: range) -> None:
        self.task, self.hidden, self.calls = task, hidden, -1
        self.target = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))

    def frames(self) -> dict[str, Pose]:
        self.calls += 1
        if self.calls in self.hidden:
            raise FramesNotVisible("covered")
        return {"target": Pose(np.array([0.001 * self.calls, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))}


@pytest.fixture
def planned(monkeypatch: pytest.MonkeyPatch):
    """Replace planning: the command follows the frame, and the poses a period ago are recorded."""
    passed: list[tuple[float, float]] = []

    def step(skill, before, now, x, states, **options):
        passed.append((before["target"].position[0], now["target"].position[0]))
        moved = x.copy()
        moved[0] = now["target"].position[0]
        moved[7:] = 1.0
        return moved

    monkeypatch.setattr(execution, "reproduce_step", step)
    monkeypatch.setattr(execution, "_plan_states", lambda *_: np.zeros(20, dtype=int))
    monkeypatch.setattr(
        execution, "_start_state", lambda skill, cell: np.append(np.zeros(3), [1.0, *[0.0] * 10])
    )
    monkeypatch.setattr(execution, "_at_rest", lambda x, skill: np.append(x[:7], np.zeros(7)))
    return passed


class Period:
    period = 0.1


def commands(hidden: range) -> list[float]:
    cell = BlinkingCell(TASKS["screwdriver"], hidden)
    plan = execution._plan_each_period(Period(), cell, 20, control_cost=None, covariance_regularisation=None)
    return [pose.position[0] for pose, _ in plan]


def test_hidden_frame_holds_the_command_and_then_continues(planned: list[tuple[float, float]]):
    made = commands(range(5, 9))
    assert made[3] == made[4] == made[7] == pytest.approx(0.004)
    assert made[8] == pytest.approx(0.009)
    assert planned[4] == pytest.approx((0.009, 0.009))  # after the hold the frame's speed is taken as 0
    assert len(made) == len(commands(range(0))) + 4


def test_frame_that_stays_hidden_stops_the_execution(planned: list[tuple[float, float]]):
    with pytest.raises(FramesNotVisible, match="covered"):
        commands(range(5, 1000))
    assert len(planned) == 4
