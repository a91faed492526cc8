"""Regression over time, compared with enumeration of all state paths and finite differences."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians import Gaussian, condition, marginal
from pilotfish.geometry import quaternion_exp
from pilotfish.models import (
    AdaptedSkill,
    Censoring,
    MarkovChain,
    MixtureWeights,
    SemiMarkovChain,
    filtered_regression,
    smoothed_regression,
)
from pilotfish.models.durations import Gaussian as DurationGaussian
from pilotfish.planning import tangent_chart

K, D = 3, 3
INPUTS = np.array([2, 0])


def markov(rng):
    return MarkovChain(rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K))


def semi_markov(rng):
    """Return a chain whose last state is final."""
    transitions = rng.random((K, K)) * (1.0 - np.eye(K))
    transitions[-1] = 0.0
    transitions[:-1] /= transitions[:-1].sum(axis=1, keepdims=True)
    durations = DurationGaussian(rng.uniform(1.0, 3.0, K), rng.uniform(0.5, 1.0, K))
    return SemiMarkovChain(rng.dirichlet(np.ones(K)), transitions, durations)


def skill(rng, dynamics):
    A = rng.normal(size=(K, D, D))
    covariances = A @ A.transpose(0, 2, 1) + 0.1 * np.eye(D)
    layout = Layout((Part("place", Quantity.SCALAR, D, "m"),))
    return AdaptedSkill(dynamics, 2.0 * rng.normal(size=(K, D)), covariances, layout, 0.1)


def log_prior(dynamics, path):
    """Return log p of a state path whose last segment is right-censored."""
    with np.errstate(divide="ignore"):
        log_initial, log_A = np.log(dynamics.initial), np.log(dynamics.transitions)
    if isinstance(dynamics, MarkovChain):
        return log_initial[path[0]] + sum(log_A[i, j] for i, j in itertools.pairwise(path))
    segments = [(k, len(list(steps))) for k, steps in itertools.groupby(path)]
    table = np.exp(dynamics.durations.log_table(60))
    log_p = log_initial[segments[0][0]] + sum(log_A[i[0], j[0]] for i, j in itertools.pairwise(segments))
    log_p += sum(np.log(table[length - 1, k]) for k, length in segments[:-1])
    last, length = segments[-1]
    return log_p + (np.log(table[length - 1 :, last].sum()) if dynamics.transitions[last].any() else 0.0)


def regression_by_enumeration(model, x, t):
    """Return mean and covariance of the output at step t given inputs x, by enumeration of paths."""
    densities, conditionals = np.empty((len(x), K)), []
    for k in range(K):
        state = Gaussian(model.means[k], model.covariances[k])
        own = marginal(state, INPUTS)
        densities[:, k] = multivariate_normal(own.mean, own.covariance).logpdf(x)
        conditionals.append(condition(state, INPUTS, x[t]))
    total, first, second = 0.0, 0.0, 0.0
    for path in itertools.product(range(K), repeat=len(x)):
        p = np.exp(log_prior(model.dynamics, path) + densities[np.arange(len(x)), list(path)].sum())
        conditional = conditionals[path[t]]
        total, first = total + p, first + p * conditional.mean
        second = second + p * (conditional.covariance + np.outer(conditional.mean, conditional.mean))
    mean = first / total
    return mean, second / total - np.outer(mean, mean)


@pytest.mark.parametrize("chain", [markov, semi_markov])
def test_filtered_regression_equals_enumeration(rng, chain):
    model, x = skill(rng, chain(rng)), 2.0 * rng.normal(size=(5, 2))
    regression = filtered_regression(model, INPUTS, x)
    for t in range(5):
        mean, covariance = regression_by_enumeration(model, x[: t + 1], t)
        np.testing.assert_allclose(regression.means[t], mean, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(regression.covariances[t], covariance, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("chain", [markov, semi_markov])
def test_smoothed_regression_equals_enumeration(rng, chain):
    model, x = skill(rng, chain(rng)), 2.0 * rng.normal(size=(5, 2))
    regression = smoothed_regression(model, INPUTS, x)
    for t in range(5):
        mean, covariance = regression_by_enumeration(model, x, t)
        np.testing.assert_allclose(regression.means[t], mean, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(regression.covariances[t], covariance, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("regress_over_time", [filtered_regression, smoothed_regression])
@pytest.mark.parametrize("chain", [markov, semi_markov])
def test_regression_jacobian_equals_finite_difference(rng, chain, regress_over_time):
    """Responsibilities change with the input of the step; those of other steps do not."""
    model, x = skill(rng, chain(rng)), rng.normal(size=(6, 2))
    exact = regress_over_time(model, INPUTS, x).jacobians
    for t, i in itertools.product(range(6), range(2)):
        step = np.zeros_like(x)
        step[t, i] = 1e-5
        more, less = (
            regress_over_time(model, INPUTS, x + step).means[t],
            regress_over_time(model, INPUTS, x - step).means[t],
        )
        np.testing.assert_allclose(exact[t, :, i], (more - less) / 2e-5, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("chain", [markov, semi_markov])
def test_filtered_regression_equals_smoothed_at_last_step(rng, chain):
    """At earlier steps they differ."""
    model, x = skill(rng, chain(rng)), rng.normal(size=(30, 2))
    filtered, smoothed = filtered_regression(model, INPUTS, x), smoothed_regression(model, INPUTS, x)
    np.testing.assert_allclose(filtered.means[-1], smoothed.means[-1], rtol=1e-8)
    np.testing.assert_allclose(filtered.covariances[-1], smoothed.covariances[-1], rtol=1e-7)
    assert not np.allclose(filtered.means, smoothed.means)


def test_filtered_regression_is_causal(rng):
    model, x = skill(rng, semi_markov(rng)), rng.normal(size=(9, 2))
    whole, beginning = filtered_regression(model, INPUTS, x), filtered_regression(model, INPUTS, x[:4])
    np.testing.assert_allclose(whole.means[:4], beginning.means, rtol=1e-9)


def test_regression_memoryless_chain_equals_mixture(rng):
    """With equal rows of transitions, steps are independent."""
    weights = rng.dirichlet(np.ones(K))
    forgetful = skill(rng, MarkovChain(weights, np.tile(weights, (K, 1))))
    mixture, x = replace(forgetful, dynamics=MixtureWeights(weights)), rng.normal(size=(4, 2))
    expected = mixture.as_mixture().regress(INPUTS, x)
    for model in (forgetful, mixture):
        for regress_over_time in (filtered_regression, smoothed_regression):
            regression = regress_over_time(model, INPUTS, x)
            np.testing.assert_allclose(regression.means, expected.means)
            np.testing.assert_allclose(regression.covariances, expected.covariances, rtol=1e-6)
            np.testing.assert_allclose(regression.jacobians, expected.jacobians, rtol=1e-6)


def test_filtered_regression_equal_inputs_are_distinguished_by_past():
    """On a path out and back along one line; a mixture predicts the mean of both."""
    means = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0], [1.0, -1.0], [0.0, 0.0]])
    chain = SemiMarkovChain(np.eye(5)[0], np.eye(5, k=1), DurationGaussian(np.full(5, 4.0), np.full(5, 1.0)))
    layout = Layout((Part("place", Quantity.SCALAR, 2, "m"),))
    model = AdaptedSkill(chain, means, np.tile(1e-2 * np.eye(2), (5, 1, 1)), layout, 0.1)
    x = np.repeat(means[:, :1], 4, axis=0)
    for regress_over_time in (filtered_regression, smoothed_regression):
        regression = regress_over_time(model, np.array([0]), x).means[:, 0]
        np.testing.assert_allclose(regression[[5, 13]], [1.0, -1.0], atol=1e-3)
    mixture = replace(model, dynamics=MixtureWeights(np.full(5, 0.2)))
    np.testing.assert_allclose(filtered_regression(mixture, np.array([0]), x).means[5], 0.0, atol=1e-3)


def test_regression_distant_inputs_gives_finite_result(rng):
    for dynamics in (markov(rng), semi_markov(rng), MixtureWeights(np.full(K, 1 / K))):
        model, x = skill(rng, dynamics), 1e7 * rng.normal(size=(5, 2))
        for regress_over_time in (filtered_regression, smoothed_regression):
            regression = regress_over_time(model, INPUTS, x)
            assert np.isfinite(regression.means).all()
            assert np.isfinite(regression.jacobians).all()


def test_regression_invalid_inputs_are_refused(rng):
    model = skill(rng, markov(rng))
    for regress_over_time in (filtered_regression, smoothed_regression):
        with pytest.raises(InvalidInput, match="no rows"):
            regress_over_time(model, INPUTS, np.empty((0, 2)))
        with pytest.raises(InvalidInput, match="1 columns, expected 2"):
            regress_over_time(model, INPUTS, np.zeros((4, 1)))
        with pytest.raises(InvalidInput, match=r"x\[1, 0\] is nan"):
            regress_over_time(model, INPUTS, np.array([[0.0, 0.0], [np.nan, 0.0]]))
        with pytest.raises(InvalidInput, match="at least one input and one output"):
            regress_over_time(model, np.arange(3), np.zeros((4, 3)))
        with pytest.raises(NotPositiveDefinite, match="component 0"):
            regress_over_time(replace(model, covariances=np.zeros((K, D, D))), INPUTS, np.zeros((4, 2)))


def test_smoothed_state_probs_unobserved_steps_equal_prediction(rng):
    """Rows of zeros after the last observation are a prediction."""
    for chain in (markov(rng), semi_markov(rng)):
        log_observed = np.vstack([3.0 * rng.normal(size=(2, K)), np.zeros((4, K))])
        expected = chain.filtered_state_probs(log_observed[:2], 6)
        np.testing.assert_allclose(
            chain.smoothed_state_probs(log_observed)[1:], expected[1:], rtol=1e-8, atol=1e-12
        )


def test_smoothed_state_probs_ignore_censoring_of_training_data(rng):
    """The last segment of a running robot is right-censored."""
    chain, log_observed = semi_markov(rng), rng.normal(size=(5, K))
    ended = replace(chain, censoring=Censoring.NONE)
    np.testing.assert_allclose(
        ended.smoothed_state_probs(log_observed), chain.smoothed_state_probs(log_observed)
    )


def test_smoothed_state_probs_invalid_observations_are_refused(rng):
    with pytest.raises(InvalidInput, match="no rows"):
        markov(rng).smoothed_state_probs(np.empty((0, K)))
    with pytest.raises(InvalidInput, match=r"observation 1 in state 2 is -inf"):
        markov(rng).smoothed_state_probs(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -np.inf]]))


def test_smoothed_regression_on_s3_equals_tangent_chart(rng):
    """About one axis S^3 is a circle."""
    layout = Layout((Part("time", Quantity.SCALAR, 1, "s"), Part("turn", Quantity.ORIENTATION, 4, "1")))
    q = quaternion_exp(0.2 * np.arange(K)[:, None] * np.array([0.0, 0.0, 1.0]))
    means = np.hstack([np.arange(K)[:, None], q])
    curved = AdaptedSkill(markov(rng), means, np.tile(1e-2 * np.eye(4), (K, 1, 1)), layout, 0.1)
    here, times = tangent_chart(curved, base_pose=means[0]), np.arange(K)[:, None].astype(float)
    regression = smoothed_regression(here.skill, np.array([0]), times)
    back = here.to_manifold(np.hstack([np.zeros((K, 1)), regression.means]))
    np.testing.assert_allclose(back[:, 1:], q, atol=1e-3)
    whole = smoothed_regression(curved, np.array([0]), times)
    np.testing.assert_allclose(whole.means, back[:, 1:], atol=1e-12)
