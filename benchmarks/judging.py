"""Whether what was measured keeps what is promised."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from cases import LIBRARIES, OURS, OWN, TARGETS
from kinds import BestAnswer, Case, MemoryLimit, MinRate, MinSpeedup, Requirement, TimeLimit
from measure import Result, SampleStatistics

Measured = tuple[str, bool]  # in words, nothing when it could not be told; and whether it is enough
CaseResults = Sequence[tuple[Case, list[Result]]]


@dataclass(frozen=True, slots=True)
class RequirementResult:
    requirement: str
    measured: str
    verdict: str  # pass, miss, or why it cannot be told


def incompatibility(results: Sequence[Result]) -> float:
    """How far apart the answers lie, relative to the largest; infinite, where one is not a finite number.

    Where models differ only the answers before the first iteration count: there they are the same.
    """
    done = [result for result in results if not result.failure]
    ends = [result.answer for result in done if not result.entry.differs]
    begins = [result.begin for result in done if result.entry.differs or not math.isnan(result.begin)]
    return max(_relative_difference(ends), _relative_difference(begins))


def _relative_difference(answers: Sequence[float]) -> float:
    if not all(map(math.isfinite, answers)):
        return math.inf
    scale = max((abs(answer) for answer in answers), default=0.0)
    return (max(answers) - min(answers)) / scale if scale else 0.0


def agrees(case: Case, results: Sequence[Result]) -> bool:
    """Whether the libraries computed the same thing."""
    return case.agreement is None or incompatibility(results) <= case.agreement


def own_result(results: Sequence[Result], label: str = "") -> Result | None:
    """Pilotfish's entry; the first, where it has several and no label is given."""
    own = (r for r in results if r.entry.library == OURS and r.cpu)
    return next((r for r in own if label in ("", r.entry.label)), None)


def peer_results(results: Sequence[Result], over: str | None = None) -> list[Result]:
    """What has figures and is of another library; over None: of any."""
    chosen = (r for r in results if r.cpu)
    return [r for r in chosen if (r.entry.library == over if over else r.entry.library not in OWN)]


def ratio(theirs: SampleStatistics, own: SampleStatistics) -> float:
    """How many times as long theirs took: the median over rounds, so that slow minutes cancel."""
    return median(a / b for a, b in zip(theirs.samples, own.samples, strict=True))


def evaluate_requirement(target: Requirement, case_results: CaseResults) -> RequirementResult:
    case, results = next(((c, r) for c, r in case_results if c.name == target.case), (None, []))
    own = own_result(results, target.entry if isinstance(target, TimeLimit) else "")
    requirement = describe_requirement(target)
    if case is None or own is None:
        return RequirementResult(requirement, "", "not measured")
    if not agrees(case, results):
        return RequirementResult(requirement, "", "not comparable: the answers differ")
    measured, kept = _measured(target, own, results)
    return RequirementResult(
        requirement, measured, "not measured" if not measured else "pass" if kept else "miss"
    )


def _measured(target: Requirement, own: Result, results: Sequence[Result]) -> Measured:
    match target:
        case TimeLimit():
            return _time_limit(target, own)
        case MinRate():
            return _min_rate(target, own)
        case MemoryLimit():
            return _memory_limit(target, own)
        case MinSpeedup():
            return _speedup(target, own, results)
        case BestAnswer():
            return _best_answer(own, results)


def _time_limit(target: TimeLimit, own: Result) -> Measured:
    if own.cpu is None:
        return "", False
    return f"{milliseconds(own.cpu.median)} ms", own.cpu.median <= target.milliseconds * 1e-3


def _min_rate(target: MinRate, own: Result) -> Measured:
    if own.cpu is None:
        return "", False
    return f"{per_second(own.cpu.median)} a second", own.cpu.median * target.datapoints_per_second <= 1.0


def _memory_limit(target: MemoryLimit, own: Result) -> Measured:
    if own.first is None:
        return "", False
    times = own.first.grown_mb / target.data_mb
    return f"{times:.2f} x", times <= target.times


def _speedup(target: MinSpeedup, own: Result, results: Sequence[Result]) -> Measured:
    """Against the fastest, whose label is told where it might have been any."""
    others = [
        (ratio(r.cpu, own.cpu), r.entry.label)
        for r in peer_results(results, target.over)
        if r.cpu and own.cpu
    ]
    if not others:
        return "", False
    lead, label = min(others)
    return f"{lead:.1f} x" + ("" if target.over else f" ({label})"), lead >= target.times


def _best_answer(own: Result, results: Sequence[Result]) -> Measured:
    """Against the best whose model is not another; an answer that is no number is none, theirs or ours."""
    alike = [r for r in peer_results(results) if not r.entry.differs]
    others = [(r.answer, r.entry.label) for r in alike if not math.isnan(r.answer)]
    if not others:
        return "", False
    best, label = max(others)
    return f"{own.answer:.3f} against {best:.3f} ({label})", own.answer > best


def describe_requirement(target: Requirement) -> str:
    match target:
        case TimeLimit():
            which = f" for {target.entry}" if target.entry else ""
            return f"`{target.case}`: at most {target.milliseconds:g} ms CPU{which}"
        case MinRate():
            return f"`{target.case}`: at least {target.datapoints_per_second:,.0f} datapoints a CPU second"
        case MemoryLimit():
            data = f"the data's {target.data_mb:g} MB"
            return f"`{target.case}`: at most {target.times:g} times {data} beyond the data themselves"
        case MinSpeedup():
            rival = f"{LIBRARIES[target.over].name} at its fastest" if target.over else "the fastest peer"
            return f"`{target.case}`: " + (
                f"at least {target.times:g} times less CPU than {rival}"
                if target.times != 1.0
                else f"less CPU than {rival}"
            )
        case BestAnswer():
            return f"`{target.case}`: a larger answer than that of every peer"


def requirement_results(case_results: CaseResults) -> list[RequirementResult]:
    """Of the cases that were taken."""
    names = {case.name for case, _ in case_results}
    return [evaluate_requirement(target, case_results) for target in TARGETS if target.case in names]


def milliseconds(seconds: float) -> str:
    """Three figures."""
    return _three_figures(seconds * 1e3)


def per_second(seconds: float) -> str:
    """How many there are in a second, when one takes so long; three figures."""
    return f"{float(f'{1.0 / seconds:.3g}'):,.0f}" if seconds > 0.0 else "?"


def _three_figures(value: float) -> str:
    if value <= 0.0 or not math.isfinite(value):
        return f"{value:g}"
    return f"{value:.{max(0, 2 - math.floor(math.log10(value)))}f}"
