"""A plan holds the states' means, and weights that are never larger than the slack allows."""

import numpy as np
import pytest

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.models import AdaptedSkill, GaussianDurations, SemiMarkovChain
from pilotfish.planning import expected_plan, plan, planned_states, reference_from_states


@pytest.fixture
def model(rng):
    A = rng.normal(size=(3, 2, 2))
    chain = SemiMarkovChain(
        np.array([0.8, 0.2, 0.0]), np.eye(3, k=1), GaussianDurations(np.full(3, 6.0), np.ones(3))
    )
    means = np.array([[0.0, 0.0], [5.0, 0.0], [9.0, 9.0]])
    covariances = A @ A.transpose(0, 2, 1) * 1e-3 + 1e-6 * np.eye(2)
    return AdaptedSkill(chain, means, covariances, Layout((Part("place", Quantity.SCALAR, 2, "m"),)), 0.1)


def test_targets_are_the_means_of_the_states_in_their_order(model):
    targets = expected_plan(model, horizon=25).targets
    np.testing.assert_allclose(targets[0], model.means[0])
    np.testing.assert_allclose(targets[-1], model.means[2])
    assert all(np.any(np.all(t == model.means, axis=1)) for t in targets)


def test_weights_are_the_inverse_of_the_softened_covariance(model):
    plan_ = reference_from_states(model, np.array([1]), covariance_regularisation=2e-3)
    np.testing.assert_allclose(
        plan_.weights[0] @ (model.covariances[1] + 2e-3 * np.eye(2)), np.eye(2), atol=1e-9
    )


@pytest.mark.parametrize("covariance_regularisation", [1e-4, 2e-3, 1.0])
def test_no_direction_is_followed_with_more_than_one_over_the_slack(model, covariance_regularisation):
    weights = reference_from_states(model, np.arange(3), covariance_regularisation).weights
    assert np.linalg.eigvalsh(weights).max() <= 1.0 / covariance_regularisation
    assert np.linalg.eigvalsh(weights).min() > 0.0


def test_a_robot_that_stands_at_the_second_state_begins_there(model):
    np.testing.assert_allclose(plan(model, model.means[1], horizon=10).targets[0], model.means[1])
    np.testing.assert_allclose(plan(model, model.means[0], horizon=10).targets[0], model.means[0])


def test_a_start_far_from_everything_still_gets_a_plan(model):
    assert np.isfinite(plan(model, np.array([1e5, -1e5]), horizon=10).targets).all()


def test_unusable_starts_horizons_and_slacks_are_refused(model):
    with pytest.raises(InvalidInput, match=r"\(3,\), expected \(2,\)"):
        plan(model, np.zeros(3), horizon=10)
    with pytest.raises(InvalidInput, match="not finite"):
        plan(model, np.array([np.nan, 0.0]), horizon=10)
    with pytest.raises(InvalidInput, match="horizon"):
        plan(model, np.zeros(2), horizon=0)
    with pytest.raises(InvalidInput, match="covariance_regularisation"):
        plan(model, np.zeros(2), horizon=10, covariance_regularisation=-1.0)


def test_a_certain_state_without_slack_is_reported(model):
    certain = AdaptedSkill(model.dynamics, model.means, np.zeros((3, 2, 2)), model.layout, 0.1)
    with pytest.raises(NotPositiveDefinite, match="state 0"):
        expected_plan(certain, horizon=5, covariance_regularisation=0.0)


def test_planned_states_are_those_of_the_plan(model):
    """The sequence that a picture needs is the one that the reference was made of."""
    start = model.means[1]
    states = planned_states(model, start, horizon=20)
    np.testing.assert_array_equal(plan(model, start, horizon=20).targets, model.means[states])


def test_a_plan_knows_the_time_between_its_targets(model):
    assert plan(model, model.means[0], horizon=5).period == model.period
    assert expected_plan(model, horizon=5).period == model.period


def test_weights_that_would_not_fit_in_memory_are_refused(model):
    """They are counted before they are made."""
    with pytest.raises(InvalidInput, match="weights of 16777217 steps have 67108868 numbers"):
        reference_from_states(model, np.zeros(2**24 + 1, dtype=np.int64), 1e-3)
    with pytest.raises(InvalidInput, match="horizon is 1000000000, expected a whole number from"):
        expected_plan(model, horizon=10**9)
