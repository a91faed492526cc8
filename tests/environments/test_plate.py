"""The glass plate: only one that was carried over the obstacle, let go and lies on the cross is done."""

from math import radians

import mujoco
import numpy as np
import pytest
from simulated_demonstration import simulate_human_demonstration

from pilotfish.environments import Outcome, Workcell
from pilotfish.environments.baxter import solve_posture
from pilotfish.environments.tasks import PLATE, Scene
from pilotfish.environments.tasks.plate import (
    BAR,
    CONTACT_LIMITS,
    LEVELS,
    PlateSituation,
    goal_pose,
    obstacle_pose,
    plate_pose,
    situation_for_level,
)
from pilotfish.geometry import Pose, from_rotation_vector, rotation_matrix

pytestmark = pytest.mark.usefixtures("unchecked")

LENGTH = 0.15  # m, of the tool
HERE = np.array([1.0, 0.0, 0.0, 0.0])
UP = np.array([0.0, 0.0, 1.0])


def drawn(seed: int) -> PlateSituation:
    return PLATE.sample_situation(np.random.default_rng(seed))


def goals(situation: PlateSituation) -> list[Pose]:
    """Where the tool is to be brought, one act after the other."""
    frames = {"plate": situation.plate, "obstacle": obstacle_pose(situation.level)}
    return [subtask.goal(frames) for subtask in PLATE.demonstration_script(situation)]


def judged(cell: Workcell, plate: Pose, forces: dict[str, float] | None = None) -> Outcome:
    """The verdict on a plate that lies there at rest, the tool far away unless the cell's is near."""
    at = int(cell.model.joint("plate").qposadr[0])
    cell.data.qpos[at : at + 7] = np.append(plate.position, plate.quaternion)
    cell.data.qvel[:] = 0.0
    mujoco.mj_forward(cell.model, cell.data)
    scene = Scene(cell.model, cell.data, cell.arm.tool, 0.0, forces or dict.fromkeys(CONTACT_LIMITS, 0.0))
    return PLATE.check_success(scene, cell.situation)


def moved(aside: float, lean: float, turn: float) -> Pose:
    """The cross's pose so far along x [m], leaning about x and turned about z [degrees]."""
    return goal_pose() @ Pose(
        np.array([aside, 0.0, 0.0]), from_rotation_vector(radians(1.0) * np.array([lean, 0.0, turn]))
    )


@pytest.mark.parametrize("level", [0, 7])
def test_a_person_carries_the_plate_over_the_obstacle(level):
    """Led by a person it ends within 1 cm of the cross, past a low or a high bar that nothing touches."""
    rng, heights = np.random.default_rng(level), []
    cell = simulate_human_demonstration(
        PLATE,
        situation_for_level(level, rng),
        rng,
        callback=lambda cell: heights.append(plate_pose(cell.data).position[2]),
    )
    assert cell.outcome() == Outcome(True, cell.outcome().error)
    assert cell.outcome().error < 0.01
    assert max(heights) > obstacle_pose(level).position[2] + BAR[2]
    assert 0.0 < cell.peak_forces["tool"] < 60.0
    assert all(cell.peak_forces[name] == 0.0 for name in CONTACT_LIMITS)


def test_nothing_is_done_by_waiting():
    """At the beginning and after two seconds of holding still the plate lies far from the cross."""
    cell = Workcell(PLATE, drawn(0))
    for _ in range(2):
        outcome = cell.outcome()
        assert not outcome.success
        assert "from the cross" in outcome.reason
        assert outcome.error > 0.3
        cell.step_impedance(cell.target, 0.0, 2000)
    assert np.linalg.norm(plate_pose(cell.data).position - cell.situation.plate.position) < 1e-3


def test_suction_holds_the_plate_and_half_a_grip_does_not():
    """What was sucked hangs at the cup, nearly level, 20 cm above the table; at a grip of .4 it drops."""
    cell = Workcell(PLATE, drawn(1))
    at_plate = goals(cell.situation)[2]
    for up, grip, ticks in ((0.04, 0.0, 1500), (0.0, 0.0, 600), (0.0, 1.0, 300), (0.2, 1.0, 1500)):
        cell.step_impedance(Pose(at_plate.position + up * UP, at_plate.quaternion), grip, ticks)
    hung = plate_pose(cell.data)
    assert hung.position[2] > cell.situation.plate.position[2] + 0.18
    assert np.linalg.norm(hung.position - cell.arm.tool.position) < 0.015
    assert rotation_matrix(hung.quaternion)[2, 2] > np.cos(radians(5.0))
    cell.step_impedance(cell.target, 0.4, 600)
    assert plate_pose(cell.data).position[2] < cell.situation.plate.position[2] + 0.05
    assert not cell.outcome().success


def test_a_hand_that_comes_down_beside_the_plate_lifts_nothing():
    """Sucking 12 cm beside it, over the bare table, leaves the plate where it lies."""
    cell = Workcell(PLATE, drawn(1))
    use_free_name = goals(cell.situation)[2].position - np.array([0.0, 0.12, -0.01])
    down = goals(cell.situation)[2].quaternion
    for up, grip, ticks in ((0.05, 0.0, 1500), (0.0, 1.0, 800), (0.1, 1.0, 800)):
        cell.step_impedance(Pose(use_free_name + up * UP, down), grip, ticks)
    assert np.linalg.norm(plate_pose(cell.data).position - cell.situation.plate.position) < 2e-3
    assert not cell.outcome().success


def test_the_verdict_is_that_of_the_plate_on_the_cross():
    """In place is done; 25 mm off, 5 degrees aslant or 12 turned is not, nor with the obstacle pushed."""
    cell = Workcell(PLATE, drawn(2))
    assert judged(cell, moved(0.0, 0.0, 0.0)).success
    assert judged(cell, moved(0.015, 0.0, -8.0)).success
    assert judged(cell, moved(0.015, 0.0, 0.0)).error == pytest.approx(0.015, abs=1e-6)
    assert "0.025 m from the cross" in judged(cell, moved(0.025, 0.0, 0.0)).reason
    assert "leans by 5.0 degrees" in judged(cell, moved(0.0, 5.0, 0.0)).reason
    assert "turned by 12.0 degrees" in judged(cell, moved(0.0, 0.0, 12.0)).reason
    for name in CONTACT_LIMITS:
        pushed = judged(cell, moved(0.0, 0.0, 0.0), dict.fromkeys(CONTACT_LIMITS, 0.0) | {name: 3.0})
        assert not pushed.success
        assert "pushed by 3.0 N" in pushed.reason


def test_a_plate_that_is_still_held_or_moves_is_not_put_down():
    """With the cup on it, or while it slides at 5 cm/s, the plate on the cross does not count."""
    cell = Workcell(PLATE, drawn(3))
    cell.arm.q[:] = solve_posture(goals(cell.situation)[-3], LENGTH)
    assert "from the plate" in judged(cell, goal_pose()).reason
    cell = Workcell(PLATE, drawn(3))
    assert judged(cell, goal_pose()).success
    cell.data.joint("plate").qvel[0] = 0.05
    scene = Scene(cell.model, cell.data, cell.arm.tool, 0.0, dict.fromkeys(CONTACT_LIMITS, 0.0))
    assert "still moves" in PLATE.check_success(scene, cell.situation).reason


@pytest.mark.parametrize("seed", range(3))
def test_what_is_seen_is_where_things_stand(seed):
    """The frames at the beginning are the plate's body and the bar's middle, as the physics has them."""
    cell = Workcell(PLATE, drawn(seed))
    frames = cell.frames()
    assert list(frames) == list(PLATE.frames)
    np.testing.assert_allclose(frames["plate"].position, plate_pose(cell.data).position, atol=1e-9)
    np.testing.assert_allclose(frames["plate"].quaternion, plate_pose(cell.data).quaternion, atol=1e-9)
    np.testing.assert_allclose(frames["obstacle"].position, cell.data.geom("obstacle").xpos, atol=1e-9)
    np.testing.assert_array_equal(frames["obstacle"].quaternion, HERE)


def test_situations_come_again_with_their_seed_and_levels_are_those_asked_for():
    """One seed gives one situation, another another; all 8 levels are drawn, each higher than the last."""
    a, b, c = drawn(5), drawn(5), drawn(6)
    np.testing.assert_array_equal(a.plate.position, b.plate.position)
    np.testing.assert_array_equal(a.plate.quaternion, b.plate.quaternion)
    assert np.linalg.norm(a.plate.position - c.plate.position) > 1e-3
    assert {drawn(seed).level for seed in range(60)} == set(range(LEVELS))
    for level in range(LEVELS):
        assert situation_for_level(level, np.random.default_rng(0)).level == level
    assert (np.diff([obstacle_pose(level).position[2] for level in range(LEVELS)]) > 0.01).all()


@pytest.mark.parametrize("level", range(LEVELS))
def test_every_goal_is_within_reach(level):
    """The arm has a posture for every goal of the script, wherever the plate lies and at each height."""
    for seed in range(6):
        situation = situation_for_level(level, np.random.default_rng(seed))
        for goal in (PLATE.start_pose(situation), *goals(situation)):
            solve_posture(goal, LENGTH)
