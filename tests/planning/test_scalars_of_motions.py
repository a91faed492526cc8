"""Scalars of a motion: columns that switch have two values, others stay in their range."""

from dataclasses import replace

import numpy as np
import pytest
from reaches import make_reaches

from pilotfish.demonstrations import Layout, Part, Quantity, add_derivatives, demonstration, world_frame
from pilotfish.models import learn
from pilotfish.planning import reproduce, via_point

GRIPPER, GRIPPER_RATE = 3, 7


@pytest.mark.parametrize("states", [None, 7])
def test_reproduce_switch_has_two_values_and_no_derivative(states):
    """The gripper closes once, within a tenth of the time of the demonstrations."""
    skill = learn(make_reaches(0), states=states, rng=np.random.default_rng(0)).skill
    assert skill.demonstrated.switches == ("gripper",)
    for demo in make_reaches(1, count=3):
        x = reproduce(skill, demo.frames).motion.x
        assert set(x[1:, GRIPPER]) == {0.0, 1.0}
        np.testing.assert_array_equal(x[1:, GRIPPER_RATE], 0.0)
        closed = np.flatnonzero(np.diff(x[1:, GRIPPER]))
        assert len(closed) == 1
        assert (closed[0] + 2) / 60 == pytest.approx(0.8, abs=0.1)


def test_reproduce_switch_keeps_given_start():
    """The first row is the start, whatever its value; the others have the values of the states."""
    skill = learn(make_reaches(0), rng=np.random.default_rng(0)).skill
    demo = make_reaches(1, count=1)[0]
    start = demo.x[0].copy()
    start[GRIPPER] = 0.4
    x = reproduce(skill, demo.frames, start).motion.x
    np.testing.assert_array_equal(x[0], start)
    assert set(x[1:, GRIPPER]) == {0.0, 1.0}


def opening_demonstrations():
    """Return openings of a gripper from 0 to .08 m that overshoot nowhere, with rests at both ends."""
    layout, demos = Layout((Part("opening", Quantity.SCALAR, 1, "m"),)), []
    for n in range(4):
        ramp = np.clip((np.arange(60) - 18 - n) / 20.0, 0.0, 1.0)
        x = 0.08 * ramp[:, None]
        demos.append(add_derivatives(demonstration(x, 0.1, layout, (world_frame(1),), f"opening {n}")))
    return demos


def test_reproduce_scalar_stays_in_demonstrated_range():
    """Without the range, the motion overshoots both ends; a start outside the range is kept."""
    demos = opening_demonstrations()
    skill = learn(demos, states=4, rng=np.random.default_rng(0)).skill
    assert skill.demonstrated.switches == ()
    soft = {"control_cost": 0.05 * 1e3}
    free = reproduce(replace(skill, demonstrated=None), demos[0].frames, np.array([0.0, -0.05]), **soft)
    held = reproduce(skill, demos[0].frames, np.array([0.0, -0.05]), **soft)
    assert free.motion.x[:, 0].min() < 0.0
    assert held.motion.x[:, 0].min() == 0.0
    assert held.motion.x[:, 0].max() <= 0.08
    outside = reproduce(skill, demos[0].frames, np.array([-0.02, 0.0])).motion.x
    assert outside[:, 0].min() == -0.02


def test_reproduce_scalar_via_point_outside_range_is_passed():
    """A via-point is asked for explicitly, so that the range of the demonstrations does not bound it."""
    demos = opening_demonstrations()
    skill = learn(demos, states=4, rng=np.random.default_rng(0)).skill
    point = via_point("opening", 0.1, time=3.0, deviation=1e-5)
    x = reproduce(skill, demos[0].frames, via_points=[point]).motion.x
    assert x[30, 0] == pytest.approx(0.1, abs=1e-4)
