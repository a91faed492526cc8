"""Labellings agree whatever they call things, and no further than they do."""

from itertools import permutations

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.models import match_labels, matched_accuracy, normalised_mutual_information


def labellings(rng, N=40, K=4, L=3):
    labels = rng.integers(0, L, N)
    states = np.where(rng.random(N) < 0.5, labels, rng.integers(0, K, N))
    return states, labels


@pytest.mark.parametrize(("K", "L"), [(4, 3), (3, 4), (3, 3), (1, 3)])
def test_the_matching_is_the_best_of_all(rng, K, L):
    """No other way of giving states labels one to one agrees with more datapoints: all are tried."""
    states, labels = labellings(rng, K=K, L=L)
    size = 5  # names beyond those in use stand for nothing
    best = max(np.mean(np.array(order)[states] == labels) for order in permutations(range(size)))
    assert matched_accuracy(states, labels) == pytest.approx(best)
    label_of_state = match_labels(states, labels)
    assert len(set(label_of_state.values())) == len(label_of_state) == min(len(set(states)), len(set(labels)))


def test_mutual_information_is_what_its_definition_says(rng):
    """Sum over pairs of p log(p / (p q)), each pair counted by hand, over the mean of the entropies."""
    states, labels = labellings(rng)
    N, shared, entropies = len(states), 0.0, 0.0
    for k in set(states):
        for name in set(labels):
            both = np.mean((states == k) & (labels == name))
            if both:
                shared += both * np.log(both / (np.mean(states == k) * np.mean(labels == name)))
    for given in (states, labels):
        entropies -= sum(np.log(np.mean(given == value)) for value in given) / N
    expected = shared / (0.5 * entropies)
    assert normalised_mutual_information(states, labels) == pytest.approx(expected)


def test_agreement_is_invariant_to_label_names(rng):
    """Renaming states changes nothing; a labelling agrees fully with itself under other names."""
    states, labels = labellings(rng)
    other = np.array([17, -3, 5, 0])[states]
    for measure in (matched_accuracy, normalised_mutual_information):
        assert measure(other, labels) == pytest.approx(measure(states, labels))
        assert measure(states, labels) < 1.0
        assert measure(states, states + 7) == pytest.approx(1.0)


def test_a_label_cut_in_two_costs_accuracy_and_less_information():
    """Matched accuracy counts only one of the halves; mutual information sees that each half is pure."""
    labels = np.repeat([0, 1], 50)
    cut = np.repeat([0, 1, 2], [50, 25, 25])
    assert matched_accuracy(cut, labels) == 0.75
    assert match_labels(cut, labels)[0] == 0
    assert normalised_mutual_information(cut, labels) == pytest.approx(
        np.log(2) / (0.5 * (np.log(2) + 1.5 * np.log(2)))
    )


def test_labellings_without_any_information():
    """One state for everything says nothing; two labellings of one name each agree; nothing is refused."""
    constant, labels = np.zeros(6, dtype=int), np.array([0, 1, 2, 0, 1, 2])
    assert normalised_mutual_information(constant, labels) == 0.0
    assert normalised_mutual_information(constant, constant) == 1.0
    assert matched_accuracy(constant, labels) == pytest.approx(1 / 3)
    for measure in (matched_accuracy, normalised_mutual_information):
        with pytest.raises(InvalidInput, match="0 states and 0 labels"):
            measure(np.zeros(0, dtype=int), np.zeros(0, dtype=int))
        with pytest.raises(InvalidInput, match="6 states and 5 labels, expected one of each"):
            measure(labels, labels[1:])


def test_independent_labellings_share_almost_nothing(rng):
    """Of many random datapoints, the information shared vanishes and the accuracy is that of a guess."""
    states, labels = rng.integers(0, 4, 20_000), rng.integers(0, 4, 20_000)
    assert normalised_mutual_information(states, labels) < 1e-3
    assert matched_accuracy(states, labels) < 0.27
