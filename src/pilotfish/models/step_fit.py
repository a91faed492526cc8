"""Fit of a mixture or a Markov skill by EM, from one initialisation or from the better of two.

EM finds a local maximum, so `learn` begins at two models by default. Equal time bins suit a movement that
goes once from left to right. K-means suits a movement that returns to its states, such as a periodic one; the
fit is taken only then, and only if its BIC is lower. Of other movements it may leave out parts, or describe
single demonstrations.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.demonstrations import Demonstration, Views
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.models.degrees_of_freedom import bic, degrees_of_freedom
from pilotfish.models.em import Convergence, EStep, MStep, expected_statistics, fit_em
from pilotfish.models.initialisation import Initialisation, KMeans, TimeBins
from pilotfish.models.learning_problem import Fit, LearningProblem
from pilotfish.models.sequences import state_segments, viterbi
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.models.statistics import Statistics

MIN_RETURNS = 1.5  # visits of a state in a demonstration, on average, of a movement that returns


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
    if initialisation is None:
        return _fit_likelier(problem, m_step)
    candidates = [
        initialisation.initial_statistics(problem.data, problem.states, problem.rng)
        for _ in range(problem.settings.restarts)
    ]
    complete = getattr(initialisation, "complete", False)
    return _fit_restarts(candidates, problem, m_step, complete), complete


def _fit_likelier(problem: LearningProblem, m_step: MStep) -> tuple[Fit, bool]:
    """Fit from time bins and from k-means, and return the fit of lower BIC."""
    once, _ = fit_steps(problem, TimeBins(complete=problem.has_time_order), m_step)
    try:
        clusters, _ = fit_steps(problem, KMeans(), m_step)
    except (InvalidInput, NotPositiveDefinite):  # fewer distinct points than states, or a state of one point
        return once, problem.has_time_order
    if not _returns_to_states(clusters.skill, problem.demonstrations):
        return once, problem.has_time_order

    def criterion(fit: Fit) -> float:
        parameters = degrees_of_freedom(fit.skill, problem.structure, None)
        return bic(float(fit.log_likelihoods[-1]), parameters, fit.skill.provenance.datapoints)

    best = min(once, clusters, key=criterion)
    return best, problem.has_time_order and best is once


def _returns_to_states(skill: Skill, demonstrations: Sequence[Demonstration]) -> bool:
    """Return whether demonstrations return to states that they have left, and most visit each state."""
    visits = np.zeros((len(demonstrations), skill.states))
    for m, demo in enumerate(demonstrations):
        np.add.at(visits[m], state_segments(viterbi(skill, demo))[0], 1.0)
    shared = (2 * (visits > 0.0).sum(axis=0) >= len(demonstrations)).all()
    return bool(shared and visits.sum() >= MIN_RETURNS * (visits > 0.0).sum())


def _make_e_step(problem: LearningProblem, *, complete: bool) -> EStep:
    threads = problem.settings.threads

    def e_step(model: HiddenModel, data: Views, previous: Statistics) -> Statistics:
        return expected_statistics(model, data, previous, threads=threads, complete=complete)

    return e_step


def _fit_restarts(
    candidates: Sequence[Statistics], problem: LearningProblem, m_step: MStep, complete: bool
) -> Fit:
    """Fit from every initialisation; a fit whose covariance collapses fails only if all do."""
    results: list[tuple[HiddenModel, Convergence]] = []
    failures: list[NotPositiveDefinite] = []
    e_step = _make_e_step(problem, complete=complete)
    for initial_statistics in candidates:
        try:
            model, _, convergence = fit_em(initial_statistics, problem.data, m_step, problem.settings, e_step)
            results.append((model, convergence))
        except NotPositiveDefinite as error:
            failures.append(error)
    if not results:
        raise failures[0]
    model, convergence = max(results, key=lambda result: result[1].log_likelihoods[-1])
    if failures:
        failed = f"{len(failures)} of {len(candidates)} restarts collapsed: {failures[0]}"
        convergence = replace(convergence, reason=f"{convergence.reason}; {failed}")
    skill = problem.skill(model, convergence)
    return Fit(skill, skill, convergence)
