"""What `learn` does without options: number of states, structure, initialisation and convergence."""

from pathlib import Path

import numpy as np
import pytest
from reaches import make_reaches

from pilotfish.control import Motion
from pilotfish.demonstrations import add_derivatives, demonstration, position_layout, resample, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import Diagonal, Full
from pilotfish.io import datasets
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import (
    EMSettings,
    FromModel,
    KMeans,
    TimeBins,
    default_regularisation,
    default_states,
    default_structure,
    learn,
)
from pilotfish.models.degrees_of_freedom import bic, degrees_of_freedom
from pilotfish.planning import mean_squared_error, reproduce, reproduce_demonstration

RADIUS, ROUNDS, ROUND_STEPS = 0.2, 5, 40


def test_learn_without_options_has_thirty_diagonal_states(rng):
    demos = make_reaches(0)
    fit = learn(demos, rng=rng)
    assert fit.skill.states == 30
    assert fit.skill.provenance.structure == Diagonal().label
    assert fit.convergence.converged
    expected = default_regularisation(fit.skill.demonstrated.scales, fit.skill.layout)
    np.testing.assert_array_equal(fit.skill.regularisation, expected)


def test_learn_regularisation_given_is_kept_for_every_column(rng):
    skill = learn(make_reaches(0), rng=rng, settings=EMSettings(regularisation=1e-3)).skill
    np.testing.assert_array_equal(skill.regularisation, np.full(8, 1e-3))


def test_default_states_short_demonstrations_have_one_for_two_steps():
    demos = make_reaches(0, count=2)
    assert default_states(demos) == 30
    assert default_states([demos[0], resample(demos[1], 59)]) == 29
    assert default_states([resample(demos[0], 2)]) == 1


def test_default_structure_is_diagonal_only_for_default_states_in_time_order():
    assert default_structure(None) == Diagonal()
    assert default_structure(None, "markov") == Diagonal()
    assert default_structure(None, "mixture") == Full()
    assert default_structure(7) == Full()


def test_learn_from_model_without_states_is_refused(rng):
    demos = make_reaches(0)
    fit = learn(demos, states=3, rng=rng)
    with pytest.raises(InvalidInput, match="states is None, expected the number of states of the given"):
        learn(demos, rng=rng, initialisation=FromModel(fit.skill))


def test_learn_counted_durations_by_default_add_a_tenth_of_the_mean(rng):
    """The variance of each duration has (mean / 10)^2 + 1/12 more than the segments."""
    demos, options = make_reaches(0), {"rng": rng, "states": 5, "initialisation": TimeBins()}
    plain = learn(demos, settings=EMSettings(duration_regularisation=1e-12), **options).skill
    found = learn(demos, **options).skill.dynamics.durations
    means, deviations = plain.dynamics.durations.means, plain.dynamics.durations.deviations
    np.testing.assert_allclose(found.means, means, rtol=1e-12)
    expected = np.sqrt(deviations**2 + (0.1 * means) ** 2 + 1.0 / 12.0)
    np.testing.assert_allclose(found.deviations, expected, rtol=1e-6)


@pytest.mark.parametrize("recorded", [False, True])
def test_learn_valve_without_options_reproduces_unseen_situations(
    recorded: bool, data_folder: Path, monkeypatch: pytest.MonkeyPatch
):
    """With four demonstrations, errors in the other situations are at most those of the published settings.

    These are .0149 on the recording, from the first state (Tanwani 2018, table 4.1: .0146).
    """
    monkeypatch.setenv("PILOTFISH_DATA", str(data_folder))
    demos = datasets.valve() if recorded else synthetic_valve(np.random.default_rng(0))
    skill = learn(demos[:4], rng=np.random.default_rng(0)).skill
    errors = [mean_squared_error(reproduce_demonstration(skill, d).motion, d) for d in demos[4:]]
    assert np.mean(errors) < 0.0149


def circles(count: int = 3):
    """Return recordings of five rounds of a circle, with a little noise."""
    rng, demos = np.random.default_rng(3), []
    layout = position_layout(2)
    for n in range(count):
        angles = 2.0 * np.pi * (np.arange(ROUNDS * ROUND_STEPS) / ROUND_STEPS + 0.02 * rng.normal())
        x = RADIUS * np.stack([np.cos(angles), np.sin(angles)], axis=1) + 0.002 * rng.normal(size=(200, 2))
        demos.append(add_derivatives(demonstration(x, 0.05, layout, (world_frame(2),), f"circle {n}")))
    return demos


def radius(motion: Motion) -> float:
    """Return the median distance from the centre, without the first and the last half round."""
    return float(np.median(np.linalg.norm(motion.x[20:-20, :2], axis=1)))


def test_learn_periodic_movement_keeps_its_radius():
    """Time bins average several rounds to a point near the centre; k-means follows each round."""
    demos = circles()
    fit = learn(demos, states=8, rng=np.random.default_rng(0))
    found = reproduce(fit.skill, demos[0].frames)
    assert radius(found.motion) == pytest.approx(RADIUS, rel=0.1)
    turned = np.unwrap(np.arctan2(found.motion.x[:, 1], found.motion.x[:, 0]))
    assert abs(turned[-1] - turned[0]) / (2.0 * np.pi) == pytest.approx(ROUNDS, abs=1.0)
    bins = learn(demos, states=8, rng=np.random.default_rng(0), initialisation=TimeBins())
    assert criterion(fit) < criterion(bins)
    assert radius(reproduce(bins.skill, demos[0].frames).motion) < 0.5 * RADIUS


def criterion(fit) -> float:
    parameters = degrees_of_freedom(fit.skill, Full(), None)
    source = fit.skill.provenance
    return bic(source.log_likelihood, parameters, source.datapoints)


def test_learn_states_of_single_demonstrations_are_refused():
    """Three recordings far apart: k-means gives a state to each, is likelier, and is not taken."""
    rng, demos = np.random.default_rng(0), []
    for n in range(3):
        x = np.array([10.0 * n, 0.0]) + np.linspace(0.0, 1.0, 40)[:, None] + 0.01 * rng.normal(size=(40, 2))
        demos.append(demonstration(x, 0.1, position_layout(2), (world_frame(2),), f"line {n}"))
    options = {"states": 3, "dynamics": "markov"}
    found = learn(demos, rng=np.random.default_rng(0), **options)
    bins, clusters = (
        learn(demos, rng=np.random.default_rng(0), initialisation=each, **options)
        for each in (TimeBins(), KMeans())
    )
    assert criterion(clusters) < criterion(bins)
    np.testing.assert_allclose(found.skill.means, bins.skill.means, atol=0.2)
    assert abs(clusters.skill.means - bins.skill.means).max() > 5.0
