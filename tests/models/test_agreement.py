"""Agreement of labellings: matching, accuracy and normalised mutual information."""

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
def test_match_labels_equals_enumeration(rng, K, L):
    """The accuracy is the best over all one-to-one assignments of labels to states."""
    states, labels = labellings(rng, K=K, L=L)
    size = 5  # more names than labels in use
    best = max(np.mean(np.array(order)[states] == labels) for order in permutations(range(size)))
    assert matched_accuracy(states, labels) == pytest.approx(best)
    matching = match_labels(states, labels)
    assert len(set(matching.values())) == len(matching) == min(len(set(states)), len(set(labels)))


def test_normalised_mutual_information_equals_definition(rng):
    """Sum over pairs of p log(p / (p q)), over the mean of the entropies."""
    states, labels = labellings(rng)
    N, information, entropies = len(states), 0.0, 0.0
    for k in set(states):
        for name in set(labels):
            joint = np.mean((states == k) & (labels == name))
            if joint:
                information += joint * np.log(joint / (np.mean(states == k) * np.mean(labels == name)))
    for given in (states, labels):
        entropies -= sum(np.log(np.mean(given == value)) for value in given) / N
    expected = information / (0.5 * entropies)
    assert normalised_mutual_information(states, labels) == pytest.approx(expected)


def test_agreement_renamed_labels_is_unchanged(rng):
    """A labelling agrees fully with itself under other names."""
    states, labels = labellings(rng)
    other = np.array([17, -3, 5, 0])[states]
    for measure in (matched_accuracy, normalised_mutual_information):
        assert measure(other, labels) == pytest.approx(measure(states, labels))
        assert measure(states, labels) < 1.0
        assert measure(states, states + 7) == pytest.approx(1.0)


def test_agreement_split_label_costs_accuracy_and_less_information():
    """Accuracy counts one half only; each half is still informative."""
    labels = np.repeat([0, 1], 50)
    split = np.repeat([0, 1, 2], [50, 25, 25])
    assert matched_accuracy(split, labels) == 0.75
    assert match_labels(split, labels)[0] == 0
    assert normalised_mutual_information(split, labels) == pytest.approx(
        np.log(2) / (0.5 * (np.log(2) + 1.5 * np.log(2)))
    )


def test_agreement_constant_labelling_has_no_information():
    """Two constant labellings agree; empty labellings and unequal lengths are refused."""
    constant, labels = np.zeros(6, dtype=int), np.array([0, 1, 2, 0, 1, 2])
    assert normalised_mutual_information(constant, labels) == 0.0
    assert normalised_mutual_information(constant, constant) == 1.0
    assert matched_accuracy(constant, labels) == pytest.approx(1 / 3)
    for measure in (matched_accuracy, normalised_mutual_information):
        with pytest.raises(InvalidInput, match="0 states and 0 labels"):
            measure(np.zeros(0, dtype=int), np.zeros(0, dtype=int))
        with pytest.raises(InvalidInput, match="6 states and 5 labels, expected one of each"):
            measure(labels, labels[1:])


def test_agreement_independent_labellings_is_that_of_chance(rng):
    """With many random datapoints, the mutual information vanishes."""
    states, labels = rng.integers(0, 4, 20_000), rng.integers(0, 4, 20_000)
    assert normalised_mutual_information(states, labels) < 1e-3
    assert matched_accuracy(states, labels) < 0.27
