"""Expectation-maximisation as a fold: statistics of data, and the model that they are likeliest under."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Moments, TangentMoments, moments, moments_from_sums, tangent_moments
from pilotfish.gaussians.structures import Covariances, CovarianceStructure
from pilotfish.models.durations.values import Durations
from pilotfish.models.dynamics import Dynamics, MarkovChain, MixtureWeights, SemiMarkovChain
from pilotfish.models.segments import TAIL_PROBABILITY, Segments, segment_tables, segments_from_counts
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.types import Array, Float, Int

BLOCK_ROWS = 8192  # rows summed up at a time


@dataclass(frozen=True, slots=True, eq=False)
class Statistics:
    """All that a model of K states needs to know of demonstrations. Adding is exact, in any order.

    moments      one for each frame
    first        expected number of demonstrations that begin in each state
    transitions  expected number of steps from each state to each other; of a semi-Markov model, of visits to
                 a state that follow one to another
    visits       expected number of visits by how long they lasted; of semi-Markov models alone
    """

    moments: tuple[Moments | TangentMoments, ...]
    initial_counts: Float[Array, " K"]
    transitions: Float[Array, "K K"]
    log_likelihood: float
    segments: Segments | None = None

    def __add__(self, other: "Statistics") -> "Statistics":
        return Statistics(
            tuple(_add_moments(a, b) for a, b in zip(self.moments, other.moments, strict=True)),
            self.initial_counts + other.initial_counts,
            self.transitions + other.transitions,
            self.log_likelihood + other.log_likelihood,
            self.segments + other.segments if self.segments and other.segments else None,
        )


def _add_moments(a: Moments | TangentMoments, b: Moments | TangentMoments) -> Moments | TangentMoments:
    if isinstance(a, Moments) and isinstance(b, Moments):
        return a + b
    if isinstance(a, TangentMoments) and isinstance(b, TangentMoments):
        return a + b
    raise InvalidInput("statistics of a skill with orientations on S^3 and of one without do not add up")


def expected_statistics(
    model: HiddenModel | Skill, views: Views, *, max_duration: int | None = None, threads: int = 1
) -> Statistics:
    """What the model believes about the data: the E-step (3.8-3.15, 3.22), over every demonstration at once.

    Of a semi-Markov model visits of up to longest steps are followed, by default up to what a visit to any
    state outlasts with a probability of at most 1e-8; no further than the longest demonstration either way.
    threads share the work, 0 meaning as many as this process may use; the sums do not depend on them.
    Raises: NotPositiveDefinite.
    """
    each = [c.precision_cholesky("the covariance of state") for c in model.covariances]
    W = each[0][None] if len(each) == 1 else np.stack(each)  # of wide states a copy takes as long as they do
    emissions = kernels.Emissions(model.means, W, views.orientation_starts)
    if isinstance(chain := model.dynamics, SemiMarkovChain):
        limit = max_duration or chain.durations.max_duration(TAIL_PROBABILITY)
        tables = segment_tables(chain, min(limit, int(views.lengths.max())))
        step = kernels.semi_markov_e_step(views.x, views.lengths, tables, emissions, threads)
        segments = segments_from_counts(step.segments, chain)
        return _statistics_from_sums(model.means, step, segments, views.orientation_starts)
    initial, transitions = step_probabilities(chain)
    markov = kernels.e_step(views.x, views.lengths, initial, transitions, emissions, threads)
    return _statistics_from_sums(model.means, markov, None, views.orientation_starts)


def monotone_statistics(
    model: HiddenModel | Skill, views: Views, before: Statistics, *, threads: int = 1
) -> Statistics:
    """Statistics as above, of visits at least as long as were followed before.

    A law that narrows then loses no path, and the likelihood cannot fall by it.
    """
    if not isinstance(chain := model.dynamics, SemiMarkovChain):
        return expected_statistics(model, views, threads=threads)
    min_duration = len(before.segments.uncensored) if before.segments else 1
    max_duration = max(default_max_duration(chain.durations, views.lengths), min_duration)
    return expected_statistics(model, views, max_duration=max_duration, threads=threads)


def default_max_duration(durations: Durations, lengths: Int[Array, " M"]) -> int:
    """How many steps of a visit are followed in demonstrations of these lengths, where nobody says."""
    return min(durations.max_duration(TAIL_PROBABILITY), int(lengths.max()))


def _statistics_from_sums(
    origins: Float[Array, "P K D"],
    step: kernels.EStep | kernels.SemiMarkovEStep,
    segments: Segments | None,
    orientation_starts: tuple[int, ...],
) -> Statistics:
    frames = [
        TangentMoments(step.counts, frame_origins, offsets, scatter_matrices, orientation_starts)
        if orientation_starts
        else moments_from_sums(frame_origins, step.counts, offsets, scatter_matrices)
        for frame_origins, offsets, scatter_matrices in zip(
            origins, step.offsets, step.scatter_matrices, strict=True
        )
    ]
    log_likelihood = float(step.log_likelihoods.sum())
    return Statistics(tuple(frames), step.initial_counts, step.transitions, log_likelihood, segments)


def step_probabilities(dynamics: Dynamics) -> tuple[Float[Array, " K"], Float[Array, "K K"]]:
    """Initial and transition probabilities of one step; a mixture is the chain with all rows alike."""
    if isinstance(dynamics, SemiMarkovChain):
        raise InvalidInput(
            "a semi-Markov skill has no one-step transitions; use the Markov model, fit.markov"
        )
    if isinstance(dynamics, MixtureWeights):
        return dynamics.weights, np.tile(dynamics.weights, (len(dynamics.weights), 1))
    return dynamics.initial, dynamics.transitions


def labelled_statistics(views: Views, labels: Int[Array, " N"], states: int) -> Statistics:
    """Statistics of data whose states are known; the log-likelihood is not evaluated (NaN)."""
    ends = np.cumsum(views.lengths)
    within_demonstration = np.ones(len(labels) - 1, dtype=bool)
    within_demonstration[ends[:-1] - 1] = False  # no step leads from one demonstration to the next
    transition_counts = np.zeros((states, states))
    np.add.at(transition_counts, (labels[:-1][within_demonstration], labels[1:][within_demonstration]), 1.0)
    initial_counts = np.bincount(labels[ends - views.lengths], minlength=states).astype(float)
    frame_moments = tuple(
        tangent_moments(x, np.eye(states)[labels], views.orientation_starts)
        if views.orientation_starts
        else _labelled_moments(x, labels, states)
        for x in views.x
    )
    return Statistics(frame_moments, initial_counts, transition_counts, np.nan)


def _labelled_moments(x: Float[Array, "N D"], labels: Int[Array, " N"], states: int) -> Moments:
    """Moments of the points of each label, so many at a time: what they need beside the data stays small."""
    each = [_moments_of_rows(x, np.flatnonzero(labels == k)) for k in range(states)]
    return Moments(
        np.concatenate([m.counts for m in each]),
        np.concatenate([m.means for m in each]),
        np.concatenate([m.scatter_matrices for m in each]),
    )


def _moments_of_rows(x: Float[Array, "N D"], rows: Int[Array, " n"]) -> Moments:
    blocks = (rows[begin : begin + BLOCK_ROWS] for begin in range(0, max(len(rows), 1), BLOCK_ROWS))
    return reduce(add, (moments(x[block], np.ones((len(block), 1))) for block in blocks))


def maximise_likelihood(
    statistics: Statistics,
    previous: HiddenModel | None,
    structure: CovarianceStructure,
    regularisation: float,
    chain: Callable[[Statistics, Dynamics | None], Dynamics],
) -> HiddenModel:
    """The model most likely to have these statistics: the M-step (3.12-3.17, 3.23-3.25).

    Every sample covariance is raised by regularisation [unit of x squared] before its structure is
    imposed. like, the model before, lets iterative structures and laws go on where they were. chain is
    most_likely_chain, most_likely_weights or most_likely_semi_markov.
    """
    before: tuple[Covariances | None, ...] = (
        previous.covariances if previous else (None,) * len(statistics.moments)
    )
    covariances = []
    for m, previous_covariances in zip(statistics.moments, before, strict=True):
        sample_covariances = m.scatter_matrices / m.counts[:, None, None] + regularisation * np.eye(
            m.scatter_matrices.shape[2]
        )
        covariances.append(
            structure.estimate(
                m.counts,
                0.5 * (sample_covariances + sample_covariances.transpose(0, 2, 1)),
                previous_covariances,
            )
        )
    return HiddenModel(
        chain(statistics, previous.dynamics if previous else None),
        np.stack([m.means for m in statistics.moments]),
        tuple(covariances),
    )


def fit_markov_chain(statistics: Statistics, previous: Dynamics | None = None) -> MarkovChain:
    """Shares of the first steps and of the steps from each state; one that was never left leads to itself.

    Of the statistics of a semi-Markov model, the steps within visits are put back.
    """
    steps = statistics.transitions
    if statistics.segments:
        segments_started = statistics.initial_counts + steps.sum(axis=0)
        steps = steps + np.diag(np.maximum(statistics.moments[0].counts - segments_started, 0.0))
    departures = steps.sum(axis=1, keepdims=True)
    transitions = np.divide(steps, departures, out=np.eye(len(departures)), where=departures > 0.0)
    return MarkovChain(statistics.initial_counts / statistics.initial_counts.sum(), transitions)


def fit_mixture_weights(statistics: Statistics, previous: Dynamics | None = None) -> MixtureWeights:
    """Shares of the datapoints."""
    counts = statistics.moments[0].counts
    return MixtureWeights(counts / counts.sum())
