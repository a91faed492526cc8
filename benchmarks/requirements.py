"""Requirements on pilotfish's results; each describes itself and evaluates the results of its case."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Protocol

from measure import Result, SampleStatistics
from peer_libraries import LIBRARIES, OWN

Evaluation = tuple[str, bool] | None  # measured value in words, and whether it suffices; None if not measured


class Requirement(Protocol):
    """Requirement on the results of one case."""

    @property
    def case(self) -> str:
        """Return the name of the case."""

    @property
    def entry(self) -> str:
        """Return the label of pilotfish's entry; empty for its first one."""

    def describe(self) -> str:
        """Return the requirement in words."""

    def evaluate(self, own: Result, results: Sequence[Result]) -> Evaluation:
        """Compare pilotfish's result with the limit or with the other results."""


@dataclass(frozen=True, slots=True)
class TimeLimit:
    """A call of pilotfish takes at most some CPU time."""

    case: str
    milliseconds: float
    entry: str = ""

    def describe(self) -> str:
        """Return the requirement in words."""
        entry = f" for {self.entry}" if self.entry else ""
        return f"`{self.case}`: at most {self.milliseconds:g} ms CPU{entry}"

    def evaluate(self, own: Result, results: Sequence[Result]) -> Evaluation:
        """Compare the median with the limit."""
        del results
        if own.cpu is None:
            return None
        return f"{format_milliseconds(own.cpu.median)} ms", own.cpu.median <= self.milliseconds * 1e-3


@dataclass(frozen=True, slots=True)
class MinRate:
    """Pilotfish learns at least some datapoints per second of CPU."""

    case: str
    datapoints_per_second: float
    entry: str = ""

    def describe(self) -> str:
        """Return the requirement in words."""
        return f"`{self.case}`: at least {self.datapoints_per_second:,.0f} datapoints per CPU second"

    def evaluate(self, own: Result, results: Sequence[Result]) -> Evaluation:
        """Compare the median with the limit."""
        del results
        if own.cpu is None:
            return None
        return (
            f"{format_rate(own.cpu.median)} per second",
            own.cpu.median * self.datapoints_per_second <= 1.0,
        )


@dataclass(frozen=True, slots=True)
class MemoryLimit:
    """Pilotfish needs at most a multiple of the memory of the data, beyond the data itself."""

    case: str
    data_mb: float
    times: float
    entry: str = ""

    def describe(self) -> str:
        """Return the requirement in words."""
        data = f"the data's {self.data_mb:g} MB"
        return f"`{self.case}`: at most {self.times:g} times {data} beyond the data itself"

    def evaluate(self, own: Result, results: Sequence[Result]) -> Evaluation:
        """Compare the memory that the first call added with the limit."""
        del results
        if own.first is None:
            return None
        times = own.first.grown_mb / self.data_mb
        return f"{times:.2f} x", times <= self.times


@dataclass(frozen=True, slots=True)
class MinSpeedup:
    """Every entry of another library takes at least a multiple of pilotfish's CPU time."""

    case: str
    times: float
    over: str | None = None  # library; None for all
    entry: str = ""

    def describe(self) -> str:
        """Return the requirement in words."""
        rival = f"{LIBRARIES[self.over].name} at its fastest" if self.over else "the fastest peer"
        share = f"at least {self.times:g} times less CPU" if self.times != 1.0 else "less CPU"
        return f"`{self.case}`: {share} than {rival}"

    def evaluate(self, own: Result, results: Sequence[Result]) -> Evaluation:
        """Compare with the fastest entry, which is named if any library counts."""
        ratios = [
            (ratio(r.cpu, own.cpu), r.entry.label)
            for r in peer_results(results, self.over)
            if r.cpu and own.cpu
        ]
        if not ratios:
            return None
        lead, label = min(ratios)
        return f"{lead:.1f} x" + ("" if self.over else f" ({label})"), lead >= self.times


@dataclass(frozen=True, slots=True)
class BestAnswer:
    """Pilotfish has a larger answer than every entry of another library with the same model."""

    case: str
    entry: str = ""

    def describe(self) -> str:
        """Return the requirement in words."""
        return f"`{self.case}`: a larger answer than every peer"

    def evaluate(self, own: Result, results: Sequence[Result]) -> Evaluation:
        """Compare with the largest answer that is a number."""
        same_model = [r for r in peer_results(results) if not r.entry.differs]
        answers = [(r.answer, r.entry.label) for r in same_model if not math.isnan(r.answer)]
        if not answers:
            return None
        best, label = max(answers)
        return f"{own.answer:.3f} against {best:.3f} ({label})", own.answer > best


def peer_results(results: Sequence[Result], library: str | None = None) -> list[Result]:
    """Return the measured results of one other library, or of all."""
    measured = (r for r in results if r.cpu)
    return [r for r in measured if (r.entry.library == library if library else r.entry.library not in OWN)]


def ratio(peer: SampleStatistics, own: SampleStatistics) -> float:
    """Return the median over rounds of peer over own time, in which slow periods of the machine cancel."""
    return median(a / b for a, b in zip(peer.samples, own.samples, strict=True))


def format_milliseconds(seconds: float) -> str:
    """Format a time in milliseconds with three significant figures."""
    value = seconds * 1e3
    if value <= 0.0 or not math.isfinite(value):
        return f"{value:g}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(value)))}f}"


def format_rate(seconds: float) -> str:
    """Format the rate of events that take some seconds each, with three significant figures."""
    return f"{float(f'{1.0 / seconds:.3g}'):,.0f}" if seconds > 0.0 else "?"
