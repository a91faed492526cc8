"""Agreement of two labellings of the same datapoints, such as states and manual labels."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int


def match_labels(predicted: Int[Array, " N"], labels: Int[Array, " M"]) -> dict[int, int]:
    """Match states and labels one to one such that most datapoints agree (assignment problem).

    Args:
        predicted: State of each datapoint.
        labels: Label of each datapoint.

    Returns:
        The label of each state; states without a label are missing if there are more states than labels.

    Raises:
        InvalidInput: If the two differ in length or are empty.

    Source:
        Kuhn 1955, The Hungarian method for the assignment problem.
    """
    from scipy.optimize import linear_sum_assignment  # here: SciPy doubles the time of importing pilotfish

    counts, states, label_values = _contingency_table(predicted, labels)
    rows, columns = linear_sum_assignment(-counts)  # most agreements
    return {int(states[i]): int(label_values[j]) for i, j in zip(rows, columns, strict=True)}


def matched_accuracy(predicted: Int[Array, " N"], labels: Int[Array, " M"]) -> float:
    """Return the share of datapoints whose state matches their label, under the best one-to-one matching.

    Args:
        predicted: State of each datapoint.
        labels: Label of each datapoint.

    Raises:
        InvalidInput: If the two differ in length or are empty.
    """
    matching = match_labels(predicted, labels)
    predicted, labels = np.asarray(predicted), np.asarray(labels)
    agreements = sum(int(np.sum((predicted == state) & (labels == name))) for state, name in matching.items())
    return agreements / len(labels)


def normalised_mutual_information(predicted: Int[Array, " N"], labels: Int[Array, " M"]) -> float:
    """Return the mutual information of two labellings over the mean of their entropies, between 0 and 1.

    Unlike `matched_accuracy` it does not penalise a label that several states share. Two constant labellings
    have the value 1.

    Args:
        predicted: State of each datapoint.
        labels: Label of each datapoint.

    Raises:
        InvalidInput: If the two differ in length or are empty.

    Source:
        Strehl & Ghosh 2002, section 2.2, with the arithmetic instead of the geometric mean.
    """
    counts, _, _ = _contingency_table(predicted, labels)
    joint = counts / counts.sum()
    entropies = _entropy(joint.sum(axis=1)) + _entropy(joint.sum(axis=0))
    if entropies == 0.0:
        return 1.0
    return float(np.clip(2.0 * (entropies - _entropy(joint.ravel())) / entropies, 0.0, 1.0))


def _entropy(probabilities: Float[Array, " _"]) -> float:
    """Return the entropy [nats]."""
    positive = probabilities[probabilities > 0.0]
    return float(-np.sum(positive * np.log(positive)))


def _contingency_table(
    predicted: Int[Array, " N"], labels: Int[Array, " M"]
) -> tuple[Float[Array, "K L"], Int[Array, " K"], Int[Array, " L"]]:
    """Count the datapoints of each pair of state and label; return counts, states and labels."""
    if len(predicted) != len(labels) or not len(predicted):
        raise InvalidInput(
            f"there are {len(predicted)} states and {len(labels)} labels, expected one of each per datapoint"
        )
    states, state_index = np.unique(predicted, return_inverse=True)
    label_values, label_index = np.unique(labels, return_inverse=True)
    counts = np.zeros((len(states), len(label_values)))
    np.add.at(counts, (state_index, label_index), 1.0)
    return counts, states, label_values
