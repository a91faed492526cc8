"""Initialisation of expectation-maximisation: time bins, a template, k-means, or a given model."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from pilotfish.demonstrations import Views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import karcher_mean, log_map
from pilotfish.models.dynamics import MarkovChain
from pilotfish.models.em import expected_statistics
from pilotfish.models.partitions import Partitions, as_partitions
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.models.statistics import BLOCK_ROWS, Statistics, labelled_statistics
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_count, require_number, shorten_repr

MAX_ATTEMPTS = 20
MAX_DEMONSTRATIONS = 10**6
MAX_HALVINGS = 500  # that float64 represents
TEMPLATE_DEVIATION = 0.5  # of the deviation of all datapoints: that of the states of a template


@runtime_checkable
class Initialisation(Protocol):
    """Initial statistics of K states; `TimeBins`, `Template`, `KMeans` and `FromModel` implement it."""

    def initial_statistics(self, views: Views, states: int, rng: np.random.Generator) -> Statistics:
        """Compute the statistics of the first M-step.

        Args:
            views: Demonstrations as every frame sees them.
            states: Number of states K.
            rng: Source of randomness.
        """
        ...


@dataclass(frozen=True, slots=True)
class TimeBins:
    """Cut every demonstration into K bins of equal duration: a left-right skill.

    Only transitions from one bin to the next are possible, so that no state is revisited. Where boundaries
    are given, each part between them is cut by itself, so that the bins describe the same events in all
    demonstrations. The parts share the bins in proportion to their mean duration.

    Attributes:
        jitter: Largest random shift of a cut, as a fraction of a bin, from 0 to 1; gives restarts different
            initialisations.
        complete: Whether every demonstration must end in the last state, as a recording of the whole movement
            does. EM may otherwise let some end in an earlier one.
        boundaries: For each demonstration, the steps at which a bin begins, in ascending order, such as those
            at which a gripper closes. Empty: none.
    """

    jitter: float = 0.0
    complete: bool = False
    boundaries: tuple[tuple[int, ...], ...] = ()

    def __post_init__(self) -> None:
        require_number(self.jitter, "jitter", 0.0, 1.0)
        if len({len(steps) for steps in self.boundaries}) > 1:
            counts = sorted({len(steps) for steps in self.boundaries})
            raise InvalidInput(
                f"boundaries has demonstrations with {counts[0]} and with {counts[-1]} steps, expected the "
                "same number for each"
            )

    def initial_statistics(self, views: Views, states: int, rng: np.random.Generator) -> Statistics:
        """Compute the statistics of the bins.

        Args:
            views: Demonstrations as every frame sees them.
            states: Number of bins.
            rng: Source of the jitter.

        Raises:
            InvalidInput: If a demonstration has fewer steps than states, or the boundaries do not fit.
        """
        require_enough_steps(views.lengths, states)
        lengths = _part_lengths(views.lengths, self.boundaries)
        counts = _bins_of_parts(lengths, states)
        first = np.cumsum(counts) - counts
        labels = [
            k + _time_bins(int(length), int(count), self.jitter, rng)
            for parts in lengths
            for k, length, count in zip(first, parts, counts, strict=True)
        ]
        return labelled_statistics(views, np.concatenate(labels), states)


def require_enough_steps(lengths: Int[Array, " M"], states: int) -> None:
    """Raise unless every demonstration has a step for each state.

    Args:
        lengths: Number of steps of each demonstration.
        states: Number of states.

    Raises:
        InvalidInput: If one is shorter.
    """
    if (shortest := int(lengths.min())) < states:
        raise InvalidInput(
            f"demonstration {lengths.argmin()} (first is 0) has {shortest} steps, which cannot "
            f"be cut into {states} states; ask for at most {shortest} states or resample it to more steps"
        )


def _part_lengths(lengths: Int[Array, " M"], boundaries: tuple[tuple[int, ...], ...]) -> Int[Array, "M S"]:
    """Return the number of steps between the boundaries of each demonstration."""
    if not boundaries:
        return lengths[:, None]
    if len(boundaries) != len(lengths):
        raise InvalidInput(
            f"boundaries has {len(boundaries)} demonstrations, expected {len(lengths)}, one entry for each"
        )
    steps = np.column_stack([np.zeros_like(lengths), np.array(boundaries, dtype=np.int64), lengths])
    parts = np.diff(steps, axis=1)
    if (parts < 1).any():
        m = int((parts < 1).any(axis=1).argmax())
        raise InvalidInput(
            f"boundaries of demonstration {m} (first is 0) is {boundaries[m]}, expected ascending steps from "
            f"1 to {lengths[m] - 1}"
        )
    return parts


def _bins_of_parts(lengths: Int[Array, "M S"], states: int) -> Int[Array, " S"]:
    """Share out the bins: at least one for each part, and at most one for each step of its shortest.

    Each bin in turn goes to the part whose bins are longest.
    """
    means, most = lengths.mean(axis=0), lengths.min(axis=0)
    counts: Int[Array, " S"] = np.ones_like(most)
    if not len(counts) <= states <= most.sum():
        raise InvalidInput(
            f"states is {states}, expected {len(counts)} to {most.sum()} with these boundaries; give fewer "
            "boundaries"
        )
    for _ in range(states - len(counts)):
        counts[np.where(counts < most, means / counts, 0.0).argmax()] += 1
    return counts


def _time_bins(length: int, states: int, jitter: float, rng: np.random.Generator) -> Int[Array, " T"]:
    order = np.arange(1, states)
    cuts = np.ceil((order + jitter * rng.uniform(-0.5, 0.5, states - 1)) * length / states).astype(np.int64)
    cuts = np.maximum.accumulate(np.maximum(cuts - order, 0)) + order  # every bin has at least one step,
    cuts = np.minimum(cuts, length - states + order)  # the last bins too
    return np.searchsorted(cuts, np.arange(length), side="right").astype(np.int64)


@dataclass(frozen=True, slots=True)
class Template:
    """Cut one demonstration into K bins and let the others pass through them, wait in them or skip them.

    The states have the means of the bins in every frame, and half the deviation of all datapoints, so that
    demonstrations of other situations and another rhythm follow the order of the template. From a state every
    later one can be reached, with a probability that halves for each state that is skipped.

    Attributes:
        demonstration: Number of the demonstration, from 0.
        complete: Whether every demonstration must end in the last state.
    """

    demonstration: int = 0
    complete: bool = True

    def __post_init__(self) -> None:
        require_count(self.demonstration, "demonstration", MAX_DEMONSTRATIONS)

    def initial_statistics(self, views: Views, states: int, rng: np.random.Generator) -> Statistics:
        """Compute the expected statistics of all demonstrations under the template.

        Args:
            views: Demonstrations as every frame sees them.
            states: Number of bins.
            rng: Not used.

        Raises:
            InvalidInput: If the number is beyond the last demonstration, or it has fewer steps than states.
        """
        if self.demonstration >= len(views.lengths):
            raise InvalidInput(
                f"demonstration is {self.demonstration}, expected a number below {len(views.lengths)}"
            )
        start = int(views.lengths[: self.demonstration].sum())
        length = int(views.lengths[self.demonstration])
        rows = np.ascontiguousarray(views.x[:, start : start + length])
        bins = TimeBins().initial_statistics(
            Views(rows, np.array([length]), views.orientation_starts), states, rng
        )
        means = np.stack([moments.means for moments in bins.moments])
        covariances = tuple(_wide_covariances(x, states, views.orientation_starts) for x in views.x)
        model = HiddenModel(_skipping_chain(states, length), means, covariances)
        return expected_statistics(model, views, complete=self.complete)


def _wide_covariances(
    x: Float[Array, "N D"], states: int, orientation_starts: tuple[int, ...]
) -> DenseCovariances:
    """Return one diagonal covariance for every state, of half the deviation of the datapoints."""
    if orientation_starts:
        x = log_map(karcher_mean(x, np.ones(len(x)), orientation_starts), x, orientation_starts)
    deviations = x.std(axis=0)
    deviations = TEMPLATE_DEVIATION * np.where(deviations > 0.0, deviations, 1.0)
    return DenseCovariances(np.tile(np.diag(deviations**2), (states, 1, 1)))


def _skipping_chain(states: int, length: int) -> MarkovChain:
    """Return a chain that begins in the first state and can go to every later one."""
    steps = np.arange(states) - np.arange(states)[:, None]
    exits = np.where(steps > 0, 0.5 ** np.clip(steps, 0, MAX_HALVINGS), 0.0)
    sums = exits.sum(axis=1, keepdims=True)
    leave = min(states / length, 0.5)
    transitions = leave * np.divide(exits, sums, out=np.zeros_like(exits), where=sums > 0.0)
    return MarkovChain(np.eye(states)[0], transitions + np.diag(1.0 - transitions.sum(axis=1)))


@dataclass(frozen=True, slots=True)
class KMeans:
    """Cluster the datapoints in the coordinates of all frames together by k-means.

    Columns are scaled to unit variance. Every transition is possible.

    Attributes:
        pseudocount: Added to the transition counts of every state, spread evenly over its successors, and to
            the initial counts.
    """

    pseudocount: float = 1.0

    def __post_init__(self) -> None:
        require_number(self.pseudocount, "pseudocount", 0.0)

    def initial_statistics(self, views: Views, states: int, rng: np.random.Generator) -> Statistics:
        """Compute the statistics of the clusters.

        Args:
            views: Demonstrations as every frame sees them.
            states: Number of clusters.
            rng: Source of the initial centres.

        Raises:
            InvalidInput: If the data has fewer distinct points than clusters, or a cluster stays empty.
        """
        joint = _joint_features(views)
        if (distinct := _count_distinct(joint, states)) < states:
            raise InvalidInput(
                f"states is {states}, expected at most {distinct}, the number of distinct points in the data"
            )
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
    from scipy.cluster.vq import (  # not at the top: importing scipy doubles the import time
        ClusterError,
        kmeans2,
    )

    for _ in range(MAX_ATTEMPTS):
        try:
            return np.asarray(
                kmeans2(x, states, minit="++", missing="raise", iter=50, rng=rng)[1], dtype=np.int64
            )
        except ClusterError:  # a cluster became empty
            continue
    raise InvalidInput(
        f"k-means found no {states} separate clusters in {MAX_ATTEMPTS} attempts; ask for fewer states"
    )


def _joint_features(views: Views) -> Float[Array, "N C"]:
    """Concatenate the scaled columns of all frames, in place to save memory."""
    P, N, D = views.x.shape
    E = D - len(views.orientation_starts)
    joint = np.empty((N, P * E))
    for p, x in enumerate(views.x):
        if views.orientation_starts:  # in the tangent space, where q and -q are one point
            x = log_map(karcher_mean(x, np.ones(N), views.orientation_starts), x, views.orientation_starts)
        deviations = np.array([column.std() for column in x.T])
        np.divide(x, np.where(deviations > 0.0, deviations, 1.0), out=joint[:, p * E : (p + 1) * E])
    return joint


def _count_distinct(x: Float[Array, "N C"], limit: int) -> int:
    """Count the distinct rows, up to a limit."""
    points = x[:0]
    for start in range(0, len(x), BLOCK_ROWS):
        points = np.unique(np.concatenate([points, x[start : start + BLOCK_ROWS]]), axis=0)[:limit]
        if len(points) == limit:
            break
    return len(points)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class FromModel:
    """Initialise by the E-step of a given model, for instance one learned from other demonstrations.

    Attributes:
        model: A model or skill with the same frames and columns.
    """

    model: HiddenModel | Skill

    def initial_statistics(
        self, views: Views | Partitions[Views], states: int, rng: np.random.Generator
    ) -> Statistics:
        """Compute the expected statistics under the given model.

        Args:
            views: Demonstrations as every frame sees them.
            states: Number of states of the given model.
            rng: Not used.

        Raises:
            InvalidInput: If states, frames or columns are not those of the model.
        """
        P, K, D = self.model.means.shape
        if states != K:
            raise InvalidInput(f"states is {states}, expected {K}, the number of states of the given model")
        shape = next(as_partitions(views).map(_shape))
        if (given := (shape[0], shape[2])) != (P, D):
            raise InvalidInput(
                f"the demonstrations have {given[0]} frames of {given[1]} columns, expected {P} of {D} as in "
                "the given model"
            )
        return expected_statistics(self.model, views)


def _shape(views: Views) -> tuple[int, ...]:
    return views.x.shape
