"""Semi-Markov skills learned exactly: states, transitions and durations together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pilotfish.demonstrations import Demonstration, Views, views
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.gaussians import Structure
from pilotfish.models.duration_laws import DurationLaw, Normal
from pilotfish.models.durations import GaussianDurations
from pilotfish.models.durations_counted import with_durations
from pilotfish.models.dynamics import CUT_SHORT, Censoring, Dynamics, SemiMarkovChain, final_states
from pilotfish.models.em import EMSettings, EStep, improve
from pilotfish.models.learn import DEFAULTS, FULL, TIME_BINS, Fit, learn_markov, learned, m_step_of
from pilotfish.models.skill import Skill
from pilotfish.models.starts import Given, Start
from pilotfish.models.statistics import (
    Statistics,
    further_statistics,
    most_likely_chain,
    statistics,
)
from pilotfish.models.visits import LOST, log_tails, require_longest, whole_visits
from pilotfish.types import Array, Bool

NORMAL = Normal()
BREADTH = 0.5  # the least deviation of the durations that a fit begins with, as a share of their mean


@dataclass(frozen=True, slots=True)
class Timing:
    """What is learned about how long visits last, and from what.

    law        the family of their durations
    censoring  what the recordings cut off
    longest    no visit of more recorded steps is followed; None follows visits until one outlasts them with a
               probability of at most 1e-8, and never less far than in the iteration before
    """

    law: DurationLaw = NORMAL
    censoring: Censoring = CUT_SHORT
    longest: int | None = None

    def __post_init__(self) -> None:
        require_kind("law", self.law, DurationLaw, "give an instance, say pf.LogNormal()")
        require_kind("censoring", self.censoring, Censoring, "pf.Censoring(first=True) makes one")
        require_longest(self.longest)


TIMING = Timing()


def learn_semi_markov(  # noqa: PLR0913 - one argument for each choice, as learn has, and one for durations
    demonstrations: Sequence[Demonstration],
    *,
    states: int,
    rng: np.random.Generator,
    timing: Timing = TIMING,
    structure: Structure = FULL,
    start: Start = TIME_BINS,
    settings: EMSettings = DEFAULTS,
) -> Fit:
    """A task-parameterised hidden semi-Markov skill of maximum likelihood, durations included.

    A Markov model is fitted first, as learn does, and its durations counted; from there on, with durations
    widened to at least half their mean, expectation-maximisation goes over all states and durations. A start
    that is Given a semi-Markov skill is gone on from as it is. fit.markov is the Markov model at the outset,
    fit.trace and fit.outcome are those of the semi-Markov fit.
    Cost: O(T K (K + longest visit)) an iteration.
    Raises: as learn does; InvalidInput also, when visits longer than timing.longest are needed.
    Source: Yu 2010, the explicit duration model; Guedon 2003 for a last visit that is cut short.
    """
    require_kind("timing", timing, Timing, "pf.Timing(law=pf.LogNormal()) makes one")
    data = views(demonstrations)
    if isinstance(start, Given) and isinstance(start.model.dynamics, SemiMarkovChain):
        guess = start.guess(data, states, rng)
        markov = _as_markov(demonstrations, guess, structure, settings)
        dropped: tuple[str, ...] = ()
    else:
        fit = learn_markov(
            demonstrations, states=states, rng=rng, structure=structure, start=start, settings=settings
        )
        markov, dropped = fit.markov, fit.outcome.dropped
        guess = _with_broad_visits(markov, data, timing, settings.duration_floor)
    chain = partial(most_likely_semi_markov, timing=timing, floor=settings.duration_floor)
    run = improve(guess, data, m_step_of(structure, settings, chain), settings, _e_step(timing, settings))
    outcome = replace(run.outcome, dropped=dropped + run.outcome.dropped)
    return Fit(learned(demonstrations, run, structure.label, settings), markov, run.trace, outcome)


def most_likely_semi_markov(
    sums: Statistics, previous: Dynamics | None, timing: Timing, floor: float
) -> SemiMarkovChain:
    """Shares of the first states and of the visits that follow each, and the likeliest durations."""
    if sums.visits is None:
        raise InvalidInput(
            "these statistics are of a model without durations; give those of a semi-Markov one"
        )
    before = previous if isinstance(previous, SemiMarkovChain) else None
    durations = timing.law.estimate(sums.visits, before.durations if before else None, floor)
    leaving = sums.transitions * (1.0 - np.eye(len(sums.first)))
    departures = np.where(_final(sums, before), 0.0, leaving.sum(axis=1))[:, None]
    onward = np.divide(leaving, departures, out=np.zeros_like(leaving), where=departures > 0.0)
    return SemiMarkovChain(sums.first / sums.first.sum(), onward, durations, timing.censoring)


def _final(sums: Statistics, before: SemiMarkovChain | None) -> Bool[Array, " K"]:
    """States left less than half a time, where to stay for ever is no less likely than to leave sometimes.

    A path that never leaves has at least the share 1 - departures of the likelihood, and gains what its last
    visits, cut off by the end, are more probable once they cannot end.
    """
    departures = sums.transitions.sum(axis=1)
    seldom = departures < 0.5
    if before is None or sums.visits is None:
        return np.asarray(seldom)
    log_longer, _ = log_tails(before.durations, len(sums.visits.goes_on))
    seen = sums.visits.goes_on > 0.0
    gains = -(sums.visits.goes_on * np.where(seen, log_longer, 0.0)).sum(axis=0)
    losses = -np.log1p(-np.where(seldom, departures, 0.0))
    return np.asarray(final_states(before) | (seldom & (losses <= gains)))


def _e_step(timing: Timing, settings: EMSettings) -> EStep:
    if (longest := timing.longest) is None:
        return partial(further_statistics, threads=settings.threads)
    return lambda model, data, before: statistics(model, data, longest=longest, threads=settings.threads)


def _with_broad_visits(markov: Skill, data: Views, timing: Timing, floor: float) -> Statistics:
    """What the Markov skill believes, its visits as many as it makes but spread over many lengths."""
    sums, counted = statistics(markov, data), with_durations(markov, data, floor).durations
    broad = GaussianDurations(counted.means, np.maximum(counted.deviations, BREADTH * counted.means))
    longest = min(timing.longest or broad.longest(LOST), int(data.lengths.max()))
    between = sums.transitions * (1.0 - np.eye(len(sums.first)))
    table = np.exp(broad.log_table(longest))
    visits = whole_visits(table / table.sum(axis=0) * (sums.first + between.sum(axis=0)))
    return replace(sums, transitions=between, visits=visits)


def _as_markov(
    demonstrations: Sequence[Demonstration], sums: Statistics, structure: Structure, settings: EMSettings
) -> Skill:
    """The Markov skill that these statistics of a semi-Markov one make likeliest."""
    data = views(demonstrations)
    once = replace(settings, max_iterations=1, watch=None)
    run = improve(sums, data, m_step_of(structure, settings, most_likely_chain), once)
    return learned(demonstrations, run, structure.label, settings)
