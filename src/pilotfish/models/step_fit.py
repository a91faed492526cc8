"""Fit of a mixture or a Markov skill by EM, from one initialisation or from the best of several.

EM finds a local maximum, so `learn` begins at several models by default and keeps the fit of lowest BIC:

    time bins  suit a movement that goes once from left to right, in one rhythm. Where columns such as a
               gripper switch in the same order in all demonstrations, the bins between two switches are those
               of the same part of the movement.
    templates  are single demonstrations. They suit movements of which some have a part that others lack, such
               as a second attempt: time bins would average unlike parts.
    k-means    suits a movement that returns to its states, such as a periodic one.

The likelihood alone prefers states that describe single demonstrations. A template is therefore taken only if
nearly all of its states are visited by more than half of the demonstrations, and k-means only if all are and
the movement returns to its states; otherwise it may leave out parts.

The models are compared on demonstrations that are resampled to about 100 rows, and the chosen one takes one
iteration with all rows. The maximum that EM reaches depends on the number of rows, and so would the motion:
the same recording at 10, 30 and 200 Hz would give motions that differ by up to 13 % of their extent. Learning
from a fast recording is cheaper too.

A large set. At most 500 demonstrations, at equal distances in the set, are compared and give initial
statistics. The chosen model then takes EM with all demonstrations, resampled too, before the iteration with
all rows. Each of these iterations is a fold over the parts of the set.

EM stops early, when an iteration gains less than half a nat per datapoint. Later iterations move states to
what few demonstrations have in common by chance: held-out letters and household tasks are reproduced no
better. `EMSettings(min_gain=0.001)` asks for them.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from pilotfish.demonstrations import Views, common_switches
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.models.degrees_of_freedom import bic, degrees_of_freedom
from pilotfish.models.em import Convergence, MStep, expected_statistics, fit_em
from pilotfish.models.initialisation import (
    FromModel,
    Initialisation,
    KMeans,
    Template,
    TimeBins,
    require_enough_steps,
)
from pilotfish.models.learning_problem import Fit, LearningProblem, Sample
from pilotfish.models.partitions import Partitions
from pilotfish.models.sequences import log_emissions, state_segments
from pilotfish.models.skill import HiddenModel
from pilotfish.models.statistics import Statistics

EARLY_GAIN = 0.5  # nats per datapoint
COMPARED_ROWS = 100  # mean number of rows of a demonstration with which initialisations are compared
ROWS_PER_STATE = 2  # at least, of the shortest
MIN_FOR_TEMPLATES, MAX_TEMPLATES = 3, 5  # demonstrations
MIN_SHARED = 0.95  # of the states of a template are visited by more than half of the demonstrations
MIN_RETURNS = 1.5  # visits of a state in a demonstration, on average, of a movement that returns

StepFit = tuple[HiddenModel, Convergence, bool]  # and whether demonstrations had to end in the last state


def fit_steps(
    problem: LearningProblem, initialisation: Initialisation | None, m_step: MStep
) -> tuple[Fit, bool]:
    """Fit a mixture or a Markov skill; of several restarts the most likely.

    Args:
        problem: Demonstrations and settings.
        initialisation: Initial statistics; None compares several.
        m_step: M-step of the dynamics.

    Returns:
        The fit, and whether every demonstration had to end in the last state.
    """
    if initialisation is not None:
        model, convergence, complete = _fit_from(initialisation, problem, m_step)
        skill = problem.skill(model, convergence)
        return Fit(skill, skill, convergence), complete
    require_enough_steps(problem.summary.lengths, problem.states)
    if problem.settings.min_gain is None:
        problem = replace(problem, settings=replace(problem.settings, min_gain=EARLY_GAIN))
    resampled = _resample(problem)
    sample = resampled.sample()
    model, convergence, complete = _best_fit(resampled, sample, m_step)
    e_step = partial(expected_statistics, threads=problem.settings.threads, complete=complete)
    if len(sample.numbers) < len(problem.summary.lengths):
        model, convergence = _continue_fit(model, convergence, resampled, m_step, e_step)
    one_iteration = replace(problem.settings, max_iterations=1, callback=None)
    model, _, last = fit_em(e_step(model, problem.data), problem.data, m_step, one_iteration, e_step)
    convergence = replace(convergence, dropped=convergence.dropped + last.dropped)
    skill = problem.skill(model, replace(convergence, log_likelihoods=last.log_likelihoods))
    return Fit(skill, skill, convergence), complete


def _continue_fit(
    model: HiddenModel,
    convergence: Convergence,
    problem: LearningProblem,
    m_step: MStep,
    e_step: Callable[..., Statistics],
) -> tuple[HiddenModel, Convergence]:
    """Continue the fit of a sample with all demonstrations."""
    model, _, last = fit_em(e_step(model, problem.data), problem.data, m_step, problem.settings, e_step)
    iterations = convergence.iterations + last.iterations
    return model, replace(last, iterations=iterations, dropped=convergence.dropped + last.dropped)


def initial_statistics(initialisation: Initialisation, problem: LearningProblem) -> Statistics:
    """Return the statistics with which EM begins; of a large set, those of a sample.

    Args:
        initialisation: Initialisation.
        problem: Demonstrations and settings.

    Raises:
        InvalidInput: If the initialisation does not fit the demonstrations.
    """
    states, rng, count = problem.states, problem.rng, len(problem.summary.lengths)
    if isinstance(initialisation, FromModel):
        return initialisation.initial_statistics(problem.data, states, rng)
    if isinstance(initialisation, TimeBins):
        require_enough_steps(problem.summary.lengths, states)
    if not isinstance(initialisation, Template):
        sample = problem.sample()
    elif initialisation.demonstration < count:
        sample = problem.sample([initialisation.demonstration])
        position = sample.numbers.index(initialisation.demonstration)
        initialisation = replace(initialisation, demonstration=position)
    else:
        raise InvalidInput(
            f"demonstration is {initialisation.demonstration}, expected a number below {count}"
        )
    if isinstance(initialisation, TimeBins) and len(initialisation.boundaries) == count:
        boundaries = tuple(initialisation.boundaries[m] for m in sample.numbers)
        initialisation = replace(initialisation, boundaries=boundaries)
    return initialisation.initial_statistics(sample.data, states, rng)


def _resample(problem: LearningProblem) -> LearningProblem:
    """Resample the demonstrations, so that the shortest has at least two rows for each state."""
    lengths = problem.summary.lengths
    rows = max(COMPARED_ROWS, math.ceil(ROWS_PER_STATE * problem.states * lengths.mean() / lengths.min()))
    try:
        return problem.resample(rows)
    except InvalidInput:  # a single row, or a frame that turns too fast to be interpolated
        return problem


def _best_fit(problem: LearningProblem, sample: Sample, m_step: MStep) -> StepFit:
    """Return the admissible fit of lowest BIC."""
    results = [_fit_time_bins(problem, sample, m_step)]
    others: list[Initialisation] = [KMeans()]
    count = len(sample.demonstrations)
    if problem.has_time_order and count >= MIN_FOR_TEMPLATES:
        chosen = np.linspace(0, count - 1, min(count, MAX_TEMPLATES)).round().astype(int).tolist()
        others += [Template(m) for m in chosen]
    for initialisation in others:
        try:
            fit = _fit_from_sample(initialisation, problem, sample, m_step)
        except (InvalidInput, NotPositiveDefinite):
            continue  # too few distinct points, or a state collapses
        if _is_admissible(fit[0], sample.data, initialisation):
            results.append(fit)

    def criterion(fit: StepFit) -> float:
        model, convergence, _ = fit
        parameters = degrees_of_freedom(model, problem.structure, None)
        return bic(float(convergence.log_likelihoods[-1]), parameters, int(sample.data.lengths.sum()))

    return min(results, key=criterion)


def _fit_time_bins(problem: LearningProblem, sample: Sample, m_step: MStep) -> StepFit:
    """Fit from time bins between common switches, or of whole demonstrations if there are too many."""
    bins = TimeBins(complete=problem.has_time_order)
    boundaries = common_switches(sample.demonstrations, problem.summary.statistics.switches)
    if boundaries:
        try:
            return _fit_from_sample(replace(bins, boundaries=boundaries), problem, sample, m_step)
        except InvalidInput:  # more parts than states, or too few steps in some
            pass
    return _fit_from_sample(bins, problem, sample, m_step)


def _fit_from_sample(
    initialisation: Initialisation, problem: LearningProblem, sample: Sample, m_step: MStep
) -> StepFit:
    """Fit the demonstrations of a sample only."""
    compute = partial(initialisation.initial_statistics, sample.data, problem.states, problem.rng)
    return _fit_restarts(compute, getattr(initialisation, "complete", False), problem, sample.data, m_step)


def _is_admissible(model: HiddenModel, data: Views, initialisation: Initialisation) -> bool:
    """Return whether demonstrations share the states, and those of k-means return to theirs.

    The views of all demonstrations together have the quaternion signs of the skill; those of one alone may
    not.
    """
    visits = np.zeros((len(data.lengths), model.means.shape[1]))
    for m, log_b in enumerate(np.split(log_emissions(model, data), np.cumsum(data.lengths)[:-1])):
        np.add.at(visits[m], state_segments(model.dynamics.viterbi(log_b))[0], 1.0)
    shared = float((2 * (visits > 0.0).sum(axis=0) > len(data.lengths)).mean())
    if isinstance(initialisation, KMeans):
        return shared == 1.0 and bool(visits.sum() >= MIN_RETURNS * (visits > 0.0).sum())
    return shared >= MIN_SHARED


def _fit_from(initialisation: Initialisation, problem: LearningProblem, m_step: MStep) -> StepFit:
    """Fit all demonstrations."""
    compute = partial(initial_statistics, initialisation, problem)
    return _fit_restarts(compute, getattr(initialisation, "complete", False), problem, problem.data, m_step)


def _fit_restarts(
    compute: Callable[[], Statistics],
    complete: bool,
    problem: LearningProblem,
    data: Views | Partitions[Views],
    m_step: MStep,
) -> StepFit:
    """Fit from every restart; a fit whose covariance collapses fails only if all do."""
    candidates = [compute() for _ in range(problem.settings.restarts)]
    e_step = partial(expected_statistics, threads=problem.settings.threads, complete=complete)
    results: list[tuple[HiddenModel, Convergence]] = []
    failures: list[NotPositiveDefinite] = []
    for statistics in candidates:
        try:
            model, _, convergence = fit_em(statistics, data, m_step, problem.settings, e_step)
            results.append((model, convergence))
        except NotPositiveDefinite as error:
            failures.append(error)
    if not results:
        raise failures[0]
    model, convergence = max(results, key=lambda result: result[1].log_likelihoods[-1])
    if failures:
        failed = f"{len(failures)} of {len(candidates)} restarts collapsed: {failures[0]}"
        convergence = replace(convergence, reason=f"{convergence.reason}; {failed}")
    return model, convergence, complete
