"""Stream of three stages for online_stages.py: how it is sampled and learned.

Clusters follow one another in a cycle, in segments of 70 to 90 datapoints. In the first stage there are four
clusters, each in a subspace of one or two dimensions. In the second stage each has the orthogonal
complement. In the third there are two more clusters.

The thesis does not state the following; it is our choice. Datapoints are Gaussian about the centre, with
standard deviation 1 along the basis of the subspace and .2 in every column. A segment continues across the
end of a stage. The centres of the fifth and sixth cluster keep the minimum distance, too.

Source: Tanwani 2018, section 5.7.1.1.
"""

import time
from dataclasses import dataclass
from functools import cache

import numpy as np

from pilotfish.demonstrations import position_layout
from pilotfish.models.online import SOSC, Maintenance, OnlineModel, observe_stream, online_model

D, LENGTH, CLUSTERS = 3, 2500, (4, 4, 6)
MAX_COORDINATE, MIN_SEPARATION, MIN_DURATION, MAX_DURATION, DEVIATION = 5.0, 4.0, 70, 90, 0.2
MEAN_DURATION, DEVIATION_OF_DURATIONS = (
    80.0,
    float(np.sqrt(((MAX_DURATION - MIN_DURATION + 1) ** 2 - 1) / 12)),
)
PERIOD = 1.0  # [s]; the thesis names no time
MAINTENANCES = {
    "thesis": Maintenance(discount=0.995, merge_distance=3.6),
    "separate": Maintenance(discount=0.995),
    "forgetting": Maintenance(discount=0.995, forget_below=0.3),
}


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """Datapoints of one stage, the cluster of each, and the true centres and bases."""

    x: np.ndarray
    labels: np.ndarray
    centres: np.ndarray
    bases: tuple[np.ndarray, ...]

    @property
    def dimensions(self) -> list[int]:
        """Dimension of each subspace."""
        return [basis.shape[1] for basis in self.bases]


@dataclass(frozen=True, slots=True, eq=False)
class StageResult:
    """Model after a stage, the cluster of each datapoint of the stage, and CPU time [s]."""

    stage: Stage
    model: OnlineModel
    cluster_ids: np.ndarray
    seconds: float


@cache
def stages(seed: int) -> tuple[Stage, ...]:
    """Sample the three stages."""
    rng = np.random.default_rng(seed)
    centres = sample_centres(rng, CLUSTERS[-1])
    first = [orthonormal(rng, int(d)) for d in rng.integers(1, D, size=CLUSTERS[0])]
    second = [complement(basis) for basis in first]
    third = [*second, *(orthonormal(rng, int(d)) for d in rng.integers(1, D, size=2))]
    sampled, cluster, remaining = [], 0, int(rng.integers(MIN_DURATION, MAX_DURATION + 1))
    for bases in (first, second, third):
        labels, cluster, remaining = sample_cycle(rng, len(bases), cluster, remaining)
        x = np.stack([sample_point(rng, centres[k], bases[k]) for k in labels])
        sampled.append(Stage(x, labels, centres[: len(bases)], tuple(bases)))
    return tuple(sampled)


def sample_centres(rng: np.random.Generator, count: int) -> np.ndarray:
    """Sample centres in [-5, 5]^D with distances of at least 4 sqrt(D); restart if no further one fits."""
    while True:
        centres: list[np.ndarray] = []
        for candidate in rng.uniform(-MAX_COORDINATE, MAX_COORDINATE, size=(20_000, D)):
            if all(np.linalg.norm(candidate - centre) >= MIN_SEPARATION * np.sqrt(D) for centre in centres):
                centres.append(candidate)
            if len(centres) == count:
                return np.stack(centres)


def orthonormal(rng: np.random.Generator, d: int) -> np.ndarray:
    """Sample an orthonormal basis of d directions."""
    return np.linalg.qr(rng.normal(size=(D, d)))[0]


def complement(basis: np.ndarray) -> np.ndarray:
    """Return the other D - d directions."""
    return np.linalg.svd(basis)[0][:, basis.shape[1] :]


def sample_cycle(
    rng: np.random.Generator, count: int, cluster: int, remaining: int
) -> tuple[np.ndarray, int, int]:
    """Return the clusters of one stage, the last of them, and the remaining steps of its segment."""
    labels = []
    for _ in range(LENGTH):
        if remaining == 0:
            cluster, remaining = (cluster + 1) % count, int(rng.integers(MIN_DURATION, MAX_DURATION + 1))
        labels.append(cluster)
        remaining -= 1
    return np.array(labels), cluster, remaining


def sample_point(rng: np.random.Generator, centre: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Sample a datapoint of a cluster."""
    return centre + basis @ rng.normal(size=basis.shape[1]) + DEVIATION * rng.normal(size=D)


def settings(variant: str) -> SOSC:
    """Return the penalties of the thesis with one of MAINTENANCES."""
    return SOSC(
        cluster=3.6,
        dimension=0.35,
        noise=0.15,
        bandwidth=50.0,
        transition=0.025,
        new_transition=0.025,
        maintenance=MAINTENANCES[variant],
    )


def empty_model(variant: str) -> OnlineModel:
    """Create a model before its first datapoint."""
    return online_model(settings(variant), position_layout(D, "1"), PERIOD)


@cache
def stage_results(variant: str, seed: int) -> tuple[StageResult, ...]:
    """Learn the stream and return the model after each stage."""
    model = empty_model(variant)
    results: list[StageResult] = []
    for stage in stages(seed):
        begin = time.process_time()
        model, assignments = observe_stream(model, stage.x)
        seconds = time.process_time() - begin
        results.append(StageResult(stage, model, assignments.current_cluster_ids(), seconds))
    return tuple(results)


def models_by_step(variant: str, seed: int, step: int) -> list[OnlineModel]:
    """Return the model after every `step` datapoints."""
    model, models = empty_model(variant), []
    for stage in stages(seed):
        for start in range(0, LENGTH, step):
            model, _ = observe_stream(model, stage.x[start : start + step])
            models.append(model)
    return models


def nearest_cluster(stage_result: StageResult) -> list[int]:
    """Return the index of the cluster that is nearest to each true centre."""
    offsets = stage_result.model.means[None, :, 0] - stage_result.stage.centres[:, None]
    return [int(k) for k in np.linalg.norm(offsets, axis=2).argmin(axis=1)]
