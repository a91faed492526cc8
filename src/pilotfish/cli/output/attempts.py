"""Summary of executions of a skill: successes, spread over seeds, and what went wrong in which phase."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from pilotfish.cli.output.results import CommandResult
from pilotfish.cli.output.tables import Table, key_value_table
from pilotfish.validation import shorten_repr

if TYPE_CHECKING:
    from pilotfish.environments import Failure, Task
    from pilotfish.simulation import ExecutionResult, TeleoperationResult

# What to try if most failures are in a phase, by the name of the phase. On the plate task from four
# demonstrations (seed 0, control cost 0.1), nine states with diagonal covariances succeeded in 20 of 20
# situations, seven with full covariances in 2 of the first 4; tighter tracking did not change that.
RELEARN = "learn again with more --states and with diagonal covariances, as the defaults do"
TIGHTER = "track more closely, with a smaller --control-cost and --covariance-regularisation"
MORE_DEMONSTRATIONS = "record more demonstrations, in situations like those that fail"
ADVICE = {
    "approach": f"{TIGHTER}; or {RELEARN}",
    "grasp": f"{RELEARN}; or {MORE_DEMONSTRATIONS}",
    "motion": f"{RELEARN}; or give a longer --horizon, for a slower motion",
    "goal": f"{RELEARN}; or {TIGHTER}",
    "release": f"{RELEARN}; or {MORE_DEMONSTRATIONS}",
    "contact": f"{MORE_DEMONSTRATIONS}; or {TIGHTER}",
    "other": f"{RELEARN}; or {TIGHTER}",
}


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Attempt:
    """Execution in one situation.

    Attributes:
        seed: Seed of the situations.
        situation: Number of the situation.
        execution: What happened, of a skill alone or with an operator.
    """

    seed: int
    situation: int
    execution: "ExecutionResult | TeleoperationResult"


def name_situation(attempt: Attempt, seeds: int) -> str:
    """Return the number of a situation, with its seed if there are several seeds."""
    return (
        f"seed {attempt.seed}, situation {attempt.situation}"
        if seeds > 1
        else f"situation {attempt.situation}"
    )


def format_attempt(attempt: Attempt, unit: str) -> str:
    """Return the result of an attempt in one line."""
    execution = attempt.execution
    result = "success" if execution.failure is None else f"failure, {_explain(execution.failure)}"
    error, force = execution.outcome.error, execution.peak_forces["tool"]
    return f"{result}; error {error:.2g} {unit}, peak force {force:.0f} N, {execution.duration:.1f} s"


def summarise_attempts(attempts: Sequence[Attempt], task: "Task[Any]", film: Path | None) -> CommandResult:
    """Return the output of the command: successes, errors, and the failures by what went wrong.

    Args:
        attempts: One or more attempts.
        task: Task that was performed.
        film: File of the film; None if there is none.
    """
    executions = [attempt.execution for attempt in attempts]
    by_seed = _successes_by_seed(attempts)
    n_each, succeeded = len(attempts) // len(by_seed), sum(by_seed.values())
    errors = [execution.outcome.error for execution in executions]
    rows = [
        ("result", f"{succeeded} of {len(attempts)} succeeded"),
        *_spread_rows(by_seed, n_each),
        ("error, median", f"{median(errors):.2g} {task.unit}"),
        ("error, maximum", f"{max(errors):.2g} {task.unit}"),
        ("peak force, median", f"{median(e.peak_forces['tool'] for e in executions):.1f} N"),
        ("duration, median", f"{median(e.duration for e in executions):.1f} s"),
    ]
    data = {
        "succeeded": succeeded,
        "succeeded_by_seed": {str(seed): count for seed, count in by_seed.items()},
        "situations": [_attempt_to_json(attempt) for attempt in attempts],
        "failures": [
            {"phase": phase, "summary": summary, "count": count}
            for (phase, summary), count in _count_failures(attempts)
        ],
        "advice": _advise(attempts),
        "film": str(film) if film else None,
        "unit": task.unit,
    }
    return CommandResult([key_value_table(rows), *_failure_blocks(attempts, len(by_seed))], data)


def _successes_by_seed(attempts: Sequence[Attempt]) -> dict[int, int]:
    counts = dict.fromkeys((attempt.seed for attempt in attempts), 0)
    for attempt in attempts:
        counts[attempt.seed] += attempt.execution.outcome.success
    return counts


def _spread_rows(by_seed: dict[int, int], n_each: int) -> list[tuple[str, str]]:
    if len(by_seed) == 1:
        return []
    counts = list(by_seed.values())
    return [
        ("each seed", f"{', '.join(map(str, counts))} of {n_each} succeeded"),
        ("over seeds", f"{min(counts)} to {max(counts)}, median {median(counts):g} of {n_each}"),
    ]


def _failures(attempts: Sequence[Attempt]) -> list[tuple[Attempt, "Failure"]]:
    return [(attempt, failure) for attempt in attempts if (failure := attempt.execution.failure)]


def _count_failures(attempts: Sequence[Attempt]) -> list[tuple[tuple[str, str], int]]:
    """Return phase, summary and number of failures, the most frequent first."""
    return Counter((failure.phase.value, failure.summary) for _, failure in _failures(attempts)).most_common()


def _advise(attempts: Sequence[Attempt]) -> str | None:
    """Return what to try against the most frequent failure; None if all succeeded."""
    counts = _count_failures(attempts)
    return ADVICE[counts[0][0][0]] if counts else None


def _failure_blocks(attempts: Sequence[Attempt], seeds: int) -> list[str | Table]:
    if not (counts := _count_failures(attempts)):
        return []
    rows = tuple((str(count), summary, phase) for (phase, summary), count in counts)
    lines = [
        f"{name_situation(attempt, seeds)}: {_explain(failure)}" for attempt, failure in _failures(attempts)
    ]
    return [
        Table(("failures", "what went wrong", "phase"), rows),
        "\n".join(lines),
        f"try: {_advise(attempts)}",
    ]


def _explain(failure: "Failure") -> str:
    return failure.detail if failure.phase == "other" else f"{failure.summary}: {failure.detail}"


def _attempt_to_json(attempt: Attempt) -> dict[str, object]:
    execution = attempt.execution
    outcome, failure = execution.outcome, execution.failure
    return {
        "seed": attempt.seed,
        "situation": attempt.situation,
        "success": outcome.success,
        "error": outcome.error,
        "reason": outcome.reason,
        "failure": {"phase": failure.phase.value, "summary": failure.summary, "detail": failure.detail}
        if failure
        else None,
        "peak_forces": execution.peak_forces,
        "seconds": execution.duration,
    }
