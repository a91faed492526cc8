"""Scalable online sequence clustering: where each datapoint of a stream goes, and what it changes."""

from dataclasses import dataclass, field

import numpy as np

from pilotfish.kernels.refusals import not_observable
from pilotfish.kernels.streams import (
    LARGEST,
    StreamRules,
    StreamState,
    StreamStep,
    Weighting,
    in_fours,
    stream_of,
)
from pilotfish.kernels.streams import StreamColumn as Column
from pilotfish.kernels.twins.subspaces import (
    Subspace,
    born,
    learned,
    loss_of,
    merged,
    put,
    shortened,
    squared_distance,
    straightened,
    taken,
)
from pilotfish.types import Array, Float

STRAIGHTEN_EVERY = 256  # datapoints of a cluster


@dataclass(slots=True, eq=False)
class Cluster:
    """One row of a StreamState, taken apart; numbers are by Column."""

    numbers: Float[Array, " 9"]
    seen: list[Subspace]


@dataclass(slots=True, eq=False)
class Stream:
    """A StreamState, taken apart, while it changes."""

    rules: StreamRules
    clusters: list[Cluster]
    counts: Float[Array, "K K"]
    current: int  # -1 where a demonstration begins
    steps: int
    next: int
    points: int
    before: int  # the cluster visited before, -1 where a demonstration has begun since
    before_steps: int
    gone: list[tuple[int, int, int]] = field(default_factory=list)


def observe(x: Float[Array, "N P D"], state: StreamState, rules: StreamRules) -> StreamStep:
    """The model after N datapoints, each seen from P frames, taken one after the other.

    Assignments are made rules.batch at a time; subspaces then learn from their datapoints in order.
    Raises: InvalidInput, when a number is not finite or beyond 1e100.
    Source: Tanwani 2018, algorithm 5, with what specification 2 corrects.
    """
    if (bad := np.flatnonzero(~(np.abs(x) <= LARGEST))).size:
        raise not_observable(x, int(bad[0]))
    stream = unpacked(state, rules)
    identities, costs = np.empty(len(x), dtype=np.int64), np.empty(len(x))
    changes = np.empty(len(x))
    for start in range(0, len(x), rules.batch):
        batch = range(start, min(start + rules.batch, len(x)))
        fresh = set()
        for n in batch:
            k, costs[n], changes[n] = assigned(stream, x[n])
            if k == len(stream.clusters):
                k = created(stream, x[n], n)
                fresh.add(n)
            identities[n] = stream.clusters[k].numbers[Column.IDENTITY]
            changes[n] += followed(stream, k)
        for n in batch:
            changes[n] += weighted(stream, x[n], int(identities[n]), n in fresh)
            forgotten(stream, n)
        last = batch[-1]
        for identity in dict.fromkeys(identities[batch].tolist()):
            merge_close(stream, identity, last)
    gone = np.array(stream.gone, dtype=np.int64).reshape(-1, 3)
    return StreamStep(packed(stream, state.frames, state.width), identities, costs, changes, gone)


def observe_one(
    x: Float[Array, "P D"], state: StreamState, rules: StreamRules
) -> tuple[StreamState, int, float, float]:
    """The same for one datapoint: the state, and the identity, cost and change of this one."""
    step = observe(x[None], state, rules)
    return step.state, int(step.identities[0]), float(step.costs[0]), float(step.changes[0])


def assigned(stream: Stream, x: Float[Array, "P D"]) -> tuple[int, float, float]:
    """The cluster of least cost, or K for a new one; its cost; and for a new one, the loss that it saves."""
    rules, K = stream.rules, len(stream.clusters)
    costs = np.array([distance_to(cluster, x, rules.bandwidth) for cluster in stream.clusters])
    costs += transition_costs(stream)
    new = rules.cluster
    if stream.current >= 0:
        new += rules.transition * np.log(stream.counts[stream.current].sum() + 1.0) + rules.new_transition
    if K == 0:
        return 0, new, 0.0
    best = int(costs.argmin())
    if costs[best] < new:
        return best, float(costs[best]), 0.0
    dimensions = sum(seen.dimension for seen in stream.clusters[best].seen)
    return K, float(new), float(new - costs[best] - (rules.dimension * dimensions if dimensions else 0.0))


def distance_to(cluster: Cluster, x: Float[Array, "P D"], bandwidth: float) -> float:
    """The squared distances of all frames, added."""
    return sum(squared_distance(row, seen, bandwidth) for row, seen in zip(x, cluster.seen, strict=True))


def transition_costs(stream: Stream) -> Float[Array, " K"]:
    """What it costs to go from the current cluster to each (5.26, 5.27); nothing where none is current."""
    if stream.current < 0:
        return np.zeros(len(stream.clusters))
    rules, counts = stream.rules, stream.counts[stream.current]
    known = counts > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        surprise = np.log(np.where(known, counts.sum() / counts, counts.sum() + 1.0))
    return np.asarray(rules.transition * surprise + np.where(known, 0.0, rules.new_transition))


def created(stream: Stream, x: Float[Array, "P D"], n: int) -> int:
    """The row of a new cluster at x; where no more may be, the lightest but the current makes room."""
    if len(stream.clusters) >= stream.rules.clusters:
        weights = np.array([cluster.numbers[Column.WEIGHT] for cluster in stream.clusters])
        if len(weights) > 1 and stream.current >= 0:
            weights[stream.current] = np.inf
        remove(stream, int(weights.argmin()), n, -1)
    numbers = np.zeros(len(Column))
    numbers[Column.IDENTITY] = stream.next
    numbers[Column.WEIGHT] = _first_weight(stream.rules)
    stream.next += 1
    stream.clusters.append(Cluster(numbers, [born(row) for row in x]))
    stream.counts = np.pad(stream.counts, (0, 1))
    return len(stream.clusters) - 1


def _first_weight(rules: StreamRules) -> float:
    return rules.weight if rules.weighting == Weighting.CONSTANT else 1.0


def followed(stream: Stream, k: int) -> float:
    """Transitions and durations after a datapoint in k (5.29-5.34); how much its transition cost changed."""
    numbers, before = stream.clusters[k].numbers, stream.current
    numbers[Column.POINTS] += 1.0
    stream.points += 1
    change = 0.0
    if before < 0:
        numbers[Column.BEGUN] += 1.0
    else:
        c, total = stream.counts[before, k], stream.counts[before].sum()
        if c > 0.0:
            change = stream.rules.transition * np.log(c / total * (total + 1.0) / (c + 1.0))
        stream.counts[before, k] += 1.0
    if before == k:
        stream.steps += 1
        return float(change)
    if before >= 0:
        lasted(stream.clusters[before].numbers, stream.steps)
    stream.before, stream.before_steps = before, stream.steps if before >= 0 else 0
    stream.current, stream.steps = k, 1
    return float(change)


def lasted(numbers: Float[Array, " 9"], steps: int) -> None:
    """One more complete visit (5.32-5.33, Welford)."""
    numbers[Column.VISITS] += 1.0
    off = steps - numbers[Column.DURATION]
    numbers[Column.DURATION] += off / numbers[Column.VISITS]
    numbers[Column.SQUARES] += off * (steps - numbers[Column.DURATION])


def unlast(numbers: Float[Array, " 9"], steps: int) -> None:
    """One complete visit of so many steps less: the inverse of lasted."""
    numbers[Column.VISITS] -= 1.0
    if numbers[Column.VISITS] == 0.0:
        numbers[Column.DURATION] = numbers[Column.SQUARES] = 0.0
        return
    off = steps - numbers[Column.DURATION]
    numbers[Column.DURATION] -= off / numbers[Column.VISITS]
    left = numbers[Column.SQUARES] - off * (steps - numbers[Column.DURATION])
    numbers[Column.SQUARES] = max(left, 0.0)


def weighted(stream: Stream, x: Float[Array, "P D"], identity: int, fresh: bool) -> float:
    """The cluster learns x, then all weights change; what the loss at x changed by."""
    rules, change = stream.rules, 0.0
    k = row_of(stream, identity)
    if k >= 0 and not fresh:
        cluster = stream.clusters[k]
        w = cluster.numbers[Column.WEIGHT]
        check = cluster.numbers[Column.POINTS] % STRAIGHTEN_EVERY == 0.0
        for p, before in enumerate(cluster.seen):
            most = min(rules.directions, len(before.mean) - 1)
            after = learned(x[p], before, float(w), rules.dimension, rules.bandwidth, most)
            kept = shortened(after, rules.spare)
            cluster.seen[p] = straightened(kept) if check else kept
            change += loss_of(x[p], after, rules.dimension, rules.bandwidth)
            change -= loss_of(x[p], before, rules.dimension, rules.bandwidth)
    for i, cluster in enumerate(stream.clusters):
        here = i == k
        if rules.weighting == Weighting.COUNT:
            cluster.numbers[Column.WEIGHT] += here and not fresh
        elif rules.weighting == Weighting.TRACE:
            if here and fresh:
                cluster.numbers[Column.WEIGHT] = 1.0
            else:
                cluster.numbers[Column.WEIGHT] *= rules.weight
                cluster.numbers[Column.WEIGHT] += here
    return change


def row_of(stream: Stream, identity: int) -> int:
    for k, cluster in enumerate(stream.clusters):
        if cluster.numbers[Column.IDENTITY] == identity:
            return k
    return -1


def forgotten(stream: Stream, n: int) -> None:
    """Clusters whose weight has worn off are no more; the current one stays."""
    k = 0
    while k < len(stream.clusters):
        light = stream.clusters[k].numbers[Column.WEIGHT] < stream.rules.forget_below
        if light and k != stream.current:
            remove(stream, k, n, -1)
        else:
            k += 1


def merge_close(stream: Stream, identity: int, n: int) -> None:
    """Clusters whose means came closer than the threshold become one, the closest first."""
    k = row_of(stream, identity)
    while k >= 0:
        apart = np.array([square_apart(stream.clusters[k], other) for other in stream.clusters])
        apart[k] = np.inf
        j = int(apart.argmin())
        if not apart[j] < stream.rules.merge_distance**2:
            return
        k = merge(stream, k, j, n)


def square_apart(a: Cluster, b: Cluster) -> float:
    return float(sum(np.sum((p.mean - q.mean) ** 2) for p, q in zip(a.seen, b.seen, strict=True)))


def merge(stream: Stream, k: int, j: int, n: int) -> int:
    """The row of both as one: weights, counts and durations added, moments pooled. The heavier one stays."""
    a, b = stream.clusters[k].numbers, stream.clusters[j].numbers
    if (b[Column.WEIGHT], -b[Column.IDENTITY]) > (a[Column.WEIGHT], -a[Column.IDENTITY]):
        k, j, a, b = j, k, b, a
    share = b[Column.WEIGHT] / (a[Column.WEIGHT] + b[Column.WEIGHT])
    stream.clusters[k].seen = [
        shortened(merged(p, q, float(share)), stream.rules.spare)
        for p, q in zip(stream.clusters[k].seen, stream.clusters[j].seen, strict=True)
    ]
    pool(a, b, Column.VISITS, Column.DURATION, Column.SQUARES)
    pool(a, b, Column.CUT, Column.CUT_DURATION, None)
    a[Column.POINTS] += b[Column.POINTS]
    a[Column.BEGUN] += b[Column.BEGUN]
    if stream.rules.weighting != Weighting.CONSTANT:
        a[Column.WEIGHT] += b[Column.WEIGHT]
    stream.counts[k] += stream.counts[j]
    stream.counts[:, k] += stream.counts[:, j]
    stream.current = k if stream.current == j else stream.current
    stream.before = k if stream.before == j else stream.before
    if stream.current == stream.before >= 0:  # what was taken for two visits is one, and goes on
        unlast(stream.clusters[k].numbers, stream.before_steps)
        stream.steps += stream.before_steps
        stream.before, stream.before_steps = -1, 0
    remove(stream, j, n, int(a[Column.IDENTITY]))
    return k - (j < k)


def pool(a: Float[Array, " 9"], b: Float[Array, " 9"], number: int, mean: int, squares: int | None) -> None:
    """Means and squared deviations of two sets as of one (Chan, Golub & LeVeque 1979)."""
    both = a[number] + b[number]
    if both == 0.0:
        return
    off = b[mean] - a[mean]
    if squares is not None:
        a[squares] += b[squares] + off**2 * a[number] * b[number] / both
    a[mean] += off * b[number] / both
    a[number] = both


def remove(stream: Stream, k: int, n: int, into: int) -> None:
    stream.gone.append((n, int(stream.clusters[k].numbers[Column.IDENTITY]), into))
    del stream.clusters[k]
    stream.counts = np.delete(np.delete(stream.counts, k, axis=0), k, axis=1)
    stream.current = _without(stream.current, k)
    stream.before = _without(stream.before, k)
    if stream.before < 0:
        stream.before_steps = 0


def _without(place: int, k: int) -> int:
    """Where a place is once k is gone; -1, when it was k."""
    return -1 if place == k else place - (place > k)


def unpacked(state: StreamState, rules: StreamRules) -> Stream:
    clusters = []
    for k, row in enumerate(state.clusters):
        clusters.append(Cluster(row[: len(Column)].copy(), [taken(state, k, p) for p in range(state.frames)]))
    current, steps, following, points, before, lasted = (int(number) for number in state.head)
    return Stream(rules, clusters, state.counts.copy(), current, steps, following, points, before, lasted)


def packed(stream: Stream, frames: int, width: int) -> StreamState:
    ranks = [len(seen.variances) for cluster in stream.clusters for seen in cluster.seen]
    state = stream_of(len(stream.clusters), frames, width, in_fours(max(ranks, default=0)))
    head = (stream.current, stream.steps, stream.next, stream.points, stream.before, stream.before_steps)
    state.head[:] = head
    state.counts[:] = stream.counts
    for k, cluster in enumerate(stream.clusters):
        state.clusters[k, : len(Column)] = cluster.numbers
        for p, seen in enumerate(cluster.seen):
            put(seen, state, k, p)
    return state
