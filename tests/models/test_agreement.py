"""Labellings agree whatever they call things, and no further than they do."""

from itertools import permutations

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.models import matched_accuracy, matching, normalised_mutual_information


def labellings(rng, N=40, K=4, L=3):
    labels = rng.integers(0, L, N)
    found = np.where(rng.random(N) < 0.5, labels, rng.integers(0, K, N))
    return found, labels


@pytest.mark.parametrize(("K", "L"), [(4, 3), (3, 4), (3, 3), (1, 3)])
def test_the_matching_is_the_best_of_all(rng, K, L):
    """No other way of giving states labels one to one agrees with more datapoints: all are tried."""
    found, labels = labellings(rng, K=K, L=L)
    size = 5  # names beyond those in use stand for nothing
    best = max(np.mean(np.array(order)[found] == labels) for order in permutations(range(size)))
    assert matched_accuracy(found, labels) == pytest.approx(best)
    stands_for = matching(found, labels)
    assert len(set(stands_for.values())) == len(stands_for) == min(len(set(found)), len(set(labels)))


def test_mutual_information_is_what_its_definition_says(rng):
    """Sum over pairs of p log(p / (p q)), each pair counted by hand, over the mean of the entropies."""
    found, labels = labellings(rng)
    N, shared, entropies = len(found), 0.0, 0.0
    for k in set(found):
        for name in set(labels):
            both = np.mean((found == k) & (labels == name))
            if both:
                shared += both * np.log(both / (np.mean(found == k) * np.mean(labels == name)))
    for given in (found, labels):
        entropies -= sum(np.log(np.mean(given == value)) for value in given) / N
    expected = shared / (0.5 * entropies)
    assert normalised_mutual_information(found, labels) == pytest.approx(expected)


def test_names_do_not_matter(rng):
    """Renaming states changes nothing; a labelling agrees fully with itself under other names."""
    found, labels = labellings(rng)
    other = np.array([17, -3, 5, 0])[found]
    for measure in (matched_accuracy, normalised_mutual_information):
        assert measure(other, labels) == pytest.approx(measure(found, labels))
        assert measure(found, labels) < 1.0
        assert measure(found, found + 7) == pytest.approx(1.0)


def test_a_label_cut_in_two_costs_accuracy_and_less_information():
    """Matched accuracy counts only one of the halves; mutual information sees that each half is pure."""
    labels = np.repeat([0, 1], 50)
    cut = np.repeat([0, 1, 2], [50, 25, 25])
    assert matched_accuracy(cut, labels) == 0.75
    assert matching(cut, labels)[0] == 0
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
    found, labels = rng.integers(0, 4, 20_000), rng.integers(0, 4, 20_000)
    assert normalised_mutual_information(found, labels) < 1e-3
    assert matched_accuracy(found, labels) < 0.27
