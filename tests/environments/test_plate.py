"""The plate task is done when the plate was carried over the obstacle and released on the cross."""

from math import radians

import mujoco
import numpy as np
import pytest
from simulated_demonstration import simulate_human_demonstration

from pilotfish.environments import Outcome, Scene, Workcell
from pilotfish.environments.baxter import solve_posture
from pilotfish.environments.tasks.plate import (
    BAR,
    FRAGILE_GEOMS,
    LEVELS,
    PLATE,
    PlateSituation,
    goal_pose,
    obstacle_pose,
    plate_pose,
    situation_for_level,
)
from pilotfish.geometry import Pose, from_rotation_vector, rotation_matrix

pytestmark = pytest.mark.usefixtures("unchecked")

LENGTH = 0.15  # m, of the tool
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
UP = np.array([0.0, 0.0, 1.0])


def sample_situation(seed: int) -> PlateSituation:
    return PLATE.sample_situation(np.random.default_rng(seed))


def goals(situation: PlateSituation) -> list[Pose]:
    """Return the tool goals of the demonstration script."""
    frames = {"plate": situation.plate, "obstacle": obstacle_pose(situation.level)}
    return [subtask.goal(frames) for subtask in PLATE.demonstration_script(situation)]


def outcome_with(cell: Workcell, plate: Pose, forces: dict[str, float] | None = None) -> Outcome:
    """Return the outcome with the plate at rest at a pose."""
    at = int(cell.model.joint("plate").qposadr[0])
    cell.data.qpos[at : at + 7] = np.append(plate.position, plate.quaternion)
    cell.data.qvel[:] = 0.0
    mujoco.mj_forward(cell.model, cell.data)
    scene = Scene(cell.model, cell.data, cell.arm.tool, 0.0, forces or dict.fromkeys(FRAGILE_GEOMS, 0.0))
    return PLATE.check_success(scene, cell.situation)


def displaced_goal(aside: float, lean: float, turn: float) -> Pose:
    """Return the goal displaced along x [m], tilted about x and rotated about z [degrees]."""
    return goal_pose() @ Pose(
        np.array([aside, 0.0, 0.0]), from_rotation_vector(radians(1.0) * np.array([lean, 0.0, turn]))
    )


@pytest.mark.parametrize(
    "level",
    [
        pytest.param(0, marks=pytest.mark.slow(reason="a demonstration in physics takes five CPU seconds")),
        7,
    ],
)
def test_demonstration_script_simulated_person_carries_plate(level):
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
    assert all(cell.peak_forces[name] == 0.0 for name in FRAGILE_GEOMS)


def test_check_success_without_motion_fails():
    cell = Workcell(PLATE, sample_situation(0))
    for _ in range(2):
        outcome = cell.outcome()
        assert not outcome.success
        assert "from the cross" in outcome.reason
        assert outcome.error > 0.3
        cell.step_impedance(cell.target, 0.0, 2000)
    assert np.linalg.norm(plate_pose(cell.data).position - cell.situation.plate.position) < 1e-3


def test_suction_full_grip_holds_plate():
    cell = Workcell(PLATE, sample_situation(1))
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


def test_suction_beside_plate_lifts_nothing():
    cell = Workcell(PLATE, sample_situation(1))
    beside = goals(cell.situation)[2].position - np.array([0.0, 0.12, -0.01])
    down = goals(cell.situation)[2].quaternion
    for up, grip, ticks in ((0.05, 0.0, 1500), (0.0, 1.0, 800), (0.1, 1.0, 800)):
        cell.step_impedance(Pose(beside + up * UP, down), grip, ticks)
    assert np.linalg.norm(plate_pose(cell.data).position - cell.situation.plate.position) < 2e-3
    assert not cell.outcome().success


def test_check_success_depends_on_plate_pose():
    cell = Workcell(PLATE, sample_situation(2))
    assert outcome_with(cell, displaced_goal(0.0, 0.0, 0.0)).success
    assert outcome_with(cell, displaced_goal(0.015, 0.0, -8.0)).success
    assert outcome_with(cell, displaced_goal(0.015, 0.0, 0.0)).error == pytest.approx(0.015, abs=1e-6)
    assert "0.025 m from the cross" in outcome_with(cell, displaced_goal(0.025, 0.0, 0.0)).reason
    assert "tilted by 5.0 degrees" in outcome_with(cell, displaced_goal(0.0, 5.0, 0.0)).reason
    assert "rotated by 12.0 degrees" in outcome_with(cell, displaced_goal(0.0, 0.0, 12.0)).reason
    for name in FRAGILE_GEOMS:
        pushed = outcome_with(
            cell, displaced_goal(0.0, 0.0, 0.0), dict.fromkeys(FRAGILE_GEOMS, 0.0) | {name: 3.0}
        )
        assert not pushed.success
        assert "pushed by 3.0 N" in pushed.reason


def test_check_success_held_or_moving_plate_fails():
    cell = Workcell(PLATE, sample_situation(3))
    cell.arm.q[:] = solve_posture(goals(cell.situation)[-3], LENGTH)
    assert "from the plate" in outcome_with(cell, goal_pose()).reason
    cell = Workcell(PLATE, sample_situation(3))
    assert outcome_with(cell, goal_pose()).success
    cell.data.joint("plate").qvel[0] = 0.05
    scene = Scene(cell.model, cell.data, cell.arm.tool, 0.0, dict.fromkeys(FRAGILE_GEOMS, 0.0))
    assert "still moves" in PLATE.check_success(scene, cell.situation).reason


@pytest.mark.parametrize("seed", range(3))
def test_frames_equal_objects(seed):
    cell = Workcell(PLATE, sample_situation(seed))
    frames = cell.frames()
    assert list(frames) == list(PLATE.frames)
    np.testing.assert_allclose(frames["plate"].position, plate_pose(cell.data).position, atol=1e-9)
    np.testing.assert_allclose(frames["plate"].quaternion, plate_pose(cell.data).quaternion, atol=1e-9)
    np.testing.assert_allclose(frames["obstacle"].position, cell.data.geom("obstacle").xpos, atol=1e-9)
    np.testing.assert_array_equal(frames["obstacle"].quaternion, IDENTITY)


def test_sample_situation_same_seed_is_equal():
    a, b, c = sample_situation(5), sample_situation(5), sample_situation(6)
    np.testing.assert_array_equal(a.plate.position, b.plate.position)
    np.testing.assert_array_equal(a.plate.quaternion, b.plate.quaternion)
    assert np.linalg.norm(a.plate.position - c.plate.position) > 1e-3
    assert {sample_situation(seed).level for seed in range(60)} == set(range(LEVELS))
    for level in range(LEVELS):
        assert situation_for_level(level, np.random.default_rng(0)).level == level
    assert (np.diff([obstacle_pose(level).position[2] for level in range(LEVELS)]) > 0.01).all()


@pytest.mark.parametrize("level", range(LEVELS))
def test_demonstration_script_every_goal_is_reachable(level):
    for seed in range(6):
        situation = situation_for_level(level, np.random.default_rng(seed))
        for goal in (PLATE.start_pose(situation), *goals(situation)):
            solve_posture(goal, LENGTH)
