"""Expectation-maximisation: statistics are a fold, and the likelihood never falls."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from pilotfish.demonstrations import Views, views
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians import DenseCovariances, Diagonal, Full, SemiTied, Spherical, moments
from pilotfish.models import (
    EMSettings,
    Given,
    HiddenModel,
    KMeans,
    MarkovChain,
    TimeBins,
    Weights,
    improve,
    labelled_statistics,
    learn,
    learn_markov,
    learn_mixture,
    maximise,
    most_likely_chain,
    most_likely_weights,
    statistics,
)

STRUCTURES = [Full(), Diagonal(), Spherical(), SemiTied(1.0), SemiTied(0.5)]


def random_model(rng, P, K, D, markov=True):
    A = rng.normal(size=(P, K, D, D))
    covariances = A @ A.transpose(0, 1, 3, 2) + 0.5 * np.eye(D)
    chain = MarkovChain(rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K))
    dynamics = chain if markov else Weights(rng.dirichlet(np.ones(K)))
    return HiddenModel(dynamics, rng.normal(size=(P, K, D)), tuple(DenseCovariances(c) for c in covariances))


def every_path(model, x):
    """(states, log p(states, x)) for all K^T state sequences of one demonstration, by definition."""
    (P, T, _), K = x.shape, model.means.shape[1]
    log_b = np.zeros((T, K))
    for p, k in itertools.product(range(P), range(K)):
        log_b[:, k] += multivariate_normal(model.means[p, k], model.covariances[p].dense[k]).logpdf(x[p])
    for states in itertools.product(range(K), repeat=T):
        if isinstance(model.dynamics, Weights):
            log_p = sum(np.log(model.dynamics.weights[k]) for k in states)
        else:
            log_p = np.log(model.dynamics.initial[states[0]])
            log_p += sum(np.log(model.dynamics.transitions[i, j]) for i, j in itertools.pairwise(states))
        yield states, log_p + sum(log_b[t, k] for t, k in enumerate(states))


@pytest.mark.parametrize("markov", [True, False])
@pytest.mark.parametrize(("P", "K", "D", "T"), [(1, 2, 1, 5), (2, 3, 2, 4), (3, 1, 2, 3)])
def test_statistics_are_expectations_over_every_state_sequence(rng, markov, P, K, D, T):
    """Likelihood, masses, first states, transitions and moments, by listing all sequences."""
    model, x = random_model(rng, P, K, D, markov), rng.normal(size=(P, T, D))
    paths, log_p = zip(*every_path(model, x), strict=True)
    posterior = np.exp(log_p - logsumexp(log_p))
    shares, pairs = np.zeros((T, K)), np.zeros((K, K))
    for states, p in zip(paths, posterior, strict=True):
        shares[np.arange(T), states] += p
        np.add.at(pairs, (states[:-1], states[1:]), p)
    found = statistics(model, Views(x, np.array([T])))
    np.testing.assert_allclose(found.log_likelihood, logsumexp(log_p))
    np.testing.assert_allclose(found.first, shares[0])
    np.testing.assert_allclose(found.transitions, pairs, atol=1e-12)
    for p in range(P):
        expected = moments(x[p], shares)
        for name in ("mass", "means", "scatters"):
            np.testing.assert_allclose(getattr(found.moments[p], name), getattr(expected, name), atol=1e-10)


def test_statistics_of_halves_add_up_to_the_whole(rng, scene):
    """Learning is a fold: demonstrations may be summed up in parts, in any order, on any machine."""
    demos = scene(lengths=(20, 33, 27, 41))
    model = random_model(rng, 2, 3, 2)
    whole = statistics(model, views(demos))
    parts = statistics(model, views(demos[2:])) + statistics(model, views(demos[:2]))
    np.testing.assert_allclose(parts.log_likelihood, whole.log_likelihood)
    np.testing.assert_allclose(parts.transitions, whole.transitions)
    np.testing.assert_allclose(parts.first, whole.first)
    for a, b in zip(parts.moments, whole.moments, strict=True):
        np.testing.assert_allclose(a.means, b.means)
        np.testing.assert_allclose(a.scatters, b.scatters, atol=1e-9)


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: s.label)
@pytest.mark.parametrize("fit", [learn, learn_mixture])
def test_a_trace_never_falls_and_a_step_that_would_is_told(rng, scene, structure, fit):
    """Regularisation and partial tying can cost likelihood: the fit then ends before, and says why."""
    settings = EMSettings(regularisation=1e-2, tolerance=0.0, max_iterations=60)
    outcome = fit(scene(width=3, stops=4), states=4, rng=rng, structure=structure, settings=settings)
    assert np.diff(outcome.trace).min(initial=0.0) >= 0.0
    if "lost" in outcome.outcome.reason:
        assert outcome.outcome.iterations == len(outcome.trace) + 1


@pytest.mark.parametrize("structure", [Full(), Diagonal(), Spherical(), SemiTied(1.0)], ids=lambda s: s.label)
@pytest.mark.parametrize("frames", [1, 2, 3])
@pytest.mark.parametrize("chain", [most_likely_chain, most_likely_weights])
@pytest.mark.parametrize("start", [TimeBins(1.0), KMeans()], ids=["bins", "k-means"])
def test_the_likelihood_of_plain_expectation_maximisation_never_falls(
    rng, scene, structure, frames, chain, start
):
    """Without regularisation nothing is undone: every single step gains, to rounding."""
    data = views(scene(frames=frames, width=2, stops=3, lengths=(50, 60, 31), noise=0.3))
    model = maximise(start.guess(data, 3, rng), None, structure, 0.0, chain)
    values = []
    for _ in range(15):
        sums = statistics(model, data)
        values.append(sums.log_likelihood)
        model = maximise(sums, model, structure, 0.0, chain)
    assert np.diff(values).min() > -1e-9 * abs(values[-1])


def test_a_step_undone_by_much_is_no_convergence(rng, scene):
    """Half-tied and strongly regularised, the climb ends in a loss far above the tolerance."""
    settings = EMSettings(regularisation=0.3, tolerance=1e-12, max_iterations=300)
    ends = [
        learn(scene(stops=4, width=3), states=4, rng=rng, structure=SemiTied(0.5), settings=settings).outcome
        for _ in range(5)
    ]
    undone = [end for end in ends if "lost" in end.reason]
    assert undone
    assert not any(end.converged for end in undone)


def test_em_stops_where_it_can_gain_no_more(rng, scene):
    """At the end, one more M-step changes neither means nor likelihood."""
    data = views(scene())
    guess = TimeBins().guess(data, 3, rng)

    def m_step(sums, like):
        return maximise(sums, like, Full(), 0.0, most_likely_chain)

    run = improve(guess, data, m_step, EMSettings(tolerance=1e-13, max_iterations=2000))
    assert run.outcome.converged
    again = m_step(run.sums, run.model)
    np.testing.assert_allclose(again.means, run.model.means, atol=1e-5)
    np.testing.assert_allclose(statistics(again, data).log_likelihood, run.trace[-1], rtol=1e-9)


def test_a_mixture_is_the_markov_model_that_forgets(rng):
    """Weights w and a chain whose rows are all w give the same statistics."""
    model, x = random_model(rng, 1, 3, 2, markov=False), rng.normal(size=(1, 12, 2))
    weights = model.dynamics.weights
    chain = replace(model, dynamics=MarkovChain(weights, np.tile(weights, (3, 1))))
    a, b = (statistics(m, Views(x, np.array([12]))) for m in (model, chain))
    np.testing.assert_allclose(a.log_likelihood, b.log_likelihood)
    np.testing.assert_allclose(a.moments[0].means, b.moments[0].means)


def test_labels_count_no_step_from_one_demonstration_to_the_next():
    data = Views(np.zeros((1, 5, 1)), np.array([2, 3]))
    sums = labelled_statistics(data, np.array([0, 1, 0, 0, 1]), 2)
    np.testing.assert_array_equal(sums.transitions, [[1, 2], [0, 0]])
    np.testing.assert_array_equal(sums.first, [2, 0])


def test_a_state_that_loses_its_data_is_dropped_and_named(rng, scene):
    """A start with a state far from everything ends with one state fewer and says so; nothing is NaN."""
    demos = scene(stops=2)
    fit = learn_markov(demos, states=2, rng=rng)
    model = fit.markov
    far = np.full_like(model.means[:, :1], 1e3)
    start = HiddenModel(
        MarkovChain(np.full(3, 1 / 3), np.full((3, 3), 1 / 3)),
        np.concatenate([model.means, far], axis=1),
        tuple(DenseCovariances(np.concatenate([c.dense, np.eye(2)[None]])) for c in model.covariances),
    )
    lost = learn(demos, states=3, rng=rng, start=Given(start))
    assert lost.skill.states == 2
    assert lost.outcome.dropped == ("state 2 of 3, left with 0 datapoints",)
    assert np.isfinite(lost.skill.means).all()
    assert np.diff(lost.trace).min(initial=0.0) >= 0.0


def test_restarts_keep_the_likeliest_and_a_seed_repeats_everything(scene):
    demos = scene(stops=5, noise=0.5)

    def fit(restarts):
        settings = EMSettings(restarts=restarts)
        return learn(demos, states=4, rng=np.random.default_rng(7), start=KMeans(), settings=settings)

    assert fit(6).trace[-1] >= fit(1).trace[-1]
    np.testing.assert_array_equal(fit(3).skill.means, fit(3).skill.means)


def test_a_constant_column_needs_regularisation_and_the_error_says_so(rng, scene):
    demos = scene(frames=1)
    flat = [replace(d, x=d.x * np.array([1.0, 0.0]), frames=scene(frames=0)[0].frames) for d in demos]
    with pytest.raises(NotPositiveDefinite, match=r"state \d.*flattest along column 1 .*regularisation"):
        learn(flat, states=2, rng=rng, settings=EMSettings(regularisation=0.0))
    assert np.isfinite(learn(flat, states=2, rng=rng).trace).all()


def test_a_duplicate_demonstration_is_no_trouble(rng, scene):
    one = scene(lengths=(40,))[0]
    fit = learn([one, one], states=3, rng=rng)
    np.testing.assert_allclose(fit.skill.dynamics.initial.sum(), 1.0)
    assert np.isfinite(fit.trace).all()


@pytest.mark.parametrize("start", [TimeBins(), KMeans()])
def test_more_states_than_data_are_refused_with_the_number_there_is(rng, scene, start):
    with pytest.raises(InvalidInput, match="5"):
        learn(scene(lengths=(5,)), states=6, rng=rng, start=start)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"regularisation": -1.0}, "regularisation"),
        ({"tolerance": np.nan}, "tolerance"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"restarts": 0}, "restarts"),
        ({"duration_floor": 0.0}, "duration_floor"),
    ],
)
def test_settings_out_of_range_are_refused(change, match):
    with pytest.raises(InvalidInput, match=match):
        EMSettings(**change)


def test_no_state_and_no_demonstration_are_refused(rng, scene):
    with pytest.raises(InvalidInput, match="states is 0, expected a whole number from 1"):
        learn(scene(), states=0, rng=rng)
    with pytest.raises(InvalidInput, match="no demonstrations"):
        learn([], states=2, rng=rng)


def test_restarts_that_would_repeat_themselves_are_refused(rng, scene):
    with pytest.raises(InvalidInput, match="jitter"):
        learn(scene(), states=2, rng=rng, start=TimeBins(), settings=EMSettings(restarts=3))


class EveryOther:
    """Time bins, but every other time a state of one single point, which no covariance can hold."""

    def __init__(self):
        self.calls = 0

    def guess(self, views, states, rng):
        self.calls += 1
        labels = np.full(len(views.x[0]), 1)
        labels[0] = 0
        single = labelled_statistics(views, labels, 2)
        return single if self.calls % 2 else TimeBins().guess(views, states, rng)


def test_a_restart_that_collapses_does_not_take_the_others_with_it(rng, scene):
    """One good end is enough, the collapsed ones are told; when all collapse the error is theirs."""
    demos, plain = scene(lengths=(40,)), EMSettings(regularisation=0.0, restarts=4)
    fit = learn_markov(demos, states=2, rng=rng, start=EveryOther(), settings=plain)
    assert np.isfinite(fit.trace).all()
    assert "2 of 4 restarts collapsed" in fit.outcome.reason
    with pytest.raises(NotPositiveDefinite):
        learn_markov(demos, states=2, rng=rng, start=EveryOther(), settings=replace(plain, restarts=1))


def test_a_state_with_half_a_datapoint_is_dropped(rng, scene):
    """Less than one point's worth is no state: it would shrink onto that point."""
    data = views(scene(lengths=(40,), stops=1))
    guess = TimeBins().guess(data, 2, rng)
    thin = replace(guess, moments=tuple(replace(m, mass=np.array([39.5, 0.5])) for m in guess.moments))

    def m_step(sums, like):
        return maximise(sums, like, Full(), 1e-6, most_likely_chain)

    run = improve(thin, data, m_step, EMSettings())
    assert run.model.means.shape[1] == 1
    assert run.outcome.dropped == ("state 1 of 2, left with 0.5 datapoints",)
