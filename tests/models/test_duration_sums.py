"""Quadrature over whole steps against explicit sums."""

import numpy as np
import pytest
from scipy.special import logsumexp, psi

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
from pilotfish.models.durations.negative_binomial import _decreasing_root
from pilotfish.models.durations.quadrature import gauss_nodes, make_quadrature, single_step_quadrature
from pilotfish.models.durations.sums import log_cumsum, log_reverse_cumsum, log_sum_exp

LONG = 2**19
WIDE_DURATIONS = {
    "gaussian": Gaussian(np.array([40.0, 900.0, 5000.0]), np.array([300.0, 20.0, 900.0])),
    "log-normal": LogNormal(np.array([3.0, 5.0, 1.0]), np.array([1.0, 0.7, 0.3])),
    "gamma": Gamma(np.array([0.1, 2.0, 400.0]), np.array([1e-4, 3e-3, 0.1])),
    "poisson": Poisson(np.array([3.0, 1000.0, 30000.0])),
    "negative binomial": NegativeBinomial(np.array([0.2, 1.0, 50.0]), np.array([1e-4, 1e-3, 0.01])),
}


@pytest.fixture(params=WIDE_DURATIONS, scope="module")
def durations(request):
    return WIDE_DURATIONS[request.param]


@pytest.fixture(scope="module")
def sum_every_step(durations):
    """Return log p(s) up to a step beyond which the tail is negligible."""
    log_w = durations.log_weights(np.arange(1.0, LONG + 1.0))
    return log_w - logsumexp(log_w, axis=0)


@pytest.mark.parametrize("length", [64, 100, 4096, 2**30])
def test_gauss_nodes_sum_polynomials_exactly(length):
    """Chebyshev polynomials up to degree 63, and the sum of cubes by its formula."""
    nodes, weights = gauss_nodes(length)
    assert nodes.min() > 1.0
    assert nodes.max() < length
    np.testing.assert_allclose(weights.sum(), length, rtol=1e-13)
    np.testing.assert_allclose(weights @ nodes**3, (length * (length + 1.0) / 2.0) ** 2, rtol=1e-12)
    if length <= 4096:
        steps = np.arange(1.0, length + 1.0)
        for degree in range(64):
            p = np.polynomial.Chebyshev.basis(degree, domain=[1.0, length])
            np.testing.assert_allclose(weights @ p(nodes), p(steps).sum(), atol=1e-11 * length)


def test_moments_equal_explicit_sums(durations, sum_every_step):
    p, steps = np.exp(sum_every_step), np.arange(1.0, LONG + 1.0)
    np.testing.assert_allclose(durations.log_survival(1)[1][0], np.log(steps @ p), rtol=1e-12)
    if not isinstance(durations, Gaussian):
        np.testing.assert_allclose(durations.means, steps @ p, rtol=1e-11)
        spread = np.sqrt(((steps[:, None] - steps @ p) ** 2 * p).sum(axis=0))
        np.testing.assert_allclose(durations.deviations, spread, rtol=1e-10)


@pytest.mark.parametrize("max_duration", [1, 64, 65, 300])
def test_log_survival_equals_explicit_sums(durations, sum_every_step, max_duration):
    actual = durations.log_survival(max_duration)
    p = np.exp(sum_every_step)
    longer = np.cumsum(p[::-1], axis=0)[::-1]
    excess = np.cumsum(longer[::-1], axis=0)[::-1]
    for log_tail, expected in zip(actual, (longer, excess), strict=True):
        assert log_tail.shape == (max_duration, 3)
        np.testing.assert_allclose(np.exp(log_tail), expected[:max_duration], rtol=1e-11)


@pytest.mark.parametrize("tail_probability", [0.2, 1e-3, 1e-8])
def test_max_duration_equals_explicit_quantile(durations, sum_every_step, tail_probability):
    longer = np.cumsum(np.exp(sum_every_step)[::-1], axis=0)[::-1]
    assert (
        durations.max_duration(tail_probability)
        == 1 + np.flatnonzero((longer > tail_probability).any(axis=1))[-1]
    )


def test_quadrature_wide_distribution_has_few_nodes(durations):
    """A narrow distribution is summed step by step."""
    wide = LogNormal(np.array([8.0]), np.array([2.0]))
    assert len(make_quadrature(wide.log_weights, 100).steps) < 4400
    broad = Gaussian(np.array([1e5]), np.array([3e3]))
    assert make_quadrature(broad.log_weights, 100).single_steps == 128
    narrow = Gaussian(np.array([5000.0]), np.array([3.0]))
    quadrature = make_quadrature(narrow.log_weights, 100)
    assert quadrature.single_steps >= 5000
    np.testing.assert_allclose(
        np.exp(log_sum_exp(narrow.log_weights(quadrature.steps) + quadrature.log_counts[:, None])),
        3.0 * np.sqrt(2.0 * np.pi),
        rtol=1e-12,
    )


@pytest.mark.parametrize("order", [1, 2])
def test_running_sums_equal_explicit_sums(rng, durations, sum_every_step, order):
    """Forwards and backwards, at single steps and at nodes beyond them."""
    quadrature = make_quadrature(durations.log_weights, 40)
    log_w = np.log(rng.random((40, 3)))
    weights = np.concatenate([np.exp(log_w), np.zeros((quadrature.single_steps, 3))])
    expected = weights
    for _ in range(order):
        expected = np.cumsum(expected, axis=0)
    actual = np.exp(log_cumsum(log_w, quadrature, order))
    np.testing.assert_allclose(
        actual[: quadrature.single_steps], expected[: quadrature.single_steps], rtol=1e-11
    )
    if len(quadrature.steps) > quadrature.single_steps:
        s = quadrature.steps[-1]
        once, twice = weights.sum(axis=0), (s - np.arange(1.0, 41.0) + 1.0) @ np.exp(log_w)
        np.testing.assert_allclose(actual[-1], once if order == 1 else twice, rtol=1e-11)
    shares = durations.log_weights(quadrature.steps) + quadrature.log_counts[:, None]
    backward = log_reverse_cumsum(shares - log_sum_exp(shares), quadrature, 40, order)
    np.testing.assert_allclose(backward, durations.log_survival(40)[order - 1], rtol=1e-11, atol=1e-12)


def test_likelihood_and_gradient_heavy_tail_equal_explicit_sums(rng):
    """Segments of every kind of censoring: a few nodes against every step."""
    S, K = 30, 2
    segments = Segments(*rng.random((4, S, K)))
    family = ExponentialFamily(
        lambda s: np.stack([np.log(s), np.log(s) ** 2], axis=1),
        lambda s: -np.log(s)[:, None],
        np.full((2, K), -np.inf),
        np.full((2, K), np.inf),
    )
    theta = np.array([[2.5, 3.0], [-0.5, -0.6]])
    actual_value, actual_gradient, *_ = evaluate_likelihood(family, segments, theta)
    N = 2**18
    steps = np.arange(1.0, N + 1.0)
    X = family.sufficient_statistics(steps)
    p = np.exp(X @ theta + family.base(steps))
    p /= p.sum(axis=0)
    mean = steps @ p
    longer = np.cumsum(p[::-1], axis=0)[::-1][:S]
    excess = np.stack([np.maximum(steps - d + 1.0, 0.0) @ p for d in range(1, S + 1)])
    value = (
        segments.uncensored * np.log(p[:S])
        + segments.right_censored * np.log(longer)
        + segments.left_censored * np.log(longer / mean)
        + segments.doubly_censored * np.log(excess / mean)
    ).sum(axis=0)
    np.testing.assert_allclose(actual_value, value, rtol=1e-11)
    table = np.log(p)
    counts = complete_segments(table, segments)
    quadrature = make_quadrature(lambda s: family.sufficient_statistics(s) @ theta + family.base(s), S)
    log_w = (
        family.sufficient_statistics(quadrature.steps) @ theta
        + family.base(quadrature.steps)
        + quadrature.log_counts[:, None]
    )
    few = complete_segments(log_w - log_sum_exp(log_w), segments, quadrature)
    np.testing.assert_allclose(few.sum(axis=0), counts.sum(axis=0), rtol=1e-11)
    np.testing.assert_allclose(quadrature.steps @ few, steps @ counts, rtol=1e-10)
    length_biased = (segments.left_censored + segments.doubly_censored).sum(axis=0)
    gradient = (
        X.T @ counts
        - counts.sum(axis=0) * (X.T @ p)
        - length_biased * (X.T @ (p * steps[:, None] / mean) - X.T @ p)
    )
    np.testing.assert_allclose(actual_gradient, gradient, rtol=1e-8, atol=1e-8)


def test_decreasing_root_is_found_or_bound_is_returned(rng):
    """Derivatives as of negative binomial shapes, and functions without a root."""
    roots = rng.uniform(-3.0, 6.0, 5)
    actual = _decreasing_root(lambda x: psi(np.exp(roots)) - psi(np.exp(x)), np.zeros(5), -4.0, 9.0)
    np.testing.assert_allclose(actual, roots, atol=1e-7)
    np.testing.assert_array_equal(
        _decreasing_root(lambda x: 1.0 + 0.0 * x, np.zeros(2), -4.0, 9.0), [9.0, 9.0]
    )
    np.testing.assert_array_equal(
        _decreasing_root(lambda x: -1.0 - x**2, np.zeros(2), -4.0, 9.0), [-4.0, -4.0]
    )


def test_histogram_log_survival_uses_single_steps():
    p = np.array([[0.25], [0.5], [0.25]])
    quadrature = single_step_quadrature(5)
    assert quadrature.single_steps == 5
    assert not quadrature.log_counts.any()
    log_longer, log_tail_sum = Histogram(p).log_survival(5)
    np.testing.assert_allclose(np.exp(log_longer)[:, 0], [1.0, 0.75, 0.25, 0.0, 0.0])
    np.testing.assert_allclose(np.exp(log_tail_sum)[:, 0], [2.0, 1.0, 0.25, 0.0, 0.0])


def test_log_normal_fit_wide_segments_keeps_their_width():
    """Lengths from one step to three thousand have a log-deviation of 2.3; the fit gives at least 1.9."""
    counts = np.zeros((3000, 1))
    counts[[0, 2, 9, 29, 99, 299, 2999]] = 1.0
    durations = LogNormal.fit(Segments.all_uncensored(counts))
    assert durations.log_deviations[0] > 1.9


def test_quadrature_many_wide_states_has_few_single_steps():
    """256 states with durations up to a quarter of an hour at 100 Hz."""
    means = np.geomspace(10.0, 1e5, 256)
    durations = Gaussian(means, means)
    assert make_quadrature(durations.log_weights, 1).single_steps == 128


def test_quadrature_narrow_distribution_far_out_raises():
    """Steps up to the maximum duration of the caller do not count."""
    narrow = Gaussian(np.full(8, 1e7), np.full(8, 1.0))
    with pytest.raises(InvalidInput, match="durations of 8 states reach 16777216 steps"):
        make_quadrature(narrow.log_weights, 1)
    assert make_quadrature(Gaussian(np.full(8, 5.0), np.ones(8)).log_weights, 10**6).single_steps == 2**20


def test_parameters_changed_in_place_change_kept_tables():
    """Short tables are kept by the values of the parameters, and cannot be altered by their reader."""
    durations = Poisson(np.array([3.0, 20.0]))
    before, longest = durations.log_survival(9)[0], durations.max_duration(1e-6)
    assert durations.log_survival(9)[0] is before
    with pytest.raises(ValueError, match="read-only"):
        before[0] = 0.0
    durations.rates[:] = 2.0 * durations.rates
    fresh = Poisson(np.array([6.0, 40.0]))
    np.testing.assert_array_equal(durations.log_survival(9)[0], fresh.log_survival(9)[0])
    assert durations.max_duration(1e-6) > longest
    assert (durations.log_survival(9)[0][1:] > before[1:]).all()
