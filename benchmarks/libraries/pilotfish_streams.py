"""pilotfish on streams: SOSC from an array, point by point, and on a very long stream."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import log
from pathlib import Path

import numpy as np
from prepared import Answer, Prepared
from problems import Floats, Stream
from streaming import normalised_mutual_information

from pilotfish.demonstrations import position_layout
from pilotfish.kernels import Assignments
from pilotfish.models import online

PERIOD = 0.1  # s
SETTLING = 10_000  # datapoints before the worst case
CHUNK, CHUNKS = 100_000, 100  # 10^7 datapoints
SEGMENT = 80  # steps, on average
NEW_CLUSTER_DISTANCE = 0.025 / 3.6  # lambda_2 and lambda_3 over lambda, as in the thesis

Labelled = tuple[online.OnlineModel, Assignments]


def settings_of(problem: Stream) -> online.SOSC:
    """Return settings by one rule from the generator's scales for every stream.

    lambda is 2/5 of a cluster's variance or 1/4 of the squared distance of centres, whichever is larger.
    lambda_1 is the geometric mean of the variances along a subspace and outside it. b_m decays a subspace to
    9/10 at twice a cluster's variance. Clusters merge at 1/4 of the distance of centres. A trace lasts one
    cycle of all clusters, and a cluster with less than 0.3 datapoints is removed.
    """
    variance = problem.radius**2
    cluster = max(0.4 * variance, 0.25 * problem.separation**2)
    return online.SOSC(
        cluster=cluster,
        dimension=problem.extent * problem.noise,
        noise=problem.noise**2,
        bandwidth=2.0 * variance / -log(0.9),
        transition=NEW_CLUSTER_DISTANCE * cluster,
        new_transition=NEW_CLUSTER_DISTANCE * cluster,
        maintenance=online.Maintenance(
            discount=1.0 - 1.0 / (SEGMENT * problem.clusters),
            forget_below=0.3,
            merge_distance=0.25 * problem.separation,
        ),
    )


def empty(problem: Stream) -> online.OnlineModel:
    return online.online_model(settings_of(problem), position_layout(problem.x.shape[1]), PERIOD)


def from_array(folder: Path) -> Prepared:
    return _prepared(folder, online.observe_stream)


def single_points(folder: Path) -> Prepared:
    """Prepare learning point by point; labels do not follow merged clusters."""
    return _prepared(folder, _observe_single_points)


def _observe_single_points(model: online.OnlineModel, x: Floats) -> Labelled:
    cluster_ids = np.empty(len(x), dtype=np.int64)
    for n, point in enumerate(x):
        model, cluster_ids[n], _, _ = online.observe(model, point)
    nothing = np.zeros(len(x))
    return model, Assignments(cluster_ids, nothing, nothing, np.empty((0, 3), dtype=np.int64))


def worst_case(folder: Path) -> Prepared:
    """Prepare learning from a converged model without decay, so that no cluster is pruned."""
    problem = Stream.load(folder)
    settled, _ = online.observe_stream(empty(problem), problem.x[:SETTLING])
    return _from(problem, without_decay(settled, problem), online.observe_stream)


def without_decay(model: online.OnlineModel, problem: Stream) -> online.OnlineModel:
    """Return the model with a large bandwidth, so that every distance is computed."""
    settings = replace(settings_of(problem), bandwidth=1e6 * problem.separation**2)
    start = online.online_model(settings, model.layout, model.period, model.frame_names)
    return replace(start, state=model.state)


def _prepared(folder: Path, learn: Callable[[online.OnlineModel, Floats], Labelled]) -> Prepared:
    problem = Stream.load(folder)
    return _from(problem, empty(problem), learn)


def _from(
    problem: Stream,
    start: online.OnlineModel,
    learn: Callable[[online.OnlineModel, Floats], Labelled],
) -> Prepared:
    def answer(result: Labelled) -> Answer:
        model, assignments = result
        nmi = normalised_mutual_information(assignments.current_cluster_ids(), problem.labels)
        return Answer(nmi, len(problem.x), _describe_clusters(model))

    return Prepared(lambda: learn(start, problem.x), answer)


def repeated_stream(folder: Path) -> Prepared:
    """Prepare learning of the first datapoints repeatedly; NMI is that of the last repetition."""
    problem = Stream.load(folder)
    start, x = empty(problem), problem.x[:CHUNK]

    def run() -> Labelled:
        model = start
        for chunk in _repeat_chunk(x):
            model, assignments = online.observe_stream(model, chunk)
        return model, assignments

    def answer(result: Labelled) -> Answer:
        model, assignments = result
        nmi = normalised_mutual_information(assignments.current_cluster_ids(), problem.labels[:CHUNK])
        return Answer(nmi, CHUNKS * len(x), f"{model.datapoints:,} datapoints; {_describe_clusters(model)}")

    return Prepared(run, answer)


def _repeat_chunk(x: Floats) -> Iterator[Floats]:
    for _ in range(CHUNKS):
        yield x


def _describe_clusters(model: online.OnlineModel) -> str:
    """Return the number of clusters and their dimensions in words."""
    d = model.dimensions[:, 0]
    return f"K = {model.clusters}, d = {d.min()} to {d.max()}"
