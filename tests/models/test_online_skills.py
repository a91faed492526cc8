"""What the skill of a scaled stream has beside its clusters: final states, endpoints, and no shortcuts."""

from itertools import pairwise, permutations

import numpy as np

import pilotfish as pf
from pilotfish.demonstrations import demonstration, position_layout
from pilotfish.io.stream_file import decode_stream, encode_stream
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import online
from pilotfish.models.online.to_skill import _select_shortcuts

LAYOUT = position_layout(1)
PLACES = np.array([0.0, 10.0, 20.0, 30.0])


def recording(*segments: tuple[int, int]) -> pf.Demonstration:
    """Return a recording that stays at places, each for a number of steps."""
    x = np.concatenate([np.full(steps, PLACES[place]) for place, steps in segments])
    return demonstration(x[:, None], 0.1, LAYOUT)


def stream(demonstrations: list[pf.Demonstration], scales: tuple[float, ...] | None = (1.0,)) -> pf.Skill:
    """Return the skill of a stream with one cluster per place, in the order of their first visit."""
    settings = online.HDPHSMM(4.0, 0.1, 0.0, 0.0, scales=scales)
    model = online.online_model(settings, LAYOUT, 0.1)
    for each in demonstrations:
        model, _ = online.observe_demonstration(model, each)
    return online.to_skill(model)


def most_probable_paths(transitions: np.ndarray) -> np.ndarray:
    """Return the largest product along any path without repetition, by enumeration."""
    K = len(transitions)
    best = np.zeros((K, K))
    for length in range(2, K + 1):
        for path in permutations(range(K), length):
            p = np.prod([transitions[i, j] for i, j in pairwise(path)])
            best[path[0], path[-1]] = max(best[path[0], path[-1]], p)
    return best


def random_transitions(rng: np.random.Generator, K: int) -> np.ndarray:
    """Return random transition probabilities, of which about half are zero."""
    counts = rng.integers(1, 9, size=(K, K)) * (rng.random((K, K)) < 0.5) * (1 - np.eye(K))
    return np.divide(counts, totals := counts.sum(axis=1, keepdims=True), out=counts, where=totals > 0.0)


def test_shortcuts_equal_enumeration_of_all_paths(rng):
    """A transition is a shortcut if a path over other states has a larger probability."""
    shortcuts = 0
    for _ in range(20):
        transitions = random_transitions(rng, 6)
        best = most_probable_paths(transitions)
        expected = (best > transitions * (1 + 1e-9)) & ~np.eye(6, dtype=bool) & (transitions > 0.0)
        actual = _select_shortcuts(transitions) & (transitions > 0.0)
        np.testing.assert_array_equal(actual, expected)
        shortcuts += int(expected.sum())
    assert shortcuts > 0


def test_shortcuts_left_out_keep_most_probable_paths(rng):
    """Every state is reached as before, and every state keeps its most probable successor."""
    for _ in range(20):
        transitions = random_transitions(rng, 6)
        kept = np.where(_select_shortcuts(transitions), 0.0, transitions)
        off_diagonal = ~np.eye(6, dtype=bool)
        before, after = most_probable_paths(transitions), most_probable_paths(kept)
        np.testing.assert_allclose(after[off_diagonal], before[off_diagonal], rtol=1e-12)
        np.testing.assert_array_equal(kept.max(axis=1), transitions.max(axis=1))


def test_to_skill_skipped_state_is_planned():
    """One of five demonstrations skips a state: only a skill without scales has this transition."""
    usual = [recording((0, 9 + m), (1, 10), (2, 10), (3, 10)) for m in range(4)]
    skips = recording((0, 25), (2, 10), (3, 10))
    skill, published = stream([*usual, skips]), stream([*usual, skips], scales=None)
    assert skill.dynamics.transitions.tolist() == np.eye(4, k=1).tolist()
    np.testing.assert_allclose(published.dynamics.transitions[0], [0.0, 0.8, 0.2, 0.0])
    assert set(skill.dynamics.plan_states(np.zeros((0, 4)), 40, complete=True).tolist()) == {0, 1, 2, 3}


def test_to_skill_optional_state_keeps_both_transitions():
    """A state that most demonstrations pass by remains optional."""
    skill = stream([recording((0, 9), (1, 9), (2, 9)), *[recording((0, 9), (2, 9)) for _ in range(3)]])
    np.testing.assert_allclose(skill.dynamics.transitions[0], [0.0, 0.25, 0.75])


def test_to_skill_state_of_most_ends_is_final():
    """Of four visits of place 1, three end a demonstration, also the last, which nothing follows."""
    through = recording((0, 5), (1, 5), (2, 5), (1, 7))
    direct = recording((0, 5), (1, 6))
    skill = stream([through, direct, direct])
    assert skill.dynamics.final_states().tolist() == [False, True, False]
    published = stream([through, direct, direct], scales=None)
    assert not published.dynamics.final_states().any()
    assert published.endpoints is None


def test_to_skill_state_of_half_the_ends_is_not_final():
    """As many visits continue as end."""
    skill = stream([recording((0, 5), (1, 5), (2, 5), (1, 7))])
    assert skill.dynamics.final_states().tolist() == [False, False, False]


def test_to_skill_endpoints_equal_those_of_datapoints(rng):
    """Mean and variance of first and last datapoints; from a batch fit, a stream, and a stream file."""
    demos = synthetic_valve(rng)[:5]
    names = tuple(frame.name for frame in demos[0].frames)
    fit = pf.learn(demos[:2], states=5, rng=rng).skill
    settings = online.estimate_penalties(fit, demos[:2])
    begun = online.from_batch_fit(fit, demos[:2], settings)
    empty = online.online_model(settings, demos[0].layout, demos[0].period, names)
    x = pf.demonstrations.views(demos).x
    last = np.cumsum([len(d.x) for d in demos]) - 1
    first = np.concatenate([[0], last[:-1] + 1])
    for model, remaining in ((begun, demos[2:]), (empty, demos)):
        for n, each in enumerate(remaining):
            model, _ = online.observe_demonstration(model, each)
            if n == 1:
                model = decode_stream(encode_stream(model))
        skill = online.to_skill(model)
        for n, rows in enumerate((first, last)):
            np.testing.assert_allclose(skill.endpoints.means[:, n], x[:, rows].mean(axis=1), atol=1e-9)
            variances = x[:, rows].var(axis=1) + skill.regularisation
            np.testing.assert_allclose(skill.endpoints.variances[:, n], variances, rtol=1e-6)
