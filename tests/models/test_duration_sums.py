"""Sums over all steps from a few of them, against sums written out."""

import numpy as np
import pytest
from pilotfish.models.segments import log_survival
from scipy.special import logsumexp, psi

from pilotfish.errors import InvalidInput
from pilotfish.models import (
    GammaDurations,
    GaussianDurations,
    HistogramDurations,
    LogNormal,
    LogNormalDurations,
    NegativeBinomialDurations,
    PoissonDurations,
    Segments,
)
from pilotfish.models.durations.fit import ExponentialFamily, complete_segments, evaluate_likelihood
from pilotfish.models.durations.negative_binomial import _decreasing_root
from pilotfish.models.durations.quadrature import gauss_nodes, make_quadrature, single_step_quadrature
from pilotfish.models.durations.sums import log_cumsum, log_reverse_cumsum, log_sum_exp

LONG = 2**19
WIDE_DURATIONS = {
    "gaussian": GaussianDurations(np.array([40.0, 900.0, 5000.0]), np.array([300.0, 20.0, 900.0])),
    "log-normal": LogNormalDurations(np.array([3.0, 5.0, 1.0]), np.array([1.0, 0.7, 0.3])),
    "gamma": GammaDurations(np.array([0.1, 2.0, 400.0]), np.array([1e-4, 3e-3, 0.1])),
    "poisson": PoissonDurations(np.array([3.0, 1000.0, 30000.0])),
    "negative binomial": NegativeBinomialDurations(np.array([0.2, 1.0, 50.0]), np.array([1e-4, 1e-3, 0.01])),
}


@pytest.fixture(params=WIDE_DURATIONS, scope="module")
def durations(request):
    return WIDE_DURATIONS[request.param]


@pytest.fixture(scope="module")
def sum_every_step(durations):
    """The laws at so many steps that nothing is left beyond them."""
    log_w = durations.log_weights(np.arange(1.0, LONG + 1.0))
    return log_w - logsumexp(log_w, axis=0)


@pytest.mark.parametrize("length", [64, 100, 4096, 2**30])
def test_a_block_of_steps_is_summed_exactly(length):
    """Every polynomial of degree 63 or less: Chebyshev's, and the sum of cubes by its formula."""
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


def test_moments_are_those_of_the_sum_over_every_step(durations, sum_every_step):
    p, steps = np.exp(sum_every_step), np.arange(1.0, LONG + 1.0)
    np.testing.assert_allclose(log_survival(durations, 1)[1][0], np.log(steps @ p), rtol=1e-12)
    if not isinstance(durations, GaussianDurations):
        np.testing.assert_allclose(durations.means, steps @ p, rtol=1e-11)
        spread = np.sqrt(((steps[:, None] - steps @ p) ** 2 * p).sum(axis=0))
        np.testing.assert_allclose(durations.deviations, spread, rtol=1e-10)


@pytest.mark.parametrize("longest", [1, 64, 65, 300])
def test_tails_are_those_of_the_sum_over_every_step(durations, sum_every_step, max_duration):
    found = log_survival(durations, max_duration)
    p = np.exp(sum_every_step)
    longer = np.cumsum(p[::-1], axis=0)[::-1]
    excess = np.cumsum(longer[::-1], axis=0)[::-1]
    for log_tail, expected in zip(found, (longer, excess), strict=True):
        assert log_tail.shape == (max_duration, 3)
        np.testing.assert_allclose(np.exp(log_tail), expected[:max_duration], rtol=1e-11)


@pytest.mark.parametrize("lost", [0.2, 1e-3, 1e-8])
def test_quantiles_are_those_of_the_sum_over_every_step(durations, sum_every_step, tail_probability):
    longer = np.cumsum(np.exp(sum_every_step)[::-1], axis=0)[::-1]
    assert (
        durations.max_duration(tail_probability)
        == 1 + np.flatnonzero((longer > tail_probability).any(axis=1))[-1]
    )


def test_a_rule_is_short(durations):
    """A few thousand nodes, where no law is narrow far out; a narrow one is followed step by step."""
    wide = LogNormalDurations(np.array([8.0]), np.array([2.0]))
    assert len(make_quadrature(wide.log_weights, 100).steps) < 4400
    broad = GaussianDurations(np.array([1e5]), np.array([3e3]))
    assert make_quadrature(broad.log_weights, 100).whole == 128
    narrow = GaussianDurations(np.array([5000.0]), np.array([3.0]))
    quadrature = make_quadrature(narrow.log_weights, 100)
    assert quadrature.single_steps >= 5000
    np.testing.assert_allclose(
        np.exp(log_sum_exp(narrow.log_weights(quadrature.steps) + quadrature.log_counts[:, None])),
        3.0 * np.sqrt(2.0 * np.pi),
        rtol=1e-12,
    )


@pytest.mark.parametrize("order", [1, 2])
def test_running_sums_over_a_rule_are_those_over_every_step(rng, durations, sum_every_step, order):
    """From the beginning and from the end, up to the last whole step and at the nodes beyond it."""
    quadrature = make_quadrature(durations.log_weights, 40)
    log_w = np.log(rng.random((40, 3)))
    weights = np.concatenate([np.exp(log_w), np.zeros((quadrature.single_steps, 3))])
    expected = weights
    for _ in range(order):
        expected = np.cumsum(expected, axis=0)
    found = np.exp(log_cumsum(log_w, quadrature, order))
    np.testing.assert_allclose(
        found[: quadrature.single_steps], expected[: quadrature.single_steps], rtol=1e-11
    )
    if len(quadrature.steps) > quadrature.single_steps:
        s = quadrature.steps[-1]
        once, twice = weights.sum(axis=0), (s - np.arange(1.0, 41.0) + 1.0) @ np.exp(log_w)
        np.testing.assert_allclose(found[-1], once if order == 1 else twice, rtol=1e-11)
    shares = durations.log_weights(quadrature.steps) + quadrature.log_counts[:, None]
    backward = log_reverse_cumsum(shares - log_sum_exp(shares), quadrature, 40, order)
    np.testing.assert_allclose(backward, log_survival(durations, 40)[order - 1], rtol=1e-11, atol=1e-12)


def test_likelihood_gradient_and_information_are_those_of_every_step(rng):
    """A law with a long tail and visits cut off in every way: a few nodes against every step."""
    S, K = 30, 2
    segments = Segments(*rng.random((4, S, K)))
    family = ExponentialFamily(
        lambda s: np.stack([np.log(s), np.log(s) ** 2], axis=1),
        lambda s: -np.log(s)[:, None],
        np.full((2, K), -np.inf),
        np.full((2, K), np.inf),
    )
    theta = np.array([[2.5, 3.0], [-0.5, -0.6]])
    found = evaluate_likelihood(family, segments, theta)
    N = 2**18
    steps = np.arange(1.0, N + 1.0)
    X = family.statistics(steps)
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
    np.testing.assert_allclose(found.value, value, rtol=1e-11)
    table = np.log(p)
    counts = complete_segments(table, segments)
    quadrature = make_quadrature(lambda s: family.statistics(s) @ theta + family.base(s), S)
    log_w = (
        family.statistics(quadrature.steps) @ theta
        + family.base(quadrature.steps)
        + quadrature.log_counts[:, None]
    )
    few = complete_segments(log_w - log_sum_exp(log_w), segments, quadrature)
    np.testing.assert_allclose(few.sum(axis=0), counts.sum(axis=0), rtol=1e-11)
    np.testing.assert_allclose(quadrature.steps @ few, steps @ counts, rtol=1e-10)
    met = (segments.left_censored + segments.doubly_censored).sum(axis=0)
    gradient = (
        X.T @ counts - counts.sum(axis=0) * (X.T @ p) - met * (X.T @ (p * steps[:, None] / mean) - X.T @ p)
    )
    np.testing.assert_allclose(found.gradient, gradient, rtol=1e-8, atol=1e-8)


def test_a_root_is_found_or_the_end_that_it_lies_beyond(rng):
    """Of slopes that fall: shapes of a negative binomial law, and where there is none."""
    roots = rng.uniform(-3.0, 6.0, 5)
    found = _decreasing_root(lambda x: psi(np.exp(roots)) - psi(np.exp(x)), np.zeros(5), -4.0, 9.0)
    np.testing.assert_allclose(found, roots, atol=1e-7)
    np.testing.assert_array_equal(
        _decreasing_root(lambda x: 1.0 + 0.0 * x, np.zeros(2), -4.0, 9.0), [9.0, 9.0]
    )
    np.testing.assert_array_equal(
        _decreasing_root(lambda x: -1.0 - x**2, np.zeros(2), -4.0, 9.0), [-4.0, -4.0]
    )


def test_a_histogram_and_a_table_need_no_rule():
    p = np.array([[0.25], [0.5], [0.25]])
    quadrature = single_step_quadrature(5)
    assert quadrature.single_steps == 5
    assert not quadrature.log_counts.any()
    log_longer, log_tail_sum = log_survival(HistogramDurations(p), 5)
    np.testing.assert_allclose(np.exp(log_longer)[:, 0], [1.0, 0.75, 0.25, 0.0, 0.0])
    np.testing.assert_allclose(np.exp(log_tail_sum)[:, 0], [2.0, 1.0, 0.25, 0.0, 0.0])


def test_a_law_may_be_as_wide_as_its_visits_are():
    """Lengths from one step to three thousand: the deviation of log s is theirs, 2.3, no less than 1.9."""
    counts = np.zeros((3000, 1))
    counts[[0, 2, 9, 29, 99, 299, 2999]] = 1.0
    none = np.zeros_like(counts)
    durations = LogNormal().estimate(Segments(counts, none, none, none), None, 1.0)
    assert durations.log_deviations[0] > 1.9


def test_many_states_of_long_broad_visits_need_few_steps_each():
    """256 states of a quarter of an hour at 100 Hz, as a long stream has them."""
    means = np.geomspace(10.0, 1e5, 256)
    durations = GaussianDurations(means, means)
    assert make_quadrature(durations.log_weights, 1).whole == 128


def test_narrow_visits_far_out_are_refused_and_recordings_of_that_length_are_not():
    """Only the steps that no caller asked for count."""
    narrow = GaussianDurations(np.full(8, 1e7), np.full(8, 1.0))
    with pytest.raises(InvalidInput, match="durations of 8 states reach 16777216 steps"):
        make_quadrature(narrow.log_weights, 1)
    assert make_quadrature(GaussianDurations(np.full(8, 5.0), np.ones(8)).log_weights, 10**6).whole == 2**20
