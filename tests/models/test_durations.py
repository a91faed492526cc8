"""Duration distributions against densities of SciPy and explicit sums."""

import numpy as np
import pytest
from scipy import stats
from scipy.special import logsumexp

from pilotfish.models.durations import Gamma, Gaussian, Histogram, LogNormal, NegativeBinomial, Poisson

STEPS = np.arange(1, 20_001)


def column(*values):
    return np.array(values, float)


# Each distribution with its log-density at whole steps, up to a constant, by state.
DISTRIBUTIONS = {
    "gaussian": (
        Gaussian(column(12.0, 1.0, -5.0, 300.0), column(3.0, 0.7, 2.0, 0.1)),
        lambda s, k: stats.norm.logpdf(s, (12.0, 1.0, -5.0, 300.0)[k], (3.0, 0.7, 2.0, 0.1)[k]),
    ),
    "log-normal": (
        LogNormal(column(3.0, 0.0, 2.0, 5.0), column(0.5, 0.3, 0.8, 0.01)),
        lambda s, k: stats.lognorm.logpdf(s, (0.5, 0.3, 0.8, 0.01)[k], scale=np.exp((3.0, 0.0, 2.0, 5.0)[k])),
    ),
    "gamma": (
        Gamma(column(9.0, 0.2, 1.0, 2000.0), column(0.5, 1.0, 0.01, 10.0)),
        lambda s, k: stats.gamma.logpdf(s, (9.0, 0.2, 1.0, 2000.0)[k], scale=1 / (0.5, 1.0, 0.01, 10.0)[k]),
    ),
    "poisson": (
        Poisson(column(5.0, 0.01, 80.0, 1.0)),
        lambda s, k: stats.poisson.logpmf(s - 1, (5.0, 0.01, 80.0, 1.0)[k]),
    ),
    "negative binomial": (
        NegativeBinomial(column(1.0, 0.3, 7.5, 500.0), column(0.2, 0.02, 0.4, 0.9)),
        lambda s, k: stats.nbinom.logpmf(s - 1, (1.0, 0.3, 7.5, 500.0)[k], (0.2, 0.02, 0.4, 0.9)[k]),
    ),
}


@pytest.fixture(params=DISTRIBUTIONS)
def distribution(request):
    return DISTRIBUTIONS[request.param]


@pytest.mark.parametrize("max_duration", [1, 7, 300])
def test_log_table_equals_normalised_density(distribution, max_duration):
    """Also far in the tails, where probabilities underflow."""
    durations, log_density = distribution
    table = durations.log_table(max_duration)
    assert table.shape == (max_duration, 4)
    for k in range(4):
        log_p = log_density(STEPS, k)
        np.testing.assert_allclose(
            table[:, k], (log_p - logsumexp(log_p))[:max_duration], rtol=1e-9, atol=1e-9
        )


def test_means_and_deviations_equal_sums_over_whole_steps(distribution):
    """All but those of the Gaussian, which are its parameters before truncation."""
    durations, log_density = distribution
    if isinstance(durations, Gaussian):
        return
    for k in range(4):
        log_p = log_density(STEPS, k)
        p = np.exp(log_p - logsumexp(log_p))
        np.testing.assert_allclose(durations.means[k], p @ STEPS, rtol=1e-9)
        np.testing.assert_allclose(durations.deviations[k] ** 2, p @ (STEPS - p @ STEPS) ** 2, rtol=1e-6)


@pytest.mark.parametrize("tail_probability", [0.3, 1e-3, 1e-12])
def test_max_duration_is_smallest_with_given_tail_probability(distribution, tail_probability):
    durations, log_density = distribution
    outlasted = []
    for k in range(4):
        log_p = log_density(STEPS, k)
        tail = np.append(np.cumsum(np.exp(log_p - logsumexp(log_p))[::-1])[::-1], 0.0)
        outlasted.append(np.flatnonzero(tail[1:] <= tail_probability)[0] + 1)
    assert durations.max_duration(tail_probability) == max(outlasted)


@pytest.mark.parametrize("max_duration", [1, 5, 120])
def test_log_survival_equals_sums_of_density(distribution, max_duration):
    durations, log_density = distribution
    log_tail, log_tail_sum = durations.log_survival(max_duration)
    for k in range(4):
        log_p = log_density(STEPS, k)
        log_p = log_p - logsumexp(log_p)
        for d in {1, (max_duration + 1) // 2, max_duration}:
            expected = logsumexp(log_p[d - 1 :]), logsumexp(log_p[d - 1 :], b=STEPS[d - 1 :] - d + 1.0)
            actual = log_tail[d - 1, k], log_tail_sum[d - 1, k]
            np.testing.assert_allclose(actual, expected, rtol=1e-8, atol=1e-9)


def test_negative_binomial_shape_one_is_geometric():
    """The exit probability is the same at every step, as in a Markov chain."""
    table = NegativeBinomial(column(1.0), column(0.3)).log_table(50)
    np.testing.assert_allclose(np.exp(table[:, 0]), 0.3 * 0.7 ** np.arange(50))


def test_histogram_table_equals_its_probabilities(rng):
    p = rng.dirichlet(np.ones(6), size=2).T
    p[5, 0], p[:5, 0] = 0.0, p[:5, 0] / p[:5, 0].sum()
    durations = Histogram(p)
    np.testing.assert_allclose(np.exp(durations.log_table(9)), np.vstack([p, np.zeros((3, 2))]))
    np.testing.assert_allclose(np.exp(durations.log_table(4)), p[:4])
    np.testing.assert_allclose(durations.means, np.arange(1, 7) @ p)
    np.testing.assert_allclose(durations.deviations**2, np.arange(1, 7) ** 2 @ p - durations.means**2)
    assert durations.max_duration(0.0) == 6
    np.testing.assert_allclose(np.exp(durations.log_survival(8)[1][0]), durations.means)
