"""Plans: targets are means of states, weights are regularised precision matrices."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.models import AdaptedSkill, SemiMarkovChain
from pilotfish.models.durations import Gaussian as GaussianDurations
from pilotfish.planning import condition_on, plan, plan_states, via_point
from pilotfish.planning.plan import reference_from_states


@pytest.fixture
def model(rng):
    A = rng.normal(size=(3, 2, 2))
    chain = SemiMarkovChain(
        np.array([0.8, 0.2, 0.0]), np.eye(3, k=1), GaussianDurations(np.full(3, 6.0), np.ones(3))
    )
    means = np.array([[0.0, 0.0], [5.0, 0.0], [9.0, 9.0]])
    covariances = A @ A.transpose(0, 2, 1) * 1e-3 + 1e-6 * np.eye(2)
    return AdaptedSkill(chain, means, covariances, Layout((Part("place", Quantity.SCALAR, 2, "m"),)), 0.1)


def test_plan_targets_are_means_of_states_in_order(model):
    targets = plan(model, horizon=25).targets
    np.testing.assert_allclose(targets[0], model.means[0])
    np.testing.assert_allclose(targets[-1], model.means[2])
    assert all(np.any(np.all(t == model.means, axis=1)) for t in targets)


def test_reference_from_states_weights_invert_regularised_covariance(model):
    reference = reference_from_states(model, np.array([1]), covariance_regularisation=2e-3)
    regularised = model.covariances[1] + 2e-3 * np.eye(2)
    np.testing.assert_allclose(reference.weights[0] @ regularised, np.eye(2), atol=1e-9)


@pytest.mark.parametrize("covariance_regularisation", [1e-4, 2e-3, 1.0])
def test_reference_from_states_weights_are_bounded_by_inverse_regularisation(
    model, covariance_regularisation
):
    weights = reference_from_states(model, np.arange(3), covariance_regularisation).weights
    assert np.linalg.eigvalsh(weights).max() <= 1.0 / covariance_regularisation
    assert np.linalg.eigvalsh(weights).min() > 0.0


def test_plan_start_near_second_state_begins_there(model):
    np.testing.assert_allclose(plan(model, model.means[1], horizon=10).targets[0], model.means[1])
    np.testing.assert_allclose(plan(model, model.means[0], horizon=10).targets[0], model.means[0])


def test_plan_distant_start_is_finite(model):
    assert np.isfinite(plan(model, np.array([1e5, -1e5]), horizon=10).targets).all()


def test_plan_unusable_argument_is_refused(model):
    with pytest.raises(InvalidInput, match=r"\(3,\), expected \(2,\)"):
        plan(model, np.zeros(3), horizon=10)
    with pytest.raises(InvalidInput, match="not finite"):
        plan(model, np.array([np.nan, 0.0]), horizon=10)
    with pytest.raises(InvalidInput, match="horizon"):
        plan(model, np.zeros(2), horizon=0)
    with pytest.raises(InvalidInput, match="covariance_regularisation"):
        plan(model, np.zeros(2), horizon=10, covariance_regularisation=-1.0)


def test_plan_singular_covariance_without_regularisation_is_refused(model):
    singular = AdaptedSkill(model.dynamics, model.means, np.zeros((3, 2, 2)), model.layout, 0.1)
    with pytest.raises(NotPositiveDefinite, match="state 0"):
        plan(singular, horizon=5, covariance_regularisation=0.0)


def test_plan_states_equal_states_of_plan(model):
    """The states are those of the targets."""
    start = model.means[1]
    aligned, states = plan_states(model, start, horizon=20)
    np.testing.assert_array_equal(plan(model, start, horizon=20).targets, aligned.means[states])


def test_plan_has_period_of_skill(model):
    assert plan(model, model.means[0], horizon=5).period == model.period
    assert plan(model, horizon=5).period == model.period


def test_plan_too_many_weights_are_refused(model):
    """The size is checked before anything is allocated."""
    with pytest.raises(InvalidInput, match="weights of 16777217 steps have 67108868 entries"):
        reference_from_states(model, np.zeros(2**24 + 1, dtype=np.int64), 1e-3)
    with pytest.raises(InvalidInput, match="horizon is 1000000000, expected a whole number from"):
        plan(model, horizon=10**9)


def test_plan_via_points_equal_conditioned_reference_of_smoothed_states(model):
    """Via-points choose the states, and the reference of these states is conditioned on them."""
    point = via_point("place", [5.0, 1.0], time=0.9, deviation=0.1)
    start = model.means[0]
    aligned, states = plan_states(model, start, horizon=20, via_points=[point])
    expected = condition_on(reference_from_states(aligned, states, 1e-3), [point], model.layout)
    found = plan(model, start, horizon=20, via_points=[point], covariance_regularisation=1e-3)
    np.testing.assert_array_equal(found.targets, expected.targets)
    np.testing.assert_array_equal(found.weights, expected.weights)


def test_plan_without_start_begins_at_most_probable_state(model):
    """With start=None the initial probabilities of the skill choose the first state.

    A complete sequence of 20 steps begins at state 0 in both cases, since two states last 12 steps and three
    18; one of 12 steps begins at state 1.
    """
    _, states = plan_states(model, horizon=20)
    assert states[0] == model.dynamics.initial.argmax()
    reordered = replace(model, dynamics=replace(model.dynamics, initial=np.array([0.1, 0.9, 0.0])))
    assert plan_states(reordered, horizon=20, stepwise=True)[1][0] == 1
    assert plan_states(reordered, horizon=20)[1][0] == 0
    assert plan_states(reordered, horizon=12)[1][0] == 1
