"""Semi-Markov chains against enumeration of all paths, and against equivalent Markov chains."""

import itertools

import numpy as np
import pytest
from scipy.special import logsumexp

from pilotfish.kernels import SemiMarkovTables, reference

SHORT = [(1, 1), (1, 3), (4, 1), (2, 2), (6, 2), (5, 3)]
EXPECTED = ("smoothed_state_probs", "transition_counts", "segment_counts", "long_segment_counts")
SUMS = (
    "log_likelihoods",
    "counts",
    "initial_counts",
    "transition_counts",
    "segment_counts",
    "long_segment_counts",
    "deviation_sums",
    "scatter_matrices",
)


def log_of(values):
    with np.errstate(divide="ignore"):
        return np.log(values)


@pytest.fixture
def problem(rng):
    """Return log-emissions and tables; a fraction `zeros` of all entries is impossible."""

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
    """Return state, begin and end of every segment of a path."""
    cuts = [0, *(t for t in range(1, len(path)) if path[t] != path[t - 1]), len(path)]
    return [(path[b], b, e) for b, e in itertools.pairwise(cuts)]


def path_log_weight(log_emissions, tables, path, counts):
    """Return log p(emissions, path) by its definition, and fill counts with those of the path."""
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
        counts["long_segment_counts" if s > S else "segment_counts"][where] += 1.0
        counts["smoothed_state_probs"][begin:end, state] = 1.0
    for (j, *_), (k, *_) in itertools.pairwise(segments):
        log_p += log_of(tables.transitions)[j, k]
        counts["transition_counts"][j, k] += 1.0
    return log_p


def enumerate_paths(log_emissions, tables):
    """Return every path, log p(emissions, path), and the counts of each path."""
    shapes = {
        "smoothed_state_probs": log_emissions.shape,
        "transition_counts": tables.transitions.shape,
        "segment_counts": tables.log_segment_weights.shape,
        "long_segment_counts": tables.log_tail_weights.shape,
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
def test_semi_markov_forward_backward_equals_enumeration(kernels, problem, T, K, S, spread, zeros):
    """Likelihood, state probabilities, transitions and segments are sums over all paths.

    Every path consists of segments of the four kinds, each with its own weights; segments may be shorter or
    longer than the tables. At the larger fraction of zeros, a quarter of all entries is impossible.
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
def test_semi_markov_forward_equals_shorter_recordings(kernels, problem, T, K, S, spread, zeros):
    """The log_forward at a step sums over the paths of a recording that ends there, by the last state.

    The log_segment_ends does so too, with weights as if another segment followed.
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
def test_semi_markov_viterbi_equals_enumeration(kernels, problem, T, K, S, spread, zeros):
    """The path is the most probable of all, and log_probability is its own."""
    given = problem(T, K, S, spread, zeros)
    paths, log_p, _ = enumerate_paths(*given)
    states, log_probability = kernels.semi_markov_viterbi(*given)
    np.testing.assert_allclose(log_probability, log_p.max(), rtol=1e-12, atol=1e-12)
    if np.isfinite(log_p.max()):
        np.testing.assert_array_equal(states, paths[log_p.argmax()])


@pytest.mark.parametrize("S", [2, 9])
def test_semi_markov_viterbi_tie_takes_lower_state(kernels, rng, S):
    """Among equally probable paths, the one whose last differing state has the lower index is returned.

    Integers everywhere make ties exact; many draws make ties of every kind.
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
        states, _ = kernels.semi_markov_viterbi(log_emissions, tables)
        assert tuple(states) == min(ties, key=lambda path: path[::-1])


def geometric(initial, transitions, S):
    """Return the semi-Markov chain of a Markov chain: geometric durations, transitions to other states."""
    stay = np.diag(transitions)
    leave = transitions * (1.0 - np.eye(len(stay)))
    survival = np.arange(S)[:, None] * log_of(stay)  # log p(a visit lasts longer than s - 1), s = 1 ... S
    ended = survival + log_of(1.0 - stay)
    segments = np.stack([ended, ended, survival, survival])
    return SemiMarkovTables(
        initial, leave / leave.sum(axis=1, keepdims=True), segments, np.full((2, len(stay)), -np.inf)
    )


@pytest.mark.parametrize(("T", "K"), [(1, 2), (2, 2), (40, 2), (60, 5)])
def test_semi_markov_geometric_durations_equal_markov_chain(kernels, chain, T, K):
    """Likelihood, state probabilities, transitions and most probable path."""
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
    np.testing.assert_array_equal(best[0], expected[0])
    np.testing.assert_allclose(best[1], expected[1], rtol=1e-12)


@pytest.mark.parametrize(("T", "S"), [(300, 40), (300, 400)])
@pytest.mark.parametrize("spread", [1.0, 700.0])
def test_semi_markov_expected_counts_are_consistent(kernels, problem, T, S, spread):
    """Segments weighted by their durations sum to the recording, except those longer than the tables.

    There is one segment more than transitions, and state probabilities sum to the time in each state.
    """
    log_emissions, tables = problem(T, 4, S, spread)
    result = kernels.semi_markov_forward_backward(log_emissions, tables)
    np.testing.assert_allclose(result.smoothed_state_probs.sum(axis=1), 1.0, rtol=1e-12)
    inside = np.einsum("csk,s->k", result.segment_counts, np.arange(1.0, S + 1.0))
    segments, longer = result.segment_counts, result.long_segment_counts.sum()
    np.testing.assert_allclose(segments.sum() + longer, 1.0 + result.transition_counts.sum(), rtol=1e-10)
    np.testing.assert_allclose(segments[2:].sum() + longer, 1.0, rtol=1e-10)
    if S >= T:
        np.testing.assert_allclose(inside, result.smoothed_state_probs.sum(axis=0), rtol=1e-9, atol=1e-9)
        assert not result.long_segment_counts.any()
        assert not result.segment_counts[:, T:].any()


def test_semi_markov_final_state_lasts_to_the_end(kernels):
    """Its row of transitions is zero: it lasts beyond any table, and no segment of it ends."""
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
    np.testing.assert_allclose(result.long_segment_counts, [[0.0, 1.0], [0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(result.log_likelihood, np.log(0.25), atol=1e-12)
    assert kernels.semi_markov_viterbi(log_emissions, tables)[0].tolist() == [0] * 3 + [1] * (T - 3)


def test_semi_markov_no_possible_path_is_zero(kernels):
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
        assert kernels.semi_markov_viterbi(log_emissions, chain)[1] == -np.inf


@pytest.mark.parametrize("rare", [1e-12, 1e-200, 1e-310])
def test_semi_markov_segment_far_beyond_underflow_is_found(kernels, rare):
    """State 1 is 1e-4000 times less likely at every early step, and the only one that can end."""
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
    np.testing.assert_allclose(result.segment_counts[1, turn - 1, 0], 1.0, rtol=1e-9)
    assert kernels.semi_markov_viterbi(log_emissions, tables)[0].sum() == T - turn


def tables_for(case, rng, S):
    K = len(case.initial)
    transitions = case.transitions * (1.0 - np.eye(K))
    log_segment_weights = rng.normal(size=(4, S, K)) - 0.1 * np.square(np.arange(S) - S / 3.0)[:, None]
    return SemiMarkovTables(case.initial, transitions, log_segment_weights, rng.normal(size=(2, K)))


def test_semi_markov_e_step_equals_sums_of_forward_backward(kernels, case, rng):
    """Every sum is its definition, from state probabilities of single demonstrations."""
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
        "segment_counts": sum(chain.segment_counts for chain in chains),
        "long_segment_counts": sum(chain.long_segment_counts for chain in chains),
        "deviation_sums": np.einsum("nk,pnki->pki", gamma, error),
        "scatter_matrices": np.einsum("nk,pnki,pnkj->pkij", gamma, error, error),
    }
    for name in SUMS:
        np.testing.assert_allclose(getattr(result, name), expected[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_semi_markov_e_step_impossible_demonstration_adds_nothing(kernels, case):
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
def test_semi_markov_compiled_equals_reference(compiled, problem, T, K, S, spread, zeros):
    """Any number of states and steps, also near the multiples of eight of a register."""
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
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-11, atol=1e-11)
    if np.isfinite(expected[1]):
        np.testing.assert_array_equal(found[0], expected[0])


@pytest.mark.parametrize("rng", [0], indirect=True)
@pytest.mark.parametrize("spread", [1.0, 3000.0])
def test_semi_markov_hundred_thousand_steps_is_consistent(compiled, problem, spread):
    """Durations sum to the length of the recording, and state probabilities sum to one.

    No stored number grows with time, while log-probabilities of the reference reach 1e8.
    """
    T, S = 100_000, 30
    result = compiled.semi_markov_forward_backward(*problem(T, 3, S, spread))
    assert np.isfinite(result.log_likelihood)
    lasted = np.einsum("csk,s->", result.segment_counts, np.arange(1.0, S + 1.0))
    np.testing.assert_allclose(lasted + result.long_segment_counts.sum() * S, T, rtol=1e-9)
    segments, longer = result.segment_counts, result.long_segment_counts
    np.testing.assert_allclose(segments.sum() + longer.sum(), 1.0 + result.transition_counts.sum())
    np.testing.assert_allclose(segments[2:].sum() + longer.sum(), 1.0, rtol=1e-8)
    np.testing.assert_allclose(segments[1::2].sum() + longer[1].sum(), 1.0, rtol=1e-8)


@pytest.mark.parametrize("S", [5, 60])
def test_semi_markov_e_step_compiled_equals_reference(compiled, case, rng, S):
    """Demonstrations shorter and longer than the tables, on one thread and on several."""
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


def test_semi_markov_e_step_any_number_of_threads_gives_same_bits(compiled, case, rng):
    """Groups of demonstrations are added in order."""
    given = case(1, rng.integers(50, 400, size=23).tolist(), 6, 10)
    arguments = given.x, given.lengths, tables_for(given, rng, 100), given.emissions
    alone = compiled.semi_markov_e_step(*arguments)
    for threads in (0, 2, 7):
        together = compiled.semi_markov_e_step(*arguments, threads=threads)
        for name in SUMS:
            np.testing.assert_array_equal(getattr(together, name), getattr(alone, name), err_msg=name)
