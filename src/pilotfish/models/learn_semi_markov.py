"""Semi-Markov skills learned exactly: states, transitions and durations together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pilotfish.demonstrations import Demonstration, Views, views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models.durations.counted import count_durations
from pilotfish.models.durations.distributions import DurationDistribution, Gaussian
from pilotfish.models.durations.values import GaussianDurations
from pilotfish.models.dynamics import RIGHT_CENSORED, Censoring, Dynamics, SemiMarkovChain, final_states
from pilotfish.models.em import EMSettings, EStep, fit_em
from pilotfish.models.learn import (
    DEFAULT_INITIALISATION,
    DEFAULT_SETTINGS,
    DEFAULT_STRUCTURE,
    Fit,
    learn_markov,
    make_m_step,
    make_skill,
)
from pilotfish.models.segments import (
    TAIL_PROBABILITY,
    log_survival,
    uncensored_segments,
    validate_max_duration,
)
from pilotfish.models.skill import Skill
from pilotfish.models.starts import FromModel, Initialisation
from pilotfish.models.statistics import (
    Statistics,
    expected_statistics,
    fit_markov_chain,
    monotone_statistics,
)
from pilotfish.types import Array, Bool
from pilotfish.validation import require_type

GAUSSIAN = Gaussian()
MIN_RELATIVE_DEVIATION = (
    0.5  # the least deviation of the durations that a fit begins with, as a share of their mean
)


@dataclass(frozen=True, slots=True)
class DurationModel:
    """What is learned about how long visits last, and from what.

    law        the family of their durations
    censoring  what the recordings cut off
    longest    no visit of more recorded steps is followed; None follows visits until one outlasts them with a
               probability of at most 1e-8, and never less far than in the iteration before
    """

    distribution: DurationDistribution = GAUSSIAN
    censoring: Censoring = RIGHT_CENSORED
    max_duration: int | None = None

    def __post_init__(self) -> None:
        require_type(
            self.distribution,
            "distribution",
            DurationDistribution,
            "give an instance, say pf.durations.LogNormal()",
        )
        require_type(self.censoring, "censoring", Censoring, "pf.models.Censoring(left=True) makes one")
        validate_max_duration(self.max_duration)


DEFAULT_DURATION_MODEL = DurationModel()


def learn_semi_markov(
    demonstrations: Sequence[Demonstration],
    *,
    states: int,
    rng: np.random.Generator,
    duration_model: DurationModel = DEFAULT_DURATION_MODEL,
    structure: CovarianceStructure = DEFAULT_STRUCTURE,
    initialisation: Initialisation = DEFAULT_INITIALISATION,
    settings: EMSettings = DEFAULT_SETTINGS,
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
    require_type(
        duration_model,
        "duration_model",
        DurationModel,
        "pf.models.Timing(law=pf.durations.LogNormal()) makes one",
    )
    data = views(demonstrations)
    if isinstance(initialisation, FromModel) and isinstance(initialisation.model.dynamics, SemiMarkovChain):
        initial_statistics = initialisation.initial_statistics(data, states, rng)
        markov_skill = _fit_markov(demonstrations, initial_statistics, structure, settings)
        dropped: tuple[str, ...] = ()
    else:
        fit = learn_markov(
            demonstrations,
            states=states,
            rng=rng,
            structure=structure,
            initialisation=initialisation,
            settings=settings,
        )
        markov_skill, dropped = fit.markov_skill, fit.convergence.dropped
        initial_statistics = _widen_durations(
            markov_skill, data, duration_model, settings.duration_regularisation
        )
    chain = partial(
        fit_semi_markov_chain, duration_model=duration_model, min_variance=settings.duration_regularisation
    )
    run = fit_em(
        initial_statistics,
        data,
        make_m_step(structure, settings, chain),
        settings,
        _make_e_step(duration_model, settings),
    )
    convergence = replace(run.convergence, dropped=dropped + run.convergence.dropped)
    return Fit(
        make_skill(demonstrations, run, structure.label, settings),
        markov_skill,
        run.log_likelihoods,
        convergence,
    )


def fit_semi_markov_chain(
    statistics: Statistics, previous: Dynamics | None, duration_model: DurationModel, min_variance: float
) -> SemiMarkovChain:
    """Shares of the first states and of the visits that follow each, and the likeliest durations."""
    if statistics.segments is None:
        raise InvalidInput(
            "these statistics are of a model without durations; give those of a semi-Markov one"
        )
    before = previous if isinstance(previous, SemiMarkovChain) else None
    durations = duration_model.distribution.estimate(
        statistics.segments, before.durations if before else None, min_variance
    )
    exits = statistics.transitions * (1.0 - np.eye(len(statistics.initial_counts)))
    departures = np.where(_select_final_states(statistics, before), 0.0, exits.sum(axis=1))[:, None]
    next_probs = np.divide(exits, departures, out=np.zeros_like(exits), where=departures > 0.0)
    return SemiMarkovChain(
        statistics.initial_counts / statistics.initial_counts.sum(),
        next_probs,
        durations,
        duration_model.censoring,
    )


def _select_final_states(statistics: Statistics, before: SemiMarkovChain | None) -> Bool[Array, " K"]:
    """States left less than half a time, where to stay for ever is no less likely than to leave sometimes.

    A path that never leaves has at least the share 1 - departures of the likelihood, and gains what its last
    visits, cut off by the end, are more probable once they cannot end.
    """
    departures = statistics.transitions.sum(axis=1)
    rarely_left = departures < 0.5
    if before is None or statistics.segments is None:
        return np.asarray(rarely_left)
    log_tail, _ = log_survival(before.durations, len(statistics.segments.right_censored))
    observed = statistics.segments.right_censored > 0.0
    gains = -(statistics.segments.right_censored * np.where(observed, log_tail, 0.0)).sum(axis=0)
    losses = -np.log1p(-np.where(rarely_left, departures, 0.0))
    return np.asarray(final_states(before) | (rarely_left & (losses <= gains)))


def _make_e_step(duration_model: DurationModel, settings: EMSettings) -> EStep:
    if (max_duration := duration_model.max_duration) is None:
        return partial(monotone_statistics, threads=settings.threads)
    return lambda model, data, before: expected_statistics(
        model, data, max_duration=max_duration, threads=settings.threads
    )


def _widen_durations(
    markov_skill: Skill, data: Views, duration_model: DurationModel, min_variance: float
) -> Statistics:
    """What the Markov skill believes, its visits as many as it makes but spread over many lengths."""
    statistics, counted = (
        expected_statistics(markov_skill, data),
        count_durations(markov_skill, data, min_variance).durations,
    )
    widened = GaussianDurations(
        counted.means, np.maximum(counted.deviations, MIN_RELATIVE_DEVIATION * counted.means)
    )
    max_duration = min(
        duration_model.max_duration or widened.max_duration(TAIL_PROBABILITY), int(data.lengths.max())
    )
    transition_counts = statistics.transitions * (1.0 - np.eye(len(statistics.initial_counts)))
    table = np.exp(widened.log_table(max_duration))
    segments = uncensored_segments(
        table / table.sum(axis=0) * (statistics.initial_counts + transition_counts.sum(axis=0))
    )
    return replace(statistics, transitions=transition_counts, segments=segments)


def _fit_markov(
    demonstrations: Sequence[Demonstration],
    statistics: Statistics,
    structure: CovarianceStructure,
    settings: EMSettings,
) -> Skill:
    """The Markov skill that these statistics of a semi-Markov one make likeliest."""
    data = views(demonstrations)
    one_iteration = replace(settings, max_iterations=1, callback=None)
    run = fit_em(statistics, data, make_m_step(structure, settings, fit_markov_chain), one_iteration)
    return make_skill(demonstrations, run, structure.label, settings)
