"""Expectation-maximisation as a fold: statistics of data, and the model that they are likeliest under."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import (
    Covariances,
    Moments,
    Structure,
    TangentMoments,
    moments,
    moments_about,
    tangent_moments,
)
from pilotfish.models.durations import Durations
from pilotfish.models.dynamics import Dynamics, MarkovChain, SemiMarkovChain, Weights
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.models.visits import LOST, Visits, visit_tables, visits_of
from pilotfish.types import Array, Float, Int

BLOCK = 8192  # rows summed up at a time


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
    first: Float[Array, " K"]
    transitions: Float[Array, "K K"]
    log_likelihood: float
    visits: Visits | None = None

    def __add__(self, other: "Statistics") -> "Statistics":
        return Statistics(
            tuple(_added(a, b) for a, b in zip(self.moments, other.moments, strict=True)),
            self.first + other.first,
            self.transitions + other.transitions,
            self.log_likelihood + other.log_likelihood,
            self.visits + other.visits if self.visits and other.visits else None,
        )


def _added(a: Moments | TangentMoments, b: Moments | TangentMoments) -> Moments | TangentMoments:
    if isinstance(a, Moments) and isinstance(b, Moments):
        return a + b
    if isinstance(a, TangentMoments) and isinstance(b, TangentMoments):
        return a + b
    raise InvalidInput("statistics of a skill with orientations on S^3 and of one without do not add up")


def statistics(
    model: HiddenModel | Skill, views: Views, *, longest: int | None = None, threads: int = 1
) -> Statistics:
    """What the model believes about the data: the E-step (3.8-3.15, 3.22), over every demonstration at once.

    Of a semi-Markov model visits of up to longest steps are followed, by default up to what a visit to any
    state outlasts with a probability of at most 1e-8; no further than the longest demonstration either way.
    threads share the work, 0 meaning as many as this process may use; the sums do not depend on them.
    Raises: NotPositiveDefinite.
    """
    each = [c.whiteners("the covariance of state") for c in model.covariances]
    W = each[0][None] if len(each) == 1 else np.stack(each)  # of wide states a copy takes as long as they do
    emissions = kernels.Emissions(model.means, W, views.turns)
    if isinstance(chain := model.dynamics, SemiMarkovChain):
        followed_to = longest or chain.durations.longest(LOST)
        tables = visit_tables(chain, min(followed_to, int(views.lengths.max())))
        step = kernels.semi_markov_e_step(views.x, views.lengths, tables, emissions, threads)
        visits = visits_of(step.visits, chain)
        return _summed(model.means, step, visits, views.turns)
    initial, transitions = one_step_chain(chain)
    markov = kernels.e_step(views.x, views.lengths, initial, transitions, emissions, threads)
    return _summed(model.means, markov, None, views.turns)


def further_statistics(
    model: HiddenModel | Skill, views: Views, before: Statistics, *, threads: int = 1
) -> Statistics:
    """Statistics as above, of visits at least as long as were followed before.

    A law that narrows then loses no path, and the likelihood cannot fall by it.
    """
    if not isinstance(chain := model.dynamics, SemiMarkovChain):
        return statistics(model, views, threads=threads)
    least = len(before.visits.whole) if before.visits else 1
    longest = max(followed(chain.durations, views.lengths), least)
    return statistics(model, views, longest=longest, threads=threads)


def followed(durations: Durations, lengths: Int[Array, " M"]) -> int:
    """How many steps of a visit are followed in demonstrations of these lengths, where nobody says."""
    return min(durations.longest(LOST), int(lengths.max()))


def _summed(
    origins: Float[Array, "P K D"],
    step: kernels.EStep | kernels.SemiMarkovEStep,
    visits: Visits | None,
    turns: tuple[int, ...],
) -> Statistics:
    frames = [
        TangentMoments(step.mass, here, offsets, scatters, turns)
        if turns
        else moments_about(here, step.mass, offsets, scatters)
        for here, offsets, scatters in zip(origins, step.offsets, step.scatters, strict=True)
    ]
    log_likelihood = float(step.log_likelihoods.sum())
    return Statistics(tuple(frames), step.first, step.transitions, log_likelihood, visits)


def one_step_chain(dynamics: Dynamics) -> tuple[Float[Array, " K"], Float[Array, "K K"]]:
    """Initial and transition probabilities of one step; a mixture is the chain with all rows alike."""
    if isinstance(dynamics, SemiMarkovChain):
        raise InvalidInput(
            "a semi-Markov skill has no one-step transitions; use the Markov model, fit.markov"
        )
    if isinstance(dynamics, Weights):
        return dynamics.weights, np.tile(dynamics.weights, (len(dynamics.weights), 1))
    return dynamics.initial, dynamics.transitions


def labelled_statistics(views: Views, labels: Int[Array, " N"], states: int) -> Statistics:
    """Statistics of data whose states are known; the log-likelihood is not evaluated (NaN)."""
    ends = np.cumsum(views.lengths)
    inner = np.ones(len(labels) - 1, dtype=bool)
    inner[ends[:-1] - 1] = False  # no step leads from one demonstration to the next
    counts = np.zeros((states, states))
    np.add.at(counts, (labels[:-1][inner], labels[1:][inner]), 1.0)
    first = np.bincount(labels[ends - views.lengths], minlength=states).astype(float)
    seen = tuple(
        tangent_moments(x, np.eye(states)[labels], views.turns)
        if views.turns
        else _labelled_moments(x, labels, states)
        for x in views.x
    )
    return Statistics(seen, first, counts, np.nan)


def _labelled_moments(x: Float[Array, "N D"], labels: Int[Array, " N"], states: int) -> Moments:
    """Moments of the points of each label, so many at a time: what they need beside the data stays small."""
    each = [_moments_of_rows(x, np.flatnonzero(labels == k)) for k in range(states)]
    return Moments(
        np.concatenate([m.mass for m in each]),
        np.concatenate([m.means for m in each]),
        np.concatenate([m.scatters for m in each]),
    )


def _moments_of_rows(x: Float[Array, "N D"], rows: Int[Array, " n"]) -> Moments:
    blocks = (rows[begin : begin + BLOCK] for begin in range(0, max(len(rows), 1), BLOCK))
    return reduce(add, (moments(x[block], np.ones((len(block), 1))) for block in blocks))


def maximise(
    sums: Statistics,
    like: HiddenModel | None,
    structure: Structure,
    regularisation: float,
    chain: Callable[[Statistics, Dynamics | None], Dynamics],
) -> HiddenModel:
    """The model most likely to have these statistics: the M-step (3.12-3.17, 3.23-3.25).

    Every sample covariance is raised by regularisation [unit of x squared] before its structure is
    imposed. like, the model before, lets iterative structures and laws go on where they were. chain is
    most_likely_chain, most_likely_weights or most_likely_semi_markov.
    """
    before: tuple[Covariances | None, ...] = like.covariances if like else (None,) * len(sums.moments)
    covariances = []
    for m, old in zip(sums.moments, before, strict=True):
        samples = m.scatters / m.mass[:, None, None] + regularisation * np.eye(m.scatters.shape[2])
        covariances.append(structure.estimate(m.mass, 0.5 * (samples + samples.transpose(0, 2, 1)), old))
    return HiddenModel(
        chain(sums, like.dynamics if like else None),
        np.stack([m.means for m in sums.moments]),
        tuple(covariances),
    )


def most_likely_chain(sums: Statistics, previous: Dynamics | None = None) -> MarkovChain:
    """Shares of the first steps and of the steps from each state; one that was never left leads to itself.

    Of the statistics of a semi-Markov model, the steps within visits are put back.
    """
    steps = sums.transitions
    if sums.visits:
        begun = sums.first + steps.sum(axis=0)
        steps = steps + np.diag(np.maximum(sums.moments[0].mass - begun, 0.0))
    departures = steps.sum(axis=1, keepdims=True)
    transitions = np.divide(steps, departures, out=np.eye(len(departures)), where=departures > 0.0)
    return MarkovChain(sums.first / sums.first.sum(), transitions)


def most_likely_weights(sums: Statistics, previous: Dynamics | None = None) -> Weights:
    """Shares of the datapoints."""
    mass = sums.moments[0].mass
    return Weights(mass / mass.sum())
