"""The carabiner task is done when the rod passes the ring and the gate is closed."""

from math import radians

import mujoco
import numpy as np
import pytest
from simulated_demonstration import simulate_human_demonstration

from pilotfish.environments import Outcome, Workcell
from pilotfish.environments.baxter import solve_posture
from pilotfish.environments.tasks.carabiner import (
    CARABINER,
    GATE_LINE,
    HALF,
    RING,
    SEAT,
    CarabinerSituation,
    point_inside_ring,
    rod_in_ring_plane,
    tool_above_rod,
)
from pilotfish.geometry import Pose, normalise

pytestmark = pytest.mark.usefixtures("unchecked")

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
OUTSIDE = GATE_LINE - SEAT + 0.03  # m above the goal: the gate is clear of the rod


def sample_situation(seed: int) -> CarabinerSituation:
    return CARABINER.sample_situation(np.random.default_rng(seed))


def outcome_at(cell: Workcell, tool: Pose, gate: float = 0.0) -> Outcome:
    """Return the outcome with the tool at a pose and the gate open by an angle [rad]."""
    cell.arm.q[:] = solve_posture(tool, SEAT)
    cell.data.joint("right_gate").qpos[0] = gate
    mujoco.mj_forward(cell.model, cell.data)
    return cell.outcome()


def push_down(cell: Workcell, place: float, aside: float, down_to: float) -> None:
    """Push the carabiner down to a height above the goal [m], at a position along and beside the rod [m]."""
    offset = Pose(np.array([0.0, aside, 0.0]), IDENTITY)
    for above, ticks in ((OUTSIDE, 1800), (down_to, 2000), (down_to, 500)):
        goal = tool_above_rod(cell.frames(), place, above)
        shifted = Pose(
            goal.position + (cell.frames()["rod"] @ offset).position - cell.frames()["rod"].position,
            goal.quaternion,
        )
        cell.step_impedance(shifted, 0.0, ticks)


@pytest.mark.parametrize("seed", range(3))
def test_demonstration_script_simulated_person_hooks_carabiner(seed):
    cell = simulate_human_demonstration(CARABINER, sample_situation(seed), np.random.default_rng(seed))
    assert cell.outcome() == Outcome(True, cell.outcome().error)
    place = (cell.frames()["rod"].inverse() @ cell.arm.tool).position[0]
    assert place == pytest.approx(cell.situation.hook_position, abs=0.015)
    assert 0.0 < cell.peak_forces["tool"] < 30.0


def test_check_success_without_motion_fails():
    cell = Workcell(CARABINER, sample_situation(0))
    for _ in range(2):
        outcome = cell.outcome()
        assert not outcome.success
        assert "not in the carabiner" in outcome.reason
        assert outcome.error > 0.05
        cell.step_impedance(cell.target, 0.0, 2000)
    assert cell.peak_forces["tool"] == 0.0


def test_check_success_after_hooking_stays_done():
    cell = Workcell(CARABINER, sample_situation(1))
    push_down(cell, 0.05, 0.0, 0.0)
    assert cell.outcome().success
    for _ in range(2):
        cell.step_impedance(tool_above_rod(cell.frames(), 0.05, 0.1), 0.0, 1500)
    assert cell.outcome().success
    assert cell.forces["tool"] > 15.0


def test_check_success_half_push_reports_open_gate():
    cell = Workcell(CARABINER, sample_situation(1))
    push_down(cell, -0.03, 0.0, 0.025)
    assert "the gate is open" in cell.outcome().reason


@pytest.mark.parametrize("aside", [-0.06, 0.06])
def test_check_success_push_beside_rod_fails(aside):
    cell = Workcell(CARABINER, sample_situation(2))
    push_down(cell, 0.0, aside, 0.0)
    assert "not in the carabiner" in cell.outcome().reason


@pytest.mark.parametrize("seed", range(3))
def test_check_success_every_position_along_rod_is_done(seed):
    cell = Workcell(CARABINER, sample_situation(seed))
    for place in (-0.1, 0.0, 0.04, 0.1):
        outcome = outcome_at(cell, tool_above_rod(cell.frames(), place, 0.0))
        assert outcome.success
        assert outcome.error < 1e-3
    beyond = outcome_at(cell, tool_above_rod(cell.frames(), HALF + 0.01, 0.0))
    assert not beyond.success
    assert beyond.error == pytest.approx(0.01, abs=1e-3)


def test_check_success_open_gate_fails():
    cell = Workcell(CARABINER, sample_situation(0))
    goal = tool_above_rod(cell.frames(), 0.0, 0.0)
    assert outcome_at(cell, goal, radians(4.5)).success
    assert "open by 6 degrees" in outcome_at(cell, goal, radians(6.0)).reason


def test_point_inside_ring_equals_polygon_test(rng):
    corners = RING - np.array([0.0, SEAT])
    for weights in rng.dirichlet(np.ones(len(corners)), 50):
        assert point_inside_ring(*map(float, weights @ corners))
    middle = corners.mean(axis=0)
    for corner in corners:
        assert not point_inside_ring(*map(float, corner + 0.01 * (corner - middle)))
    assert not point_inside_ring(np.nan, np.nan)


def test_rod_in_ring_plane_equals_bisection(rng):
    for _ in range(8):
        rod = Pose(rng.uniform(-0.1, 0.1, 3), normalise(rng.normal(size=4)))
        tool = Pose(rng.uniform(-0.1, 0.1, 3), normalise(rng.normal(size=4)))
        found, (low, high) = rod_in_ring_plane(rod, tool), (-HALF, HALF)
        if rod_point_from_tool(tool, rod, low)[1] * rod_point_from_tool(tool, rod, high)[1] > 0.0:
            assert np.isnan(found).all()
            continue
        while high - low > 1e-9:
            middle = 0.5 * (low + high)
            same = rod_point_from_tool(tool, rod, low)[1] * rod_point_from_tool(tool, rod, middle)[1] > 0.0
            low, high = (middle, high) if same else (low, middle)
        assert np.allclose(found, rod_point_from_tool(tool, rod, low), atol=1e-8)


def rod_point_from_tool(tool: Pose, rod: Pose, along: float) -> np.ndarray:
    """Return a point along the rod axis in tool axes."""
    return (tool.inverse() @ rod @ Pose(np.array([along, 0.0, 0.0]), IDENTITY)).position


def test_rod_in_ring_plane_parallel_rod_is_nan():
    along_x = Pose(np.array([0.0, 0.01, 0.0]), IDENTITY)
    assert np.isnan(rod_in_ring_plane(along_x, Pose(np.zeros(3), IDENTITY))).all()


@pytest.mark.parametrize("seed", range(3))
def test_frames_equal_rail_body(seed):
    cell = Workcell(CARABINER, sample_situation(seed))
    rod, shape = cell.frames()["rod"], cell.data.geom("rod")
    assert np.allclose(shape.xpos, rod.position, atol=1e-12)
    ahead = (rod @ Pose(np.array([1.0, 0.0, 0.0]), IDENTITY)).position - rod.position
    assert abs(shape.xmat.reshape(3, 3)[:, 2] @ ahead) == pytest.approx(1.0, abs=1e-9)
    assert np.allclose(cell.situation.rod.position, rod.position, atol=1e-12)


@pytest.mark.parametrize("seed", range(12))
def test_demonstration_script_every_goal_is_reachable(seed):
    situation = sample_situation(seed)
    for place in (-0.08, 0.08):
        for above in (0.0, OUTSIDE + 0.03):
            solve_posture(tool_above_rod({"rod": situation.rod}, place, above), SEAT)


def test_sample_situation_same_seed_is_equal():
    a, b, c = sample_situation(5), sample_situation(5), sample_situation(6)
    for first, same, different in (
        (a.rod.position, b.rod.position, c.rod.position),
        ([a.hook_position], [b.hook_position], [c.hook_position]),
    ):
        assert np.array_equal(first, same)
        assert not np.isclose(first, different).any()
    assert np.array_equal(a.rod.quaternion, b.rod.quaternion)
