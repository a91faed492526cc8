"""Scalable online sequence clustering (SOSC): one step of learning per datapoint of a stream.

Model. K clusters, each with a mean and a low-dimensional subspace per frame, and a transition count between
each pair of clusters. It is the small-variance limit of a hidden semi-Markov model with a Dirichlet process
prior. Learning minimises the loss

    sum over datapoints of dist(x, cluster) + lambda_1 d(cluster) + transition cost,  plus lambda per cluster.

Distance (5.13). With e = x - mean and an orthonormal basis U of d directions, dist = |e - rho U U^T e|^2
summed over frames, where rho = exp(-|e|^2 / b_m). Near the mean, deviations along the subspace are free; far
from it they count.

Assignment (5.26-5.28). From the current cluster i, a transition to j costs lambda_2 log(c_i / c_ij), with
transition counts c_ij and c_i = sum_j c_ij. A transition that never occurred costs lambda_2 log(c_i + 1) +
lambda_3. x goes to the cluster of least distance plus transition cost, or to a new one if that costs more
than lambda plus the cost of a transition that never occurred. At the start of a demonstration transitions are
free.

Update. Transition counts and segment durations follow the assignment (5.29-5.34). The subspace takes x by a
rank-one update of its covariance and chooses the dimension with the least mean loss, see subspaces.py
(5.17-5.23). Weights then count datapoints, decay exponentially, or are constant (5.15, 5.16). Light clusters
are forgotten, and clusters with close means are merged: counts add up, moments and durations are pooled.

Invariants. No update raises the loss at its datapoint, up to rounding: `loss_changes` are at most zero. The
result does not depend on how a stream is cut into calls, only on the batch size. Without truncation, merging
and decay, a cluster has exactly the moments of its datapoints. Segments that a merge joins are one segment.

Batches. `batch` datapoints are assigned one after the other before the subspaces change, then the subspaces
take the same datapoints in order.

Keep in step: cpp/streaming.cpp makes the same decisions in the same order, ties included; its lower bounds of
the distance only skip clusters that cannot win. The layout of packed rows is in stream_state.py.

Source: Tanwani 2018, algorithm 5; Kulis & Jordan 2012 for the small-variance limit.
"""

import numpy as np

from pilotfish.kernels.errors import datapoint_error
from pilotfish.kernels.reference.clusters import (
    Cluster,
    MutableState,
    add_segment_duration,
    find_cluster,
    pack,
    pool_durations,
    remove_cluster,
    remove_segment_duration,
    squared_mean_distance,
    unpack,
)
from pilotfish.kernels.reference.subspaces import (
    initial_subspace,
    merge_subspaces,
    point_loss,
    reorthonormalise,
    squared_distance,
    truncate,
    update_subspace,
)
from pilotfish.kernels.stream_state import (
    CENSORED,
    CLUSTER_ID,
    DEMONSTRATION_STARTS,
    MAX_VALUE,
    MEAN_CENSORED_DURATION,
    MEAN_DURATION,
    POINTS,
    SEGMENTS,
    SQUARED_DEVIATIONS,
    STATISTICS,
    WEIGHT,
    Assignments,
    StreamParameters,
    StreamState,
    Weighting,
)
from pilotfish.types import Array, Float

ORTHONORMALISE_EVERY = 256  # datapoints of a cluster


def observe(
    x: Float[Array, "N P D"], state: StreamState, parameters: StreamParameters
) -> tuple[StreamState, Assignments]:
    """Return the state after N datapoints, in order, and how they were assigned.

    Args:
        x: Datapoints in every frame.
        state: State before them.
        parameters: Penalties and limits.

    Raises:
        InvalidInput: If a number is not finite or larger than 1e100.

    Source:
        Tanwani 2018, algorithm 5, corrected as described at the head of this file.
    """
    if (bad := np.flatnonzero(~(np.abs(x) <= MAX_VALUE))).size:
        raise datapoint_error(x, int(bad[0]))
    stream = unpack(state, parameters)
    cluster_ids, costs = np.empty(len(x), dtype=np.int64), np.empty(len(x))
    loss_changes = np.empty(len(x))
    for start in range(0, len(x), parameters.batch):
        batch = range(start, min(start + parameters.batch, len(x)))
        created = set()
        for n in batch:
            k, costs[n], loss_changes[n] = assign_point(stream, x[n])
            if k == len(stream.clusters):
                k = create_cluster(stream, x[n], n)
                created.add(n)
            cluster_ids[n] = stream.clusters[k].statistics[CLUSTER_ID]
            loss_changes[n] += update_transitions(stream, k)
        for n in batch:
            loss_changes[n] += update_cluster(stream, x[n], int(cluster_ids[n]), n in created)
            remove_light_clusters(stream, n)
        last = batch[-1]
        for cluster_id in dict.fromkeys(cluster_ids[batch].tolist()):
            merge_close_clusters(stream, cluster_id, last)
    removed = np.array(stream.removed, dtype=np.int64).reshape(-1, 3)
    assignments = Assignments(cluster_ids, costs, loss_changes, removed)
    return pack(stream, state.frames, state.width), assignments


def observe_one(
    x: Float[Array, "P D"], state: StreamState, parameters: StreamParameters
) -> tuple[StreamState, int, float, float]:
    """Return the state after one datapoint, its cluster id, the cost of the assignment and the loss change.

    Args:
        x: Datapoint in every frame.
        state: State before it.
        parameters: Penalties and limits.

    Raises:
        InvalidInput: If a number is not finite or larger than 1e100.
    """
    after, step = observe(x[None], state, parameters)
    return after, int(step.cluster_ids[0]), float(step.costs[0]), float(step.loss_changes[0])


def assign_point(stream: MutableState, x: Float[Array, "P D"]) -> tuple[int, float, float]:
    """Return the cluster of least cost (K for a new one), its cost, and the loss change of a new cluster."""
    parameters, K = stream.parameters, len(stream.clusters)
    costs = np.array([cluster_distance(cluster, x, parameters.bandwidth) for cluster in stream.clusters])
    costs += transition_costs(stream)
    new = parameters.cluster
    if stream.current_cluster >= 0:
        new += (
            parameters.transition * np.log(stream.transition_counts[stream.current_cluster].sum() + 1.0)
            + parameters.new_transition
        )
    if K == 0:
        return 0, new, 0.0
    best = int(costs.argmin())
    if costs[best] < new:
        return best, float(costs[best]), 0.0
    dimensions = sum(subspace.dimension for subspace in stream.clusters[best].subspaces)
    return (
        K,
        float(new),
        float(new - costs[best] - (parameters.dimension * dimensions if dimensions else 0.0)),
    )


def cluster_distance(cluster: Cluster, x: Float[Array, "P D"], bandwidth: float) -> float:
    """Return the squared distance, summed over frames."""
    return sum(
        squared_distance(row, subspace, bandwidth) for row, subspace in zip(x, cluster.subspaces, strict=True)
    )


def transition_costs(stream: MutableState) -> Float[Array, " K"]:
    """Return the transition costs from the current cluster (5.26, 5.27); zeros if there is none."""
    if stream.current_cluster < 0:
        return np.zeros(len(stream.clusters))
    parameters, transition_counts = stream.parameters, stream.transition_counts[stream.current_cluster]
    occurred = transition_counts > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        log_ratio = np.log(
            np.where(occurred, transition_counts.sum() / transition_counts, transition_counts.sum() + 1.0)
        )
    return np.asarray(parameters.transition * log_ratio + np.where(occurred, 0.0, parameters.new_transition))


def create_cluster(stream: MutableState, x: Float[Array, "P D"], n: int) -> int:
    """Create a cluster at x and return its index; at the maximum, remove the lightest other cluster first."""
    if len(stream.clusters) >= stream.parameters.max_clusters:
        weights = np.array([cluster.statistics[WEIGHT] for cluster in stream.clusters])
        if len(weights) > 1 and stream.current_cluster >= 0:
            weights[stream.current_cluster] = np.inf
        remove_cluster(stream, int(weights.argmin()), n, -1)
    statistics = np.zeros(len(STATISTICS))
    statistics[CLUSTER_ID] = stream.next_cluster_id
    statistics[WEIGHT] = _initial_weight(stream.parameters)
    stream.next_cluster_id += 1
    stream.clusters.append(Cluster(statistics, [initial_subspace(row) for row in x]))
    stream.transition_counts = np.pad(stream.transition_counts, (0, 1))
    return len(stream.clusters) - 1


def _initial_weight(parameters: StreamParameters) -> float:
    return parameters.weight if parameters.weighting == Weighting.CONSTANT else 1.0


def update_transitions(stream: MutableState, k: int) -> float:
    """Update transition counts and durations (5.29-5.34); return the change of the transition cost."""
    statistics, previous = stream.clusters[k].statistics, stream.current_cluster
    statistics[POINTS] += 1.0
    stream.points += 1
    loss_change = 0.0
    if previous < 0:
        statistics[DEMONSTRATION_STARTS] += 1.0
    else:
        c, total = stream.transition_counts[previous, k], stream.transition_counts[previous].sum()
        if c > 0.0:
            loss_change = stream.parameters.transition * np.log(c / total * (total + 1.0) / (c + 1.0))
        stream.transition_counts[previous, k] += 1.0
    if previous == k:
        stream.steps += 1
        return float(loss_change)
    if previous >= 0:
        add_segment_duration(stream.clusters[previous].statistics, stream.steps)
    stream.previous, stream.previous_steps = previous, stream.steps if previous >= 0 else 0
    stream.current_cluster, stream.steps = k, 1
    return float(loss_change)


def update_cluster(stream: MutableState, x: Float[Array, "P D"], cluster_id: int, new_cluster: bool) -> float:
    """Update the subspaces of the cluster by x, then all weights; return the loss change at x."""
    parameters, loss_change = stream.parameters, 0.0
    k = find_cluster(stream, cluster_id)
    if k >= 0 and not new_cluster:
        cluster = stream.clusters[k]
        w = cluster.statistics[WEIGHT]
        check = cluster.statistics[POINTS] % ORTHONORMALISE_EVERY == 0.0
        for p, previous in enumerate(cluster.subspaces):
            max_dimension = min(parameters.max_dimension, len(previous.mean) - 1)
            after = update_subspace(
                x[p], previous, float(w), parameters.dimension, parameters.bandwidth, max_dimension
            )
            kept = truncate(after, parameters.extra_directions)
            cluster.subspaces[p] = reorthonormalise(kept) if check else kept
            loss_change += point_loss(x[p], after, parameters.dimension, parameters.bandwidth)
            loss_change -= point_loss(x[p], previous, parameters.dimension, parameters.bandwidth)
    for i, cluster in enumerate(stream.clusters):
        is_assigned = i == k
        if parameters.weighting == Weighting.COUNT:
            cluster.statistics[WEIGHT] += is_assigned and not new_cluster
        elif parameters.weighting == Weighting.EXPONENTIAL_DECAY:
            if is_assigned and new_cluster:
                cluster.statistics[WEIGHT] = 1.0
            else:
                cluster.statistics[WEIGHT] *= parameters.weight
                cluster.statistics[WEIGHT] += is_assigned
    return loss_change


def remove_light_clusters(stream: MutableState, n: int) -> None:
    """Remove clusters, except the current one, whose weight is below the limit."""
    k = 0
    while k < len(stream.clusters):
        is_light = stream.clusters[k].statistics[WEIGHT] < stream.parameters.forget_below
        if is_light and k != stream.current_cluster:
            remove_cluster(stream, k, n, -1)
        else:
            k += 1


def merge_close_clusters(stream: MutableState, cluster_id: int, n: int) -> None:
    """Merge a cluster with those whose means are closer than the threshold, the closest first."""
    k = find_cluster(stream, cluster_id)
    while k >= 0:
        separation = np.array([squared_mean_distance(stream.clusters[k], c) for c in stream.clusters])
        separation[k] = np.inf
        j = int(separation.argmin())
        if not separation[j] < stream.parameters.merge_distance**2:
            return
        k = merge_clusters(stream, k, j, n)


def merge_clusters(stream: MutableState, k: int, j: int, n: int) -> int:
    """Merge two clusters into the heavier one and return its index.

    Weights, counts and durations are added; moments are pooled.
    """
    a, b = stream.clusters[k].statistics, stream.clusters[j].statistics
    if (b[WEIGHT], -b[CLUSTER_ID]) > (a[WEIGHT], -a[CLUSTER_ID]):
        k, j, a, b = j, k, b, a
    fraction = b[WEIGHT] / (a[WEIGHT] + b[WEIGHT])
    stream.clusters[k].subspaces = [
        truncate(merge_subspaces(p, q, float(fraction)), stream.parameters.extra_directions)
        for p, q in zip(stream.clusters[k].subspaces, stream.clusters[j].subspaces, strict=True)
    ]
    pool_durations(a, b, SEGMENTS, MEAN_DURATION, SQUARED_DEVIATIONS)
    pool_durations(a, b, CENSORED, MEAN_CENSORED_DURATION, None)
    a[POINTS] += b[POINTS]
    a[DEMONSTRATION_STARTS] += b[DEMONSTRATION_STARTS]
    if stream.parameters.weighting != Weighting.CONSTANT:
        a[WEIGHT] += b[WEIGHT]
    stream.transition_counts[k] += stream.transition_counts[j]
    stream.transition_counts[:, k] += stream.transition_counts[:, j]
    stream.current_cluster = k if stream.current_cluster == j else stream.current_cluster
    stream.previous = k if stream.previous == j else stream.previous
    if stream.current_cluster == stream.previous >= 0:  # the two segments are one, which continues
        remove_segment_duration(stream.clusters[k].statistics, stream.previous_steps)
        stream.steps += stream.previous_steps
        stream.previous, stream.previous_steps = -1, 0
    remove_cluster(stream, j, n, int(a[CLUSTER_ID]))
    return k - (j < k)
