"""Frames of moving objects equal those of a recording of the same motion."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    MovingFrame,
    add_derivatives,
    demonstration,
    frame_from_pose,
    moving_frame_from_poses,
    pose_layout,
    to_sphere,
)
from pilotfish.geometry import (
    Pose,
    angle,
    conjugate,
    from_rotation_vector,
    multiply,
    normalise,
    quaternion_exp,
    rotation_matrix,
    to_rotation_vector,
)
from pilotfish.models import Skill, adapt, learn
from pilotfish.planning import (
    moving_frames,
)

HOLD = quaternion_exp(
    np.array([0.2, -0.1, 0.3])
)  # orientation of a hand in the frame of the object that it holds


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(rng.normal(size=3), normalise(rng.normal(size=4)))


def constant_velocity_motion(rng: np.random.Generator, steps: int) -> list[Pose]:
    """Return the poses of an object with constant velocity in the world."""
    begun, move, turn = random_pose(rng), 0.01 * rng.normal(size=3), 0.03 * rng.normal(size=3)
    return [
        Pose(begun.position + t * move, multiply(from_rotation_vector(t * turn), begun.quaternion))
        for t in range(steps)
    ]


def carried(rng: np.random.Generator, name: str) -> tuple[Demonstration, list[Pose]]:
    """Return a hand near an object with constant velocity, and the object's poses."""
    poses, layout, steps = constant_velocity_motion(rng, 12), pose_layout(), 12
    near = [Pose(0.1 * rng.normal(size=3), quaternion_exp(0.05 * rng.normal(size=3))) for _ in range(steps)]
    hands = [pose @ close for pose, close in zip(poses, near, strict=True)]
    x = np.array([np.append(hand.position, hand.quaternion) for hand in hands])
    frames = [moving_frame_from_poses("cup", layout, poses)]
    return demonstration(x, 0.1, layout, frames, name), poses


@pytest.fixture
def carrying(rng: np.random.Generator) -> tuple[Skill, Demonstration, list[Pose]]:
    """Return a skill of one state with one moving frame, a demonstration, and the poses of the frame."""
    made = [carried(rng, f"m{m}") for m in range(3)]
    skill = learn([add_derivatives(demo) for demo, _ in made], states=1, rng=rng).skill
    return skill, *made[0]


def test_moving_frames_equal_recorded_motion(
    carrying: tuple[Skill, Demonstration, list[Pose]],
):
    skill, demo, poses = carrying
    (whole,) = add_derivatives(demo).frames
    assert isinstance(whole, MovingFrame)
    for t in range(1, len(poses) - 1):
        x = np.append(demo.x[t], np.zeros(7))
        (frame,) = moving_frames(skill, {"cup": poses[t - 1]}, {"cup": poses[t]}, x)
        sign = np.sign(whole.A[t, 3, 3] * frame.A[3, 3])  # of q and -q
        signs = np.concatenate([np.ones(3), np.full(4, sign)] * 2)
        np.testing.assert_allclose(frame.A, whole.A[t] * signs[:, None], atol=1e-9)
        np.testing.assert_allclose(frame.b, whole.b[t], atol=1e-9)


def test_moving_frames_means_move_with_objects(carrying: tuple[Skill, Demonstration, list[Pose]]):
    skill, demo, poses = carrying
    local_mean, h = skill.means[0, 0], skill.period
    for t in range(1, len(poses) - 1):
        frames = moving_frames(
            skill, {"cup": poses[t - 1]}, {"cup": poses[t]}, np.append(demo.x[t], np.zeros(7))
        )
        mean = adapt(skill, frames).means[0]
        now, later = (
            poses[s].position + rotation_matrix(poses[s].quaternion) @ local_mean[:3] for s in (t, t + 1)
        )
        own = (
            rotation_matrix(poses[t + 1].quaternion) @ local_mean[7:10]
        )  # the hand's velocity, local_mean from the object
        np.testing.assert_allclose(mean[:3], now, atol=1e-9)
        np.testing.assert_allclose(mean[7:10], (later - now) / h + own, atol=1e-9)


def test_moving_frames_on_sphere_means_rotate(carrying: tuple[Skill, Demonstration, list[Pose]]):
    _, demo, poses = carrying
    converted = to_sphere(demo)
    held = replace(
        converted,
        x=np.hstack([converted.x[:, :3], [(p @ Pose(np.zeros(3), HOLD)).quaternion for p in poses]]),
    )
    skill = learn([add_derivatives(held)], states=1, rng=np.random.default_rng(0)).skill
    for t in range(1, len(poses) - 1):
        x = np.append(held.x[t], np.zeros(6))
        frames = moving_frames(skill, {"cup": poses[t - 1]}, {"cup": poses[t]}, x)
        mean = adapt(skill, frames).means[0]
        expected = multiply(poses[t].quaternion, HOLD)
        assert angle(mean[3:7], expected) < 1e-6
        after = multiply(poses[t + 1].quaternion, HOLD)
        speed = to_rotation_vector(multiply(conjugate(expected), after)) / skill.period
        np.testing.assert_allclose(mean[10:13], speed, atol=1e-6)


def test_moving_frames_fixed_objects_are_fixed(carrying: tuple[Skill, Demonstration, list[Pose]]):
    skill, demo, poses = carrying
    fixed = {"cup": poses[0]}
    (frame,) = moving_frames(skill, fixed, fixed, np.append(demo.x[0], np.zeros(7)))
    expected = frame_from_pose("cup", skill.layout, poses[0])
    np.testing.assert_allclose(frame.A, expected.A, atol=1e-12)
    np.testing.assert_allclose(frame.b, expected.b, atol=1e-12)


@pytest.mark.parametrize("length", [0.7, 0.98, 1.2])
def test_moving_frames_short_quaternion_is_accepted(
    carrying: tuple[Skill, Demonstration, list[Pose]], length: float
):
    skill, demo, poses = carrying
    x = np.append(demo.x[1], np.zeros(7))
    short = x.copy()
    short[3:7] *= length
    (a,), (b,) = (moving_frames(skill, {"cup": poses[0]}, {"cup": poses[1]}, given) for given in (x, short))
    np.testing.assert_allclose(a.A, b.A, atol=1e-12)
    np.testing.assert_allclose(a.b, b.b, atol=1e-12)
