"""Errors of reproductions against demonstrations, and the published valve experiment."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from published import published_options

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, MovingFrame, pose_layout, to_sphere
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import CovarianceStructure, Full, SemiTied
from pilotfish.geometry import from_rotation_vector, multiply
from pilotfish.io import datasets
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import Skill, learn
from pilotfish.planning import (
    end_orientation_error,
    end_position_error,
    largest_acceleration,
    mean_squared_error,
    reproduce,
    reproduce_demonstration,
    time_warped_distance,
)

STATES, TRAINING = 7, 4  # of the published experiment: states, and demonstrations that train


@cache
def demonstrations(seed: int) -> tuple[Demonstration, ...]:
    return synthetic_valve(np.random.default_rng(seed))


@cache
def learn_valve(seed: int) -> Skill:
    return learn(demonstrations(seed)[:TRAINING], states=STATES, rng=np.random.default_rng(seed)).skill


def copy_motion(demonstration: Demonstration) -> Motion:
    """Return a motion that equals the demonstration."""
    x = demonstration.x.copy()
    return Motion(x, np.zeros((len(x) - 1, 7)), demonstration.period)


@pytest.mark.parametrize("from_first_state", [False, True])
def test_reproduce_demonstration_equals_reproduce_in_its_situation(from_first_state: bool):
    """Frames, start and length are those of the demonstration."""
    skill, situation = learn_valve(0), demonstrations(0)[5]
    start = None if from_first_state else situation.x[0]
    expected = reproduce(skill, situation.frames, start, horizon=200, control_cost=9.0)
    found = reproduce_demonstration(
        skill, situation, from_first_state=from_first_state, control_cost=9.0
    ).motion
    np.testing.assert_array_equal(found.x, expected.motion.x)
    np.testing.assert_array_equal(found.u, expected.motion.u)


def test_reproduce_demonstration_begins_at_point_or_first_mean():
    """The motion begins at the demonstration's first point, or where the skill begins.

    That is the adapted start of the demonstrations, in a published plan the mean of the first state.
    """
    skill, situation = learn_valve(1), demonstrations(1)[6]
    motion = reproduce_demonstration(skill, situation).motion
    np.testing.assert_array_equal(motion.x[0], situation.x[0])
    result = reproduce_demonstration(skill, situation, from_first_state=True)
    np.testing.assert_array_equal(result.motion.x[0], result.adapted.endpoints.means[0])
    result = reproduce_demonstration(skill, situation, from_first_state=True, stepwise=True)
    np.testing.assert_array_equal(result.motion.x[0], result.adapted.means[0])


def test_errors_copied_motion_are_zero():
    """All errors of the demonstration's own motion are zero."""
    for situation in demonstrations(0):
        motion = copy_motion(situation)
        assert mean_squared_error(motion, situation) == 0.0
        assert end_position_error(motion, situation) == 0.0
        assert end_orientation_error(motion, situation) < 1e-7  # an angle near zero loses half the digits
        assert largest_acceleration(motion, situation.layout) == 0.0


def test_mean_squared_error_averages_coordinates_only(rng: np.random.Generator):
    """It is the mean over steps of seven squared differences, without derivatives."""
    situation = demonstrations(0)[0]
    motion = copy_motion(situation)
    offset = rng.normal(size=(200, 14))
    motion.x[:] += offset
    total = sum(offset[t, i] ** 2 for t in range(200) for i in range(7))
    assert mean_squared_error(motion, situation) == pytest.approx(total / 1400)


def test_mean_squared_error_sphere_is_independent_of_signs(rng: np.random.Generator):
    """On S^3, q and -q are one orientation."""
    situation = to_sphere(demonstrations(0)[0])
    motion = Motion(situation.x.copy(), np.zeros((199, 6)), situation.period)
    motion.x[:, 3:7] *= rng.choice([-1.0, 1.0], size=(200, 1))
    assert mean_squared_error(motion, situation) == 0.0


def test_end_errors_equal_distance_and_angle(rng: np.random.Generator):
    """A last pose moved by 3 cm and rotated by 0.2 rad has these errors, for any norm of the quaternion."""
    situation = demonstrations(0)[3]
    motion = copy_motion(situation)
    direction, axis = rng.normal(size=3), rng.normal(size=3)
    motion.x[-1, :3] += 0.03 * direction / np.linalg.norm(direction)
    rotation = from_rotation_vector(0.2 * axis / np.linalg.norm(axis))
    motion.x[-1, 3:7] = rng.choice([-1.0, 1.0]) * 1.7 * multiply(rotation, situation.x[-1, 3:7])
    assert end_position_error(motion, situation) == pytest.approx(0.03)
    assert end_orientation_error(motion, situation) == pytest.approx(0.2)


def test_largest_acceleration_equals_longest_position_input(rng: np.random.Generator):
    """It is the longest vector of the first three inputs."""
    motion = copy_motion(demonstrations(0)[0])
    motion.u[:] = rng.normal(size=motion.u.shape)
    expected = max(float(np.sqrt(u[0] ** 2 + u[1] ** 2 + u[2] ** 2)) for u in motion.u)
    assert largest_acceleration(motion, demonstrations(0)[0].layout) == pytest.approx(expected)


def test_reproduce_demonstration_other_situation_is_refused():
    """Another period, other columns, a moving frame and a motion of another length are named."""
    skill, situation = learn_valve(0), demonstrations(0)[4]
    with pytest.raises(InvalidInput, match=r"every 0\.2 s, the skill .* every 0\.1 s"):
        reproduce_demonstration(skill, replace(situation, period=0.2))
    with pytest.raises(InvalidInput, match=r"has the columns position x, .* the skill"):
        reproduce_demonstration(skill, replace(situation, layout=pose_layout()))
    first = situation.frames[0]
    moving = MovingFrame(first.name, np.tile(first.A, (200, 1, 1)), np.tile(first.b, (200, 1)))
    with pytest.raises(InvalidInput, match="'valve before' moves"):
        reproduce_demonstration(skill, replace(situation, frames=(moving, situation.frames[1])))
    with pytest.raises(InvalidInput, match=r"the motion has shape \(200, 14\), expected \(150, 14\)"):
        mean_squared_error(copy_motion(situation), replace(situation, x=situation.x[:150]))


def test_reproduce_demonstration_without_velocities_is_refused():
    """A double integrator needs positions and velocities: a skill of poses alone is refused."""
    poses = [
        replace(d, x=d.x[:, :7], layout=pose_layout(), frames=_pose_frames(d)) for d in demonstrations(0)
    ]
    skill = learn(poses[:TRAINING], states=3, rng=np.random.default_rng(0)).skill
    with pytest.raises(InvalidInput, match="expected coordinates, then the derivative of each"):
        reproduce_demonstration(skill, poses[5])


def _pose_frames(demonstration: Demonstration):
    return tuple(replace(f, A=f.A[:7, :7], b=f.b[:7]) for f in demonstration.frames)


@pytest.mark.parametrize(
    ("structure", "train", "test"), [(Full(), 0.0012, 0.0149), (SemiTied(), 0.0035, 0.0115)]
)
def test_reproduce_demonstration_published_valve_has_known_errors(
    structure: CovarianceStructure,
    train: float,
    test: float,
    data_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    """On the recording, training and test errors are those found before, within a tenth.

    Tanwani 2018, table 4.1, prints .0021 / .0146 for full and .0040 / .0119 for semi-tied covariances. Our
    training error is lower; as there, tying raises it and lowers the test error.
    """
    monkeypatch.setenv("PILOTFISH_DATA", str(data_folder))
    demos = datasets.valve()
    skill = learn(
        demos[:TRAINING],
        states=STATES,
        rng=np.random.default_rng(0),
        structure=structure,
        **published_options(),
    ).skill
    errors = [
        mean_squared_error(
            reproduce_demonstration(
                skill,
                d,
                from_first_state=True,
                control_cost=9.0,
                covariance_regularisation=2e-3,
                stepwise=True,
            ).motion,
            d,
        )
        for d in demos
    ]
    assert np.mean(errors[:TRAINING]) == pytest.approx(train, rel=0.1)
    assert np.mean(errors[TRAINING:]) == pytest.approx(test, rel=0.1)


def pairings(i: int, j: int, N: int, M: int):
    """Yield every monotone sequence of pairs from (i, j) to the last rows."""
    if (i, j) == (N - 1, M - 1):
        yield [(i, j)]
        return
    for a, b in ((i + 1, j), (i, j + 1), (i + 1, j + 1)):
        if a < N and b < M:
            yield from ([(i, j), *rest] for rest in pairings(a, b, N, M))


@pytest.mark.parametrize(("N", "M"), [(1, 1), (1, 4), (4, 1), (3, 5), (5, 5), (6, 4)])
def test_time_warped_distance_equals_enumeration(rng: np.random.Generator, N: int, M: int):
    x, y = rng.normal(size=(N, 2)), rng.normal(size=(M, 2))
    costs = []
    for pairs in pairings(0, 0, N, M):
        distances = [np.linalg.norm(x[i] - y[j]) for i, j in pairs]
        costs.append((sum(distances), np.mean(distances)))
    assert time_warped_distance(x, y) == pytest.approx(min(costs)[1], rel=1e-12)


def test_time_warped_distance_ignores_repeated_rows(rng: np.random.Generator):
    x = rng.normal(size=(7, 3))
    slower = np.repeat(x, [1, 3, 1, 2, 5, 1, 1], axis=0)
    assert time_warped_distance(x, slower) == 0.0


@pytest.mark.parametrize(("x", "y"), [(np.zeros((2, 2)), np.zeros((2, 3))), (np.zeros((0, 2)),) * 2])
def test_time_warped_distance_of_unlike_rows_is_refused(x: np.ndarray, y: np.ndarray, unchecked: None):
    with pytest.raises(InvalidInput, match="rows of the same columns"):
        time_warped_distance(x, y)
