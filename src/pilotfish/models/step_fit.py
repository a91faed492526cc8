"""Fit of a mixture or a Markov skill by EM, from one initialisation or from the best of several.

EM finds a local maximum, so `learn` begins at several models by default and keeps the fit of lowest BIC:

    time bins  suit a movement that goes once from left to right, in one rhythm.
    templates  are single demonstrations. They suit movements of which some have a part that others lack, such
               as a second attempt: time bins would average unlike parts.
    k-means    suits a movement that returns to its states, such as a periodic one.

The likelihood alone prefers states that describe single demonstrations. A template is therefore taken only if
nearly all of its states are visited by more than half of the demonstrations, and k-means only if all are and
the movement returns to its states; otherwise it may leave out parts.

EM stops early, when an iteration gains less than half a nat per datapoint. Later iterations move states to
what few demonstrations have in common by chance: held-out letters and household tasks are reproduced no
better, and recordings of another period get other states. On Meta-World EM to convergence is better by 3 %
(docs/benchmarks-metaworld.md); `EMSettings(min_gain=0.001)` asks for it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.demonstrations import Views
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.models.degrees_of_freedom import bic, degrees_of_freedom
from pilotfish.models.em import Convergence, EStep, MStep, expected_statistics, fit_em
from pilotfish.models.initialisation import Initialisation, KMeans, Template, TimeBins
from pilotfish.models.learning_problem import Fit, LearningProblem
from pilotfish.models.sequences import log_emissions, state_segments
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.models.statistics import Statistics

EARLY_GAIN = 0.5  # nats per datapoint
MIN_FOR_TEMPLATES, MAX_TEMPLATES = 3, 5  # demonstrations
MIN_SHARED = 0.95  # of the states of a template are visited by more than half of the demonstrations
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
    """Fit from several initialisations, and return the admissible fit of lowest BIC."""
    if problem.settings.min_gain is None:
        problem = replace(problem, settings=replace(problem.settings, min_gain=EARLY_GAIN))
    bins = TimeBins(complete=problem.has_time_order)
    results = [fit_steps(problem, bins, m_step)]
    others: list[Initialisation] = [KMeans()]
    if problem.has_time_order and len(problem.demonstrations) >= MIN_FOR_TEMPLATES:
        count = min(len(problem.demonstrations), MAX_TEMPLATES)
        chosen = np.linspace(0, len(problem.demonstrations) - 1, count).round().astype(int).tolist()
        others += [Template(m) for m in chosen]
    for initialisation in others:
        try:
            fit, complete = fit_steps(problem, initialisation, m_step)
        except (InvalidInput, NotPositiveDefinite):
            continue  # too few distinct points, or a state collapses
        if _is_admissible(fit.skill, problem.data, initialisation):
            results.append((fit, complete))

    def criterion(result: tuple[Fit, bool]) -> float:
        fit, _ = result
        parameters = degrees_of_freedom(fit.skill, problem.structure, None)
        return bic(float(fit.log_likelihoods[-1]), parameters, fit.skill.provenance.datapoints)

    return min(results, key=criterion)


def _is_admissible(skill: Skill, data: Views, initialisation: Initialisation) -> bool:
    """Return whether demonstrations share the states, and those of k-means return to theirs.

    The views of all demonstrations together have the quaternion signs of the skill; those of one alone may
    not.
    """
    visits = np.zeros((len(data.lengths), skill.states))
    for m, log_b in enumerate(np.split(log_emissions(skill, data), np.cumsum(data.lengths)[:-1])):
        np.add.at(visits[m], state_segments(skill.dynamics.viterbi(log_b))[0], 1.0)
    shared = float((2 * (visits > 0.0).sum(axis=0) > len(data.lengths)).mean())
    if isinstance(initialisation, KMeans):
        return shared == 1.0 and bool(visits.sum() >= MIN_RETURNS * (visits > 0.0).sum())
    return shared >= MIN_SHARED


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
