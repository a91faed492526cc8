"""Sub-movements are of minimum jerk, and end as precisely as people do."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.environments.human import (
    PEAK_TO_MEAN_SPEED,
    HumanModel,
    Submovement,
    duration,
    minimum_jerk,
    minimum_jerk_acceleration,
    minimum_jerk_speed,
)
from pilotfish.environments.human.aiming import add_motor_noise, aim_submovement
from pilotfish.environments.human.movements import final_hand_pose, hand_pose, remaining_displacement
from pilotfish.environments.human.offsets import add_offset, clip_offset, offset_norms, pose_difference
from pilotfish.geometry import Pose, angle, normalise, rotation_matrix

EXACT = 1e-12


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(rng.uniform(-0.3, 0.3, 3), normalise(rng.normal(size=4)))


def random_offset(rng: np.random.Generator, length: float = 0.3) -> np.ndarray:
    directions = rng.normal(size=(2, 3))
    return (length * directions / np.linalg.norm(directions, axis=1, keepdims=True)).ravel()


def test_minimum_jerk_goes_from_rest_to_rest():
    """Place, speed and acceleration are nothing at the beginning; all is done, at rest, at the end."""
    ends = np.array([-1.0, 0.0, 1.0, 2.0])
    np.testing.assert_array_equal(minimum_jerk(ends), [0.0, 0.0, 1.0, 1.0])
    np.testing.assert_array_equal(minimum_jerk_speed(ends), 0.0)
    np.testing.assert_array_equal(minimum_jerk_acceleration(ends), 0.0)


def test_speed_and_acceleration_are_the_derivatives():
    """Central differences of each closed form give the next."""
    s, h = np.linspace(0.01, 0.99, 99), 1e-5
    for curve, slope in ((minimum_jerk, minimum_jerk_speed), (minimum_jerk_speed, minimum_jerk_acceleration)):
        np.testing.assert_allclose((curve(s + h) - curve(s - h)) / (2 * h), slope(s), atol=1e-8)


def test_the_peak_speed_is_in_the_middle():
    """It is 1.875 times the mean speed, and nowhere is the speed higher."""
    assert minimum_jerk_speed(np.array(0.5)) == PEAK_TO_MEAN_SPEED == 1.875
    assert minimum_jerk_speed(np.linspace(0, 1, 1001)).max() == PEAK_TO_MEAN_SPEED


def test_no_other_way_from_rest_to_rest_has_less_jerk(rng: np.random.Generator):
    """Among polynomials with the same ends, every change adds to the integral of the squared jerk."""
    s = np.polynomial.Polynomial([0.0, 1.0])
    ours = 10 * s**3 - 15 * s**4 + 6 * s**5
    np.testing.assert_allclose(ours(0.3), minimum_jerk(np.array(0.3)), atol=EXACT)
    for _ in range(5):
        change = s**3 * (1 - s) ** 3 * np.polynomial.Polynomial(rng.normal(size=3))
        jerks = [((curve.deriv(3) ** 2).integ())(1.0) for curve in (ours, ours + change)]
        assert jerks[1] > jerks[0]


@pytest.mark.parametrize("speed", [1.0, 0.4])
@pytest.mark.parametrize("length", [1e-4, 0.05, 0.5])
def test_movements_keep_to_the_peaks_and_the_shortest_time(
    speed: float, length: float, rng: np.random.Generator
):
    """The hand's peak speed and peak turning, by finite differences, are within the shares of the person's,
    and one of them is met unless the movement is the shortest.
    """
    human_model, displacement, start, h = HumanModel(), random_offset(rng, length), random_pose(rng), 1e-5
    displacement[3:] *= rng.uniform(0.1, 10.0)
    move = Submovement(displacement, 1.0, duration(human_model, displacement, speed))
    middle = 1.0 + move.duration / 2
    early, late = (hand_pose(start, (move,), middle + shift) for shift in (-h, h))
    fast = np.linalg.norm(late.position - early.position) / (2 * h * speed * human_model.peak_speed)
    turning = float(angle(late.quaternion, early.quaternion)) / (
        2 * h * speed * human_model.peak_angular_speed
    )
    assert move.duration >= human_model.min_duration
    assert max(fast, turning) <= 1.0 + 1e-5
    assert move.duration == human_model.min_duration or max(fast, turning) > 1.0 - 1e-5


def test_a_hand_turns_about_one_axis(rng: np.random.Generator):
    """The way of a single movement is straight, and its turn a geodesic on the same clock."""
    start, goal = random_pose(rng), random_pose(rng)
    displacement = pose_difference(start, goal)
    move = Submovement(displacement, 0.0, 2.0)
    for time in (0.3, 1.0, 1.7):
        part = pose_difference(start, hand_pose(start, (move,), time))
        np.testing.assert_allclose(part, minimum_jerk(np.array(time / 2.0)) * displacement, atol=EXACT)
    last = hand_pose(start, (move,), 2.0)
    np.testing.assert_allclose(last.position, goal.position, atol=EXACT)
    assert angle(last.quaternion, goal.quaternion) < 1e-7


def test_movements_add_up(rng: np.random.Generator):
    """A second movement changes neither place nor speed as it begins, and in the end both ways are gone."""
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
def test_ends_scatter_along_and_across_as_stated(length: float, rng: np.random.Generator):
    """Of 4000 ends the deviation is .07 of the length along it, .035 in each direction across, never under
    1 mm, and .05 of the angle, never under half a degree, about every axis; none is correlated.
    """
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


def test_a_hand_falls_short_by_the_gain(rng: np.random.Generator):
    """The mean end of 500 aimed movements has gone .95 of the way and of the turn."""
    tool, displacement = random_pose(rng), random_offset(rng)
    goal = add_offset(tool, displacement)
    ends = np.array([aim_submovement(HumanModel(), tool, tool, goal, rng) for _ in range(500)])
    np.testing.assert_allclose(ends.mean(axis=0), 0.95 * displacement, atol=5 * 0.07 * 0.3 / np.sqrt(500))


def test_a_hand_keeps_its_offset_up_to_the_lean(rng: np.random.Generator):
    """A tool some way behind the hand is moved by the whole error; of a longer offset the lean is kept."""
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


def test_noise_turns_with_the_world(rng: np.random.Generator):
    """Where tool and way are turned, the same draw misses by as much, turned."""
    turn, tool, displacement = random_pose(rng), random_pose(rng), random_offset(rng)
    R = rotation_matrix(turn.quaternion)
    here = add_motor_noise(HumanModel(), displacement, tool, np.random.default_rng(1))
    moved = np.concatenate([R @ displacement[:3], displacement[3:]])
    there = add_motor_noise(HumanModel(), moved, turn @ tool, np.random.default_rng(1))
    np.testing.assert_allclose(there[:3], R @ here[:3], atol=EXACT)
    np.testing.assert_allclose(there[3:], here[3:], atol=EXACT)


def test_offsets_lead_from_pose_to_pose(rng: np.random.Generator):
    """Beyond undoes between; shortened keeps directions, and changes nothing that is short enough."""
    a, b = random_pose(rng), random_pose(rng)
    offset = pose_difference(a, b)
    again = add_offset(a, offset)
    np.testing.assert_allclose(again.position, b.position, atol=EXACT)
    assert angle(again.quaternion, b.quaternion) < 1e-7
    assert offset_norms(clip_offset(offset, 0.01, 0.02)) == pytest.approx((0.01, 0.02))
    np.testing.assert_array_equal(clip_offset(offset, 10.0, 10.0), offset)
    np.testing.assert_array_equal(clip_offset(np.zeros(6), 0.0, 0.0), 0.0)


def test_a_person_without_noise_does_not_miss(rng: np.random.Generator):
    """With every deviation at nothing the way comes out as it was meant."""
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
