"""Agreement of the libraries' answers, and evaluation of the requirements."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from cases import REQUIREMENTS
from kinds import Case
from measure import Result
from peer_libraries import OURS
from requirements import Requirement

CaseResults = Sequence[tuple[Case, list[Result]]]


@dataclass(frozen=True, slots=True)
class RequirementResult:
    """Requirement in words, measured value in words, and pass, miss or why it was not evaluated."""

    requirement: str
    measured: str
    verdict: str


def disagreement(results: Sequence[Result]) -> float:
    """Return the largest relative difference of the answers; infinite if one is not finite.

    Where models differ, only the answers before the first iteration count: there the models are the same.
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
    """Return whether the libraries computed the same answer."""
    return case.agreement is None or disagreement(results) <= case.agreement


def own_result(results: Sequence[Result], label: str = "") -> Result | None:
    """Return pilotfish's measured entry with a label, or its first one."""
    own = (r for r in results if r.entry.library == OURS and r.cpu)
    return next((r for r in own if label in ("", r.entry.label)), None)


def evaluate_requirement(requirement: Requirement, case_results: CaseResults) -> RequirementResult:
    """Evaluate a requirement if its case was measured and the answers agree."""
    case, results = next(((c, r) for c, r in case_results if c.name == requirement.case), (None, []))
    own = own_result(results, requirement.entry)
    words = requirement.describe()
    if case is None or own is None:
        return RequirementResult(words, "", "not measured")
    if not agrees(case, results):
        return RequirementResult(words, "", "not comparable: the answers differ")
    evaluation = requirement.evaluate(own, results)
    if evaluation is None:
        return RequirementResult(words, "", "not measured")
    return RequirementResult(words, evaluation[0], "pass" if evaluation[1] else "miss")


def requirement_results(case_results: CaseResults) -> list[RequirementResult]:
    """Evaluate the requirements of the measured cases."""
    names = {case.name for case, _ in case_results}
    return [evaluate_requirement(r, case_results) for r in REQUIREMENTS if r.case in names]
