"""Semi-Markov chains short enough to list every path, and those that are Markov chains in other words."""

import itertools

import numpy as np
import pytest
from scipy.special import logsumexp

from pilotfish.kernels import SemiMarkovTables, reference

SHORT = [(1, 1), (1, 3), (4, 1), (2, 2), (6, 2), (5, 3)]
EXPECTED = ("smoothed_state_probs", "transition_counts", "segments", "tail_counts")
SUMS = (
    "log_likelihoods",
    "counts",
    "initial_counts",
    "transition_counts",
    "segments",
    "tail_counts",
    "offsets",
    "scatter_matrices",
)


def log_of(values):
    with np.errstate(divide="ignore"):
        return np.log(values)


@pytest.fixture
def problem(rng):
    """Log-emissions and tables; zeros is the share of impossible weights, transitions and emissions."""

    def draw(T, K, S, spread=1.0, zeros=0.0):
        def possible(shape):
            return rng.random(shape) >= zeros

        transitions = rng.uniform(0.1, 1.0, (K, K)) * (1.0 - np.eye(K)) * possible((K, K))
        tables = SemiMarkovTables(
            rng.uniform(0.1, 1.0, K) * possible(K),
            transitions,
            np.where(possible((4, S, K)), rng.normal(size=(4, S, K)), -np.inf),
            np.where(possible((2, K)), rng.normal(size=(2, K)), -np.inf),
        )
        return np.where(possible((T, K)), spread * rng.normal(size=(T, K)), -np.inf), tables

    return draw


def segments_of(path):
    """State, begin and end of every visit: a path's maximal runs."""
    cuts = [0, *(t for t in range(1, len(path)) if path[t] != path[t - 1]), len(path)]
    return [(path[b], b, e) for b, e in itertools.pairwise(cuts)]


def path_log_weight(log_emissions, tables, path, counts):
    """Log p(emissions, path) by its definition; counts are those of this path alone, to be filled."""
    T, S = len(path), tables.log_segment_weights.shape[1]
    segments = segments_of(path)
    log_p = log_of(tables.initial)[path[0]] + log_emissions[np.arange(T), path].sum()
    for state, begin, end in segments:
        s = end - begin
        if end < T and s > S:
            return -np.inf
        kind = 2 * (end == T) + (begin == 0)
        where = (kind - 2, state) if s > S else (kind, s - 1, state)
        log_p += (tables.log_tail_weights if s > S else tables.log_segment_weights)[where]
        counts["tail_counts" if s > S else "segments"][where] += 1.0
        counts["smoothed_state_probs"][begin:end, state] = 1.0
    for (j, *_), (k, *_) in itertools.pairwise(segments):
        log_p += log_of(tables.transitions)[j, k]
        counts["transition_counts"][j, k] += 1.0
    return log_p


def enumerate_paths(log_emissions, tables):
    """Every path, log p(emissions, path), and what each counts."""
    shapes = {
        "smoothed_state_probs": log_emissions.shape,
        "transition_counts": tables.transitions.shape,
        "segments": tables.log_segment_weights.shape,
        "tail_counts": tables.log_tail_weights.shape,
    }
    T, K = log_emissions.shape
    paths, log_p, counts = [], [], []
    for path in itertools.product(range(K), repeat=T):
        counts.append({name: np.zeros(shape) for name, shape in shapes.items()})
        log_p.append(path_log_weight(log_emissions, tables, path, counts[-1]))
        paths.append(path)
    return paths, np.array(log_p), counts


@pytest.mark.parametrize("zeros", [0.0, 0.25])
@pytest.mark.parametrize("spread", [1.0, 3000.0])
@pytest.mark.parametrize("S", [1, 2, 4, 9])
@pytest.mark.parametrize(("T", "K"), SHORT)
def test_semi_markov_agrees_with_listing_every_path(kernels, problem, T, K, S, spread, zeros):
    """Likelihood, posteriors, changes of state and lengths of visits are sums over all paths.

    Every path is cut into visits of the four kinds, each with weights of its own; visits may be shorter or
    longer than the tables. At the larger share of zeros a quarter of all there is cannot be.
    """
    given = problem(T, K, S, spread, zeros)
    _, log_p, counts = enumerate_paths(*given)
    result = kernels.semi_markov_forward_backward(*given)
    log_likelihood = logsumexp(log_p) if np.isfinite(log_p).any() else -np.inf
    np.testing.assert_allclose(result.log_likelihood, log_likelihood, rtol=1e-12, atol=1e-12)
    share = np.exp(log_p - log_likelihood) if np.isfinite(log_likelihood) else np.zeros(len(log_p))
    for name in EXPECTED:
        expected = sum(p * count[name] for p, count in zip(share, counts, strict=True))
        np.testing.assert_allclose(getattr(result, name), expected, rtol=1e-8, atol=1e-11, err_msg=name)


@pytest.mark.parametrize("zeros", [0.0, 0.25])
@pytest.mark.parametrize("spread", [1.0, 3000.0])
@pytest.mark.parametrize("S", [1, 2, 4, 9])
@pytest.mark.parametrize(("T", "K"), SHORT)
def test_semi_markov_forward_agrees_with_recordings_that_end_earlier(
    kernels, problem, T, K, S, spread, zeros
):
    """Occupancy at a step sums the paths of a recording that ends there, by its last state. Visits that end
    there sum them too, weighed as if another visit followed.
    """
    log_emissions, tables = problem(T, K, S, spread, zeros)
    inside = np.concatenate([tables.log_segment_weights[:2]] * 2)  # nothing is known to be cut short
    followed = SemiMarkovTables(tables.initial, tables.transitions, inside, np.full((2, K), -np.inf))
    result = kernels.semi_markov_forward(log_emissions, tables)
    for t in range(T):
        log_segment_ends, log_forward = result
        for chain, found in [(tables, log_forward), (followed, log_segment_ends)]:
            paths, log_p, _ = enumerate_paths(log_emissions[: t + 1], chain)
            ends = np.array(paths)[:, -1]
            expected = [np.logaddexp.reduce(log_p[ends == k]) for k in range(K)]
            np.testing.assert_allclose(found[t], expected, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("zeros", [0.0, 0.25])
@pytest.mark.parametrize("spread", [1.0, 3000.0])
@pytest.mark.parametrize("S", [1, 3, 9])
@pytest.mark.parametrize(("T", "K"), SHORT)
def test_semi_markov_viterbi_agrees_with_listing_every_path(kernels, problem, T, K, S, spread, zeros):
    """The path found is the most probable of all, and log_probability is its own."""
    given = problem(T, K, S, spread, zeros)
    paths, log_p, _ = enumerate_paths(*given)
    result = kernels.semi_markov_viterbi(*given)
    np.testing.assert_allclose(result.log_probability, log_p.max(), rtol=1e-12, atol=1e-12)
    if np.isfinite(log_p.max()):
        np.testing.assert_array_equal(result.states, paths[log_p.argmax()])


@pytest.mark.parametrize("S", [2, 9])
def test_semi_markov_viterbi_takes_the_lower_state_at_a_tie(kernels, rng, S):
    """Of equally probable paths, that one whose last differing state has the lower index.

    Whole numbers everywhere make ties exact; many draws make ties of every kind.
    """
    T, K = 5, 3
    for _ in range(30):
        tables = SemiMarkovTables(
            np.ones(K),
            np.ones((K, K)) - np.eye(K),
            rng.integers(0, 2, (4, S, K)).astype(float),
            np.zeros((2, K)),
        )
        log_emissions = rng.integers(0, 2, (T, K)).astype(float)
        paths, log_p, _ = enumerate_paths(log_emissions, tables)
        ties = [path for path, p in zip(paths, log_p, strict=True) if p == log_p.max()]
        result = kernels.semi_markov_viterbi(log_emissions, tables)
        assert tuple(result.states) == min(ties, key=lambda path: path[::-1])


def geometric(initial, transitions, S):
    """The semi-Markov chain that a Markov chain is: geometric lengths of visits, states left for others."""
    stay = np.diag(transitions)
    leave = transitions * (1.0 - np.eye(len(stay)))
    survival = np.arange(S)[:, None] * log_of(stay)  # log p(a visit lasts longer than s - 1), s = 1 ... S
    ended = survival + log_of(1.0 - stay)
    segments = np.stack([ended, ended, survival, survival])
    return SemiMarkovTables(
        initial, leave / leave.sum(axis=1, keepdims=True), segments, np.full((2, len(stay)), -np.inf)
    )


@pytest.mark.parametrize(("T", "K"), [(1, 2), (2, 2), (40, 2), (60, 5)])
def test_with_geometric_lengths_it_is_a_markov_chain(kernels, chain, T, K):
    """Likelihood, posteriors, changes of state and the most probable path are the hidden Markov model's."""
    log_emissions, initial, transitions = chain(T, K, spread=3.0)
    transitions = 0.5 * (transitions + np.eye(K))
    tables = geometric(initial, transitions / transitions.sum(axis=1, keepdims=True), T)
    markov = reference.forward_backward(log_emissions, initial, transitions)
    result = kernels.semi_markov_forward_backward(log_emissions, tables)
    np.testing.assert_allclose(result.log_likelihood, markov.log_likelihood, rtol=1e-12)
    np.testing.assert_allclose(
        result.smoothed_state_probs, markov.smoothed_state_probs, rtol=1e-8, atol=1e-12
    )
    changes = markov.transition_counts * (1.0 - np.eye(K))
    np.testing.assert_allclose(result.transition_counts, changes, rtol=1e-8, atol=1e-12)
    best, expected = (
        kernels.semi_markov_viterbi(log_emissions, tables),
        reference.viterbi(log_emissions, initial, transitions),
    )
    np.testing.assert_array_equal(best.states, expected.states)
    np.testing.assert_allclose(best.log_probability, expected.log_probability, rtol=1e-12)


@pytest.mark.parametrize(("T", "S"), [(300, 40), (300, 400)])
@pytest.mark.parametrize("spread", [1.0, 700.0])
def test_what_is_counted_adds_up(kernels, problem, T, S, spread):
    """Visits weighted by their lengths fill the recording, but for those longer than the tables; one visit
    more than changes of state; the posteriors' sum is each state's share of the recording.
    """
    log_emissions, tables = problem(T, 4, S, spread)
    result = kernels.semi_markov_forward_backward(log_emissions, tables)
    np.testing.assert_allclose(result.smoothed_state_probs.sum(axis=1), 1.0, rtol=1e-12)
    inside = np.einsum("csk,s->k", result.segments, np.arange(1.0, S + 1.0))
    np.testing.assert_allclose(
        result.segments.sum() + result.tail_counts.sum(), 1.0 + result.transition_counts.sum(), rtol=1e-10
    )
    np.testing.assert_allclose(result.segments[2:].sum() + result.tail_counts.sum(), 1.0, rtol=1e-10)
    if S >= T:
        np.testing.assert_allclose(inside, result.smoothed_state_probs.sum(axis=0), rtol=1e-9, atol=1e-9)
        assert not result.tail_counts.any()
        assert not result.segments[:, T:].any()


def test_a_state_that_is_never_left_keeps_the_rest(kernels):
    """Its row of transitions is zero: it lasts beyond any table, and no visit to it ends."""
    T, S = 30, 4
    log_emissions = np.zeros((T, 2))
    log_emissions[:3, 1] = -50.0
    log_emissions[3:, 0] = -50.0
    tables = SemiMarkovTables(
        np.array([1.0, 0.0]),
        np.array([[0.0, 1.0], [0.0, 0.0]]),
        np.full((4, S, 2), np.log(0.25)),
        np.zeros((2, 2)),
    )
    result = kernels.semi_markov_forward_backward(log_emissions, tables)
    np.testing.assert_allclose(result.smoothed_state_probs[:, 1], np.arange(T) >= 3, atol=1e-12)
    np.testing.assert_allclose(result.tail_counts, [[0.0, 1.0], [0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(result.log_likelihood, np.log(0.25), atol=1e-12)
    assert kernels.semi_markov_viterbi(log_emissions, tables).states.tolist() == [0] * 3 + [1] * (T - 3)


def test_what_no_path_explains_has_likelihood_zero(kernels):
    """Log-likelihood -inf and zeros, nothing undefined."""
    tables = SemiMarkovTables(
        np.array([1.0, 0.0]), np.zeros((2, 2)), np.zeros((4, 2, 2)), np.full((2, 2), -np.inf)
    )
    for log_emissions, chain in [
        (np.zeros((3, 2)), tables),  # no way on from the first state, and it cannot last
        (np.full((2, 2), -np.inf), tables),
        (
            np.zeros((1, 2)),
            SemiMarkovTables(np.zeros(2), np.zeros((2, 2)), np.zeros((4, 1, 2)), np.zeros((2, 2))),
        ),
    ]:
        result = kernels.semi_markov_forward_backward(log_emissions, chain)
        assert result.log_likelihood == -np.inf
        assert not any(getattr(result, name).any() for name in EXPECTED)
        assert kernels.semi_markov_viterbi(log_emissions, chain).log_probability == -np.inf


@pytest.mark.parametrize("rare", [1e-12, 1e-200, 1e-310])
def test_a_segment_ten_thousand_times_beyond_underflow_is_not_lost(kernels, rare):
    """State 1 looks 1e-4000 times less likely at every early step, and is the only one that ends well."""
    T, turn, S = 40, 25, 30
    log_emissions = np.zeros((T, 2))
    log_emissions[:turn, 1], log_emissions[turn:, 0] = -9000.0, -1e6
    tables = SemiMarkovTables(
        np.array([1.0, 0.0]),
        np.array([[0.0, rare], [0.0, 0.0]]),
        np.full((4, S, 2), -800.0),
        np.zeros((2, 2)),
    )
    result = kernels.semi_markov_forward_backward(log_emissions, tables)
    np.testing.assert_allclose(result.log_likelihood, np.log(rare) - 1600.0, rtol=1e-12)  # change at the turn
    np.testing.assert_allclose(result.transition_counts[0, 1], 1.0, rtol=1e-9)
    np.testing.assert_allclose(result.segments[1, turn - 1, 0], 1.0, rtol=1e-9)
    assert kernels.semi_markov_viterbi(log_emissions, tables).states.sum() == T - turn


def tables_for(case, rng, S):
    K = len(case.initial)
    transitions = case.transitions * (1.0 - np.eye(K))
    log_segment_weights = rng.normal(size=(4, S, K)) - 0.1 * np.square(np.arange(S) - S / 3.0)[:, None]
    return SemiMarkovTables(case.initial, transitions, log_segment_weights, rng.normal(size=(2, K)))


def test_semi_markov_e_step_sums_what_is_found_in_each_demonstration(kernels, case, rng):
    """Every sum is its definition, taken over posteriors of demonstrations one at a time."""
    given = case(2, [7, 1, 20], 4, 3)
    tables = tables_for(given, rng, 6)
    result = kernels.semi_markov_e_step(given.x, given.lengths, tables, given.emissions)
    parts = np.split(reference.log_emissions(given.x, given.emissions), np.cumsum(given.lengths)[:-1])
    chains = [reference.semi_markov_forward_backward(part, tables) for part in parts]
    gamma = np.concatenate([chain.smoothed_state_probs for chain in chains])
    error = given.x[:, :, None] - given.means[:, None]  # (P, N, K, D)
    expected = {
        "log_likelihoods": [chain.log_likelihood for chain in chains],
        "counts": gamma.sum(axis=0),
        "initial_counts": sum(chain.smoothed_state_probs[0] for chain in chains),
        "transition_counts": sum(chain.transition_counts for chain in chains),
        "segments": sum(chain.segments for chain in chains),
        "tail_counts": sum(chain.tail_counts for chain in chains),
        "offsets": np.einsum("nk,pnki->pki", gamma, error),
        "scatter_matrices": np.einsum("nk,pnki,pnkj->pkij", gamma, error, error),
    }
    for name in SUMS:
        np.testing.assert_allclose(getattr(result, name), expected[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_a_demonstration_that_no_segments_explain_adds_nothing(kernels, case):
    """Its log-likelihood is -inf; the sums are those of the others."""
    given = case(1, [8, 1], 2, 2)
    tables = SemiMarkovTables(given.initial, np.zeros((2, 2)), np.zeros((4, 3, 2)), np.full((2, 2), -np.inf))
    result = kernels.semi_markov_e_step(given.x, given.lengths, tables, given.emissions)
    alone = kernels.semi_markov_e_step(given.x[:, 8:], np.array([1]), tables, given.emissions)
    assert result.log_likelihoods[0] == -np.inf
    for name in SUMS[1:]:
        np.testing.assert_allclose(getattr(result, name), getattr(alone, name), atol=1e-15, err_msg=name)


@pytest.mark.parametrize("zeros", [0.0, 0.3])
@pytest.mark.parametrize("spread", [1.0, 700.0])
@pytest.mark.parametrize(
    ("T", "K", "S"), [(1, 1, 1), (50, 1, 7), (31, 2, 8), (120, 3, 1), (64, 8, 9), (97, 9, 17), (150, 17, 200)]
)
def test_compiled_semi_markov_chain_agrees_with_the_reference(compiled, problem, T, K, S, spread, zeros):
    """Any number of states and steps, also around the multiples of eight that registers hold."""
    given = problem(T, K, S, spread, zeros)
    result, reference_result = (
        compiled.semi_markov_forward_backward(*given),
        reference.semi_markov_forward_backward(*given),
    )
    np.testing.assert_allclose(result.log_likelihood, reference_result.log_likelihood, rtol=1e-11, atol=1e-11)
    for name in EXPECTED:
        np.testing.assert_allclose(
            getattr(result, name), getattr(reference_result, name), rtol=1e-7, atol=1e-10, err_msg=name
        )
    for compiled_array, reference_array in zip(
        compiled.semi_markov_forward(*given), reference.semi_markov_forward(*given), strict=True
    ):
        np.testing.assert_allclose(compiled_array, reference_array, rtol=1e-11, atol=1e-10)
    found, expected = compiled.semi_markov_viterbi(*given), reference.semi_markov_viterbi(*given)
    np.testing.assert_allclose(found.log_probability, expected.log_probability, rtol=1e-11, atol=1e-11)
    if np.isfinite(expected.log_probability):
        np.testing.assert_array_equal(found.states, expected.states)


@pytest.mark.parametrize("rng", [0], indirect=True)
@pytest.mark.parametrize("spread", [1.0, 3000.0])
def test_a_hundred_thousand_steps_of_segments_lose_nothing(compiled, problem, spread):
    """Lengths of visits add up to the recording's, one visit follows each change, and posteriors sum to one.

    None of the numbers kept grows with time: in the twin, log probabilities reach 1e8.
    """
    T, S = 100_000, 30
    result = compiled.semi_markov_forward_backward(*problem(T, 3, S, spread))
    assert np.isfinite(result.log_likelihood)
    lasted = np.einsum("csk,s->", result.segments, np.arange(1.0, S + 1.0))
    np.testing.assert_allclose(lasted + result.tail_counts.sum() * S, T, rtol=1e-9)
    np.testing.assert_allclose(
        result.segments.sum() + result.tail_counts.sum(), 1.0 + result.transition_counts.sum()
    )
    np.testing.assert_allclose(result.segments[2:].sum() + result.tail_counts.sum(), 1.0, rtol=1e-8)
    np.testing.assert_allclose(result.segments[1::2].sum() + result.tail_counts[1].sum(), 1.0, rtol=1e-8)


@pytest.mark.parametrize("S", [5, 60])
def test_compiled_semi_markov_e_step_agrees_with_the_reference(compiled, case, rng, S):
    """Demonstrations of unequal lengths, shorter and longer than the tables, on one thread and on several."""
    given = case(2, [1, 40, 33, 90, 2], 7, 5)
    arguments = given.x, given.lengths, tables_for(given, rng, S), given.emissions
    result, reference_result = (
        compiled.semi_markov_e_step(*arguments),
        reference.semi_markov_e_step(*arguments),
    )
    for name in SUMS:
        scale = np.abs(getattr(reference_result, name)).max()
        np.testing.assert_allclose(
            getattr(result, name),
            getattr(reference_result, name),
            rtol=1e-8,
            atol=1e-11 * scale,
            err_msg=name,
        )


def test_segments_are_the_same_to_the_last_digit_on_any_number_of_threads(compiled, case, rng):
    """Work that is cut into several groups, and shared, adds up in the order of the demonstrations."""
    given = case(1, rng.integers(50, 400, size=23).tolist(), 6, 10)
    arguments = given.x, given.lengths, tables_for(given, rng, 100), given.emissions
    alone = compiled.semi_markov_e_step(*arguments)
    for threads in (0, 2, 7):
        together = compiled.semi_markov_e_step(*arguments, threads=threads)
        for name in SUMS:
            np.testing.assert_array_equal(getattr(together, name), getattr(alone, name), err_msg=name)
