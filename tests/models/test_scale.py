"""Long and wide recordings: no underflow, no loss of precision."""

import numpy as np

from pilotfish.demonstrations import Layout, Part, Quantity, Views, demonstration
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.models import EMSettings, HiddenModel, MarkovChain, expected_statistics, learn, viterbi


def make_chain(rng, K, D, spread):
    covariances = np.tile(spread**2 * np.eye(D), (K, 1, 1))
    chain = MarkovChain(np.full(K, 1 / K), 0.98 * np.eye(K) + 0.02 / K)
    return HiddenModel(chain, rng.normal(size=(1, K, D)), (DenseCovariances(covariances),))


def test_statistics_of_100000_steps_in_94_dimensions_do_not_underflow(rng):
    """Every step has a log-density of some hundred nats; counts still sum to the number of steps."""
    K, D, T = 3, 94, 100_000
    model = make_chain(rng, K, D, 0.01)
    states = np.repeat(rng.integers(0, K, size=T // 100), 100)
    x = model.means[0, states] + 0.01 * rng.normal(size=(T, D))
    statistics = expected_statistics(model, Views(x[None], np.array([T])))
    assert np.isfinite(statistics.log_likelihood)
    np.testing.assert_allclose(statistics.moments[0].counts, np.bincount(states, minlength=K), atol=1.0)
    np.testing.assert_allclose(statistics.transitions.sum(), T - 1)
    layout = Layout((Part("marker", Quantity.SCALAR, D, "m"),))
    np.testing.assert_array_equal(viterbi(model, demonstration(x, 0.01, layout)), states)


def test_statistics_outlier_belongs_to_nearest_state(rng):
    """Thousands of nats from every state: the density has no lower bound."""
    model = make_chain(rng, 2, 14, 1e-3)
    outlier = model.means[0, 1] + 0.2 * (model.means[0, 1] - model.means[0, 0])
    x = np.stack([model.means[0, 0], outlier])[None]
    statistics = expected_statistics(model, Views(x, np.array([2])))
    np.testing.assert_allclose(statistics.moments[0].counts, [1.0, 1.0])
    assert statistics.log_likelihood < -1e4


def test_learn_94_dimensions_from_few_points_is_finite(rng):
    """With fewer points than dimensions in each state, regularisation keeps covariances positive definite."""
    x = np.cumsum(rng.normal(size=(300, 94)), axis=0) * 0.01
    demo = demonstration(x, 0.01, Layout((Part("marker", Quantity.SCALAR, 94, "m"),)))
    fit = learn([demo], states=10, rng=rng, settings=EMSettings(max_iterations=10))
    assert np.isfinite(fit.log_likelihoods).all()
    assert np.diff(fit.log_likelihoods).min(initial=0.0) >= 0.0
