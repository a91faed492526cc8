"""The hot-stab: only a stab that is deep in the bore, along its axis and at rest is done."""

from math import radians

import mujoco
import numpy as np
import pytest
from simulated_demonstration import simulate_human_demonstration

from pilotfish.environments import Outcome, Workcell
from pilotfish.environments.baxter import solve_posture
from pilotfish.environments.tasks import STAB
from pilotfish.environments.tasks.stab import (
    BORE,
    BOTTOM,
    LENGTH,
    MOUTH,
    RADIUS,
    SIDES,
    StabSituation,
    insertion_depth,
)
from pilotfish.geometry import Pose, from_rotation_vector, rotation_matrix

pytestmark = pytest.mark.usefixtures("unchecked")

HERE = np.array([1.0, 0.0, 0.0, 0.0])


def drawn(seed: int) -> StabSituation:
    return STAB.sample_situation(np.random.default_rng(seed))


def at(situation: StabSituation, aside: float, depth: float, lean: float = 0.0) -> Pose:
    """The tool so deep beyond the mouth and so far from the axis [m], leaning [degrees] away from it."""
    turn = from_rotation_vector(radians(lean) * np.array([0.0, 1.0, 0.0]))
    return situation.receptacle @ Pose(np.array([aside, 0.0, depth]), turn)


def pushed_in(cell: Workcell, aside: float, depth: float) -> None:
    """The workcell when the arm was drawn straight in, aside of the axis all the way."""
    for goal, ticks in ((-0.1, 1500), (-0.02, 600), (depth, 2000), (depth, 500)):
        cell.step_impedance(at(cell.situation, aside, goal), 0.0, ticks)


def stand(cell: Workcell, tool: Pose) -> Outcome:
    """The verdict on an arm that holds the tool there."""
    cell.arm.q[:] = solve_posture(tool, LENGTH)
    mujoco.mj_forward(cell.model, cell.data)
    return cell.outcome()


@pytest.mark.parametrize("seed", range(3))
def test_a_person_puts_the_stab_in(seed):
    """Led by a person the stab ends in the bore, and nothing is pushed by 60 N."""
    cell = simulate_human_demonstration(STAB, drawn(seed), np.random.default_rng(seed))
    assert cell.outcome() == Outcome(True, cell.outcome().error)
    assert cell.outcome().error < 0.001
    assert cell.peak_forces["tool"] < 60.0


def test_nothing_is_done_by_waiting():
    """At the beginning and after two seconds of holding still the stab is outside, and the verdict tells."""
    cell = Workcell(STAB, drawn(0))
    for _ in range(2):
        outcome = cell.outcome()
        assert not outcome.success
        assert "not in it" in outcome.reason or "deep" in outcome.reason
        assert outcome.error > 0.1
        cell.step_impedance(cell.target, 0.0, 2000)
    assert cell.peak_forces["tool"] == 0.0


@pytest.mark.parametrize("aside", [0.0, 0.008])
def test_the_funnel_leads_a_stab_in_that_is_a_little_aside(aside):
    """Asked 8 mm beside the axis it goes in all the same, pressed by the bore's wall to within its play."""
    cell = Workcell(STAB, drawn(1))
    pushed_in(cell, aside, 0.07)
    assert cell.outcome().success
    depth, use_free_name, _ = insertion_depth(cell.situation.receptacle, cell.arm.tool)
    assert depth == pytest.approx(0.07, abs=0.003)
    # Corners between the walls are farther from the axis than their middles; contacts give a little.
    assert use_free_name < BORE / np.cos(np.pi / SIDES) - RADIUS + 5e-4
    assert (cell.forces["tool"] > 1.0) == (aside > 0.0)


def test_a_stab_beside_the_funnel_stays_outside():
    """Pushed 26 mm aside it meets the rim and does not go in."""
    cell = Workcell(STAB, drawn(0))
    pushed_in(cell, 0.026, 0.04)
    assert not cell.outcome().success
    assert insertion_depth(cell.situation.receptacle, cell.arm.tool)[0] < 0.01
    assert cell.peak_forces["tool"] > 5.0


def test_the_bore_has_a_bottom():
    """Asked 20 mm beyond it the stab stops there, and pushes."""
    cell = Workcell(STAB, drawn(2))
    pushed_in(cell, 0.0, BOTTOM + 0.02)
    assert insertion_depth(cell.situation.receptacle, cell.arm.tool)[0] == pytest.approx(BOTTOM, abs=0.002)
    assert cell.forces["tool"] > 5.0


def test_the_verdict_is_that_of_the_stab_in_the_bore():
    """In place is done; 20 mm short, beside the bore, or 6 degrees aslant is not, each for its reason."""
    cell = Workcell(STAB, drawn(3))
    situation = cell.situation
    assert stand(cell, at(situation, 0.0, 0.07)) == Outcome(True, 0.0)
    assert stand(cell, at(situation, 0.001, 0.065, 2.0)).success
    short = stand(cell, at(situation, 0.0, 0.04))
    assert "40 mm deep" in short.reason
    assert short.error == pytest.approx(0.02, abs=1e-4)
    assert "not in it" in stand(cell, at(situation, 0.02, 0.07)).reason
    assert "leans 6.0 degrees" in stand(cell, at(situation, 0.0, 0.07, 6.0)).reason
    assert stand(cell, at(situation, 0.0, 0.07)).success
    cell.arm.velocity[:] = 0.05
    mujoco.mj_forward(cell.model, cell.data)
    assert "still moves" in cell.outcome().reason


@pytest.mark.parametrize("seed", range(3))
def test_what_is_seen_is_where_the_bore_is(seed):
    """The frame is the receptacle's body: its z axis is the line that the middles of all walls surround."""
    cell = Workcell(STAB, drawn(seed))
    seen = cell.frames()["receptacle"]
    np.testing.assert_allclose(seen.position, cell.data.body("receptacle").xpos, atol=1e-9)
    for name, radius in (("wall", (BORE, MOUTH)), ("funnel", (BORE, 0.04))):
        middles = np.array([cell.data.geom(f"{name}_{n}").xpos for n in range(SIDES)]) - seen.position
        local = middles @ rotation_matrix(seen.quaternion)
        np.testing.assert_allclose(local[:, :2].mean(0), 0.0, atol=1e-9)
        assert np.ptp(local[:, 2]) < 1e-9
        assert 0.0 < local[0, 2] < BOTTOM
        distances = np.linalg.norm(local[:, :2], axis=1)
        assert (radius[0] < distances).all()
        assert (distances < radius[1]).all()


def test_situations_come_again_with_their_seed():
    """One seed gives one situation, another seed another."""
    a, b, c = drawn(5), drawn(5), drawn(6)
    np.testing.assert_array_equal(a.receptacle.position, b.receptacle.position)
    np.testing.assert_array_equal(a.receptacle.quaternion, b.receptacle.quaternion)
    assert np.linalg.norm(a.receptacle.position - c.receptacle.position) > 1e-3


@pytest.mark.parametrize("seed", range(30))
def test_every_goal_is_within_reach(seed):
    """The arm has a posture for every goal of the script, wherever the receptacle is."""
    situation = drawn(seed)
    frames = {"receptacle": situation.receptacle}
    for goal in (
        STAB.start_pose(situation),
        *(subtask.goal(frames) for subtask in STAB.demonstration_script(situation)),
    ):
        solve_posture(goal, LENGTH)
