"""Model selection by success: compare candidates by what they achieve in physics."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.environments import Task
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.models import Candidate, EMSettings, Skill, default_states, require_selection
from pilotfish.planning import DEFAULT_CANDIDATE, ReproductionScore, ReproductionSelection
from pilotfish.simulation.execution import perform
from pilotfish.simulation.recording import situation_from_seed
from pilotfish.types import Array, Float
from pilotfish.validation import require_count

DEFAULT_SETTINGS = EMSettings()
MAX_SITUATIONS = 10_000


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    """A candidate in one situation."""

    skill: Skill | str
    task: Task[Any]
    seed: int
    number: int


def select_by_success(
    demonstrations: Sequence[Demonstration],
    candidates: Sequence[Candidate],
    task: Task[Any],
    *,
    situations: int = 10,
    seed: int = 0,
    settings: EMSettings = DEFAULT_SETTINGS,
    executor: Executor | None = None,
    callback: Callable[[Candidate], None] | None = None,
) -> ReproductionSelection:
    """Score candidates, and the default of `learn`, by failures in situations of a task.

    Every candidate is learned once, from all demonstrations, and performed in the same situations, which are
    neither those of `record_demonstrations` nor those of `pilotfish perform`. The choice is that of
    `select_by_reproduction`. Candidates that weight frames or change the control cost are not performed.

    Args:
        demonstrations: At least two recordings of the task, with derivatives.
        candidates: Models to compare; the default is added.
        task: Task from `TASKS`.
        situations: Number of situations.
        seed: Seed of the situations and of learning.
        settings: Settings of expectation-maximisation.
        executor: Runs the trials, such as a `concurrent.futures.ProcessPoolExecutor`; None runs them here.
        callback: Called with the candidate after every trial.

    Returns:
        Scores, 1 for each failure and 0 for each success, and candidates that failed to be performed.

    Raises:
        InvalidInput: If there are fewer than two demonstrations, no candidates or no situations.
    """
    require_selection(demonstrations, candidates)
    require_count(situations, "situations", MAX_SITUATIONS, 1)
    every_candidate = (DEFAULT_CANDIDATE, *(c for c in candidates if c != DEFAULT_CANDIDATE))
    skills = [_learn(candidate, demonstrations, seed, settings) for candidate in every_candidate]
    trials = [_Trial(skill, task, seed, n) for skill in skills for n in range(situations)]
    results = []
    for n, result in enumerate((executor.map if executor else map)(_perform, trials)):
        results.append(result)
        if callback:
            callback(every_candidate[n // situations])
    scores, failures = [], []
    for i, candidate in enumerate(every_candidate):
        own = results[i * situations : (i + 1) * situations]
        if reasons := [result for result in own if isinstance(result, str)]:
            failures.append((candidate, reasons[0]))
            continue
        rows = np.stack([result for result in own if not isinstance(result, str)])
        measures = {"failures": rows[:, 0], f"error [{task.unit}]": rows[:, 1]}
        states = candidate.states or default_states(demonstrations)
        scores.append(ReproductionScore(candidate, states, rows[:, 0], measures))
    executions = len(scores) * situations
    return ReproductionSelection(tuple(scores), tuple(failures), len(every_candidate), executions)


def _learn(
    candidate: Candidate, demonstrations: Sequence[Demonstration], seed: int, settings: EMSettings
) -> Skill | str:
    """Return the skill of a candidate, or why there is none."""
    if candidate.frames != "equal" or candidate.control_cost_factor != 1.0:
        return "physics is performed with equal frames and the default control cost"
    try:
        rng = np.random.default_rng(seed)
        return candidate.learn(demonstrations, rng=rng, settings=settings).skill
    except SkillError as error:
        return str(error)


def _perform(trial: _Trial) -> Float[Array, " 2"] | str:
    """Return whether a trial failed, and its error; or why it was impossible."""
    if isinstance(trial.skill, str):
        return trial.skill
    situation = situation_from_seed(trial.task, "selection", trial.seed, trial.number)
    try:
        outcome = perform(trial.skill, trial.task, situation).outcome
    except InvalidInput as error:
        return str(error)
    return np.array([float(not outcome.success), outcome.error])
