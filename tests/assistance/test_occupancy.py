"""The filter of states and ages: against the forward variable, enumeration and simple chains."""

import assisted_task as task
import numpy as np
import pytest

from pilotfish.assistance.occupancy import (
    initial_belief,
    occupancy_tables,
)
from pilotfish.kernels import observe_command, predict_belief
from pilotfish.models import Censoring, MarkovChain, MixtureWeights, SemiMarkovChain
from pilotfish.models.durations import Gaussian, NegativeBinomial


def random_chain(rng, K=4, durations=None) -> SemiMarkovChain:
    transitions = rng.dirichlet(np.ones(K), size=K) * (1.0 - np.eye(K))
    transitions /= transitions.sum(axis=1, keepdims=True)
    transitions[-1] = 0.0
    durations = durations or Gaussian(rng.uniform(2.0, 6.0, K), rng.uniform(0.5, 2.0, K))
    return SemiMarkovChain(rng.dirichlet(np.ones(K)), transitions, durations, Censoring.RIGHT)


def filtered(tables, log_observed):
    belief, rows = initial_belief(tables), []
    for t, row in enumerate(log_observed):
        belief = observe_command(predict_belief(tables, belief) if t else belief, row)
        rows.append(belief.sum(axis=0))
    return np.array(rows)


@pytest.mark.parametrize("family", ["gaussian", "negative binomial"])
def test_filter_equals_forward_variable_of_semi_markov_chain(rng, family):
    durations = None if family == "gaussian" else NegativeBinomial(np.full(4, 3.0), np.full(4, 0.5))
    chain = random_chain(rng, durations=durations)
    log_observed = rng.normal(size=(40, 4))
    exact = occupancy_tables(chain, max_hazard=1.0, reset=0.0)
    expected = chain.filtered_state_probs(log_observed, 40)
    assert np.allclose(filtered(exact, log_observed), expected, atol=1e-6)


def test_filter_equals_forward_variable_of_markov_chain(rng):
    chain = MarkovChain(rng.dirichlet(np.ones(3)), rng.dirichlet(np.ones(3), size=3))
    log_observed = rng.normal(size=(20, 3))
    tables = occupancy_tables(chain, reset=0.0)
    assert np.allclose(filtered(tables, log_observed), chain.filtered_state_probs(log_observed, 20))


def test_mixture_forgets_the_past(rng):
    weights = rng.dirichlet(np.ones(3))
    log_observed = rng.normal(size=(5, 3))
    expected = weights * np.exp(log_observed)
    tables = occupancy_tables(MixtureWeights(weights), reset=0.0)
    assert np.allclose(filtered(tables, log_observed), expected / expected.sum(axis=1, keepdims=True))


def test_age_is_the_time_since_the_state_was_entered():
    tables = occupancy_tables(task.learn().dynamics, reset=0.0)
    belief = initial_belief(tables)
    K = belief.shape[1]
    for step, state in enumerate([0, 0, 0, 1, 1, 1, 1]):
        row = np.where(np.arange(K) == state, 0.0, -500.0)
        belief = observe_command(predict_belief(tables, belief) if step else belief, row)
    assert belief[:, 1].argmax() == 3  # four steps in state 1


def test_belief_of_impossible_commands_stays_a_distribution(rng):
    tables = occupancy_tables(random_chain(rng))
    belief = initial_belief(tables)
    for row in (np.full(4, -1e300), rng.normal(size=4) * 1e5, np.zeros(4)):
        belief = observe_command(predict_belief(tables, belief), row)
        assert np.isfinite(belief).all()
        assert belief.min() >= 0.0
        assert belief.sum() == pytest.approx(1.0)


def test_person_who_goes_back_is_followed():
    """A left-right chain cannot return; the filter does within a few steps."""
    K = 3
    transitions = np.eye(K, k=1)
    chain = SemiMarkovChain(np.eye(K)[0], transitions, Gaussian(np.full(K, 5.0), np.full(K, 1.0)))
    log_observed = np.array([[0.0, -20.0, -40.0]] * 5 + [[-20.0, 0.0, -20.0]] * 5 + [[0.0, -20.0, -40.0]] * 3)
    probs = filtered(occupancy_tables(chain), log_observed)
    assert probs[9].argmax() == 1
    assert probs[12].argmax() == 0


def test_person_who_pauses_stays_in_the_state():
    K = 3
    chain = SemiMarkovChain(np.eye(K)[0], np.eye(K, k=1), Gaussian(np.full(K, 5.0), np.full(K, 1.0)))
    log_observed = np.tile([[0.0, -4.0, -16.0]], (300, 1))
    probs = filtered(occupancy_tables(chain), log_observed)
    assert probs[-1].argmax() == 0
    assert probs[-1, 0] > 0.9
