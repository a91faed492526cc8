"""The stab task is done when the stab is deep in the bore, aligned and at rest."""

from math import radians

import mujoco
import numpy as np
import pytest
from simulated_demonstration import simulate_human_demonstration

from pilotfish.environments import Outcome, Workcell
from pilotfish.environments.baxter import solve_posture
from pilotfish.environments.tasks.stab import (
    BORE,
    BOTTOM,
    LENGTH,
    MOUTH,
    RADIUS,
    SIDES,
    STAB,
    StabSituation,
    insertion_depth,
)
from pilotfish.geometry import Pose, from_rotation_vector, rotation_matrix

pytestmark = pytest.mark.usefixtures("unchecked")

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def sample_situation(seed: int) -> StabSituation:
    return STAB.sample_situation(np.random.default_rng(seed))


def tool_at(situation: StabSituation, aside: float, depth: float, tilt: float = 0.0) -> Pose:
    """Return the tool pose at a distance from the axis and a depth [m], tilted from the axis [degrees]."""
    turn = from_rotation_vector(radians(tilt) * np.array([0.0, 1.0, 0.0]))
    return situation.receptacle @ Pose(np.array([aside, 0.0, depth]), turn)


def push_in(cell: Workcell, aside: float, depth: float) -> None:
    """Push the stab in, parallel to the axis at a distance [m]."""
    for goal, ticks in ((-0.1, 1500), (-0.02, 600), (depth, 2000), (depth, 500)):
        cell.step_impedance(tool_at(cell.situation, aside, goal), 0.0, ticks)


def outcome_at(cell: Workcell, tool: Pose) -> Outcome:
    """Return the outcome with the tool at a pose."""
    cell.arm.q[:] = solve_posture(tool, LENGTH)
    mujoco.mj_forward(cell.model, cell.data)
    return cell.outcome()


@pytest.mark.parametrize("seed", range(3))
def test_demonstration_script_simulated_person_inserts_stab(seed):
    cell = simulate_human_demonstration(STAB, sample_situation(seed), np.random.default_rng(seed))
    assert cell.outcome() == Outcome(True, cell.outcome().error)
    assert cell.outcome().error < 0.001
    assert cell.peak_forces["tool"] < 60.0


def test_check_success_without_motion_fails():
    cell = Workcell(STAB, sample_situation(0))
    for _ in range(2):
        outcome = cell.outcome()
        assert not outcome.success
        assert "not in it" in outcome.reason or "deep" in outcome.reason
        assert outcome.error > 0.1
        cell.step_impedance(cell.target, 0.0, 2000)
    assert cell.peak_forces["tool"] == 0.0


@pytest.mark.parametrize("aside", [0.0, 0.008])
def test_funnel_guides_offset_stab(aside):
    cell = Workcell(STAB, sample_situation(1))
    push_in(cell, aside, 0.07)
    assert cell.outcome().success
    depth, distance, _ = insertion_depth(cell.situation.receptacle, cell.arm.tool)
    assert depth == pytest.approx(0.07, abs=0.003)
    # Corners between the walls are farther from the axis than their middles; contacts give a little.
    assert distance < BORE / np.cos(np.pi / SIDES) - RADIUS + 5e-4
    assert (cell.forces["tool"] > 1.0) == (aside > 0.0)


def test_stab_beside_funnel_stays_outside():
    cell = Workcell(STAB, sample_situation(0))
    push_in(cell, 0.026, 0.04)
    assert not cell.outcome().success
    assert insertion_depth(cell.situation.receptacle, cell.arm.tool)[0] < 0.01
    assert cell.peak_forces["tool"] > 5.0


def test_bore_has_bottom():
    cell = Workcell(STAB, sample_situation(2))
    push_in(cell, 0.0, BOTTOM + 0.02)
    assert insertion_depth(cell.situation.receptacle, cell.arm.tool)[0] == pytest.approx(BOTTOM, abs=0.002)
    assert cell.forces["tool"] > 5.0


def test_check_success_depends_on_stab_pose():
    cell = Workcell(STAB, sample_situation(3))
    situation = cell.situation
    assert outcome_at(cell, tool_at(situation, 0.0, 0.07)) == Outcome(True, 0.0)
    assert outcome_at(cell, tool_at(situation, 0.001, 0.065, 2.0)).success
    short = outcome_at(cell, tool_at(situation, 0.0, 0.04))
    assert "40 mm deep" in short.reason
    assert short.error == pytest.approx(0.02, abs=1e-4)
    assert "not in it" in outcome_at(cell, tool_at(situation, 0.02, 0.07)).reason
    assert "tilted by 6.0 degrees" in outcome_at(cell, tool_at(situation, 0.0, 0.07, 6.0)).reason
    assert outcome_at(cell, tool_at(situation, 0.0, 0.07)).success
    cell.arm.velocity[:] = 0.05
    mujoco.mj_forward(cell.model, cell.data)
    assert "still moves" in cell.outcome().reason


@pytest.mark.parametrize("seed", range(3))
def test_frames_equal_receptacle_body(seed):
    cell = Workcell(STAB, sample_situation(seed))
    receptacle = cell.frames()["receptacle"]
    np.testing.assert_allclose(receptacle.position, cell.data.body("receptacle").xpos, atol=1e-9)
    for name, radius in (("wall", (BORE, MOUTH)), ("funnel", (BORE, 0.04))):
        middles = np.array([cell.data.geom(f"{name}_{n}").xpos for n in range(SIDES)]) - receptacle.position
        local = middles @ rotation_matrix(receptacle.quaternion)
        np.testing.assert_allclose(local[:, :2].mean(0), 0.0, atol=1e-9)
        assert np.ptp(local[:, 2]) < 1e-9
        assert 0.0 < local[0, 2] < BOTTOM
        distances = np.linalg.norm(local[:, :2], axis=1)
        assert (radius[0] < distances).all()
        assert (distances < radius[1]).all()


def test_sample_situation_same_seed_is_equal():
    a, b, c = sample_situation(5), sample_situation(5), sample_situation(6)
    np.testing.assert_array_equal(a.receptacle.position, b.receptacle.position)
    np.testing.assert_array_equal(a.receptacle.quaternion, b.receptacle.quaternion)
    assert np.linalg.norm(a.receptacle.position - c.receptacle.position) > 1e-3


@pytest.mark.parametrize("seed", range(30))
def test_demonstration_script_every_goal_is_reachable(seed):
    situation = sample_situation(seed)
    frames = {"receptacle": situation.receptacle}
    for goal in (
        STAB.start_pose(situation),
        *(subtask.goal(frames) for subtask in STAB.demonstration_script(situation)),
    ):
        solve_posture(goal, LENGTH)
