"""The recorded valve in physics: where it was recorded, turned only by who turns it, and judged so."""

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
    """The situations of the eight openings, as their frames say."""
    valves = []
    for demo in datasets.valve():
        before, after = (Pose(frame.b[:3].copy(), normalise(frame.A[3:7, 3])) for frame in demo.frames)
        start_pose = Pose(demo.x[0, :3].copy(), normalise(demo.x[0, 3:7]))
        valves.append(RecordedValve(before, after, start_pose))
    return valves


def drawn(seed: int) -> RecordedValve:
    return RECORDED_VALVE.sample_situation(np.random.default_rng(seed))


def standing(cell: Workcell[RecordedValve], lever: float) -> Workcell[RecordedValve]:
    """The same workcell, its lever turned to an angle [rad]."""
    cell.data.joint("valve").qpos[:] = lever
    mujoco.mj_forward(cell.model, cell.data)
    return cell


@pytest.mark.parametrize("turned", ANGLES)
def test_a_handle_is_as_far_round_as_it_was_turned(turned: float):
    """An angle makes a pose and the pose gives the angle back; the pose lies on the circle, x away from its
    middle and z into the valve, which is to the robot's right.
    """
    handle = handle_pose(turned)
    assert lever_angle(handle) == pytest.approx(turned, abs=1e-12)
    away = handle.position - CENTRE
    x, _, z = rotation_matrix(handle.quaternion).T
    np.testing.assert_allclose(away, LEVER * x, atol=1e-12)
    np.testing.assert_allclose(z, [0.0, -1.0, 0.0], atol=1e-12)


def test_the_simulated_handle_is_where_the_pose_says():
    """At every angle the lever of the physics lies along the line from the axle to the handle's pose."""
    cell = Workcell(RECORDED_VALVE, drawn(0))
    for turned in ANGLES:
        standing(cell, turned)
        bar = cell.data.geom("handle")
        np.testing.assert_allclose(
            np.cross(bar.xpos - CENTRE, handle_pose(turned).position - CENTRE), 0.0, atol=1e-12
        )
        assert (bar.xpos - CENTRE) @ (handle_pose(turned).position - CENTRE) > 0.0


def test_the_recording_lies_on_the_circle(recorded: list[RecordedValve]):
    """All sixteen frames are within 12 mm of it, and turned as the handle is there to within 15 degrees."""
    for valve in recorded:
        for frame in (valve.before, valve.after):
            expected = handle_pose(lever_angle(frame))
            assert np.linalg.norm(frame.position - expected.position) < 0.012
            assert angle(frame.quaternion, expected.quaternion) < radians(15.0)


def test_at_first_the_lever_stands_where_it_was_before(recorded: list[RecordedValve]):
    """And frames are seen where they were recorded."""
    valve = recorded[0]
    cell = Workcell(RECORDED_VALVE, valve)
    assert cell.data.joint("valve").qpos[0] == pytest.approx(valve.begin)
    seen = cell.frames()
    assert list(seen) == list(RECORDED_VALVE.frames)
    assert seen["valve before"] is valve.before
    assert seen["valve after"] is valve.after


def test_doing_nothing_opens_no_valve(recorded: list[RecordedValve]):
    """None of the recording's, not even that which had to be turned by ten degrees alone; no drawn one."""
    for valve in [*recorded, *map(drawn, range(3))]:
        cell = Workcell(RECORDED_VALVE, valve)
        cell.step_impedance(cell.target, 1.0, 300)
        outcome = cell.outcome()
        assert not outcome.success
        assert outcome.error == pytest.approx(valve.turn, abs=1e-3)
        assert outcome.reason


@pytest.mark.parametrize("seed", range(3))
def test_open_is_within_ten_degrees(seed: int):
    """On either side, and once round the circle too; the error is the angle that is left."""
    valve = drawn(seed)
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
            outcome = standing(cell, valve.end + radians(left) + 2 * pi * turns).outcome()
            assert outcome.success is expected
            assert outcome.error == pytest.approx(radians(abs(left)), abs=1e-9)
            assert bool(outcome.reason) is not expected


@pytest.mark.parametrize(("turned", "expected"), [(0.0, False), (3.9, False), (4.1, True), (8.0, True)])
def test_open_is_nearer_to_the_end_than_to_the_beginning(turned: float, expected: bool):
    """A valve that had to be turned by eight degrees is not open at less than half, though within ten."""
    valve = RecordedValve(handle_pose(radians(8.0)), handle_pose(0.0), drawn(0).start_pose)
    outcome = standing(Workcell(RECORDED_VALVE, valve), radians(8.0 - turned)).outcome()
    assert outcome.success is expected
    assert ("hardly been turned" in outcome.reason) is not expected


@pytest.mark.parametrize(("begin", "end"), [(178.0, -178.0), (-178.0, 178.0), (4.0, 0.0)])
def test_a_short_way_is_short_across_half_a_turn_too(begin: float, end: float):
    """Where angles begin anew nothing is different: four degrees to go are four; staying opens nothing."""
    valve = RecordedValve(handle_pose(radians(begin)), handle_pose(radians(end)), drawn(0).start_pose)
    assert valve.turn == pytest.approx(radians(4.0))
    cell = Workcell(RECORDED_VALVE, valve)
    assert not cell.outcome().success
    assert standing(cell, radians(end)).outcome().success


@pytest.mark.parametrize("lever", [0.0, 1.0, 2.5])
def test_the_lever_stays_where_it_is_left(lever: float):
    """It is balanced, and its axle has friction: in two seconds alone it moves by less than a degree."""
    cell = standing(Workcell(RECORDED_VALVE, drawn(0)), lever)
    for _ in range(20):
        cell.step_impedance(cell.target, 0.0, 100)
    assert cell.data.joint("valve").qpos[0] == pytest.approx(lever, abs=radians(1.0))


@pytest.mark.parametrize(("moment", "turns"), [(0.2, False), (2.0, True)])
def test_it_takes_a_moment_to_turn_it(moment: float, turns: bool):
    """Less than its friction does not turn it in a second, more does."""
    cell = standing(Workcell(RECORDED_VALVE, drawn(0)), 1.0)
    cell.data.joint("valve").qfrc_applied[:] = moment
    for _ in range(10):
        cell.step_impedance(cell.target, 0.0, 100)
    gone = abs(cell.data.joint("valve").qpos[0] - 1.0)
    assert gone > 0.3 if turns else gone < radians(1.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_hand_that_goes_round_with_the_handle_opens_it(seed: int):
    """Come from before it, grip, follow the circle, let go, withdraw: it is open, and no force is large."""
    valve = drawn(seed)
    cell = Workcell(RECORDED_VALVE, valve)
    back = Pose(np.array([0.0, 0.0, -0.12]), np.array([1.0, 0.0, 0.0, 0.0]))
    way = np.linspace(valve.begin, valve.end, 30)
    path = [(valve.before @ back, 0.0)] * 15 + [(valve.before, 0.0)] * 10 + [(valve.before, 1.0)] * 5
    path += [(handle_pose(turned), 1.0) for turned in way] + [(valve.after, 1.0)] * 5
    path += [(valve.after, 0.0)] * 5 + [(valve.after @ back, 0.0)] * 10
    for pose, grip in path:
        cell.step_impedance(pose, grip, 100)
    assert cell.outcome().success, cell.outcome().reason
    assert 1.0 < cell.peak_forces["tool"] < 100.0


def test_its_script_leads_from_handle_to_handle():
    """Goals are before the handle where it is, on it, on it where it is to be, and away from that."""
    valve = drawn(1)
    seen = Workcell(RECORDED_VALVE, valve).frames()
    goals = [subtask.goal(seen) for subtask in RECORDED_VALVE.demonstration_script(valve)]
    places = np.array([goal.position for goal in goals])
    np.testing.assert_allclose(places[1], valve.before.position)
    np.testing.assert_allclose(places[2], valve.after.position)
    assert places[0][1] - places[1][1] == pytest.approx(0.12)  # on the robot's side of the valve
    assert places[3][1] - places[2][1] == pytest.approx(0.15)
    assert [subtask.grip for subtask in RECORDED_VALVE.demonstration_script(valve)] == [0.0, 1.0, 0.0, 0.0]
