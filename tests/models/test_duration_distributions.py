"""Maximum-likelihood fit of duration distributions to censored segments."""

from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest
from scipy import optimize, stats
from scipy.special import logsumexp

from pilotfish.errors import InvalidInput
from pilotfish.models.durations import (
    Gamma,
    Gaussian,
    Histogram,
    LogNormal,
    NegativeBinomial,
    Poisson,
    Segments,
)
from pilotfish.models.durations.fit import ExponentialFamily, complete_segments, evaluate_likelihood
from pilotfish.models.durations.histogram import _complete_segments
from pilotfish.models.durations.negative_binomial import _fit_shapes

FITS = {
    "gaussian": Gaussian.fit,
    "log-normal": LogNormal.fit,
    "gamma": Gamma.fit,
    "poisson": Poisson.fit,
    "negative-binomial": NegativeBinomial.fit,
    "geometric": partial(NegativeBinomial.fit, shape=1.0),
    "histogram": Histogram.fit,
}
S, K = 24, 3


def random_segments(rng, kinds=4):
    """Return segments with a length per state, of the first `kinds` of the four kinds of censoring."""
    places = rng.uniform(3.0, 15.0, size=K)
    counts = np.zeros((4, S, K))
    for kind in range(kinds):
        for k in range(K):
            lengths = np.clip(rng.normal(places[k], 3.0, size=8).round(), 1, S).astype(int)
            np.add.at(counts[kind, :, k], lengths - 1, rng.uniform(0.1, 2.0, size=8))
    return Segments(*counts)


def log_likelihood(durations, segments):
    """Compute the log-likelihood of every state by definition."""
    N = 1500  # longer durations have negligible probability
    log_p = durations.log_table(N)
    steps = np.arange(1.0, N + 1)[:, None]
    log_mean = logsumexp(log_p, b=steps, axis=0)
    total = np.zeros(segments.uncensored.shape[1])
    with np.errstate(divide="ignore"):
        for d in range(1, len(segments.uncensored) + 1):
            tail = logsumexp(log_p[d - 1 :], axis=0)
            excess = logsumexp(log_p[d - 1 :], b=steps[: N - d + 1], axis=0)
            for counts, log_weight in (
                (segments.uncensored, log_p[d - 1]),
                (segments.right_censored, tail),
                (segments.left_censored, tail - log_mean),
                (segments.doubly_censored, excess - log_mean),
            ):
                total += np.where(counts[d - 1] > 0.0, counts[d - 1] * np.maximum(log_weight, -1e9), 0.0)
    return total


def perturb_durations(durations, rng, size):
    """Return the same distribution with slightly different parameters."""
    if isinstance(durations, Histogram):
        p = durations.probabilities * np.exp(size * rng.normal(size=durations.probabilities.shape))
        return Histogram(p / p.sum(axis=0))
    new = {f.name: getattr(durations, f.name) * np.exp(size * rng.normal(size=K)) for f in fields(durations)}
    if isinstance(durations, Gaussian):
        new["means"] = np.maximum(new["means"], 1.0)  # the fit keeps the mean at one step or more
    if isinstance(durations, NegativeBinomial):
        new["exit_probs"] = np.minimum(new["exit_probs"], 1.0 - 1e-6)
        if (durations.shapes == 1.0).all():
            new["shapes"] = np.ones(K)
    return type(durations)(**new)


@pytest.mark.parametrize("kinds", [1, 2, 3, 4])
@pytest.mark.parametrize("name", FITS)
def test_estimate_is_local_maximum_of_likelihood(rng, name, kinds):
    """Uncensored, right-censored, left-censored and doubly censored segments, against the definition."""
    segments, durations = random_segments(rng, kinds), None
    if name == "negative-binomial" and kinds > 1:
        pytest.skip("with censored segments the shape converges over many calls")
    for _ in range(60 if name == "histogram" else 1):
        durations = FITS[name](segments, durations, 1e-3)
    best = log_likelihood(durations, segments)
    for size in (0.3, 0.03, 0.003):
        for _ in range(3):
            perturbed = log_likelihood(perturb_durations(durations, rng, size), segments)
            assert (perturbed <= best + 1e-5 * np.abs(best)).all()


@pytest.mark.parametrize("kinds", [1, 4])
@pytest.mark.parametrize("name", FITS)
def test_estimate_is_at_least_as_likely_as_previous(rng, name, kinds):
    """Also if the segments lie far in the tails of the previous distribution."""
    segments = random_segments(rng, kinds)
    for size in (0.01, 0.4):
        previous = perturb_durations(FITS[name](random_segments(rng), None, 0.25), rng, size)
        after = FITS[name](segments, previous, 0.25)
        before = log_likelihood(previous, segments)
        assert (log_likelihood(after, segments) >= before - 1e-9 * np.abs(before)).all()


def test_gradient_and_information_are_derivatives_of_the_log_likelihood(rng):
    """Finite differences, with segments of every kind of censoring."""
    segments = random_segments(rng)
    wide = np.full((2, K), np.inf)
    family = ExponentialFamily(
        lambda s: np.stack([np.log(s), s * 1.0], axis=1), lambda s: np.zeros((len(s), 1)), -wide, wide
    )
    theta = np.stack([rng.uniform(0.5, 3.0, K), rng.uniform(-0.9, -0.2, K)])
    (_, gradient, information, _), h = evaluate_likelihood(family, segments, theta), 1e-5
    for q in range(2):
        shift = h * np.eye(2)[:, q, None]
        above, below = (evaluate_likelihood(family, segments, theta + sign * shift) for sign in (1, -1))
        np.testing.assert_allclose((above[0] - below[0]) / (2 * h), gradient[q], rtol=1e-6)
        curvature = (above[1] - below[1]) / (2 * h)
        np.testing.assert_allclose(-curvature.T, information[:, q], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("name", ["gaussian", "log-normal", "gamma", "poisson", "negative-binomial"])
def test_equal_durations_keep_minimum_variance(name):
    """Three segments of 20 steps: their mean, and the minimum deviation or that of the distribution."""
    counts = np.zeros((30, 1))
    counts[19] = 3.0
    durations = FITS[name](Segments.all_uncensored(counts), None, 4.0)
    np.testing.assert_allclose(durations.means, 20.0, rtol=1e-2)
    if name in ("gaussian", "log-normal", "gamma"):
        np.testing.assert_allclose(durations.deviations, 2.0, rtol=2e-2)
    else:
        np.testing.assert_allclose(durations.deviations, np.sqrt(19.0), rtol=2e-2)


@pytest.mark.parametrize("kinds", [1, 4])
def test_fit_shapes_completed_segments_is_maximum(rng, kinds):
    """No neighbouring shape with its best exit probability is likelier, also for length-biased segments."""
    segments = random_segments(rng, kinds)
    shapes, stay_probs = np.array([2.0, 3.0, 1.5]), np.array([0.7, 0.6, 0.8])
    before = NegativeBinomial(shapes, 1.0 - stay_probs)
    log_p = before.log_table(400)
    counts = complete_segments(log_p, segments)
    length_biased = (segments.left_censored + segments.doubly_censored).sum(axis=0)
    actual = _fit_shapes(segments, shapes, stay_probs)
    more = np.arange(400)

    def best(k, r):
        def loss(p):
            log_q = stats.nbinom.logpmf(more, r, p)
            return length_biased[k] * np.log(1.0 + r * (1.0 - p) / p) - counts[:, k] @ log_q

        return -optimize.minimize_scalar(loss, bounds=(1e-4, 1 - 1e-6), method="bounded").fun

    for k in range(K):
        factors = (0.9, 1.1) if actual[k] < 9e3 else (0.9,)  # no shape is larger than 1e4
        assert best(k, actual[k]) >= max(best(k, near * actual[k]) for near in factors) - 1e-7


@pytest.mark.parametrize("name", FITS)
def test_state_without_segments_keeps_its_distribution(rng, name):
    segments = random_segments(rng, 2)
    previous = FITS[name](segments, None, 1.0)
    none = replace(
        segments,
        uncensored=segments.uncensored * [0, 1, 1],
        right_censored=segments.right_censored * [0, 1, 1],
    )
    np.testing.assert_allclose(FITS[name](none, previous, 1.0).means[0], previous.means[0])
    one = np.zeros((S, K))
    one[7] = [1.0, 0.0, 1e-9]
    alone = FITS[name](Segments.all_uncensored(one), None, 1.0)
    np.testing.assert_allclose(alone.means[[0, 2]], 8.0, rtol=0.3)
    assert np.isfinite(alone.means).all()
    assert (alone.deviations >= 0.0).all()


def test_histogram_fit_uncensored_equals_frequencies(rng):
    segments = Segments.all_uncensored(rng.uniform(size=(9, 2)))
    p = Histogram.fit(segments).probabilities
    np.testing.assert_allclose(p, segments.uncensored / segments.uncensored.sum(axis=0))
    spread = Histogram.fit(segments, pseudocount=2.0).probabilities
    expected = (segments.uncensored + 2.0 / 9) / (segments.uncensored.sum(axis=0) + 2.0)
    np.testing.assert_allclose(spread, expected)


@pytest.mark.parametrize("kinds", [1, 2, 3, 4])
@pytest.mark.parametrize("least", [1e-3, 1e-200, 1e-320, 0.0])
def test_complete_segments_linear_equals_logarithmic(rng, kinds, least):
    """Also if long segments have a tiny probability or none."""
    segments = random_segments(rng, kinds)
    p = rng.dirichlet(np.ones(len(segments.uncensored)), size=segments.uncensored.shape[1]).T
    p[len(p) // 2 :] *= least
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = complete_segments(np.log(p), segments)
        actual = _complete_segments(p, segments)
    np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-200)


def test_histogram_fit_right_censored_equals_kaplan_meier(rng):
    """Kaplan and Meier 1958: p(s > d) is the product over s <= d of 1 - ended(s) / at risk(s)."""
    segments, durations = random_segments(rng, 2), None
    last = np.zeros((S, K))
    last[-1] = 1.0  # uncensored of maximum length: no mass remains beyond
    segments = replace(segments, uncensored=segments.uncensored + last)
    for _ in range(300):
        durations = Histogram.fit(segments, durations)
    recorded = segments.uncensored + segments.right_censored
    at_risk = np.cumsum(recorded[::-1], axis=0)[::-1] - segments.right_censored
    survival = np.cumprod(1.0 - segments.uncensored / at_risk, axis=0)
    np.testing.assert_allclose(1.0 - np.cumsum(durations.probabilities, axis=0), survival, atol=1e-6)


def test_geometric_fit_right_censored_equals_departures_per_step(rng):
    """Shape one: departures over steps; right-censored segments count as steps only."""
    segments = random_segments(rng, 2)
    durations = NegativeBinomial.fit(segments, shape=1.0)
    steps = np.arange(1.0, S + 1) @ (segments.uncensored + segments.right_censored)
    departures = segments.uncensored.sum(axis=0)
    np.testing.assert_allclose(
        durations.exit_probs, departures / (steps - segments.right_censored.sum(axis=0)), rtol=1e-6
    )


def test_recorded_length_moments_state_without_segments_is_pooled():
    counts = np.zeros((5, 2))
    counts[[1, 3], 0] = 1.0
    means, variances = Segments.all_uncensored(counts).recorded_length_moments()
    np.testing.assert_allclose(means, [3.0, 3.0])
    np.testing.assert_allclose(variances, [1.0, 1.0])


def test_segments_of_different_lengths_add_up(rng):
    a, b = random_segments(rng), Segments(*np.ones((4, S + 3, K)))
    total = a + b
    for f in fields(total):
        np.testing.assert_allclose(getattr(total, f.name).sum(), getattr(a, f.name).sum() + K * (S + 3))
        np.testing.assert_array_equal(getattr(total, f.name), getattr(b + a, f.name))


def test_estimate_warm_starts_only_from_same_family(rng):
    segments = random_segments(rng, 1)
    other = Gaussian(np.full(K, 500.0), np.ones(K))
    for distribution in (LogNormal, Poisson):
        actual = distribution.fit(segments, other, 1.0)
        assert type(actual) is distribution
        np.testing.assert_allclose(actual.means, segments.recorded_length_moments()[0], rtol=0.1)


def test_fit_option_out_of_range_raises(rng):
    segments = random_segments(rng)
    with pytest.raises(InvalidInput, match="pseudocount is -1"):
        Histogram.fit(segments, pseudocount=-1.0)
    with pytest.raises(InvalidInput, match="shape is 0"):
        NegativeBinomial.fit(segments, shape=0.0)


@pytest.mark.parametrize("name", ["gamma", "poisson"])
def test_fit_parameter_changes_sign_converges(name):
    """A shape crosses one, or a mean two steps, without getting stuck at the change of sign."""
    counts = np.zeros((30, 1))
    counts[[0, 1, 2]] = [[8.0], [1.0], [1.0]]
    before = FITS[name](Segments.all_uncensored(counts), None, 1.0)
    counts = np.zeros((30, 1))
    counts[10:16] = 1.0
    after = FITS[name](Segments.all_uncensored(counts), before, 1.0)
    for _ in range(10):
        after = FITS[name](Segments.all_uncensored(counts), after, 1.0)
    np.testing.assert_allclose(after.means, 13.5, rtol=1e-3)
