"""Where expectation-maximisation begins: time bins, k-means over all frames at once, or a model one has."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from pilotfish.demonstrations import Views
from pilotfish.errors import InvalidInput
from pilotfish.geometry import karcher_mean, log_map
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.models.statistics import BLOCK_ROWS, Statistics, expected_statistics, labelled_statistics
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_number

MAX_ATTEMPTS = 20


@runtime_checkable
class Initialisation(Protocol):
    """A first guess of the statistics of K states."""

    def initial_statistics(self, views: Views, states: int, rng: np.random.Generator) -> Statistics: ...


@dataclass(frozen=True, slots=True)
class TimeBins:
    """Every demonstration cut into as many equal times as there are states: a left-right skill.

    Only transitions that the cut shows are possible, so a state is never revisited.
    jitter  moves every cut at random by up to this fraction of a bin, to give restarts different beginnings
    """

    jitter: float = 0.0

    def __post_init__(self) -> None:
        require_number(self.jitter, "jitter", 0.0, 1.0)

    def initial_statistics(self, views: Views, states: int, rng: np.random.Generator) -> Statistics:
        if (shortest := int(views.lengths.min())) < states:
            raise InvalidInput(
                f"demonstration {views.lengths.argmin()} (first is 0) has {shortest} steps, which cannot "
                f"be cut into {states} states; ask for at most {shortest} states or resample it to more steps"
            )
        labels = [_time_bins(int(length), states, self.jitter, rng) for length in views.lengths]
        return labelled_statistics(views, np.concatenate(labels), states)


def _time_bins(length: int, states: int, jitter: float, rng: np.random.Generator) -> Int[Array, " T"]:
    order = np.arange(1, states)
    cuts = np.ceil((order + jitter * rng.uniform(-0.5, 0.5, states - 1)) * length / states).astype(np.int64)
    cuts = np.maximum.accumulate(np.maximum(cuts - order, 0)) + order  # every bin keeps at least one step,
    cuts = np.minimum(cuts, length - states + order)  # the last ones too
    return np.searchsorted(cuts, np.arange(length), side="right").astype(np.int64)


@dataclass(frozen=True, slots=True)
class KMeans:
    """Clusters of the datapoints as all frames see them together, so that frames agree on the labels.

    Columns are scaled to unit variance first. Any state may follow any other: each gets a count of
    pseudocount spread over all transitions on top of those seen.
    """

    pseudocount: float = 1.0

    def __post_init__(self) -> None:
        require_number(self.pseudocount, "pseudocount", 0.0)

    def initial_statistics(self, views: Views, states: int, rng: np.random.Generator) -> Statistics:
        joint = _joint_features(views)
        if (distinct := _count_distinct(joint, states)) < states:
            raise InvalidInput(f"{states} states were asked for but the data has {distinct} distinct points")
        labels = _kmeans_labels(joint, states, rng)
        statistics = labelled_statistics(views, labels, states)
        spread = self.pseudocount / states
        return Statistics(
            statistics.moments,
            statistics.initial_counts + spread,
            statistics.transitions + spread,
            statistics.log_likelihood,
        )


def _kmeans_labels(x: Float[Array, "N C"], states: int, rng: np.random.Generator) -> Int[Array, " N"]:
    from scipy.cluster.vq import ClusterError, kmeans2  # here: scipy doubles the time of importing pilotfish

    for _ in range(MAX_ATTEMPTS):
        try:
            return np.asarray(
                kmeans2(x, states, minit="++", missing="raise", iter=50, rng=rng)[1], dtype=np.int64
            )
        except ClusterError:  # a cluster lost its points
            continue
    raise InvalidInput(
        f"k-means found no {states} separate clusters in {MAX_ATTEMPTS} attempts; ask for fewer states"
    )


def _joint_features(views: Views) -> Float[Array, "N C"]:
    """All views side by side, filled in place: at the large size a copy more is felt."""
    P, N, D = views.x.shape
    E = D - len(views.orientation_starts)
    joint = np.empty((N, P * E))
    for p, x in enumerate(views.x):
        if views.orientation_starts:  # q and -q are one point
            x = log_map(karcher_mean(x, np.ones(N), views.orientation_starts), x, views.orientation_starts)
        deviations = np.array([column.std() for column in x.T])
        np.divide(x, np.where(deviations > 0.0, deviations, 1.0), out=joint[:, p * E : (p + 1) * E])
    return joint


def _count_distinct(x: Float[Array, "N C"], limit: int) -> int:
    """How many different points there are, counted no further than enough."""
    points = x[:0]
    for begin in range(0, len(x), BLOCK_ROWS):
        points = np.unique(np.concatenate([points, x[begin : begin + BLOCK_ROWS]]), axis=0)[:limit]
        if len(points) == limit:
            break
    return len(points)


@dataclass(frozen=True, slots=True, eq=False)
class FromModel:
    """The beliefs of a model that one already has, say one learned from other demonstrations."""

    model: HiddenModel | Skill

    def initial_statistics(self, views: Views, states: int, rng: np.random.Generator) -> Statistics:
        P, K, D = self.model.means.shape
        if states != K:
            raise InvalidInput(f"the given model has {K} states, {states} were asked for")
        if (given_shape := (views.x.shape[0], views.x.shape[2])) != (P, D):
            raise InvalidInput(
                f"the given model has {P} frames of {D} columns, the demonstrations {given_shape[0]} of {given_shape[1]}"
            )
        return expected_statistics(self.model, views)
