"""State of an online learner: named arrays for Python, and the packed numbers that the kernels update.

Packing. A step of the compiled kernel takes about a microsecond, less than it takes to build the named
arrays. `StreamState` therefore holds the packed form, and its named arrays are properties. `counters` holds
six numbers of the stream, in the order of `INITIAL_COUNTERS`. `rows` holds one row per cluster: first the
columns of `STATISTICS`, then for every frame a block of

    dimension d, number of directions r >= d, mean (D, padded), variances (C), distances (C + 1, padded),
    bases (D x C, row-major).

The capacity C is a multiple of four, and mean and distances are padded with zeros to a multiple of four, so
that the kernel reads aligned rows. Entries beyond the first r directions are zero. An index of
-1 means no cluster.

Keep in step: the layout of a row here, in cpp/streaming.hpp, and nowhere else. The NumPy reference reads the
named arrays and returns them through `StreamState.from_arrays`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Any

import numpy as np

from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr

MAX_VALUE = 1e100  # of a datapoint: its square must not overflow


class Weighting(IntEnum):
    """Update of the cluster weights with every datapoint (5.15, 5.16, and a constant step)."""

    COUNT = 0
    EXPONENTIAL_DECAY = 1
    CONSTANT = 2


@shorten_repr
@dataclass(frozen=True, slots=True)
class StreamParameters:
    """Penalties and limits of an online learner, with the letters of Tanwani 2018.

    Attributes:
        cluster: Penalty lambda of a new cluster.
        dimension: Penalty lambda_1 of a dimension of a subspace.
        transition: Penalty lambda_2 of a transition, per nat.
        new_transition: Penalty lambda_3 of a transition that has not occurred before.
        bandwidth: Squared distance b_m at which the influence of a subspace has decayed to 1 / e.
        merge_distance: Clusters whose means are closer than this are merged.
        weighting: A value of `Weighting`.
        weight: Discount factor of an exponential decay, or the constant weight.
        forget_below: A cluster whose weight falls below this value is removed; 0 removes none.
        extra_directions: Directions stored beyond the dimension d of a subspace.
        max_dimension: Largest dimension of a subspace.
        max_clusters: The lightest cluster is removed when a new one would exceed this number.
        batch: Number of datapoints that are assigned before subspaces are updated.
        packed: All of the above in this order, for the compiled kernel.
    """

    cluster: float
    dimension: float
    transition: float
    new_transition: float
    bandwidth: float
    merge_distance: float
    weighting: int
    weight: float
    forget_below: float
    extra_directions: int
    max_dimension: int
    max_clusters: int
    batch: int
    packed: Float[Array, " 13"] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        values = [getattr(self, f.name) for f in fields(self) if f.init]
        object.__setattr__(self, "packed", np.array(values, dtype=np.float64))


# First columns of a packed row.
CLUSTER_ID, WEIGHT, POINTS, DEMONSTRATION_STARTS, SEGMENTS, MEAN_DURATION = range(6)
SQUARED_DEVIATIONS, CENSORED, MEAN_CENSORED_DURATION = range(6, 9)

STATISTICS = {
    "cluster_ids": CLUSTER_ID,
    "weights": WEIGHT,
    "points": POINTS,
    "demonstration_starts": DEMONSTRATION_STARTS,
    "segments": SEGMENTS,
    "mean_durations": MEAN_DURATION,
    "squared_deviations": SQUARED_DEVIATIONS,
    "censored": CENSORED,
    "mean_censored_durations": MEAN_CENSORED_DURATION,
}
INITIAL_COUNTERS = {
    "current_cluster": -1,
    "steps_in_cluster": 0,
    "next_cluster_id": 0,
    "datapoints": 0,
    "previous_cluster": -1,
    "previous_steps": 0,
}


def _counter(index: int, doc: str) -> property:
    return property(lambda state: int(state.counters[index]), doc=doc)


def _statistic(column: int, doc: str) -> property:
    return property(lambda state: state.rows[:, column], doc=doc)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class StreamState:
    """K clusters in P frames, their subspaces, and the transitions and durations between them.

    Clusters are in the order of their creation. The named arrays below the attributes are float64 views of
    the packed numbers: do not write to them, use `with_changes`. A value with an index beyond r in
    `variances`, `distances` and `bases` is zero.

    Attributes:
        counters: Packed counters, read by the kernels.
        rows: Packed clusters, read by the kernels.
        transition_counts: Number of times a datapoint in cluster j followed one in cluster i, i = j included.
        frames: Number of frames P.
        width: Number of columns D.
        capacity: Number of directions C per subspace, a multiple of four.
    """

    counters: Float[Array, " 6"]
    rows: Float[Array, "K R"]
    transition_counts: Float[Array, "K K"]
    frames: int
    width: int
    capacity: int

    @classmethod
    def empty(cls, frames: int, width: int) -> StreamState:
        """Return the state before the first datapoint.

        Args:
            frames: Number of frames P.
            width: Number of columns D.
        """
        return cls.from_arrays(zero_arrays(0, frames, width, 0))

    @classmethod
    def from_arrays(
        cls, arrays: Mapping[str, Float[Array, ...]], counters: Mapping[str, int] = INITIAL_COUNTERS
    ) -> StreamState:
        """Pack named arrays.

        Args:
            arrays: One array per name and shape of `zero_arrays`.
            counters: Values of `current_cluster`, `steps_in_cluster`, `next_cluster_id`, `datapoints`,
                `previous_cluster` and `previous_steps`; by default those at the start of a stream.

        Returns:
            A state that does not share memory with the arrays.
        """
        K, P, D, given = arrays["bases"].shape
        capacity = round_up_to_four(given)
        rows = np.zeros((K, stream_row_length(P, D, capacity)))
        packed = np.array([counters[name] for name in INITIAL_COUNTERS], dtype=np.float64)
        transition_counts = np.array(arrays["transition_counts"], dtype=np.float64)
        state = cls(packed, rows, transition_counts, P, D, capacity)
        for name, column in STATISTICS.items():
            rows[:, column] = arrays[name]
        for name in ("dimensions", "ranks", "means"):
            getattr(state, name)[:] = arrays[name]
        for name in ("variances", "distances", "bases"):
            getattr(state, name)[..., : arrays[name].shape[-1]] = arrays[name]
        return state

    def to_arrays(self) -> dict[str, Float[Array, ...]]:
        """Return a copy of every named array."""
        names = zero_arrays(0, self.frames, self.width, 0)
        return {name: np.array(getattr(self, name), order="C") for name in names}

    def to_counters(self) -> dict[str, int]:
        """Return every counter by its name."""
        return {name: int(value) for name, value in zip(INITIAL_COUNTERS, self.counters, strict=True)}

    def with_changes(self, **changes: Any) -> StreamState:
        """Return a copy of the state in which some arrays or counters are replaced.

        Args:
            changes: New values by the name of the array or the counter.
        """
        counters = {name: changes.pop(name, value) for name, value in self.to_counters().items()}
        return StreamState.from_arrays(self.to_arrays() | changes, counters)

    @property
    def clusters(self) -> int:
        """Number of clusters K."""
        return len(self.rows)

    current_cluster = _counter(
        0, "Index of the cluster of the last datapoint; -1 where a demonstration begins."
    )
    steps_in_cluster = _counter(1, "Number of steps that the stream has stayed in the current cluster.")
    next_cluster_id = _counter(2, "Identifier of the next cluster to be created.")
    datapoints = _counter(3, "Number of datapoints, including those of removed clusters.")
    previous_cluster = _counter(4, "Index of the cluster before the current segment; -1 if there is none.")
    previous_steps = _counter(5, "Length of the segment before the current one [steps].")

    cluster_ids = _statistic(CLUSTER_ID, "Identifiers (K,) in the order of creation.")
    weights = _statistic(WEIGHT, "Weight w (K,) of the past relative to the next datapoint.")
    points = _statistic(POINTS, "Number of datapoints assigned to each cluster (K,).")
    demonstration_starts = _statistic(
        DEMONSTRATION_STARTS, "Number of demonstrations that began in each cluster (K,)."
    )
    segments = _statistic(SEGMENTS, "Number of completed segments (K,).")
    mean_durations = _statistic(MEAN_DURATION, "Mean duration of those segments (K,) [steps].")
    squared_deviations = _statistic(
        SQUARED_DEVIATIONS, "Sum of squared deviations from the mean duration (K,) [steps^2]."
    )
    censored = _statistic(CENSORED, "Number of segments censored by the end of a demonstration (K,).")
    mean_censored_durations = _statistic(
        MEAN_CENSORED_DURATION, "Mean duration of the censored segments (K,) [steps]."
    )

    @property
    def dimensions(self) -> Float[Array, "K P"]:
        """Dimension d of each subspace."""
        return self._blocks[:, :, 0]

    @property
    def ranks(self) -> Float[Array, "K P"]:
        """Number r of stored directions, d and at most `extra_directions` more."""
        return self._blocks[:, :, 1]

    @property
    def means(self) -> Float[Array, "K P D"]:
        """Mean of each cluster in each frame."""
        return self._blocks[:, :, 2 : 2 + self.width]

    @property
    def variances(self) -> Float[Array, "K P C"]:
        """Variance along each stored direction, in descending order."""
        start = 2 + round_up_to_four(self.width)
        return self._blocks[:, :, start : start + self.capacity]

    @property
    def distances(self) -> Float[Array, "K P _"]:
        """Mean squared distances to the subspaces of the first 0 ... C directions (5.22)."""
        start = 2 + round_up_to_four(self.width) + self.capacity
        return self._blocks[:, :, start : start + self.capacity + 1]

    @property
    def bases(self) -> Float[Array, "K P D C"]:
        """Stored directions, orthonormal columns."""
        flat = self._blocks[:, :, block_length(self.width, self.capacity) - self.width * self.capacity :]
        return flat.reshape(*flat.shape[:2], self.width, self.capacity)

    @property
    def _blocks(self) -> Float[Array, "K P S"]:
        length = block_length(self.width, self.capacity)
        return self.rows[:, len(STATISTICS) :].reshape(self.clusters, self.frames, length)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Assignments:
    """Result of N datapoints, and the clusters that were removed at the same time.

    Attributes:
        cluster_ids: Identifier of the cluster to which each datapoint was assigned.
        costs: Cost of each assignment: squared distance plus transition penalties (5.26-5.28).
        loss_changes: Change of the loss at each datapoint by its update; at most 0 up to rounding (5.35).
        removed: One row per removed cluster: index of the datapoint, identifier of the cluster, and
            identifier of the cluster that it was merged into, or -1 if it was forgotten.
    """

    cluster_ids: Int[Array, " N"]
    costs: Float[Array, " N"]
    loss_changes: Float[Array, " N"]
    removed: Int[Array, "M 3"]

    def current_cluster_ids(self) -> Int[Array, " N"]:
        """Return the cluster that holds each datapoint after the last one, with merges applied."""
        target: dict[int, int] = {}
        for _, cluster_id, merged_into in self.removed[::-1].tolist():
            target[cluster_id] = target.get(merged_into, merged_into) if merged_into >= 0 else cluster_id
        return np.array([target.get(i, i) for i in self.cluster_ids.tolist()], dtype=np.int64)


def zero_arrays(clusters: int, frames: int, width: int, capacity: int) -> dict[str, Float[Array, ...]]:
    """Return the named arrays of a state, all zero.

    Args:
        clusters: Number of clusters K.
        frames: Number of frames P.
        width: Number of columns D.
        capacity: Number of directions C.
    """
    K, P, D, C = clusters, frames, width, capacity
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(STATISTICS, (K,))
    shapes |= {"dimensions": (K, P), "ranks": (K, P), "means": (K, P, D), "variances": (K, P, C)}
    shapes |= {"distances": (K, P, C + 1), "bases": (K, P, D, C), "transition_counts": (K, K)}
    return {name: np.zeros(shape) for name, shape in shapes.items()}


def round_up_to_four(size: int) -> int:
    """Return the least multiple of four that is not less."""
    return (size + 3) // 4 * 4


def stream_row_length(frames: int, width: int, capacity: int) -> int:
    """Return the length of a packed row."""
    return len(STATISTICS) + frames * block_length(width, capacity)


def block_length(width: int, capacity: int) -> int:
    """Return the length of the block of one frame in a packed row."""
    return 2 + round_up_to_four(width) + capacity + (capacity + 4) + width * capacity
