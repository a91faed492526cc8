"""A controlled stop decelerates at most at its limit, ends at rest, and stops where predicted."""

import numpy as np
import pytest

from pilotfish.teleop.controlled_stop import Braking, TargetMotion, brake, stopping_point

DT = 0.005


def moving(rng: np.random.Generator, scalars: int) -> TargetMotion:
    q = rng.normal(size=4)
    pose = np.concatenate([rng.normal(size=3), q / np.linalg.norm(q), rng.uniform(size=scalars)])
    return TargetMotion(
        pose, np.concatenate([0.2 * rng.normal(size=3), rng.normal(size=3), np.zeros(scalars)])
    )


@pytest.mark.parametrize("scalars", [0, 1])
def test_brake_deceleration_is_the_limit_and_scalars_hold(rng, scalars):
    motion, braking = moving(rng, scalars), Braking(2.0, 8.0)
    grip, speed = motion.pose[7:].copy(), np.linalg.norm(motion.velocity[:3])
    steps = 0
    while motion.velocity.any():
        after = brake(motion, braking, DT)
        change = np.linalg.norm(after.velocity[:3] - motion.velocity[:3]) / DT
        assert change <= 2.0 + 1e-9
        assert np.linalg.norm(after.velocity[3:6] - motion.velocity[3:6]) / DT <= 8.0 + 1e-9
        np.testing.assert_allclose(after.pose[:3] - motion.pose[:3], DT * after.velocity[:3], atol=1e-12)
        assert abs(np.linalg.norm(after.pose[3:7]) - 1.0) < 1e-12
        motion = after
        steps += 1
    assert steps * DT <= max(speed / 2.0, 1.0) + 1.0
    assert not motion.velocity.any()
    np.testing.assert_array_equal(motion.pose[7:], grip)


def test_stopping_point_equals_end_of_a_stop_in_small_steps(rng):
    motion, braking = moving(rng, 0), Braking(2.0, 8.0)
    expected = stopping_point(motion, braking)
    for _ in range(40_000):
        motion = brake(motion, braking, 1e-4)
    np.testing.assert_allclose(motion.pose[:3], expected, atol=1e-4)
