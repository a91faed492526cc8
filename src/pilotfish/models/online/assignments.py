"""Where the datapoints of a stream went."""

from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Float, Int


@dataclass(frozen=True, slots=True)
class Assignment:
    """Where one datapoint went.

    identity  of the cluster that took it: clusters are numbered by birth, and no number is used twice
    cost      what that cost: squared distance and surprise of the transition (5.26-5.28)
    change    how the loss at this datapoint changed with its update; it never rises (5.35)
    """

    cluster_id: int
    cost: float
    loss_change: float


@dataclass(frozen=True, slots=True, eq=False)
class Assignments:
    """Where N datapoints went, each as Assignment tells, and what became of clusters meanwhile.

    gone has a row for each cluster that is no more: at which datapoint, its identity, and the identity that
    it was merged into, or -1 when it was forgotten.
    """

    cluster_ids: Int[Array, " N"]
    costs: Float[Array, " N"]
    loss_changes: Float[Array, " N"]
    removed: Int[Array, "M 3"]


def current_cluster_ids(assignments: Assignments) -> Int[Array, " N"]:
    """The clusters that hold the datapoints after the last of them: those merged are followed."""
    into: dict[int, int] = {}
    for _, cluster_id, other in assignments.removed[::-1].tolist():
        into[cluster_id] = into.get(other, other) if other >= 0 else cluster_id
    return np.array([into.get(i, i) for i in assignments.cluster_ids.tolist()], dtype=np.int64)
