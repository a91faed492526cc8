"""Replays are the steps that a user would write, and errors are what their names say."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pilotfish.control import Motion, double_integrator, track
from pilotfish.demonstrations import Demonstration, MovingFrame, pose_layout
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import CovarianceStructure, Full, SemiTied
from pilotfish.geometry import multiply, quaternion_exp
from pilotfish.io import datasets
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import Skill, adapt, learn
from pilotfish.planning import expected_plan, plan
from pilotfish.planning.evaluation import (
    SETTINGS,
    STATES,
    TRAINING_DEMONSTRATIONS,
    end_orientation_error,
    end_position_error,
    max_acceleration,
    mean_squared_error,
    replay,
    replay_from_mean,
)


@cache
def shown(seed: int) -> tuple[Demonstration, ...]:
    return synthetic_valve(np.random.default_rng(seed))


@cache
def learned(seed: int) -> Skill:
    return learn(shown(seed)[:TRAINING_DEMONSTRATIONS], states=STATES, rng=np.random.default_rng(seed)).skill


def copied(demonstration: Demonstration) -> Motion:
    """The motion of a robot that does exactly what the person did."""
    x = demonstration.x.copy()
    return Motion(x, np.zeros((len(x) - 1, 7)), demonstration.period)


def test_a_replay_is_adapt_plan_track_and_rollout():
    """From the person's start, and from the mean of the first state, as a user would write it."""
    skill, situation = learned(0), shown(0)[5]
    here, system = adapt(skill, situation.frames), double_integrator(7, period=0.1)
    wanted = plan(here, situation.x[0], horizon=200, covariance_regularisation=2e-3)
    expected = track(system, wanted, 9.0).rollout(situation.x[0])
    np.testing.assert_array_equal(replay(skill, situation).motion.x, expected.x)
    wanted = expected_plan(here, horizon=200, covariance_regularisation=2e-3)
    expected = track(system, wanted, 9.0).rollout(wanted.targets[0])
    np.testing.assert_array_equal(replay_from_mean(skill, situation).motion.x, expected.x)


def test_a_replay_begins_where_it_says():
    """The one at the person's first point, the other at the adapted mean of the first planned state."""
    skill, situation = learned(1), shown(1)[6]
    np.testing.assert_array_equal(replay(skill, situation).motion.x[0], situation.x[0])
    begun = replay_from_mean(skill, situation)
    np.testing.assert_array_equal(begun.motion.x[0], begun.skill.means[0])


def test_doing_what_the_person_did_has_no_error():
    """All errors of the demonstration's own motion are zero."""
    for situation in shown(0):
        motion = copied(situation)
        assert mean_squared_error(motion, situation) == 0.0
        assert end_position_error(motion, situation) == 0.0
        assert end_orientation_error(motion, situation) < 1e-7  # arccos-like at zero
        assert max_acceleration(motion, situation.layout) == 0.0


def test_the_mean_squared_error_counts_coordinates_alone(rng: np.random.Generator):
    """It is the average over steps of seven squared differences; derivatives do not matter."""
    situation = shown(0)[0]
    motion = copied(situation)
    offset = rng.normal(size=(200, 14))
    motion.x[:] += offset
    total = sum(offset[t, i] ** 2 for t in range(200) for i in range(7))
    assert mean_squared_error(motion, situation) == pytest.approx(total / 1400)


def test_end_errors_are_distance_and_angle(rng: np.random.Generator):
    """A last pose moved by 3 cm and turned by .2 rad has these errors, whatever the quaternion's length."""
    situation = shown(0)[3]
    motion = copied(situation)
    push, axis = rng.normal(size=3), rng.normal(size=3)
    motion.x[-1, :3] += 0.03 * push / np.linalg.norm(push)
    turn = quaternion_exp(0.1 * axis / np.linalg.norm(axis))  # half the angle
    motion.x[-1, 3:7] = rng.choice([-1.0, 1.0]) * 1.7 * multiply(turn, situation.x[-1, 3:7])
    assert end_position_error(motion, situation) == pytest.approx(0.03)
    assert end_orientation_error(motion, situation) == pytest.approx(0.2)


def test_the_largest_push_is_that_of_the_position(rng: np.random.Generator):
    """It is the longest acceleration vector of the first three inputs."""
    motion = copied(shown(0)[0])
    motion.u[:] = rng.normal(size=motion.u.shape)
    expected = max(float(np.sqrt(u[0] ** 2 + u[1] ** 2 + u[2] ** 2)) for u in motion.u)
    assert max_acceleration(motion, shown(0)[0].layout) == pytest.approx(expected)


def test_situations_that_do_not_suit_the_skill_are_refused():
    """Another period, other columns, a frame that moves and a motion of another length are named."""
    skill, situation = learned(0), shown(0)[4]
    with pytest.raises(InvalidInput, match=r"every 0\.2 s, the skill .* every 0\.1 s"):
        replay(skill, replace(situation, period=0.2))
    with pytest.raises(InvalidInput, match=r"has the columns position x, .* the skill"):
        replay(skill, replace(situation, layout=pose_layout()))
    first = situation.frames[0]
    moving = MovingFrame(first.name, np.tile(first.A, (200, 1, 1)), np.tile(first.b, (200, 1)))
    with pytest.raises(InvalidInput, match="'valve before' moves"):
        replay(skill, replace(situation, frames=(moving, situation.frames[1])))
    with pytest.raises(InvalidInput, match=r"the motion has shape \(200, 14\), expected \(150, 14\)"):
        mean_squared_error(copied(situation), replace(situation, x=situation.x[:150]))


def test_a_skill_without_speeds_cannot_be_tracked():
    """A unit mass needs places and their speeds: a skill of poses alone is refused."""
    still = [replace(d, x=d.x[:, :7], layout=pose_layout(), frames=_halved(d)) for d in shown(0)]
    skill = learn(still[:TRAINING_DEMONSTRATIONS], states=3, rng=np.random.default_rng(0)).skill
    with pytest.raises(InvalidInput, match="expected coordinates, then the derivative of each"):
        replay(skill, still[5])


def _halved(demonstration: Demonstration):
    return tuple(replace(f, A=f.A[:7, :7], b=f.b[:7]) for f in demonstration.frames)


@pytest.mark.parametrize(
    ("structure", "train", "test"), [(Full(), 0.0012, 0.0149), (SemiTied(), 0.0035, 0.0115)]
)
def test_the_published_experiment_is_reproduced(
    structure: CovarianceStructure,
    train: float,
    test: float,
    data_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    """On the recording, errors where shown and where new are what they were found to be, within a tenth.

    Tanwani 2018, table 4.1, prints .0021 / .0146 for full and .0040 / .0119 for semi-tied covariances: our
    error is lower where shown, and as there, tying raises it where shown and lowers it where new.
    """
    monkeypatch.setenv("PILOTFISH_DATA", str(data_folder))
    shown = datasets.valve()
    rng = np.random.default_rng(0)
    skill = learn(
        shown[:TRAINING_DEMONSTRATIONS], states=STATES, rng=rng, structure=structure, settings=SETTINGS
    ).skill
    errors = [mean_squared_error(replay_from_mean(skill, d).motion, d) for d in shown]
    assert np.mean(errors[:TRAINING_DEMONSTRATIONS]) == pytest.approx(train, rel=0.1)
    assert np.mean(errors[TRAINING_DEMONSTRATIONS:]) == pytest.approx(test, rel=0.1)
