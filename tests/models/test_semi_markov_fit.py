"""Fit of semi-Markov models: monotone likelihood, recovery of durations, refusals."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from pilotfish import datasets
from pilotfish.demonstrations import Layout, Part, Quantity, demonstration, views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import DenseCovariances, Diagonal, Full, SemiTied
from pilotfish.models import (
    Censoring,
    DurationModel,
    EMSettings,
    FromModel,
    HiddenModel,
    KMeans,
    MarkovChain,
    SemiMarkovChain,
    expected_statistics,
    learn,
    log_likelihood,
    maximise_likelihood,
    state_segments,
)
from pilotfish.models.durations import (
    DISTRIBUTIONS,
    Gamma,
    Gaussian,
    NegativeBinomial,
    Poisson,
    Segments,
)
from pilotfish.models.viterbi_durations import count_durations

DURATION_MODELS = {
    **{name: DurationModel(distribution) for name, distribution in DISTRIBUTIONS.items()},
    "geometric": DurationModel(NegativeBinomial, options={"shape": 1.0}),
}
LAYOUT = Layout((Part("place", Quantity.SCALAR, 1, "m"),))


@pytest.mark.parametrize(
    ("structure", "censoring"),
    [
        *((Full(), censoring) for censoring in Censoring),
        (SemiTied(1.0), Censoring.RIGHT),
        (Diagonal(), Censoring.BOTH),
    ],
    ids=lambda value: value.label if hasattr(value, "label") else value.value,
)
@pytest.mark.parametrize("name", DURATION_MODELS)
def test_semi_markov_em_is_monotone(rng, make_demonstrations, name, structure, censoring):
    """Every step gains, up to rounding, for all distributions, kinds of censoring and structures."""
    data = views(make_demonstrations(lengths=(25, 30, 21), width=2, stops=3, noise=0.5))
    assert_likelihood_never_falls(data, rng, replace(DURATION_MODELS[name], censoring=censoring), structure)


def assert_likelihood_never_falls(data, rng, duration_model, structure, steps=4, states=3):
    initial_statistics = KMeans().initial_statistics(data, states, rng)
    model = maximise_likelihood(initial_statistics, None, structure, 1e-6, MarkovChain.fit)
    chain = count_durations(model, data, 1.0)
    broad = Gaussian(chain.durations.means, np.maximum(2.0, 0.7 * chain.durations.means))
    model = replace(model, dynamics=replace(chain, durations=broad, censoring=duration_model.censoring))
    max_duration, values = int(data.lengths.max()), []
    for _ in range(steps):
        statistics = expected_statistics(model, data, max_duration=max_duration)
        values.append(statistics.log_likelihood)
        model = maximise_likelihood(
            statistics,
            model,
            structure,
            0.0,
            partial(SemiMarkovChain.fit, duration_model=duration_model, min_variance=0.05),
        )
    # The first step changes the class of the distribution; only later steps are ascent.
    assert np.diff(values[1:]).min() > -1e-9 * abs(values[-1]), np.diff(values)


@pytest.mark.parametrize("name", DURATION_MODELS)
def test_semi_markov_em_valve_recordings_is_monotone(data_folder, name):
    """Real recordings, right-censored or censored at both ends."""
    demos = datasets.valve()[:4]
    for censoring in (Censoring.RIGHT, Censoring.BOTH):
        fit = learn(
            demos,
            states=5,
            rng=np.random.default_rng(0),
            durations=replace(DURATION_MODELS[name], censoring=censoring),
            settings=EMSettings(tolerance=0.0, max_iterations=4),
        )
        assert np.diff(fit.log_likelihoods).min(initial=0.0) >= 0.0
        np.testing.assert_allclose(log_likelihood(fit.skill, demos).sum(), fit.log_likelihoods[-1], rtol=1e-6)


def sample_demonstrations(rng, count, length=120):
    """Return recordings of three states in a loop, their mean durations and their true segments."""
    durations = Gamma(np.array([20.0, 9.0, 30.0]), np.array([2.0, 0.6, 1.5]))
    chain = SemiMarkovChain(np.full(3, 1 / 3), np.roll(np.eye(3), 1, axis=1), durations)
    demos, true = [], np.zeros((4, length, 3))
    for m in range(count):
        states = chain.sample(length, rng)
        x = 3.0 * states[:, None] + rng.normal(size=(length, 1))
        demos.append(demonstration(x, 0.1, LAYOUT, (), f"passage {m}"))
        segment_states, lengths = state_segments(states)
        np.add.at(true[0], (lengths[:-1] - 1, segment_states[:-1]), 1.0)
        true[1, lengths[-1] - 1, segment_states[-1]] += 1.0
    return demos, durations.means, Segments(*true)


def test_durations_are_recovered_from_samples():
    """The error shrinks to that of the true segments; counted durations stay too short."""
    initialisation = HiddenModel(
        MarkovChain(np.full(3, 1 / 3), np.full((3, 3), 0.05) + 0.85 * np.eye(3)),
        np.array([[[0.0], [3.0], [6.0]]]),
        (DenseCovariances(np.ones((3, 1, 1))),),
    )
    errors = {}
    for count in (4, 64):
        actual = {"exact": [], "counted": [], "true segments": []}
        for seed in range(4):
            rng = np.random.default_rng(seed)
            demos, truth, segments = sample_demonstrations(rng, count)
            fit = learn(
                demos,
                states=3,
                rng=rng,
                initialisation=FromModel(initialisation),
                durations=DurationModel(Gamma),
            )
            actual["exact"].append(fit.skill.dynamics.durations.means / truth - 1.0)
            actual["counted"].append(
                count_durations(fit.markov_skill, views(demos), 1.0).durations.means / truth - 1.0
            )
            actual["true segments"].append(Gamma.fit(segments).means / truth - 1.0)
        errors[count] = {name: np.sqrt(np.mean(np.square(values))) for name, values in actual.items()}
    assert errors[64]["exact"] < errors[4]["exact"] / 1.8, errors
    for count in errors:
        assert errors[count]["exact"] < 1.4 * errors[count]["true segments"], errors
    assert errors[64]["counted"] > 2.0 * errors[64]["exact"], errors
    assert np.mean(actual["counted"]) < -0.05, actual


def test_semi_markov_fit_continues_from_given_skill(make_demonstrations):
    """The first likelihood is no lower than the last of the given skill."""
    demos, rng = make_demonstrations(lengths=(30, 36)), np.random.default_rng(0)
    fit = learn(demos, states=3, rng=rng, durations=DurationModel(Poisson))
    duration_model = DurationModel(Poisson, max_duration=36)
    again = learn(demos, states=3, rng=rng, initialisation=FromModel(fit.skill), durations=duration_model)
    assert again.log_likelihoods[0] >= fit.log_likelihoods[-1] - 1e-3 * abs(fit.log_likelihoods[-1])
    assert isinstance(again.markov_skill.dynamics, MarkovChain)
    markov = learn(demos, states=3, rng=rng, dynamics="markov", initialisation=FromModel(fit.skill))
    np.testing.assert_allclose(markov.skill.dynamics.transitions.sum(axis=1), 1.0)


def test_max_duration_too_short_raises(rng):
    """Two states of 20 steps each cannot be explained by segments of at most 5 steps."""
    x = np.repeat([[0.0], [50.0]], 20, axis=0) + 0.1 * rng.normal(size=(40, 1))
    demo = demonstration(x, 0.1, LAYOUT, (), "long segments")
    with pytest.raises(InvalidInput, match=r"segments of at most 5 steps.*raise max_duration"):
        learn(
            [demo],
            states=2,
            rng=rng,
            durations=DurationModel(censoring=Censoring.NONE, max_duration=5),
        )


def test_semi_markov_one_state_one_demonstration_is_fitted(rng):
    demo = demonstration(rng.normal(size=(12, 1)), 0.1, LAYOUT, (), "one")
    fit = learn([demo], states=1, rng=rng, durations=DurationModel())
    np.testing.assert_array_equal(fit.skill.dynamics.transitions, [[0.0]])
    np.testing.assert_allclose(log_likelihood(fit.skill, [demo]), fit.log_likelihoods[-1])


def test_semi_markov_state_without_data_is_dropped_with_its_segments(rng, make_demonstrations):
    demos = make_demonstrations(stops=2, frames=1)
    model = learn(demos, states=2, rng=rng, durations=DurationModel()).skill
    far = np.full_like(model.means[:, :1], 1e3)
    durations = Gaussian(np.full(3, 8.0), np.full(3, 4.0))
    initialisation = HiddenModel(
        SemiMarkovChain(np.full(3, 1 / 3), (1 - np.eye(3)) / 2, durations),
        np.concatenate([model.means, far], axis=1),
        tuple(DenseCovariances(np.concatenate([c.dense, np.eye(2)[None]])) for c in model.covariances),
    )
    fit = learn(demos, states=3, rng=rng, initialisation=FromModel(initialisation), durations=DurationModel())
    assert fit.skill.states == 2
    assert "state 2 of 3" in fit.convergence.dropped[0]
    assert np.isfinite(fit.skill.dynamics.durations.means).all()


def test_invalid_arguments_raise(rng, make_demonstrations):
    with pytest.raises(InvalidInput, match="max_duration is 0"):
        DurationModel(max_duration=0)
    with pytest.raises(InvalidInput, match="'width', but gamma has no option"):
        DurationModel(Gamma, options={"width": 1.0})
    with pytest.raises(InvalidInput, match="shape is 0"):
        DurationModel(NegativeBinomial, options={"shape": 0.0})
    statistics = KMeans().initial_statistics(views(make_demonstrations()), 2, rng)
    with pytest.raises(InvalidInput, match="no segments"):
        SemiMarkovChain.fit(statistics, duration_model=DurationModel(), min_variance=1.0)
    arguments = {"states": 2, "rng": rng}
    with pytest.raises(InvalidInput, match="dynamics is 'hmm', expected one of 'mixture', 'markov'"):
        learn(make_demonstrations(), dynamics="hmm", **arguments)
    with pytest.raises(InvalidInput, match='expected dynamics="semi-markov"'):
        learn(make_demonstrations(), dynamics="markov", durations=DurationModel(), **arguments)


@pytest.mark.parametrize("name", ["gaussian", "poisson", "histogram"])
def test_max_duration_beyond_recordings_changes_nothing(make_demonstrations, name):
    """No array has its size: 10^9 steps would fit in no memory."""
    demos = make_demonstrations(lengths=(30, 36))
    fits = [
        learn(
            demos,
            states=2,
            rng=np.random.default_rng(0),
            durations=replace(DURATION_MODELS[name], max_duration=max_duration),
        )
        for max_duration in (36, 10**6, 2**31 - 1)
    ]
    for fit in fits[1:]:
        np.testing.assert_array_equal(fit.log_likelihoods, fits[0].log_likelihoods)
        np.testing.assert_array_equal(fit.skill.means, fits[0].skill.means)
    with pytest.raises(InvalidInput, match=r"max_duration is 1000000000000, expected a whole number from 1"):
        DurationModel(max_duration=10**12)
