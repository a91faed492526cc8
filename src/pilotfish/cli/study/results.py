"""Finished runs of the study, grouped by condition and paired by number."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pilotfish.cli.study.folder import Run
from pilotfish.simulation import (
    NOISE_FREE,
    OPERATORS,
    Condition,
    ModeSummary,
    Ratio,
    StudyRun,
    paired_ratio,
)

DIRECT = "direct"


class Results:
    """Measures of finished runs by condition.

    Attributes:
        conditions: Conditions of the three operators, in their order.
        seed: Seed of the study, and of the resamples.
    """

    def __init__(self, runs: Sequence[StudyRun], finished: Mapping[str, Run], seed: int) -> None:
        self._measures: dict[tuple[Condition, bool], dict[int, Run]] = {}
        self._operators: dict[int, str] = {}
        self.seed = seed
        for run in runs:
            is_perfect = run.operator == NOISE_FREE
            self._measures.setdefault((run.condition, is_perfect), {})[run.number] = finished[run.key]
            if not is_perfect:
                self._operators[run.number] = run.operator
        self.conditions = tuple(condition for condition, is_perfect in self._measures if not is_perfect)

    def has(self, condition: Condition, *, noise_free: bool = False) -> bool:
        """Return whether a condition was studied."""
        return (condition, noise_free) in self._measures

    def runs(self, condition: Condition) -> list[Run]:
        """Return the measures of all runs of a condition."""
        return list(self._measures[condition, False].values())

    def successes(self, condition: Condition) -> int:
        """Return how many runs succeeded."""
        return sum(run["success"] for run in self.runs(condition))

    def successes_by_operator(self, condition: Condition) -> list[int]:
        """Return how many runs of each operator succeeded."""
        runs = self._measures[condition, False]
        return [
            sum(run["success"] for number, run in runs.items() if self._operators[number] == operator)
            for operator in OPERATORS
        ]

    def values(self, condition: Condition, measure: str, *, noise_free: bool = False) -> dict[int, float]:
        """Return a measure of the runs that succeeded, by number."""
        runs = self._measures.get((condition, noise_free), {})
        return {number: float(run[measure]) for number, run in runs.items() if run["success"]}

    def mean(self, condition: Condition, measure: str, *, only_successes: bool = True) -> float:
        """Return the mean of a measure; nan without runs or if the measure does not exist in the mode."""
        values = [run[measure] for run in self.runs(condition) if run["success"] or not only_successes]
        return float(np.mean(values)) if values and None not in values else float("nan")

    def ratio(self, condition: Condition, measure: str = "time") -> Ratio:
        """Return the ratio of a measure to direct control in the same condition."""
        direct = replace(condition, mode=DIRECT)
        return self._ratio(self.values(condition, measure), self.values(direct, measure))

    def noise_free_ratio(self, condition: Condition) -> Ratio:
        """Return the ratio of the times of the noise-free operator in a mode and in direct control."""
        values = self.values(condition, "time", noise_free=True)
        return self._ratio(values, self.values(replace(condition, mode=DIRECT), "time", noise_free=True))

    def floor_ratio(self, condition: Condition) -> Ratio:
        """Return the times of the noise-free operator relative to those of the others in direct control."""
        values = self.values(condition, "time", noise_free=True)
        return self._ratio(values, self.values(replace(condition, mode=DIRECT), "time"))

    def _ratio(self, values: Mapping[int, float], reference: Mapping[int, float]) -> Ratio:
        return paired_ratio(values, reference, np.random.default_rng(self.seed))

    def summary(self, condition: Condition) -> ModeSummary:
        """Return what decides which mode is preferred."""
        if not self.successes(condition):
            return ModeSummary(condition.mode, 0, float("inf"), float("inf"))
        time, effort = self.mean(condition, "time"), self.mean(condition, "effort")
        return ModeSummary(condition.mode, self.successes(condition), time, effort)

    def to_json(self) -> list[dict[str, Any]]:
        """Return the numbers of all conditions."""
        return [self._condition_to_json(condition) for condition in self.conditions]

    def _condition_to_json(self, condition: Condition) -> dict[str, Any]:
        ratio, summary = self.ratio(condition), self.summary(condition)
        return {
            "condition": condition.name,
            "mode": condition.mode,
            "runs": len(self.runs(condition)),
            "successes": summary.successes,
            "successes_by_operator": dict(zip(OPERATORS, self.successes_by_operator(condition), strict=True)),
            "time": finite_or_none(summary.time),
            "ratio": finite_or_none(ratio.value),
            "interval": [finite_or_none(ratio.low), finite_or_none(ratio.high)],
            "pairs": ratio.pairs,
            "verdict": ratio.verdict,
        }


def finite_or_none(value: float) -> float | None:
    """Return a number for JSON, which has no nan."""
    return value if np.isfinite(value) else None
