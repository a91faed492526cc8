"""The recorded valve has the recorded geometry, friction, and a test of its angle."""

from math import pi, radians

import mujoco
import numpy as np
import pytest

from pilotfish.environments import RECORDED_VALVE, RecordedValve, Workcell
from pilotfish.environments.tasks.recorded_valve import CENTRE, LEVER, handle_pose, lever_angle
from pilotfish.geometry import Pose, angle, normalise, rotation_matrix
from pilotfish.io import datasets

pytestmark = pytest.mark.usefixtures("unchecked")

ANGLES = np.linspace(-3.0, 3.0, 13)


@pytest.fixture(scope="module")
def recorded(data_folder: object) -> list[RecordedValve]:
    """Return the situations of the eight demonstrations."""
    valves = []
    for demo in datasets.valve():
        before, after = (Pose(frame.b[:3].copy(), normalise(frame.A[3:7, 3])) for frame in demo.frames)
        start_pose = Pose(demo.x[0, :3].copy(), normalise(demo.x[0, 3:7]))
        valves.append(RecordedValve(before, after, start_pose))
    return valves


def sample_situation(seed: int) -> RecordedValve:
    return RECORDED_VALVE.sample_situation(np.random.default_rng(seed))


def set_angle(cell: Workcell[RecordedValve], lever: float) -> Workcell[RecordedValve]:
    """Set the angle of the lever [rad]."""
    cell.data.joint("valve").qpos[:] = lever
    mujoco.mj_forward(cell.model, cell.data)
    return cell


@pytest.mark.parametrize("turned", ANGLES)
def test_lever_angle_inverts_handle_pose(turned: float):
    handle = handle_pose(turned)
    assert lever_angle(handle) == pytest.approx(turned, abs=1e-12)
    away = handle.position - CENTRE
    x, _, z = rotation_matrix(handle.quaternion).T
    np.testing.assert_allclose(away, LEVER * x, atol=1e-12)
    np.testing.assert_allclose(z, [0.0, -1.0, 0.0], atol=1e-12)


def test_handle_pose_equals_simulated_handle():
    cell = Workcell(RECORDED_VALVE, sample_situation(0))
    for turned in ANGLES:
        set_angle(cell, turned)
        bar = cell.data.geom("handle")
        np.testing.assert_allclose(
            np.cross(bar.xpos - CENTRE, handle_pose(turned).position - CENTRE), 0.0, atol=1e-12
        )
        assert (bar.xpos - CENTRE) @ (handle_pose(turned).position - CENTRE) > 0.0


def test_handle_positions_of_recording_lie_on_circle(recorded: list[RecordedValve]):
    for valve in recorded:
        for frame in (valve.before, valve.after):
            expected = handle_pose(lever_angle(frame))
            assert np.linalg.norm(frame.position - expected.position) < 0.012
            assert angle(frame.quaternion, expected.quaternion) < radians(15.0)


def test_workcell_lever_starts_at_start_angle(recorded: list[RecordedValve]):
    valve = recorded[0]
    cell = Workcell(RECORDED_VALVE, valve)
    assert cell.data.joint("valve").qpos[0] == pytest.approx(valve.start_angle)
    frames = cell.frames()
    assert list(frames) == list(RECORDED_VALVE.frames)
    assert frames["valve before"] is valve.before
    assert frames["valve after"] is valve.after


def test_check_success_without_motion_fails(recorded: list[RecordedValve]):
    for valve in [*recorded, *map(sample_situation, range(3))]:
        cell = Workcell(RECORDED_VALVE, valve)
        cell.step_impedance(cell.target, 1.0, 300)
        outcome = cell.outcome()
        assert not outcome.success
        assert outcome.error == pytest.approx(valve.turn, abs=1e-3)
        assert outcome.reason


@pytest.mark.parametrize("seed", range(3))
def test_check_success_within_ten_degrees_is_done(seed: int):
    valve = sample_situation(seed)
    cell = Workcell(RECORDED_VALVE, valve)
    for left, expected in (
        (0.0, True),
        (9.9, True),
        (-9.9, True),
        (10.1, False),
        (-10.1, False),
        (180.0, False),
    ):
        for turns in (-1, 0, 1):
            outcome = set_angle(cell, valve.goal_angle + radians(left) + 2 * pi * turns).outcome()
            assert outcome.success is expected
            assert outcome.error == pytest.approx(radians(abs(left)), abs=1e-9)
            assert bool(outcome.reason) is not expected


@pytest.mark.parametrize(("turned", "expected"), [(0.0, False), (3.9, False), (4.1, True), (8.0, True)])
def test_check_success_small_turn_requires_half(turned: float, expected: bool):
    valve = RecordedValve(handle_pose(radians(8.0)), handle_pose(0.0), sample_situation(0).start_pose)
    outcome = set_angle(Workcell(RECORDED_VALVE, valve), radians(8.0 - turned)).outcome()
    assert outcome.success is expected
    assert ("less than half way" in outcome.reason) is not expected


@pytest.mark.parametrize(("begin", "end"), [(178.0, -178.0), (-178.0, 178.0), (4.0, 0.0)])
def test_turn_across_half_turn_is_short(begin: float, end: float):
    valve = RecordedValve(
        handle_pose(radians(begin)), handle_pose(radians(end)), sample_situation(0).start_pose
    )
    assert valve.turn == pytest.approx(radians(4.0))
    cell = Workcell(RECORDED_VALVE, valve)
    assert not cell.outcome().success
    assert set_angle(cell, radians(end)).outcome().success


@pytest.mark.parametrize("lever", [0.0, 1.0, 2.5])
def test_lever_without_force_stays(lever: float):
    cell = set_angle(Workcell(RECORDED_VALVE, sample_situation(0)), lever)
    for _ in range(20):
        cell.step_impedance(cell.target, 0.0, 100)
    assert cell.data.joint("valve").qpos[0] == pytest.approx(lever, abs=radians(1.0))


@pytest.mark.parametrize(("moment", "turns"), [(0.2, False), (2.0, True)])
def test_lever_moves_above_friction_moment(moment: float, turns: bool):
    cell = set_angle(Workcell(RECORDED_VALVE, sample_situation(0)), 1.0)
    cell.data.joint("valve").qfrc_applied[:] = moment
    for _ in range(10):
        cell.step_impedance(cell.target, 0.0, 100)
    rotation = abs(cell.data.joint("valve").qpos[0] - 1.0)
    assert rotation > 0.3 if turns else rotation < radians(1.0)


@pytest.mark.parametrize("seed", range(3))
def test_following_handle_opens_valve(seed: int):
    valve = sample_situation(seed)
    cell = Workcell(RECORDED_VALVE, valve)
    retreat = Pose(np.array([0.0, 0.0, -0.12]), np.array([1.0, 0.0, 0.0, 0.0]))
    angles = np.linspace(valve.start_angle, valve.goal_angle, 30)
    path = [(valve.before @ retreat, 0.0)] * 15 + [(valve.before, 0.0)] * 10 + [(valve.before, 1.0)] * 5
    path += [(handle_pose(turned), 1.0) for turned in angles] + [(valve.after, 1.0)] * 5
    path += [(valve.after, 0.0)] * 5 + [(valve.after @ retreat, 0.0)] * 10
    for pose, grip in path:
        cell.step_impedance(pose, grip, 100)
    assert cell.outcome().success, cell.outcome().reason
    assert 1.0 < cell.peak_forces["tool"] < 100.0


def test_demonstration_script_goals_are_handles():
    valve = sample_situation(1)
    frames = Workcell(RECORDED_VALVE, valve).frames()
    goals = [subtask.goal(frames) for subtask in RECORDED_VALVE.demonstration_script(valve)]
    places = np.array([goal.position for goal in goals])
    np.testing.assert_allclose(places[1], valve.before.position)
    np.testing.assert_allclose(places[2], valve.after.position)
    assert places[0][1] - places[1][1] == pytest.approx(0.12)  # on the robot's side of the valve
    assert places[3][1] - places[2][1] == pytest.approx(0.15)
    assert [subtask.grip for subtask in RECORDED_VALVE.demonstration_script(valve)] == [0.0, 1.0, 0.0, 0.0]
