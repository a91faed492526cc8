"""Workspace, speed and acceleration of the target, and the blend after a change."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest

from pilotfish.assistance.limits import Limits
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle, from_rotation_vector, log_map
from pilotfish.kernels import AssistanceSettings
from pilotfish.kernels.reference import target_motion
from pilotfish.kernels.reference.target_motion import blend, blend_duration

STARTS, DT = (3,), 0.01


def random_pose(rng, spread=0.3) -> np.ndarray:
    return np.concatenate([spread * rng.normal(size=3), from_rotation_vector(rng.normal(size=3)), [0.0]])


class TargetMotion(NamedTuple):
    """Target of the robot, its velocity and the desired pose."""

    pose: np.ndarray
    velocity: np.ndarray
    desired: np.ndarray


def at_rest(pose: np.ndarray) -> TargetMotion:
    return TargetMotion(pose, np.zeros(7), pose)


def follow_desired(limits, motion, desired, dt) -> TargetMotion:
    """Return the motion of the reference, which the compiled kernel equals."""
    numbers = (limits.speed, limits.acceleration, limits.angular_speed, limits.angular_acceleration)
    settings = AssistanceSettings(np.ones(7), limits.lower, limits.upper, 1.0, 3.0, *numbers, 0.1)
    return TargetMotion(*target_motion.follow_desired(settings, tuple(motion), desired, dt))


def follow(limits, motion, desired, steps):
    motions = [motion]
    for t in range(steps):
        pose = desired(t) if callable(desired) else desired
        motions.append(follow_desired(limits, motions[-1], pose, DT))
    return motions


def test_speed_and_acceleration_are_within_limits_for_jumps(rng):
    limits = Limits()
    jumps = [random_pose(rng, 0.3) for _ in range(10)]
    motions = follow(limits, at_rest(random_pose(rng)), lambda t: jumps[t // 20], 200)
    v = np.array([m.velocity for m in motions])
    positions = np.array([m.pose[:3] for m in motions])
    assert np.linalg.norm(v[:, :3], axis=1).max() <= limits.speed + 1e-9
    assert np.linalg.norm(np.diff(positions, axis=0), axis=1).max() <= limits.speed * DT + 1e-9
    assert np.linalg.norm(np.diff(v[:, :3], axis=0), axis=1).max() <= limits.acceleration * DT + 1e-9
    assert np.linalg.norm(v[:, 3:6], axis=1).max() <= limits.angular_speed + 1e-9
    assert np.linalg.norm(np.diff(v[:, 3:6], axis=0), axis=1).max() <= limits.angular_acceleration * DT + 1e-9


def test_box_speed_and_acceleration_hold_together_for_random_desired_poses(rng, unchecked):
    """Desired poses jump in and out of a box of 40 cm, or move evenly; steps are from 1 ms to .1 s."""
    limits = Limits(lower=np.full(3, -0.2), upper=np.full(3, 0.2))
    motion, desired = at_rest(random_pose(rng, 0.05)), random_pose(rng)
    drift, at_wall = np.zeros(3), 0
    for _ in range(800):
        if rng.random() < 0.05:
            desired, drift = random_pose(rng, 0.4), rng.normal(size=3) * (rng.random() < 0.5)
        dt = 10.0 ** rng.uniform(-3.0, -1.0)
        desired[:3] += drift * dt
        before, motion = motion, follow_desired(limits, motion, desired, dt)
        v, change = motion.velocity, motion.velocity - before.velocity
        step = log_map(before.pose, motion.pose, STARTS)
        assert np.allclose(step[:6], v[:6] * dt, atol=1e-12)
        assert np.abs(motion.pose[:3]).max() <= 0.2
        assert np.linalg.norm(v[:3]) <= limits.speed + 1e-9
        assert np.linalg.norm(v[3:6]) <= limits.angular_speed + 1e-9
        assert np.linalg.norm(change[:3]) <= limits.acceleration * dt + 1e-9
        assert np.linalg.norm(change[3:6]) <= limits.angular_acceleration * dt + 1e-9
        at_wall += np.abs(motion.pose[:3]).max() > 0.199
    assert at_wall > 20


def test_jump_is_reached_without_overshoot(rng):
    start, end = random_pose(rng), random_pose(rng)
    motions = follow(Limits(), at_rest(start), end, 500)
    assert np.allclose(log_map(end, motions[-1].pose, STARTS), 0.0, atol=1e-9)
    along = np.array([m.pose[:3] - start[:3] for m in motions]) @ (end[:3] - start[:3])
    assert along.max() <= np.sum((end[:3] - start[:3]) ** 2) * 1.01


def test_smooth_motion_is_followed_without_lag():
    def desired(t):
        angle_of_step = 0.5 * t * DT
        q = from_rotation_vector(np.array([0.0, 0.0, angle_of_step]))
        return np.concatenate([[0.2 * np.sin(t * DT), 0.2 * np.cos(t * DT), 0.0], q, [0.0]])

    motions = follow(Limits(), at_rest(desired(0)), desired, 150)
    errors = [np.linalg.norm(m.pose[:3] - m.desired[:3]) for m in motions[100:]]
    assert max(errors) < 1e-6
    assert max(angle(m.pose[3:7], m.desired[3:7]) for m in motions[100:]) < 1e-6


def test_target_stays_in_the_workspace_and_returns_to_it(rng):
    limits = Limits(lower=-0.1 * np.ones(3), upper=0.1 * np.ones(3))
    outside = random_pose(rng)
    outside[:3] = [0.5, -0.5, 0.0]
    inside = at_rest(np.concatenate([np.zeros(3), outside[3:]]))
    assert all(np.abs(m.pose[:3]).max() <= 0.1 for m in follow(limits, inside, outside, 300))
    back = follow(limits, at_rest(outside), outside, 300)
    distance = np.array([np.abs(m.pose[:3]).max() for m in back])
    assert (np.diff(distance) <= 1e-12).all()
    assert distance[-1] <= 0.1 + 1e-9


@pytest.mark.parametrize(
    "arguments", [{"speed": 0.0}, {"acceleration": np.nan}, {"lower": np.ones(3), "upper": np.zeros(3)}]
)
def test_limits_refuse_what_cannot_be_met(arguments):
    with pytest.raises(InvalidInput, match=r"speed|acceleration|lower"):
        Limits(**arguments)


def test_blend_starts_at_the_target_ends_at_the_desired_pose_and_is_slow(rng):
    desired, target = random_pose(rng), random_pose(rng)
    offset = log_map(desired, target, STARTS)
    offset[6] = 0.0
    duration = blend_duration(offset)
    times = np.linspace(0.0, duration, 101)
    poses = [blend(desired, offset, t, duration, is_oriented=True) for t in times]
    assert np.allclose(log_map(target, poses[0], STARTS)[:6], 0.0, atol=1e-9)
    assert np.allclose(poses[-1], desired)
    steps = [log_map(p, q, STARTS) / times[1] for p, q in pairwise(poses)]
    assert max(np.linalg.norm(v[:3]) for v in steps) <= 0.25 * 1.001
    assert max(np.linalg.norm(v[3:6]) for v in steps) <= 1.0 * 1.001
