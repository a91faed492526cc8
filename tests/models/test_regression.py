"""Regression along time: against listing every path of states, and by finite differences."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians import Gaussian, condition, marginal, regress
from pilotfish.geometry import quaternion_exp
from pilotfish.models import (
    AdaptedSkill,
    Censoring,
    MarkovChain,
    MixtureWeights,
    SemiMarkovChain,
    as_mixture,
    filtered_regression,
    smoothed_regression,
)
from pilotfish.models.durations import Gaussian as GaussianDurations
from pilotfish.planning import tangent_chart

K, D = 3, 3
INPUTS = np.array([2, 0])


def markov(rng):
    return MarkovChain(rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K))


def semi_markov(rng):
    """The last state is final: once there, the skill stays."""
    transitions = rng.random((K, K)) * (1.0 - np.eye(K))
    transitions[-1] = 0.0
    transitions[:-1] /= transitions[:-1].sum(axis=1, keepdims=True)
    durations = GaussianDurations(rng.uniform(1.0, 3.0, K), rng.uniform(0.5, 1.0, K))
    return SemiMarkovChain(rng.dirichlet(np.ones(K)), transitions, durations)


def skill(rng, dynamics):
    A = rng.normal(size=(K, D, D))
    covariances = A @ A.transpose(0, 2, 1) + 0.1 * np.eye(D)
    layout = Layout((Part("place", Quantity.SCALAR, D, "m"),))
    return AdaptedSkill(dynamics, 2.0 * rng.normal(size=(K, D)), covariances, layout, 0.1)


def log_prior(dynamics, path):
    """Log p of a path of states whose last visit may go on: initial, transitions and whole durations."""
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
    """Mean and covariance of the output at step t given inputs x, path by path."""
    densities, guesses = np.empty((len(x), K)), []
    for k in range(K):
        state = Gaussian(model.means[k], model.covariances[k])
        own = marginal(state, INPUTS)
        densities[:, k] = multivariate_normal(own.mean, own.covariance).logpdf(x)
        guesses.append(condition(state, INPUTS, x[t]))
    total, first, second = 0.0, 0.0, 0.0
    for path in itertools.product(range(K), repeat=len(x)):
        p = np.exp(log_prior(model.dynamics, path) + densities[np.arange(len(x)), list(path)].sum())
        initial_statistics = guesses[path[t]]
        total, first = total + p, first + p * initial_statistics.mean
        second = second + p * (
            initial_statistics.covariance + np.outer(initial_statistics.mean, initial_statistics.mean)
        )
    mean = first / total
    return mean, second / total - np.outer(mean, mean)


@pytest.mark.parametrize("chain", [markov, semi_markov])
def test_filtered_regression_agrees_with_listing_every_path_so_far(rng, chain):
    model, x = skill(rng, chain(rng)), 2.0 * rng.normal(size=(5, 2))
    regression = filtered_regression(model, INPUTS, x)
    for t in range(5):
        mean, covariance = regression_by_enumeration(model, x[: t + 1], t)
        np.testing.assert_allclose(regression.means[t], mean, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(regression.covariances[t], covariance, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("chain", [markov, semi_markov])
def test_smoothed_regression_agrees_with_listing_every_path(rng, chain):
    model, x = skill(rng, chain(rng)), 2.0 * rng.normal(size=(5, 2))
    regression = smoothed_regression(model, INPUTS, x)
    for t in range(5):
        mean, covariance = regression_by_enumeration(model, x, t)
        np.testing.assert_allclose(regression.means[t], mean, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(regression.covariances[t], covariance, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("follow", [filtered_regression, smoothed_regression])
@pytest.mark.parametrize("chain", [markov, semi_markov])
def test_the_jacobian_is_the_finite_difference_along_the_steps_own_input(rng, chain, follow):
    """The shares move with the input too: a share's prior is what other steps saw, which does not."""
    model, x = skill(rng, chain(rng)), rng.normal(size=(6, 2))
    exact = follow(model, INPUTS, x).jacobians
    for t, i in itertools.product(range(6), range(2)):
        step = np.zeros_like(x)
        step[t, i] = 1e-5
        more, less = follow(model, INPUTS, x + step).means[t], follow(model, INPUTS, x - step).means[t]
        np.testing.assert_allclose(exact[t, :, i], (more - less) / 2e-5, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("chain", [markov, semi_markov])
def test_filtered_equals_smoothed_at_last_step(rng, chain):
    """Filtered and smoothed agree there; a step before, the future has its say."""
    model, x = skill(rng, chain(rng)), rng.normal(size=(30, 2))
    filtered, smoothed = filtered_regression(model, INPUTS, x), smoothed_regression(model, INPUTS, x)
    np.testing.assert_allclose(filtered.means[-1], smoothed.means[-1], rtol=1e-8)
    np.testing.assert_allclose(filtered.covariances[-1], smoothed.covariances[-1], rtol=1e-7)
    assert not np.allclose(filtered.means, smoothed.means)


def test_filtered_regression_is_causal(rng):
    model, x = skill(rng, semi_markov(rng)), rng.normal(size=(9, 2))
    whole, begun = filtered_regression(model, INPUTS, x), filtered_regression(model, INPUTS, x[:4])
    np.testing.assert_allclose(whole.means[:4], begun.means, rtol=1e-9)


def test_regression_of_memoryless_chain_equals_mixture(rng):
    """All rows of the transitions alike: steps tell nothing of each other, and regress is right."""
    weights = rng.dirichlet(np.ones(K))
    forgetful = skill(rng, MarkovChain(weights, np.tile(weights, (K, 1))))
    mixture, x = replace(forgetful, dynamics=MixtureWeights(weights)), rng.normal(size=(4, 2))
    expected = regress(as_mixture(mixture), INPUTS, x)
    for model in (forgetful, mixture):
        for follow in (filtered_regression, smoothed_regression):
            regression = follow(model, INPUTS, x)
            np.testing.assert_allclose(regression.means, expected.means)
            np.testing.assert_allclose(regression.covariances, expected.covariances, rtol=1e-6)
            np.testing.assert_allclose(regression.jacobians, expected.jacobians, rtol=1e-6)


def test_the_same_input_at_two_moments_is_told_apart_by_what_led_there():
    """Out and back along one line, the output says which: a mixture can only give their mean."""
    means = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0], [1.0, -1.0], [0.0, 0.0]])
    chain = SemiMarkovChain(np.eye(5)[0], np.eye(5, k=1), GaussianDurations(np.full(5, 4.0), np.full(5, 1.0)))
    layout = Layout((Part("place", Quantity.SCALAR, 2, "m"),))
    model = AdaptedSkill(chain, means, np.tile(1e-2 * np.eye(2), (5, 1, 1)), layout, 0.1)
    x = np.repeat(means[:, :1], 4, axis=0)
    for follow in (filtered_regression, smoothed_regression):
        regression = follow(model, np.array([0]), x).means[:, 0]
        np.testing.assert_allclose(regression[[5, 13]], [1.0, -1.0], atol=1e-3)
    mixture = replace(model, dynamics=MixtureWeights(np.full(5, 0.2)))
    np.testing.assert_allclose(filtered_regression(mixture, np.array([0]), x).means[5], 0.0, atol=1e-3)


def test_inputs_far_from_every_state_still_get_an_answer(rng):
    for dynamics in (markov(rng), semi_markov(rng), MixtureWeights(np.full(K, 1 / K))):
        model, x = skill(rng, dynamics), 1e7 * rng.normal(size=(5, 2))
        for follow in (filtered_regression, smoothed_regression):
            regression = follow(model, INPUTS, x)
            assert np.isfinite(regression.means).all()
            assert np.isfinite(regression.jacobians).all()


def test_inputs_that_cannot_be_followed_are_refused(rng):
    model = skill(rng, markov(rng))
    for follow in (filtered_regression, smoothed_regression):
        with pytest.raises(InvalidInput, match="no rows"):
            follow(model, INPUTS, np.empty((0, 2)))
        with pytest.raises(InvalidInput, match="1 columns, expected 2"):
            follow(model, INPUTS, np.zeros((4, 1)))
        with pytest.raises(InvalidInput, match=r"x\[1, 0\] is nan"):
            follow(model, INPUTS, np.array([[0.0, 0.0], [np.nan, 0.0]]))
        with pytest.raises(InvalidInput, match="nothing to map"):
            follow(model, np.arange(3), np.zeros((4, 3)))
        with pytest.raises(NotPositiveDefinite, match="component 0"):
            follow(replace(model, covariances=np.zeros((K, D, D))), INPUTS, np.zeros((4, 2)))


def test_unobserved_steps_do_not_change_state_probs(rng):
    """Rows of zeros after the last observation leave the prediction; before it, the future is heard."""
    for chain in (markov(rng), semi_markov(rng)):
        log_observed = np.vstack([3.0 * rng.normal(size=(2, K)), np.zeros((4, K))])
        expected = chain.filtered_state_probs(log_observed[:2], 6)
        np.testing.assert_allclose(
            chain.smoothed_state_probs(log_observed)[1:], expected[1:], rtol=1e-8, atol=1e-12
        )


def test_what_follows_the_last_observation_stays_open(rng):
    """Also for a skill learned from recordings that ended with a visit: a robot is asked on its way."""
    chain, log_observed = semi_markov(rng), rng.normal(size=(5, K))
    ended = replace(chain, censoring=Censoring.NONE)
    np.testing.assert_allclose(
        ended.smoothed_state_probs(log_observed), chain.smoothed_state_probs(log_observed)
    )


def test_posteriors_of_nothing_or_of_the_impossible_are_refused(rng):
    with pytest.raises(InvalidInput, match="no rows"):
        markov(rng).smoothed_state_probs(np.empty((0, K)))
    with pytest.raises(InvalidInput, match=r"observation 1 in state 2 is -inf"):
        markov(rng).smoothed_state_probs(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -np.inf]]))


def test_a_skill_on_the_sphere_is_followed_on_a_flat_map_of_it(rng):
    """About one axis S^3 is a circle: what the map answers is what the sphere does, without a map."""
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
