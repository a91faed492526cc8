"""Sub-movements have minimum jerk and the stated motor noise."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.environments.human import HumanModel
from pilotfish.environments.human.motor_noise import add_motor_noise, aim_submovement
from pilotfish.environments.human.pose_offsets import add_offset, clip_offset, offset_norms, pose_difference
from pilotfish.environments.human.submovements import (
    PEAK_TO_MEAN_SPEED,
    Submovement,
    final_hand_pose,
    hand_pose,
    remaining_displacement,
    submovement_duration,
)
from pilotfish.geometry import Pose, angle, minimum_jerk, normalise, rotation_matrix

EXACT = 1e-12


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(rng.uniform(-0.3, 0.3, 3), normalise(rng.normal(size=4)))


def random_offset(rng: np.random.Generator, length: float = 0.3) -> np.ndarray:
    directions = rng.normal(size=(2, 3))
    return (length * directions / np.linalg.norm(directions, axis=1, keepdims=True)).ravel()


def test_minimum_jerk_starts_and_ends_at_rest():
    ends = np.array([-1.0, 0.0, 1.0, 2.0])
    np.testing.assert_array_equal(minimum_jerk(ends), [0.0, 0.0, 1.0, 1.0])
    h = 1e-4  # the first terms beyond s^0 and (1 - s)^0 are cubic
    np.testing.assert_array_less(minimum_jerk(np.array([h])), 11.0 * h**3)
    np.testing.assert_array_less(1.0 - minimum_jerk(np.array([1.0 - h])), 11.0 * h**3)


def test_minimum_jerk_peak_speed_is_in_the_middle():
    s, h = np.linspace(0.001, 0.999, 999), 1e-5
    speed = (minimum_jerk(s + h) - minimum_jerk(s - h)) / (2 * h)
    assert s[speed.argmax()] == pytest.approx(0.5)
    assert speed.max() == pytest.approx(PEAK_TO_MEAN_SPEED, abs=1e-8)  # h^2 times the third derivative


def test_minimum_jerk_has_least_squared_jerk(rng: np.random.Generator):
    s = np.polynomial.Polynomial([0.0, 1.0])
    ours = 10 * s**3 - 15 * s**4 + 6 * s**5
    np.testing.assert_allclose(ours(0.3), minimum_jerk(np.array(0.3)), atol=EXACT)
    for _ in range(5):
        change = s**3 * (1 - s) ** 3 * np.polynomial.Polynomial(rng.normal(size=3))
        jerks = [((curve.deriv(3) ** 2).integ())(1.0) for curve in (ours, ours + change)]
        assert jerks[1] > jerks[0]


@pytest.mark.parametrize("speed", [1.0, 0.4])
@pytest.mark.parametrize("length", [1e-4, 0.05, 0.5])
def test_submovement_duration_keeps_peak_speeds(speed: float, length: float, rng: np.random.Generator):
    human_model, displacement, start, h = HumanModel(), random_offset(rng, length), random_pose(rng), 1e-5
    displacement[3:] *= rng.uniform(0.1, 10.0)
    move = Submovement(displacement, 1.0, submovement_duration(human_model, displacement, speed))
    middle = 1.0 + move.duration / 2
    early, late = (hand_pose(start, (move,), middle + shift) for shift in (-h, h))
    fast = np.linalg.norm(late.position - early.position) / (2 * h * speed * human_model.peak_speed)
    turning = float(angle(late.quaternion, early.quaternion)) / (
        2 * h * speed * human_model.peak_angular_speed
    )
    assert move.duration >= human_model.min_duration
    assert max(fast, turning) <= 1.0 + 1e-5
    assert move.duration == human_model.min_duration or max(fast, turning) > 1.0 - 1e-5


def test_hand_pose_follows_geodesic(rng: np.random.Generator):
    start, goal = random_pose(rng), random_pose(rng)
    displacement = pose_difference(start, goal)
    move = Submovement(displacement, 0.0, 2.0)
    for time in (0.3, 1.0, 1.7):
        part = pose_difference(start, hand_pose(start, (move,), time))
        np.testing.assert_allclose(part, minimum_jerk(np.array(time / 2.0)) * displacement, atol=EXACT)
    last = hand_pose(start, (move,), 2.0)
    np.testing.assert_allclose(last.position, goal.position, atol=EXACT)
    assert angle(last.quaternion, goal.quaternion) < 1e-7


def test_hand_pose_overlapping_submovements_add_up(rng: np.random.Generator):
    start, h = random_pose(rng), 1e-6
    first, second = Submovement(random_offset(rng), 0.0, 1.0), Submovement(random_offset(rng), 0.7, 0.9)
    for time in (0.69, 0.7 + h):
        one, both = hand_pose(start, (first,), time), hand_pose(start, (first, second), time)
        np.testing.assert_allclose(both.position, one.position, atol=EXACT)
    end = final_hand_pose(start, (first, second))
    np.testing.assert_allclose(
        end.position, start.position + first.displacement[:3] + second.displacement[:3], atol=EXACT
    )
    np.testing.assert_allclose(hand_pose(start, (first, second), 1.6).position, end.position, atol=EXACT)
    halfway = hand_pose(start, (first, second), 0.9)
    left = remaining_displacement((first, second), 0.9)
    np.testing.assert_allclose(halfway.position + left[:3], end.position, atol=EXACT)
    np.testing.assert_array_equal(remaining_displacement((first, second), 1.6), 0.0)


@pytest.mark.parametrize("length", [0.004, 0.3])
def test_add_motor_noise_has_stated_deviations(length: float, rng: np.random.Generator):
    human_model, tool = HumanModel(), random_pose(rng)
    displacement = random_offset(rng, length)
    perpendicular_noise = np.linalg.svd(displacement[None, :3])[2][1:]
    basis = np.vstack([displacement[:3] / length, perpendicular_noise])
    ends = np.array(
        [add_motor_noise(human_model, displacement, tool, rng) - displacement for _ in range(4000)]
    )
    ends[:, :3] = ends[:, :3] @ basis.T
    expected = [max(0.001, 0.07 * length), *[max(0.001, 0.035 * length)] * 2]
    expected += [max(np.radians(0.5), 0.05 * length)] * 3
    scaled = ends / expected
    np.testing.assert_allclose(scaled.std(axis=0), 1.0, atol=5 / np.sqrt(2 * 4000))
    np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=5 / np.sqrt(4000))
    np.testing.assert_allclose(np.corrcoef(scaled.T), np.eye(6), atol=5 / np.sqrt(4000))


def test_aim_submovement_mean_falls_short_by_gain(rng: np.random.Generator):
    tool, displacement = random_pose(rng), random_offset(rng)
    goal = add_offset(tool, displacement)
    ends = np.array([aim_submovement(HumanModel(), tool, tool, goal, rng) for _ in range(500)])
    np.testing.assert_allclose(ends.mean(axis=0), 0.95 * displacement, atol=5 * 0.07 * 0.3 / np.sqrt(500))


def test_aim_submovement_keeps_lead_up_to_limit(rng: np.random.Generator):
    human_model = HumanModel(
        parallel_noise=0.0,
        perpendicular_noise=0.0,
        min_noise=0.0,
        angular_noise=0.0,
        min_angular_noise=0.0,
        gain=1.0,
    )
    tool, goal = random_pose(rng), random_pose(rng)
    for length, kept in ((0.02, 0.02), (0.2, human_model.max_lead)):
        offset = random_offset(rng, length)
        offset[3:] = 0.0
        hand = add_offset(tool, offset)
        end = add_offset(hand, aim_submovement(human_model, hand, tool, goal, rng))
        expected = goal.position + kept / length * offset[:3]
        np.testing.assert_allclose(end.position, expected, atol=EXACT)
        assert angle(end.quaternion, goal.quaternion) < 1e-7


def test_add_motor_noise_rotates_with_world(rng: np.random.Generator):
    turn, tool, displacement = random_pose(rng), random_pose(rng), random_offset(rng)
    R = rotation_matrix(turn.quaternion)
    noisy = add_motor_noise(HumanModel(), displacement, tool, np.random.default_rng(1))
    moved = np.concatenate([R @ displacement[:3], displacement[3:]])
    rotated = add_motor_noise(HumanModel(), moved, turn @ tool, np.random.default_rng(1))
    np.testing.assert_allclose(rotated[:3], R @ noisy[:3], atol=EXACT)
    np.testing.assert_allclose(rotated[3:], noisy[3:], atol=EXACT)


def test_pose_difference_and_add_offset_are_inverse(rng: np.random.Generator):
    a, b = random_pose(rng), random_pose(rng)
    offset = pose_difference(a, b)
    end = add_offset(a, offset)
    np.testing.assert_allclose(end.position, b.position, atol=EXACT)
    assert angle(end.quaternion, b.quaternion) < 1e-7
    assert offset_norms(clip_offset(offset, 0.01, 0.02)) == pytest.approx((0.01, 0.02))
    np.testing.assert_array_equal(clip_offset(offset, 10.0, 10.0), offset)
    np.testing.assert_array_equal(clip_offset(np.zeros(6), 0.0, 0.0), 0.0)


def test_add_motor_noise_zero_deviation_is_exact(rng: np.random.Generator):
    human_model = replace(
        HumanModel(),
        parallel_noise=0.0,
        perpendicular_noise=0.0,
        min_noise=0.0,
        angular_noise=0.0,
        min_angular_noise=0.0,
    )
    displacement = random_offset(rng)
    np.testing.assert_array_equal(
        add_motor_noise(human_model, displacement, random_pose(rng), rng), displacement
    )
