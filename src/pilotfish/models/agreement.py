"""How far two labellings of the same datapoints agree, whatever their names: states and a person's labels."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int


def match_labels(predicted: Int[Array, " N"], labels: Int[Array, " M"]) -> dict[int, int]:
    """The label that each state found stands for, one to one, such that the most datapoints agree.

    States that get no label, because there are more states than labels, are not in it.
    Raises: InvalidInput, when the two differ in length or are empty.
    Source: Kuhn 1955, the assignment problem.
    """
    from scipy.optimize import linear_sum_assignment  # here: scipy doubles the time of importing pilotfish

    counts, states, label_values = _contingency_table(predicted, labels)
    rows, columns = linear_sum_assignment(-counts)  # the most agreements
    return {int(states[i]): int(label_values[j]) for i, j in zip(rows, columns, strict=True)}


def matched_accuracy(predicted: Int[Array, " N"], labels: Int[Array, " M"]) -> float:
    """The share of datapoints whose state stands for their label, under the best matching one to one.

    Raises: as matching does.
    """
    label_of_state = match_labels(predicted, labels)
    predicted, labels = np.asarray(predicted), np.asarray(labels)
    agree = sum(
        int(np.sum((predicted == state) & (labels == name))) for state, name in label_of_state.items()
    )
    return agree / len(labels)


def normalised_mutual_information(predicted: Int[Array, " N"], labels: Int[Array, " M"]) -> float:
    """What knowing one labelling tells of the other, over the mean of their entropies: 0 nothing, 1 all.

    Unlike matched accuracy it forgives a label that several states share. Two labellings of one name each
    agree fully.
    Raises: as matching does.
    Source: Strehl & Ghosh 2002, section 2.2, with the arithmetic mean in place of the geometric one.
    """
    counts, _, _ = _contingency_table(predicted, labels)
    joint = counts / counts.sum()
    state_index, label_index = joint.sum(axis=1), joint.sum(axis=0)
    entropies = _entropy(state_index) + _entropy(label_index)
    if entropies == 0.0:
        return 1.0
    shared = entropies - _entropy(joint.ravel())
    return float(np.clip(2.0 * shared / entropies, 0.0, 1.0))


def _entropy(shares: Float[Array, " _"]) -> float:
    """In nats."""
    positive = shares[shares > 0.0]
    return float(-np.sum(positive * np.log(positive)))


def _contingency_table(
    predicted: Int[Array, " N"], labels: Int[Array, " M"]
) -> tuple[Float[Array, "K L"], Int[Array, " K"], Int[Array, " L"]]:
    """How many datapoints have each pair of a state and a label; the states; the labels."""
    if len(predicted) != len(labels) or not len(predicted):
        raise InvalidInput(
            f"there are {len(predicted)} states and {len(labels)} labels, expected one of each a datapoint"
        )
    states, state_index = np.unique(predicted, return_inverse=True)
    label_values, label_index = np.unique(labels, return_inverse=True)
    counts = np.zeros((len(states), len(label_values)))
    np.add.at(counts, (state_index, label_index), 1.0)
    return counts, states, label_values
