"""Clusters of a stream, unpacked from a StreamState, and their duration statistics."""

from dataclasses import dataclass, field

import numpy as np

from pilotfish.kernels.reference.subspaces import Subspace, pack_subspace, unpack_subspace
from pilotfish.kernels.stream_state import (
    CLUSTER_ID,
    MEAN_DURATION,
    SEGMENTS,
    SQUARED_DEVIATIONS,
    STATISTICS,
    StreamParameters,
    StreamState,
    zero_arrays,
)
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(slots=True, eq=False)
class Cluster:
    """Cluster of a StreamState, unpacked; statistics are in the columns of STATISTICS."""

    statistics: Float[Array, " 9"]
    subspaces: list[Subspace]


@shorten_repr
@dataclass(slots=True, eq=False)
class MutableState:
    """StreamState, unpacked, while it changes."""

    parameters: StreamParameters
    clusters: list[Cluster]
    transition_counts: Float[Array, "K K"]
    current_cluster: int  # -1 at the start of a demonstration
    steps: int
    next_cluster_id: int
    points: int
    previous: int  # cluster of the segment before, -1 if there is none in this demonstration
    previous_steps: int
    removed: list[tuple[int, int, int]] = field(default_factory=list)


def unpack(state: StreamState, parameters: StreamParameters) -> MutableState:
    """Return the unpacked state."""
    statistics = np.stack([getattr(state, name) for name in STATISTICS], axis=1)
    clusters = [
        Cluster(statistics[k].copy(), [unpack_subspace(state, k, p) for p in range(state.frames)])
        for k in range(state.clusters)
    ]
    return MutableState(
        parameters,
        clusters,
        state.transition_counts.copy(),
        state.current_cluster,
        state.steps_in_cluster,
        state.next_cluster_id,
        state.datapoints,
        state.previous_cluster,
        state.previous_steps,
    )


def pack(stream: MutableState, frames: int, width: int) -> StreamState:
    """Return the packed state."""
    ranks = [len(subspace.variances) for cluster in stream.clusters for subspace in cluster.subspaces]
    arrays = zero_arrays(len(stream.clusters), frames, width, max(ranks, default=0))
    arrays["transition_counts"][:] = stream.transition_counts
    for k, cluster in enumerate(stream.clusters):
        for name, column in STATISTICS.items():
            arrays[name][k] = cluster.statistics[column]
        for p, subspace in enumerate(cluster.subspaces):
            pack_subspace(subspace, arrays, k, p)
    counters = {
        "current_cluster": stream.current_cluster,
        "steps_in_cluster": stream.steps,
        "next_cluster_id": stream.next_cluster_id,
        "datapoints": stream.points,
        "previous_cluster": stream.previous,
        "previous_steps": stream.previous_steps,
    }
    return StreamState.from_arrays(arrays, counters)


def find_cluster(stream: MutableState, cluster_id: int) -> int:
    """Return the index of a cluster by its id, or -1."""
    for k, cluster in enumerate(stream.clusters):
        if cluster.statistics[CLUSTER_ID] == cluster_id:
            return k
    return -1


def remove_cluster(stream: MutableState, k: int, n: int, into: int) -> None:
    """Remove a cluster with its transition counts; `into` is the id of the cluster that it merged into."""
    stream.removed.append((n, int(stream.clusters[k].statistics[CLUSTER_ID]), into))
    del stream.clusters[k]
    stream.transition_counts = np.delete(np.delete(stream.transition_counts, k, axis=0), k, axis=1)
    stream.current_cluster = _index_after_removal(stream.current_cluster, k)
    stream.previous = _index_after_removal(stream.previous, k)
    if stream.previous < 0:
        stream.previous_steps = 0


def _index_after_removal(index: int, k: int) -> int:
    """Return the new value of an index after the removal of k; -1 for k itself."""
    return -1 if index == k else index - (index > k)


def squared_mean_distance(a: Cluster, b: Cluster) -> float:
    """Return the squared distance between means, summed over frames."""
    return float(sum(np.sum((p.mean - q.mean) ** 2) for p, q in zip(a.subspaces, b.subspaces, strict=True)))


def add_segment_duration(statistics: Float[Array, " 9"], steps: int) -> None:
    """Add a completed segment to the duration statistics (5.32-5.33, Welford)."""
    statistics[SEGMENTS] += 1.0
    deviation = steps - statistics[MEAN_DURATION]
    statistics[MEAN_DURATION] += deviation / statistics[SEGMENTS]
    statistics[SQUARED_DEVIATIONS] += deviation * (steps - statistics[MEAN_DURATION])


def remove_segment_duration(statistics: Float[Array, " 9"], steps: int) -> None:
    """Remove a completed segment from the duration statistics."""
    statistics[SEGMENTS] -= 1.0
    if statistics[SEGMENTS] == 0.0:
        statistics[MEAN_DURATION] = statistics[SQUARED_DEVIATIONS] = 0.0
        return
    deviation = steps - statistics[MEAN_DURATION]
    statistics[MEAN_DURATION] -= deviation / statistics[SEGMENTS]
    remainder = statistics[SQUARED_DEVIATIONS] - deviation * (steps - statistics[MEAN_DURATION])
    statistics[SQUARED_DEVIATIONS] = max(remainder, 0.0)


def pool_durations(
    a: Float[Array, " 9"], b: Float[Array, " 9"], number: int, mean: int, squares: int | None
) -> None:
    """Pool the means and squared deviations of two sets into the first (Chan, Golub & LeVeque 1979)."""
    total = a[number] + b[number]
    if total == 0.0:
        return
    deviation = b[mean] - a[mean]
    if squares is not None:
        a[squares] += b[squares] + deviation**2 * a[number] * b[number] / total
    a[mean] += deviation * b[number] / total
    a[number] = total
