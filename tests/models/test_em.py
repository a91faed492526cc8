"""Expectation-maximisation: expected statistics, monotone likelihood, dropped states and restarts."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from pilotfish.demonstrations import Views, views
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians import Moments
from pilotfish.gaussians.structures import DenseCovariances, Diagonal, Full, SemiTied, Spherical
from pilotfish.models import (
    EMSettings,
    FromModel,
    HiddenModel,
    KMeans,
    MarkovChain,
    MixtureWeights,
    TimeBins,
    expected_statistics,
    fit_em,
    learn,
    maximise_likelihood,
)
from pilotfish.models.statistics import labelled_statistics

STRUCTURES = [Full(), Diagonal(), Spherical(), SemiTied(1.0), SemiTied(0.5)]


def random_model(rng, P, K, D, markov=True):
    A = rng.normal(size=(P, K, D, D))
    covariances = A @ A.transpose(0, 1, 3, 2) + 0.5 * np.eye(D)
    chain = MarkovChain(rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K))
    dynamics = chain if markov else MixtureWeights(rng.dirichlet(np.ones(K)))
    return HiddenModel(dynamics, rng.normal(size=(P, K, D)), tuple(DenseCovariances(c) for c in covariances))


def enumerate_paths(model, x):
    """Yield states and log p(states, x) of all K^T state sequences, by definition."""
    (P, T, _), K = x.shape, model.means.shape[1]
    log_b = np.zeros((T, K))
    for p, k in itertools.product(range(P), range(K)):
        log_b[:, k] += multivariate_normal(model.means[p, k], model.covariances[p].dense[k]).logpdf(x[p])
    for states in itertools.product(range(K), repeat=T):
        if isinstance(model.dynamics, MixtureWeights):
            log_p = sum(np.log(model.dynamics.weights[k]) for k in states)
        else:
            log_p = np.log(model.dynamics.initial[states[0]])
            log_p += sum(np.log(model.dynamics.transitions[i, j]) for i, j in itertools.pairwise(states))
        yield states, log_p + sum(log_b[t, k] for t, k in enumerate(states))


@pytest.mark.parametrize("markov", [True, False])
@pytest.mark.parametrize(("P", "K", "D", "T"), [(1, 2, 1, 5), (2, 3, 2, 4), (3, 1, 2, 3)])
def test_statistics_equal_enumeration_of_state_sequences(rng, markov, P, K, D, T):
    """Likelihood, counts, first states, transitions and moments."""
    model, x = random_model(rng, P, K, D, markov), rng.normal(size=(P, T, D))
    paths, log_p = zip(*enumerate_paths(model, x), strict=True)
    posterior = np.exp(log_p - logsumexp(log_p))
    state_probs, transitions = np.zeros((T, K)), np.zeros((K, K))
    for states, p in zip(paths, posterior, strict=True):
        state_probs[np.arange(T), states] += p
        np.add.at(transitions, (states[:-1], states[1:]), p)
    actual = expected_statistics(model, Views(x, np.array([T])))
    np.testing.assert_allclose(actual.log_likelihood, logsumexp(log_p))
    np.testing.assert_allclose(actual.initial_counts, state_probs[0])
    np.testing.assert_allclose(actual.transitions, transitions, atol=1e-12)
    for p in range(P):
        expected = Moments.from_data(x[p], state_probs)
        for name in ("counts", "means", "scatter_matrices"):
            np.testing.assert_allclose(getattr(actual.moments[p], name), getattr(expected, name), atol=1e-10)


def test_statistics_of_parts_sum_to_statistics_of_all(rng, make_demonstrations):
    """Statistics of parts of the demonstrations add up, in any order."""
    demos = make_demonstrations(lengths=(20, 33, 27, 41))
    model = random_model(rng, 2, 3, 2)
    total = expected_statistics(model, views(demos))
    parts = expected_statistics(model, views(demos[2:])) + expected_statistics(model, views(demos[:2]))
    np.testing.assert_allclose(parts.log_likelihood, total.log_likelihood)
    np.testing.assert_allclose(parts.transitions, total.transitions)
    np.testing.assert_allclose(parts.initial_counts, total.initial_counts)
    for a, b in zip(parts.moments, total.moments, strict=True):
        np.testing.assert_allclose(a.means, b.means)
        np.testing.assert_allclose(a.scatter_matrices, b.scatter_matrices, atol=1e-9)


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: s.label)
@pytest.mark.parametrize("dynamics", ["semi-markov", "mixture"])
def test_em_log_likelihood_is_monotone_and_reports_undone_step(rng, make_demonstrations, structure, dynamics):
    """Regularisation and partial tying can lower the likelihood; the fit then ends before and says so."""
    settings = EMSettings(regularisation=1e-2, tolerance=0.0, max_iterations=60)
    convergence = learn(
        make_demonstrations(width=3, stops=4),
        states=4,
        rng=rng,
        dynamics=dynamics,
        structure=structure,
        settings=settings,
    ).convergence
    assert np.diff(convergence.log_likelihoods).min(initial=0.0) >= 0.0
    if "lost" in convergence.reason:
        assert convergence.iterations == len(convergence.log_likelihoods) + 1


@pytest.mark.parametrize("structure", [Full(), Diagonal(), Spherical(), SemiTied(1.0)], ids=lambda s: s.label)
@pytest.mark.parametrize("frames", [1, 2, 3])
@pytest.mark.parametrize("chain", [MarkovChain.fit, MixtureWeights.fit])
@pytest.mark.parametrize("initialisation", [TimeBins(1.0), KMeans()], ids=["bins", "k-means"])
def test_em_without_regularisation_is_monotone(
    rng, make_demonstrations, structure, frames, chain, initialisation
):
    """Every step gains, up to rounding."""
    data = views(make_demonstrations(frames=frames, width=2, stops=3, lengths=(50, 60, 31), noise=0.3))
    model = maximise_likelihood(initialisation.initial_statistics(data, 3, rng), None, structure, 0.0, chain)
    values = []
    for _ in range(15):
        statistics = expected_statistics(model, data)
        values.append(statistics.log_likelihood)
        model = maximise_likelihood(statistics, model, structure, 0.0, chain)
    assert np.diff(values).min() > -1e-9 * abs(values[-1])


def test_em_large_undone_step_is_not_converged(rng, make_demonstrations):
    """Half-tied and strongly regularised, EM ends with a loss far above the tolerance."""
    settings = EMSettings(regularisation=0.3, tolerance=1e-12, max_iterations=300)
    ends = [
        learn(
            make_demonstrations(stops=4, width=3),
            states=4,
            rng=rng,
            structure=SemiTied(0.5),
            settings=settings,
        ).convergence
        for _ in range(5)
    ]
    undone = [end for end in ends if "lost" in end.reason]
    assert undone
    assert not any(end.converged for end in undone)


def test_em_converged_model_is_fixed_point(rng, make_demonstrations):
    """One more M-step changes neither means nor likelihood."""
    data = views(make_demonstrations())
    initial_statistics = TimeBins().initial_statistics(data, 3, rng)

    def m_step(statistics, like):
        return maximise_likelihood(statistics, like, Full(), 0.0, MarkovChain.fit)

    settings = EMSettings(tolerance=1e-13, max_iterations=2000)
    model, statistics, convergence = fit_em(initial_statistics, data, m_step, settings)
    assert convergence.converged
    again = m_step(statistics, model)
    np.testing.assert_allclose(again.means, model.means, atol=1e-5)
    np.testing.assert_allclose(
        expected_statistics(again, data).log_likelihood, convergence.log_likelihoods[-1], rtol=1e-9
    )


def test_mixture_equals_markov_chain_with_equal_rows(rng):
    """Weights w and a chain whose rows are all w give the same statistics."""
    model, x = random_model(rng, 1, 3, 2, markov=False), rng.normal(size=(1, 12, 2))
    weights = model.dynamics.weights
    chain = replace(model, dynamics=MarkovChain(weights, np.tile(weights, (3, 1))))
    a, b = (expected_statistics(m, Views(x, np.array([12]))) for m in (model, chain))
    np.testing.assert_allclose(a.log_likelihood, b.log_likelihood)
    np.testing.assert_allclose(a.moments[0].means, b.moments[0].means)


def test_labelled_statistics_count_no_transition_between_demonstrations():
    data = Views(np.zeros((1, 5, 1)), np.array([2, 3]))
    statistics = labelled_statistics(data, np.array([0, 1, 0, 0, 1]), 2)
    np.testing.assert_array_equal(statistics.transitions, [[1, 2], [0, 0]])
    np.testing.assert_array_equal(statistics.initial_counts, [2, 0])


def test_em_state_without_data_is_dropped_and_named(rng, make_demonstrations):
    """An initialisation with a state far from all data ends with one state fewer, without NaN."""
    demos = make_demonstrations(stops=2)
    fit = learn(demos, states=2, rng=rng, dynamics="markov")
    model = fit.markov_skill
    far = np.full_like(model.means[:, :1], 1e3)
    initialisation = HiddenModel(
        MarkovChain(np.full(3, 1 / 3), np.full((3, 3), 1 / 3)),
        np.concatenate([model.means, far], axis=1),
        tuple(DenseCovariances(np.concatenate([c.dense, np.eye(2)[None]])) for c in model.covariances),
    )
    reduced = learn(demos, states=3, rng=rng, initialisation=FromModel(initialisation))
    assert reduced.skill.states == 2
    assert reduced.convergence.dropped == ("state 2 of 3, left with 0 datapoints",)
    assert np.isfinite(reduced.skill.means).all()
    assert np.diff(reduced.log_likelihoods).min(initial=0.0) >= 0.0


def test_restarts_keep_most_likely_fit_and_are_reproducible(make_demonstrations):
    demos = make_demonstrations(stops=5, noise=0.5)

    def fit(restarts):
        settings = EMSettings(restarts=restarts)
        return learn(
            demos, states=4, rng=np.random.default_rng(7), initialisation=KMeans(), settings=settings
        )

    assert fit(6).log_likelihoods[-1] >= fit(1).log_likelihoods[-1]
    np.testing.assert_array_equal(fit(3).skill.means, fit(3).skill.means)


def test_constant_column_without_regularisation_raises(rng, make_demonstrations):
    demos = make_demonstrations(frames=1)
    flat = [
        replace(d, x=d.x * np.array([1.0, 0.0]), frames=make_demonstrations(frames=0)[0].frames)
        for d in demos
    ]
    message = r"state \d.*smallest mainly along column 1 .*regularisation"
    with pytest.raises(NotPositiveDefinite, match=message):
        learn(flat, states=2, rng=rng, settings=EMSettings(regularisation=0.0))
    assert np.isfinite(learn(flat, states=2, rng=rng).log_likelihoods).all()


def test_learn_accepts_duplicate_demonstration(rng, make_demonstrations):
    demo = make_demonstrations(lengths=(40,))[0]
    fit = learn([demo, demo], states=3, rng=rng)
    np.testing.assert_allclose(fit.skill.dynamics.initial.sum(), 1.0)
    assert np.isfinite(fit.log_likelihoods).all()


@pytest.mark.parametrize("initialisation", [TimeBins(), KMeans()])
def test_learn_more_states_than_data_raises(rng, make_demonstrations, initialisation):
    with pytest.raises(InvalidInput, match="5"):
        learn(make_demonstrations(lengths=(5,)), states=6, rng=rng, initialisation=initialisation)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"regularisation": -1.0}, "regularisation"),
        ({"tolerance": np.nan}, "tolerance"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"restarts": 0}, "restarts"),
        ({"duration_regularisation": 0.0}, "duration_regularisation"),
    ],
)
def test_settings_out_of_range_raise(change, match):
    with pytest.raises(InvalidInput, match=match):
        EMSettings(**change)


def test_learn_without_states_or_demonstrations_raises(rng, make_demonstrations):
    with pytest.raises(InvalidInput, match="states is 0, expected a whole number from 1"):
        learn(make_demonstrations(), states=0, rng=rng)
    with pytest.raises(InvalidInput, match="demonstrations is empty"):
        learn([], states=2, rng=rng)


def test_restarts_with_deterministic_initialisation_raise(rng, make_demonstrations):
    with pytest.raises(InvalidInput, match="jitter"):
        learn(
            make_demonstrations(),
            states=2,
            rng=rng,
            initialisation=TimeBins(),
            settings=EMSettings(restarts=3),
        )


class AlternatingInitialisation:
    """Time bins, but every other time a state with one point, whose covariance collapses."""

    def __init__(self):
        self.calls = 0

    def initial_statistics(self, views, states, rng):
        self.calls += 1
        labels = np.full(len(views.x[0]), 1)
        labels[0] = 0
        single = labelled_statistics(views, labels, 2)
        return single if self.calls % 2 else TimeBins().initial_statistics(views, states, rng)


def test_collapsed_restart_does_not_fail_the_fit(rng, make_demonstrations):
    """One fit is enough, and the collapsed ones are reported; if all collapse, their error is raised."""
    demos, plain = make_demonstrations(lengths=(40,)), EMSettings(regularisation=0.0, restarts=4)
    arguments = {"states": 2, "rng": rng, "dynamics": "markov"}
    fit = learn(demos, initialisation=AlternatingInitialisation(), settings=plain, **arguments)
    assert np.isfinite(fit.log_likelihoods).all()
    assert "2 of 4 restarts collapsed" in fit.convergence.reason
    with pytest.raises(NotPositiveDefinite):
        learn(
            demos,
            initialisation=AlternatingInitialisation(),
            settings=replace(plain, restarts=1),
            **arguments,
        )


def test_em_state_with_half_a_datapoint_is_dropped(rng, make_demonstrations):
    """A state with less than one datapoint would collapse onto it."""
    data = views(make_demonstrations(lengths=(40,), stops=1))
    initial_statistics = TimeBins().initial_statistics(data, 2, rng)
    thin = replace(
        initial_statistics,
        moments=tuple(replace(m, counts=np.array([39.5, 0.5])) for m in initial_statistics.moments),
    )

    def m_step(statistics, like):
        return maximise_likelihood(statistics, like, Full(), 1e-6, MarkovChain.fit)

    model, _, convergence = fit_em(thin, data, m_step, EMSettings())
    assert model.means.shape[1] == 1
    assert convergence.dropped == ("state 1 of 2, left with 0.5 datapoints",)
