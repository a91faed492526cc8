"""Learn a task-parameterised skill (TP-GMM, TP-HMM or TP-HSMM) from demonstrations.

A semi-Markov skill is learned in two ways, both after the fit of a Markov skill:

    durations=None           counts the durations along the Viterbi paths of the Markov skill (Tanwani 2018,
                             section 3.2). Cheap, and enough for movements that go once from left to right.
    durations=DurationModel  continues with EM over states and durations together, censored segments included
                             (Yu 2010). The likelihood of the semi-Markov model is maximised.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import CovarianceStructure, Diagonal, Full
from pilotfish.models.active_bounds import duration_bounds, regularisation_bounds
from pilotfish.models.demonstration_statistics import default_regularisation
from pilotfish.models.demonstration_summary import summarise
from pilotfish.models.duration_model import DurationModel
from pilotfish.models.durations import Gaussian, Segments
from pilotfish.models.dynamics import MarkovChain, MixtureWeights
from pilotfish.models.em import (
    EMSettings,
    FitDynamics,
    MStep,
    expected_statistics,
    fit_em,
)
from pilotfish.models.initialisation import FromModel, Initialisation, KMeans, TimeBins
from pilotfish.models.learning_problem import Fit, LearningProblem
from pilotfish.models.partitions import DemonstrationGroup, Partitions, as_groups, group_views
from pilotfish.models.semi_markov import TAIL_PROBABILITY, SemiMarkovChain
from pilotfish.models.skill import MAX_STATES, Skill
from pilotfish.models.statistics import Statistics
from pilotfish.models.step_fit import fit_steps, initial_statistics
from pilotfish.models.viterbi_durations import count_durations
from pilotfish.validation import require_count, require_type

DEFAULT_SETTINGS = EMSettings()
DEFAULT_STATES, MIN_DEFAULT_ROWS = 30, 2  # states, and steps of the shortest demonstration for each
MIN_FITTED_DURATION_VARIANCE = 1.0  # steps^2, the default of durations fitted by EM
MIN_RELATIVE_DEVIATION = 0.5  # of the durations with which EM of a semi-Markov skill begins
FIT_DYNAMICS: dict[str, FitDynamics] = {
    MixtureWeights.name: MixtureWeights.fit,
    MarkovChain.name: MarkovChain.fit,
    SemiMarkovChain.name: MarkovChain.fit,
}


def learn(
    demonstrations: Sequence[Demonstration] | Partitions[DemonstrationGroup],
    *,
    states: int | None = None,
    rng: np.random.Generator,
    dynamics: str = SemiMarkovChain.name,
    durations: DurationModel | None = None,
    structure: CovarianceStructure | None = None,
    initialisation: Initialisation | None = None,
    settings: EMSettings = DEFAULT_SETTINGS,
) -> Fit:
    """Learn a task-parameterised skill by expectation-maximisation.

    By default a skill has many states with diagonal covariances: short states follow corners and the times of
    a gripper, and a few demonstrations support no correlations. Few states need them, as the columns of a
    long state vary together.

    Args:
        demonstrations: Recordings of one task with the same frames, columns and period, or a set of them in
            parts. The result is the same.
        states: Number of states K. None takes 30, or one for every two steps of a short demonstration.
        rng: Source of randomness of the initialisation.
        dynamics: "semi-markov" (TP-HSMM), "markov" (TP-HMM) or "mixture" (TP-GMM).
        durations: How durations of a semi-Markov skill are fitted together with the states, in O(T K (K + L))
            per iteration. By default they are counted along the Viterbi paths of the Markov skill.
        structure: Covariance structure of the states. None is diagonal where `states` is None, else full.
        initialisation: Initial statistics. None fits from time bins, templates and k-means, and keeps the
            fit of lowest BIC; they are compared on at most 500 demonstrations of about 100 rows.
            `FromModel` with a semi-Markov model continues its fit if `durations` is given.
        settings: Settings of expectation-maximisation.

    Returns:
        The skill, the Markov skill before it, and how the fit ended.

    Raises:
        InvalidInput: If an argument is wrong, the demonstrations disagree or are too short, or segments
            longer than `durations.max_duration` are needed.
        NotPositiveDefinite: If a covariance collapses; raise `settings.regularisation`.

    Example:
        >>> import numpy as np
        >>> import pilotfish as pf
        >>> x = np.random.default_rng(0).normal(size=(20, 1)) + np.repeat([[0.0], [5.0]], 10, axis=0)
        >>> layout = pf.demonstrations.position_layout(1)
        >>> demonstration = pf.demonstration(x, 0.1, layout, ())
        >>> pf.learn([demonstration], states=2, rng=np.random.default_rng(0)).skill.states
        2

    Source:
        Tanwani 2018, chapters 3 and 4; Yu 2010, the explicit-duration model; Guedon 2003 for right-censored
        last segments.
    """
    require_type(settings, "settings", EMSettings, "pf.models.EMSettings(...) makes one")
    require_type(
        durations, "durations", (DurationModel, type(None)), "pf.models.DurationModel(...) makes one"
    )
    require_type(dynamics, "dynamics", str, "give a name")
    if dynamics not in FIT_DYNAMICS:
        names = ", ".join(map(repr, FIT_DYNAMICS))
        raise InvalidInput(f"dynamics is {dynamics!r}, expected one of {names}")
    if durations and dynamics != SemiMarkovChain.name:
        raise InvalidInput(
            f'durations is given with dynamics={dynamics!r}, expected dynamics="semi-markov"; leave one out'
        )
    fix = "give an instance, such as pf.structures.Full() or pf.structures.SemiTied()"
    require_type(structure, "structure", (CovarianceStructure, type(None)), fix)
    _validate_initialisation(initialisation, states, rng, settings.restarts)
    problem = _make_problem(demonstrations, states, rng, dynamics, structure, settings)
    m_step = problem.m_step(FIT_DYNAMICS[dynamics])
    if durations:
        fit = _learn_durations(problem, initialisation, m_step, durations)
        return _report_regularisation(fit, settings)
    fit, complete = fit_steps(problem, initialisation, m_step)
    fit = _report_regularisation(fit, settings)
    if dynamics != SemiMarkovChain.name:
        return fit
    chain = count_durations(
        fit.markov_skill, problem.data, settings.duration_regularisation, complete=complete
    )
    return replace(fit, skill=replace(fit.skill, dynamics=chain))


def _make_problem(
    demonstrations: Sequence[Demonstration] | Partitions[DemonstrationGroup],
    states: int | None,
    rng: np.random.Generator,
    dynamics: str,
    structure: CovarianceStructure | None,
    settings: EMSettings,
) -> LearningProblem:
    """Fill in the defaults that depend on the demonstrations."""
    source = as_groups(demonstrations)
    summary = summarise(source)
    data = source.transform(partial(group_views, first=summary.first))
    regularisation = default_regularisation(summary.statistics.scales, summary.first.layout)
    if settings.regularisation is not None:
        regularisation = np.full(len(regularisation), float(settings.regularisation))
    return LearningProblem(
        source,
        summary,
        data,
        _default_states(int(summary.lengths.min())) if states is None else states,
        dynamics != MixtureWeights.name,
        structure or default_structure(states, dynamics),
        settings,
        rng,
        regularisation,
    )


def _report_regularisation(fit: Fit, settings: EMSettings) -> Fit:
    """Add the bounds of a regularisation that the user chose."""
    if settings.regularisation is None:
        return fit
    return replace(fit, active_bounds=fit.active_bounds + regularisation_bounds(fit.skill))


def default_states(demonstrations: Sequence[Demonstration]) -> int:
    """Return the default number of states: 30, or one for every two steps of the shortest demonstration.

    Args:
        demonstrations: At least one.
    """
    return _default_states(min(len(demo.x) for demo in demonstrations))


def _default_states(shortest: int) -> int:
    return max(1, min(DEFAULT_STATES, shortest // MIN_DEFAULT_ROWS))


def default_structure(states: int | None, dynamics: str = SemiMarkovChain.name) -> CovarianceStructure:
    """Return the default covariance structure: diagonal, or full if states are given or make a mixture.

    Args:
        states: Number of states that was asked for; None for the default number.
        dynamics: Name of the dynamics.
    """
    return Diagonal() if states is None and dynamics != MixtureWeights.name else Full()


def _validate_initialisation(
    initialisation: Initialisation | None, states: int | None, rng: np.random.Generator, restarts: int
) -> None:
    require_type(
        initialisation,
        "initialisation",
        (TimeBins, KMeans, FromModel, Initialisation, type(None)),
        "give an instance, such as pf.models.KMeans()",
    )
    if states is not None:
        require_count(states, "states", MAX_STATES, 1)
    elif isinstance(initialisation, FromModel):
        raise InvalidInput("states is None, expected the number of states of the given model")
    require_type(rng, "rng", np.random.Generator, "np.random.default_rng(seed) makes one of a seed")
    if restarts > 1 and (initialisation in (None, TimeBins()) or isinstance(initialisation, FromModel)):
        raise InvalidInput(
            f"restarts is {restarts}, expected 1, as this initialisation is the same every time; use "
            "TimeBins(jitter=0.5) or KMeans()"
        )


def _learn_durations(
    problem: LearningProblem,
    initialisation: Initialisation | None,
    markov_m_step: MStep,
    durations: DurationModel,
) -> Fit:
    """Fit states and durations together, from a given semi-Markov model or after a Markov fit."""
    data, settings = problem.data, problem.settings
    given = settings.duration_regularisation
    min_variance = MIN_FITTED_DURATION_VARIANCE if given is None else given
    if isinstance(initialisation, FromModel) and initialisation.model.dynamics.durations is not None:
        statistics = initial_statistics(initialisation, problem)
        one_iteration = replace(settings, max_iterations=1, callback=None)
        model, _, convergence = fit_em(statistics, data, markov_m_step, one_iteration)
        markov_skill = problem.skill(model, convergence)
        dropped: tuple[str, ...] = ()
    else:
        fit, _ = fit_steps(problem, initialisation, markov_m_step)
        markov_skill, dropped = fit.markov_skill, fit.convergence.dropped
        statistics = _widen_durations(markov_skill, problem, durations.max_duration, min_variance)
    m_step = problem.m_step(partial(SemiMarkovChain.fit, duration_model=durations, min_variance=min_variance))
    e_step = partial(expected_statistics, max_duration=durations.max_duration, threads=settings.threads)
    model, statistics, convergence = fit_em(statistics, data, m_step, settings, e_step)
    skill = problem.skill(model, convergence)
    bounds: tuple[str, ...] = ()
    if durations.max_duration and statistics.segments:
        bounds = duration_bounds(statistics.segments, durations.max_duration)
    return Fit(skill, markov_skill, replace(convergence, dropped=dropped + convergence.dropped), bounds)


def _widen_durations(
    markov_skill: Skill, problem: LearningProblem, max_duration: int | None, min_variance: float
) -> Statistics:
    """Return the statistics of the Markov skill with its segments spread over many lengths.

    EM over durations starts from a standard deviation of at least half the mean: narrow durations would keep
    the segmentation of the Markov skill.
    """
    statistics = expected_statistics(markov_skill, problem.data)
    counted = count_durations(markov_skill, problem.data, min_variance).durations
    widened = Gaussian(counted.means, np.maximum(counted.deviations, MIN_RELATIVE_DEVIATION * counted.means))
    limit = min(max_duration or widened.max_duration(TAIL_PROBABILITY), int(problem.summary.lengths.max()))
    transition_counts = statistics.transitions * (1.0 - np.eye(len(statistics.initial_counts)))
    table = np.exp(widened.log_table(limit))
    counts = table / table.sum(axis=0) * (statistics.initial_counts + transition_counts.sum(axis=0))
    return replace(statistics, transitions=transition_counts, segments=Segments.all_uncensored(counts))
