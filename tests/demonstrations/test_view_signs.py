"""Signs of quaternions in views, and velocities in moving frames."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import (
    MovingFrame,
    add_derivatives,
    demonstration,
    frame_from_pose,
    moving_frame_from_poses,
    pose_layout,
    views,
)
from pilotfish.geometry import Pose, multiply, quaternion_exp

NEGATED = np.repeat([1.0, -1.0, 1.0, -1.0], [3, 4, 3, 4])


def rotating_tool(rng, steps=30, flipped=False):
    """Return a tool that rotates beside an object, whose pose is given by q or -q."""
    object_ = Pose(rng.normal(size=3), quaternion_exp(0.4 * rng.normal(size=3)))
    axis = np.array([0.0, 0.0, 0.6]) + 0.05 * rng.normal(size=3)
    q = multiply(
        quaternion_exp(np.linspace(0.0, 1.0, steps)[:, None] * axis), np.tile(object_.quaternion, (steps, 1))
    )
    x = np.hstack([object_.position + rng.normal(size=3) * np.linspace(0, 1, steps)[:, None], q])
    pose = Pose(object_.position, -object_.quaternion) if flipped else object_
    return add_derivatives(
        demonstration(x, 0.1, pose_layout(), [frame_from_pose("object", pose_layout(), pose)])
    )


def test_views_frame_pose_minus_q_is_unchanged(rng):
    """A tracker may report either sign in each demonstration."""
    seed = int(rng.integers(2**32))
    demos = [rotating_tool(np.random.default_rng([seed, m]), 30 + m) for m in range(3)]
    for flipped in range(3):
        other = list(demos)
        other[flipped] = rotating_tool(np.random.default_rng([seed, flipped]), 30 + flipped, flipped=True)
        sign = NEGATED if flipped == 0 else np.ones(14)  # the first demonstration sets the sign
        np.testing.assert_allclose(views(other).x, sign * views(demos).x, atol=1e-12)


def test_views_recording_minus_q_is_unchanged(rng):
    demos = [rotating_tool(rng), rotating_tool(rng, 41)]
    opposite = replace(demos[1], x=NEGATED * demos[1].x)
    np.testing.assert_allclose(views([demos[0], opposite]).x, views(demos).x, atol=1e-12)


def test_views_moving_frame_velocities_are_differences_of_local_points(rng):
    """Local v[t] = (y[t+1] - y[t]) / period; a hand at rest on a rotating belt has local velocity 0."""
    steps = 25
    poses = [
        Pose(np.array([0.05 * t, 0.0, 0.3]), quaternion_exp(np.array([0.0, 0.0, 0.02 * t])))
        for t in range(steps)
    ]
    belt = moving_frame_from_poses("belt", pose_layout(), poses)
    at_rest = np.concatenate([[0.1, 0.2, 0.0], quaternion_exp(np.array([0.1, 0.0, 0.0]))])
    x = np.einsum("tij,j->ti", belt.A, at_rest) + belt.b
    local = views([add_derivatives(demonstration(x, 0.1, pose_layout(), [belt]))]).x[0]
    np.testing.assert_allclose(local[:, :7], np.tile(at_rest, (steps, 1)), atol=1e-12)
    np.testing.assert_allclose(local[:, 7:], 0.0, atol=1e-9)
    wandering = x + np.concatenate([0.1 * rng.normal(size=3), np.zeros(4)]) * np.arange(steps)[:, None]
    local = views([add_derivatives(demonstration(wandering, 0.1, pose_layout(), [belt]))]).x[0]
    np.testing.assert_allclose(local[:-1, 7:], np.diff(local[:, :7], axis=0) / 0.1, atol=1e-9)


@pytest.mark.parametrize("flip", [3, 10])
def test_moving_frame_from_poses_sign_change_is_continuous(flip):
    """Trackers may change sign at any step; the matrices of the frame are continuous."""
    poses = [
        Pose(np.zeros(3), (-1.0 if t >= flip else 1.0) * quaternion_exp(np.array([0.0, 0.01 * t, 0.0])))
        for t in range(15)
    ]
    frame = moving_frame_from_poses("tracked", pose_layout(), poses)
    assert isinstance(frame, MovingFrame)
    assert np.abs(np.diff(frame.A, axis=0)).max() < 0.05
