"""The carabiner: it is hooked when the rod passes its ring and the gate is shut, anywhere along the rod."""

from math import radians

import mujoco
import numpy as np
import pytest
from simulated_demonstration import simulate_human_demonstration

from pilotfish.environments import Outcome, Workcell
from pilotfish.environments.baxter import solve_posture
from pilotfish.environments.tasks import CARABINER
from pilotfish.environments.tasks.carabiner import (
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

HERE = np.array([1.0, 0.0, 0.0, 0.0])
OUTSIDE = GATE_LINE - SEAT + 0.03  # m above its place: the gate is clear of the rod


def drawn(seed: int) -> CarabinerSituation:
    return CARABINER.sample_situation(np.random.default_rng(seed))


def stand(cell: Workcell, tool: Pose, gate: float = 0.0) -> Outcome:
    """The verdict on an arm that holds the tool there, the gate open by so much [rad]."""
    cell.arm.q[:] = solve_posture(tool, SEAT)
    cell.data.joint("right_gate").qpos[0] = gate
    mujoco.mj_forward(cell.model, cell.data)
    return cell.outcome()


def pushed(cell: Workcell, place: float, aside: float, down_to: float) -> None:
    """The arm draws the tool over the rod, and down so far [m] above where the rod is to be inside."""
    use_free_name = Pose(np.array([0.0, aside, 0.0]), HERE)
    for above, ticks in ((OUTSIDE, 1800), (down_to, 2000), (down_to, 500)):
        goal = tool_above_rod(cell.frames(), place, above)
        shifted = Pose(
            goal.position + (cell.frames()["rod"] @ use_free_name).position - cell.frames()["rod"].position,
            goal.quaternion,
        )
        cell.step_impedance(shifted, 0.0, ticks)


@pytest.mark.parametrize("seed", range(3))
def test_a_person_hooks_the_carabiner(seed):
    """Led by a person the rod ends inside, near the place chosen along it, and nothing is pushed by 30 N."""
    cell = simulate_human_demonstration(CARABINER, drawn(seed), np.random.default_rng(seed))
    assert cell.outcome() == Outcome(True, cell.outcome().error)
    place = (cell.frames()["rod"].inverse() @ cell.arm.tool).position[0]
    assert place == pytest.approx(cell.situation.place, abs=0.015)
    assert 0.0 < cell.peak_forces["tool"] < 30.0


def test_nothing_is_done_by_waiting():
    """At the beginning and after two seconds of holding still the rod is outside, and the verdict says so."""
    cell = Workcell(CARABINER, drawn(0))
    for _ in range(2):
        outcome = cell.outcome()
        assert not outcome.success
        assert "not in the carabiner" in outcome.reason
        assert outcome.error > 0.05
        cell.step_impedance(cell.target, 0.0, 2000)
    assert cell.peak_forces["tool"] == 0.0


def test_what_is_hooked_stays_hooked():
    """The gate lets the rod in and not out: a tool that is asked 10 cm up hangs on the rod by over 15 N."""
    cell = Workcell(CARABINER, drawn(1))
    pushed(cell, 0.05, 0.0, 0.0)
    assert cell.outcome().success
    for _ in range(2):
        cell.step_impedance(tool_above_rod(cell.frames(), 0.05, 0.1), 0.0, 1500)
    assert cell.outcome().success
    assert cell.forces["tool"] > 15.0


def test_half_a_push_leaves_the_gate_open():
    """Where the rod has not yet passed the gate it holds it open, though its axis is inside."""
    cell = Workcell(CARABINER, drawn(1))
    pushed(cell, -0.03, 0.0, 0.025)
    assert "the gate stands open" in cell.outcome().reason


@pytest.mark.parametrize("aside", [-0.06, 0.06])
def test_a_push_beside_the_rod_hooks_nothing(aside):
    """Six centimetres aside the ring goes down before or behind the rod, and the rod is not inside."""
    cell = Workcell(CARABINER, drawn(2))
    pushed(cell, 0.0, aside, 0.0)
    assert "not in the carabiner" in cell.outcome().reason


@pytest.mark.parametrize("seed", range(3))
def test_it_may_hang_anywhere_along_the_rod(seed):
    """In place it is done at every place between the posts, with no error; beyond an end it is not."""
    cell = Workcell(CARABINER, drawn(seed))
    for place in (-0.1, 0.0, 0.04, 0.1):
        outcome = stand(cell, tool_above_rod(cell.frames(), place, 0.0))
        assert outcome.success
        assert outcome.error < 1e-3
    beyond = stand(cell, tool_above_rod(cell.frames(), HALF + 0.01, 0.0))
    assert not beyond.success
    assert beyond.error == pytest.approx(0.01, abs=1e-3)


def test_an_open_gate_is_not_done():
    """With the rod in its place the verdict is that of the gate: shut to 5 degrees or not."""
    cell = Workcell(CARABINER, drawn(0))
    goal = tool_above_rod(cell.frames(), 0.0, 0.0)
    assert stand(cell, goal, radians(4.5)).success
    assert "open by 6 degrees" in stand(cell, goal, radians(6.0)).reason


def test_inside_is_what_lies_between_the_corners_of_the_ring(rng):
    """Weighted means of all corners are inside; a corner moved away from their middle is not."""
    corners = RING - np.array([0.0, SEAT])
    for weights in rng.dirichlet(np.ones(len(corners)), 50):
        assert point_inside_ring(*map(float, weights @ corners))
    middle = corners.mean(axis=0)
    for corner in corners:
        assert not point_inside_ring(*map(float, corner + 0.01 * (corner - middle)))
    assert not point_inside_ring(np.nan, np.nan)


def test_a_crossing_is_found_by_bisection_along_the_rod(rng):
    """Where the rod's ends lie on either side of the plane bisection finds the same point; else none is."""
    for _ in range(8):
        rod = Pose(rng.uniform(-0.1, 0.1, 3), normalise(rng.normal(size=4)))
        tool = Pose(rng.uniform(-0.1, 0.1, 3), normalise(rng.normal(size=4)))
        found, (low, high) = rod_in_ring_plane(rod, tool), (-HALF, HALF)
        if seen_from(tool, rod, low)[1] * seen_from(tool, rod, high)[1] > 0.0:
            assert np.isnan(found).all()
            continue
        while high - low > 1e-9:
            middle = 0.5 * (low + high)
            same = seen_from(tool, rod, low)[1] * seen_from(tool, rod, middle)[1] > 0.0
            low, high = (middle, high) if same else (low, middle)
        assert np.allclose(found, seen_from(tool, rod, low), atol=1e-8)


def seen_from(tool: Pose, rod: Pose, along: float) -> np.ndarray:
    """A point of the rod's axis, so far along it, in the axes of the tool."""
    return (tool.inverse() @ rod @ Pose(np.array([along, 0.0, 0.0]), HERE)).position


def test_a_rod_along_the_ring_does_not_pass_it():
    """A rod that lies in a plane beside the ring's crosses nowhere."""
    along_x = Pose(np.array([0.0, 0.01, 0.0]), HERE)
    assert np.isnan(rod_in_ring_plane(along_x, Pose(np.zeros(3), HERE))).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_frame_is_where_the_rod_is(seed):
    """The rod's shape in the physics lies along x of the frame, in its middle; the posts end below it."""
    cell = Workcell(CARABINER, drawn(seed))
    rod, shape = cell.frames()["rod"], cell.data.geom("rod")
    assert np.allclose(shape.xpos, rod.position, atol=1e-12)
    ahead = (rod @ Pose(np.array([1.0, 0.0, 0.0]), HERE)).position - rod.position
    assert abs(shape.xmat.reshape(3, 3)[:, 2] @ ahead) == pytest.approx(1.0, abs=1e-9)
    assert np.allclose(cell.situation.rod.position, rod.position, atol=1e-12)


@pytest.mark.parametrize("seed", range(12))
def test_the_arm_reaches_every_place_along_the_rod(seed):
    """There are postures for the tool above the rod and in its place, at both ends of what may be chosen."""
    situation = drawn(seed)
    for place in (-0.08, 0.08):
        for above in (0.0, OUTSIDE + 0.03):
            solve_posture(tool_above_rod({"rod": situation.rod}, place, above), SEAT)


def test_one_seed_is_one_situation():
    """The same seed draws the same rod and place, another seed others."""
    a, b, c = drawn(5), drawn(5), drawn(6)
    for one, same, other in (
        (a.rod.position, b.rod.position, c.rod.position),
        ([a.place], [b.place], [c.place]),
    ):
        assert np.array_equal(one, same)
        assert not np.isclose(one, other).any()
    assert np.array_equal(a.rod.quaternion, b.rod.quaternion)
