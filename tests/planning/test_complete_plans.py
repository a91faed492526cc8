"""Plans of whole movements: the most probable sequence to a final state, and their end point."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from reaches import make_reaches

from pilotfish.models import MarkovChain, SemiMarkovChain, TimeBins, adapt, learn
from pilotfish.models.durations import Gaussian as GaussianDurations
from pilotfish.planning import plan_states, reproduce
from pilotfish.planning.plan import reference_from_states

CUP = 1  # number of the frame


def random_chain(rng: np.random.Generator, final: tuple[int, ...]) -> SemiMarkovChain:
    transitions = rng.uniform(0.1, 1.0, size=(3, 3)) * (1.0 - np.eye(3))
    transitions /= transitions.sum(axis=1, keepdims=True)
    transitions[list(final)] = 0.0
    durations = GaussianDurations(rng.uniform(1.0, 4.0, size=3), rng.uniform(0.5, 2.0, size=3))
    return SemiMarkovChain(rng.dirichlet(np.ones(3)), transitions, durations)


def enumerate_sequences(chain: SemiMarkovChain, log_b: np.ndarray, *, complete: bool):
    """Yield every sequence with its log-probability, by definition."""
    T, K = log_b.shape
    p = np.exp(chain.durations.log_table(400))
    longer = np.cumsum(p[::-1], axis=0)[::-1]
    final = chain.final_states()
    for cuts in itertools.chain.from_iterable(itertools.combinations(range(1, T), n) for n in range(T)):
        lengths = np.diff((0, *cuts, T))
        for states in itertools.product(range(K), repeat=len(lengths)):
            prior = chain.initial[states[0]]
            prior *= np.prod([chain.transitions[i, j] for i, j in itertools.pairwise(states)])
            for k, d in zip(states[:-1], lengths[:-1], strict=True):
                prior *= p[d - 1, k]
            last, d = states[-1], lengths[-1]
            if complete:
                prior *= p[d - 1, last] if final[last] else 0.0
            else:
                prior *= 1.0 if final[last] else longer[d - 1, last]
            if prior > 0.0:
                sequence = np.repeat(states, lengths)
                yield sequence, np.log(prior) + log_b[np.arange(T), sequence].sum()


@pytest.mark.parametrize("final", [(2,), (0, 2), ()])
@pytest.mark.parametrize("complete", [True, False])
def test_plan_states_equal_most_probable_of_all_sequences(rng, final, complete):
    """Three states, up to seven steps; a chain without a final state has no complete sequence."""
    for T in (1, 4, 7):
        chain, log_b = random_chain(rng, final), rng.normal(size=(T, 3))
        listed = list(enumerate_sequences(chain, log_b, complete=complete and bool(final)))
        expected, _ = max(listed, key=lambda one: one[1])
        np.testing.assert_array_equal(chain.plan_states(log_b, T, complete=complete), expected)


def test_plan_states_markov_complete_ends_in_final_state(rng):
    """Posteriors of a Markov chain, given that the last state is final, by enumeration."""
    transitions = np.array([[0.95, 0.05, 0.0], [0.0, 0.95, 0.05], [0.0, 0.0, 1.0]])
    chain, T = MarkovChain(np.array([1.0, 0.0, 0.0]), transitions), 5
    log_b = 0.1 * rng.normal(size=(T, 3))
    total = np.zeros((T, 3))
    for path in itertools.product(range(3), repeat=T):
        p = chain.initial[path[0]] * np.prod([transitions[i, j] for i, j in itertools.pairwise(path)])
        if path[-1] == 2:
            total[np.arange(T), path] += p * np.exp(log_b[np.arange(T), path].sum())
    found = chain.plan_states(log_b, T, complete=True)
    np.testing.assert_array_equal(found, total.argmax(axis=1))
    assert found[-1] == 2
    assert chain.plan_states(log_b, T, complete=False)[-1] == 0


@pytest.mark.parametrize("horizon", [50, 61, 150])
def test_plan_complete_reaches_final_state_at_any_pace(rng, horizon):
    """A shorter or longer horizon changes durations in proportion to their variances.

    With Gaussian durations of means m and variances v, the most probable ones of sum T are
    m + v (T - sum of m) / sum of v.
    """
    demos = make_reaches(0)
    skill = learn(demos, states=6, rng=rng, initialisation=TimeBins()).skill
    _, states = plan_states(adapt(skill, demos[0].frames), horizon=horizon)
    final = np.flatnonzero(skill.dynamics.final_states())
    assert states[-1] in final
    means, variances = skill.dynamics.durations.means, skill.dynamics.durations.deviations**2
    expected = means + variances * (horizon - means.sum()) / variances.sum()
    np.testing.assert_allclose(np.bincount(states, minlength=6), expected, atol=1.0)


@pytest.mark.parametrize("horizon", [1, 2, 10, 29])
def test_plan_horizon_below_number_of_states_passes_over_states(rng, horizon):
    """The plan still ends at the end, and its states are spread over the movement."""
    demos = make_reaches(0)
    skill = learn(demos, rng=rng).skill
    _, states = plan_states(adapt(skill, demos[0].frames), horizon=horizon)
    assert skill.dynamics.final_states()[states[-1]]
    assert len(np.unique(states)) == horizon
    if horizon > 1:
        assert np.isfinite(reproduce(skill, demos[0].frames, horizon=horizon).motion.x).all()


def test_reference_from_states_end_point_has_weight_of_a_mean_state(rng):
    demos = make_reaches(0)
    adapted = adapt(learn(demos, states=5, rng=rng).skill, demos[0].frames)
    states = np.repeat(np.arange(5), 4)
    plain = reference_from_states(adapted, states, 1e-4)
    found = reference_from_states(adapted, states, 1e-4, end_point=True)
    np.testing.assert_array_equal(found.targets[:-1], plain.targets[:-1])
    np.testing.assert_array_equal(found.weights[:-1], plain.weights[:-1])
    np.testing.assert_array_equal(found.targets[-1], adapted.endpoints.means[1])
    regularised = adapted.endpoints.covariances[1] + 1e-4 * np.eye(8)
    np.testing.assert_allclose(found.weights[-1] @ regularised, 4.0 * np.eye(8), atol=1e-9)


@pytest.mark.parametrize("states", [None, 7])
def test_reproduce_reaches_end_at_moving_cup(states):
    """All demonstrations end at the cup: so does the motion, within 1 % of the way, wherever the cup is."""
    options = {} if states is None else {"states": states}
    skill = learn(make_reaches(0), rng=np.random.default_rng(0), **options).skill
    for demo in make_reaches(1, count=10):
        x = reproduce(skill, demo.frames).motion.x
        cup = demo.frames[CUP].b[:3]
        distance = np.linalg.norm(x[0, :3] - cup)
        assert np.linalg.norm(x[-1, :3] - cup) < 0.01 * distance
        assert np.linalg.norm(x[0, :3] - [0.1, 0.0, 0.3]) < 0.02
        assert np.linalg.norm(x[-1, 4:7]) < 0.1  # m/s: at rest


def test_reproduce_stream_skill_without_statistics_plans(rng):
    """The skill of a stream has neither scales nor end points: its states give scales and start."""
    demos = make_reaches(0)
    skill = replace(
        learn(demos, states=6, rng=rng).skill, regularisation=None, demonstrated=None, endpoints=None
    )
    found = reproduce(skill, demos[0].frames)
    assert found.adapted.endpoints is None
    np.testing.assert_array_equal(found.motion.x[0], found.reference.targets[0])
    assert np.isfinite(found.motion.x).all()
    assert np.linalg.norm(found.motion.x[-1, :3] - demos[0].frames[CUP].b[:3]) < 0.03


def test_plan_without_final_state_is_finite(rng):
    """A chain that returns to its states has no end to reach."""
    chain = random_chain(rng, ())
    demos = make_reaches(0)
    skill = replace(learn(demos, states=3, rng=rng).skill, dynamics=chain)
    found = reproduce(skill, demos[0].frames, horizon=40)
    assert np.isfinite(found.motion.x).all()
    np.testing.assert_array_equal(found.states, plan_states(found.adapted, horizon=40, complete=False)[1])
