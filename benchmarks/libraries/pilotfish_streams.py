"""pilotfish on streams: SOSC, from an array, one datapoint at a time, and for a very long time."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import log
from pathlib import Path

import numpy as np
from prepared import CommandResult, Prepared
from problems import Floats, Stream
from streaming import normalised_mutual_information

from pilotfish.demonstrations import position_layout
from pilotfish.kernels import Assignments
from pilotfish.models import online

PERIOD = 0.1  # s
SETTLING = 10_000  # datapoints that go before the worst case
CHUNK, CHUNKS = 100_000, 100  # 10^7 datapoints
VISIT = 80  # steps, on average
NEW_CLUSTER_DISTANCE = 0.025 / 3.6  # lambda_2 and lambda_3 as shares of lambda, in the thesis' experiment

Labelled = tuple[online.OnlineModel, Assignments]


def settings_of(problem: Stream) -> online.SOSC:
    """One rule from the generator's scales for every stream.

    lambda is two fifths of a cluster's variance or a quarter of the squared distance of centres, whichever is
    more; lambda_1 is the geometric mean of the variances along a subspace and beside it; b_m fades a
    subspace to 9 / 10 at twice a cluster's variance; a quarter of the way to the next centre two clusters
    are one. A trace lasts one round of all clusters, and what has no 0.3 datapoints left is forgotten.
    """
    variance = problem.radius**2
    cluster = max(0.4 * variance, 0.25 * problem.apart**2)
    return online.SOSC(
        cluster=cluster,
        dimension=problem.extent * problem.noise,
        noise=problem.noise**2,
        bandwidth=2.0 * variance / -log(0.9),
        transition=NEW_CLUSTER_DISTANCE * cluster,
        new_transition=NEW_CLUSTER_DISTANCE * cluster,
        maintenance=online.Maintenance(
            discount=1.0 - 1.0 / (VISIT * problem.clusters),
            forget_below=0.3,
            merge_distance=0.25 * problem.apart,
        ),
    )


def empty(problem: Stream) -> online.OnlineModel:
    return online.online_model(settings_of(problem), position_layout(problem.x.shape[1]), PERIOD)


def from_array(folder: Path) -> Prepared:
    return _prepared(folder, online.observe_stream)


def one_by_one(folder: Path) -> Prepared:
    """Each label is what it was when its datapoint came: merged clusters are not followed."""
    return _prepared(folder, _one_by_one)


def _one_by_one(model: online.OnlineModel, x: Floats) -> Labelled:
    cluster_ids = np.empty(len(x), dtype=np.int64)
    for n, point in enumerate(x):
        model, cluster_ids[n], _, _ = online.observe(model, point)
    nothing = np.zeros(len(x))
    return model, Assignments(cluster_ids, nothing, nothing, np.empty((0, 3), dtype=np.int64))


def worst_case(folder: Path) -> Prepared:
    """From a settled model, with subspaces that do not fade: no cluster is too far to matter."""
    problem = Stream.load(folder)
    settled, _ = online.observe_stream(empty(problem), problem.x[:SETTLING])
    return _from(problem, without_decay(settled, problem), online.observe_stream)


def without_decay(model: online.OnlineModel, problem: Stream) -> online.OnlineModel:
    """The same with so large a bandwidth that every distance is to be worked out in full."""
    settings = replace(settings_of(problem), bandwidth=1e6 * problem.apart**2)
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
    def answer(result: Labelled) -> CommandResult:
        model, assignments = result
        nmi = normalised_mutual_information(assignments.current_cluster_ids(), problem.labels)
        return CommandResult(nmi, len(problem.x), _describe_clusters(model))

    return Prepared(lambda: learn(start, problem.x), answer)


def endless(folder: Path) -> Prepared:
    """The first datapoints of the stream over and over; NMI is of the last time."""
    problem = Stream.load(folder)
    start, x = empty(problem), problem.x[:CHUNK]

    def run() -> Labelled:
        model = start
        for chunk in _over_and_over(x):
            model, assignments = online.observe_stream(model, chunk)
        return model, assignments

    def answer(result: Labelled) -> CommandResult:
        model, assignments = result
        nmi = normalised_mutual_information(assignments.current_cluster_ids(), problem.labels[:CHUNK])
        return CommandResult(
            nmi, CHUNKS * len(x), f"{model.datapoints:,} datapoints; {_describe_clusters(model)}"
        )

    return Prepared(run, answer)


def _over_and_over(x: Floats) -> Iterator[Floats]:
    for _ in range(CHUNKS):
        yield x


def _describe_clusters(model: online.OnlineModel) -> str:
    """How many clusters there are, and of what dimensions."""
    d = model.dimensions[:, 0]
    return f"K = {model.clusters}, d = {d.min()} to {d.max()}"
