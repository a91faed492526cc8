"""Whether what was measured keeps what is promised."""

@dataclass(frozen=True, slots=True)
class Verdict:
    promise: str
    measured: str
    verdict: str  # pass, miss, or why it cannot be told


def disagreement(results: Sequence[Result]) -> float:
    """How far apart the answers lie, relative to the largest; infinite, where one is not a finite number.

    Where models differ only the answers before the first iteration count: there they are the same.
    """
    done = [result for result in results if not result.failure]
    ends = [result.answer for result in done if not result.entry.differs]
    begins = [result.begin for result in done if result.entry.differs or not math.isnan(result.begin)]
    return max(_apart(ends), _apart(begins))


def _apart(answers: Sequence[float]) -> float:
    if not all(map(math.isfinite, answers)):
        return math.inf
    scale = max((abs(answer) for answer in answers), default=0.0)
    return (max(answers) - min(answers)) / scale if scale else 0.0


def agrees(case: Case, results: Sequence[Result]) -> bool:
    """Whether the libraries computed the same thing."""
    return case.agreement is None or disagreement(results) <= case.agreement


def ours(results: Sequence[Result]) -> Result | None:
    """pilotfish's entry; the first, where it has several."""
    return next((r for r in results if r.entry.library == OURS and r.cpu), None)


def ratio(theirs: Spread, own: Spread) -> float:
    """How many times as long theirs took: the median over rounds, so that slow minutes cancel."""
    return median(a / b for a, b in zip(theirs.samples, own.samples, strict=True))


def judge(target: Ceiling | Lead | Room, cases: Sequence[tuple[Case, list[Result]]]) -> Verdict:
    case, results = next(((c, r) for c, r in cases if c.name == target.case), (None, []))
    own = ours(results)
    promise = promised(target)
    if case is None or own is None:
        return Verdict(promise, "", "not measured")
    if not agrees(case, results):
        return Verdict(promise, "", "not comparable: the answers differ")
    match target:
        case Ceiling():
            measured, kept = _ceiling(target, own)
        case Room():
            measured, kept = _room(target, own)
        case Lead():
            measured, kept = _lead(target, own, results)
    return Verdict(promise, measured, "not measured" if not measured else "pass" if kept else "miss")


def _ceiling(target: Ceiling, own: Result) -> tuple[str, bool]:
    if own.cpu is None:
        return "", False
    return f"{milliseconds(own.cpu.median)} ms", own.cpu.median <= target.milliseconds * 1e-3


def _room(target: Room, own: Result) -> tuple[str, bool]:
    if own.first is None:
        return "", False
    times = own.first.grown_mb / target.data_mb
    return f"{times:.2f} x", times <= target.times


def _lead(target: Lead, own: Result, results: Sequence[Result]) -> tuple[str, bool]:
    """Against the fastest, whose label is told where it might have been any."""
    others = [
        (ratio(r.cpu, own.cpu), r.entry.label)
        for r in results
        if r.cpu
        and own.cpu
        and (r.entry.library == target.over if target.over else r.entry.library not in OWN)
    ]
    if not others:
        return "", False
    lead, label = min(others)
    return f"{lead:.1f} x" + ("" if target.over else f" ({label})"), lead >= target.times


def promised(target: Ceiling | Lead | Room) -> str:
    match target:
        case Ceiling():
            return f"`{target.case}`: at most {target.milliseconds:g} ms CPU"
        case Room():
            data = f"the data's {target.data_mb:g} MB"
            return f"`{target.case}`: at most {target.times:g} times {data} beyond the data themselves"
        case Lead():
            rival = f"{LIBRARIES[target.over].name} at its fastest" if target.over else "the fastest peer"
            return f"`{target.case}`: at least {target.times:g} times less CPU than {rival}"


def verdicts(report: Report) -> list[Verdict]:
    return [judge(target, report.cases) for target in TARGETS]
