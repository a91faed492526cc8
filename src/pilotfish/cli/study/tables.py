"""Tables of the study."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import degrees, isnan

import numpy as np

from pilotfish.cli.output.tables import Table
from pilotfish.cli.study.results import DIRECT, Results
from pilotfish.environments import TASKS
from pilotfish.simulation import Condition, ModeSummary, Ratio, preferred_mode

MODES = ("direct", "shared", "autonomous", "fixture")
ASSISTED = MODES[1:]
PRINTED = {  # table 6.2 of the thesis, s
    "valve": dict(zip(MODES, (18.2, 13.6, 12.3, 13.1), strict=True)),
    "stab": dict(zip(MODES, (7.2, 4.3, 5.1, 5.6), strict=True)),
}
PRINTED_NAMES = {"valve": "valve", "stab": "target"}
LIMITS = {("valve", "shared"): 0.75, ("valve", "autonomous"): 0.68} | {
    ("stab", "shared"): 0.6,
    ("stab", "autonomous"): 0.71,
}  # of the time ratio at 1 s: those of table 6.2
MAX_HARM, MAX_LOSS = 1.1, 0.05  # ratio of times, and share of success, in the two arms
CM, KB = 100.0, 1e-3
NONE = "-"
MEASURES: dict[str, tuple[str, Callable[[float], str]]] = {
    "path_ratio": ("path ratio", lambda v: f"{v:.2f}"),
    "submovements": ("open-loop moves", lambda v: f"{v:.1f}"),
    "effort": ("effort [m]", lambda v: f"{v:.2f}"),
    "disagreement": ("disagreement [cm]", lambda v: f"{CM * v:.1f}"),
    "bytes_forward": ("forward [kB]", lambda v: f"{KB * v:.0f}"),
    "bytes_backward": ("backward [kB]", lambda v: f"{KB * v:.0f}"),
    "alignments": ("alignments", lambda v: f"{v:.1f}"),
    "stale": ("stale", lambda v: f"{v:.1f}"),
    "limit_events": ("limited", lambda v: f"{v:.1f}"),
}
RATIO_MEASURES = ("path", "submovements", "effort")


def study_tables(results: Results) -> list[Table]:
    """Return all tables, without those that have no rows.

    Args:
        results: Finished runs.
    """
    tables = (
        thesis_table(results),
        requirement_table(results),
        success_table(results),
        time_table(results),
        ratio_table(results),
        arm_table(results),
        floor_table(results),
        measure_table(results),
        measure_ratio_table(results),
    )
    return [table for table in tables if table.rows]


def cases(results: Results, *, arms: bool = False) -> Iterator[Condition]:
    """Yield the direct condition of each row of a table.

    Args:
        results: Finished runs.
        arms: Whether to yield the two arms instead of the standard conditions.
    """
    for condition in results.conditions:
        if condition.mode == DIRECT and (condition.arm != "standard") == arms:
            yield condition


def success_table(results: Results) -> Table:
    """Return the number of successes in each mode, and by operator."""
    rows = []
    for case in (*cases(results), *cases(results, arms=True)):
        cells = [_success_cell(results, replace(case, mode=mode)) for mode in MODES]
        rows.append((case.name, *cells))
    caption = "Success, and by operator: ordinary, careful, hasty"
    return Table(("condition", *MODES), tuple(rows), caption, right_aligned=True)


def _success_cell(results: Results, condition: Condition) -> str:
    if not results.has(condition):
        return NONE
    by_operator = " ".join(map(str, results.successes_by_operator(condition)))
    return f"{results.successes(condition)}/{len(results.runs(condition))} ({by_operator})"


def time_table(results: Results) -> Table:
    """Return mean and standard deviation of the times of successful runs."""
    rows = []
    for case in (*cases(results), *cases(results, arms=True)):
        rows.append((case.name, *(_time_cell(results, replace(case, mode=mode)) for mode in MODES)))
    caption = "Time of successful runs [s]: mean and standard deviation"
    return Table(("condition", *MODES), tuple(rows), caption, right_aligned=True)


def _time_cell(results: Results, condition: Condition) -> str:
    values = list(results.values(condition, "time").values())
    return f"{np.mean(values):.1f} ± {np.std(values):.1f}" if values else NONE


def ratio_table(results: Results) -> Table:
    """Return the ratios of times to direct control."""
    rows = []
    for case in cases(results):
        ratios = [results.ratio(replace(case, mode=mode)) for mode in ASSISTED]
        rows.append((case.name, *map(ratio_cell, ratios)))
    caption = "Time relative to direct control [95 % interval], pairs in which both succeeded"
    return Table(("condition", *ASSISTED), tuple(rows), caption, right_aligned=True)


def ratio_cell(ratio: Ratio) -> str:
    """Return a ratio with its interval, number of pairs, and "no gain" where 1 lies inside."""
    if isnan(ratio.value):
        return "no pairs"
    if isnan(ratio.low):
        return f"{ratio.value:.2f} n={ratio.pairs}"
    verdict = {"no gain": ", no gain", "higher": ", slower"}.get(ratio.verdict, "")
    return f"{ratio.value:.2f} [{ratio.low:.2f} {ratio.high:.2f}] n={ratio.pairs}{verdict}"


def thesis_table(results: Results) -> Table:
    """Return table 6.2: times at a round trip of 1 s beside the printed ones, and the preferred mode."""
    rows = []
    for task, printed in PRINTED.items():
        for view_off in (False, True):
            case = Condition(task, DIRECT, view_off=view_off)
            if results.has(case):
                modes = [results.summary(replace(case, mode=mode)) for mode in MODES]
                rows.append((case.name, *map(_summary_cell, modes), preferred_mode(modes)))
        cells = [f"{printed[mode]:.1f}" for mode in MODES]
        preferred = {"valve": "autonomous", "stab": "shared"}[task]
        rows.append((f"{PRINTED_NAMES[task]}, printed", *cells, preferred))
    caption = "Table 6.2: mean time [s] (successes), preferred by success, then time, then effort"
    return Table(("condition", *MODES, "preferred"), tuple(rows), caption, right_aligned=True)


def _summary_cell(mode: ModeSummary) -> str:
    return f"{mode.time:.1f} ({mode.successes})" if mode.successes else "- (0)"


def requirement_table(results: Results) -> Table:
    """Return what is required of the study at a round trip of 1 s, and whether it is reached."""
    rows = []
    for (task, mode), limit in LIMITS.items():
        condition = Condition(task, mode)
        if results.has(condition):
            ratio = results.ratio(condition)
            rows.append(
                (f"{task}, {mode}: time ratio", f"<= {limit}", ratio_cell(ratio), ratio.value <= limit)
            )
    for task in PRINTED:
        condition = Condition(task, "shared", view_off=True)
        if results.has(condition):
            done, total = results.successes(condition), len(results.runs(condition))
            needed = total - total // 15
            rows.append((f"{task}, shared, view off: success", f">= {needed}", str(done), done >= needed))
    for case in cases(results, arms=True):
        shared = replace(case, mode="shared")
        ratio, change = results.ratio(shared), _success_change(results, shared)
        rows.append(
            (f"{case.name}: upper bound", f"<= {MAX_HARM}", ratio_cell(ratio), ratio.high <= MAX_HARM)
        )
        points = f"{100 * change:+.0f} points"
        rows.append((f"{case.name}: success", ">= -5 points", points, change >= -MAX_LOSS - 1e-9))
    cells = tuple((name, need, found, "yes" if met else "no") for name, need, found, met in rows)
    return Table(("at 1 s", "required", "found", "reached"), cells, "Requirements", right_aligned=True)


def _success_change(results: Results, condition: Condition) -> float:
    """Return the share of success less that of direct control."""
    direct = replace(condition, mode=DIRECT)
    shares = [results.successes(each) / len(results.runs(each)) for each in (condition, direct)]
    return shares[0] - shares[1]


def arm_table(results: Results) -> Table:
    """Return success and times with a wrong skill, and with an operator who aims at another place."""
    rows = []
    for case in cases(results, arms=True):
        shared = replace(case, mode="shared")
        both = [_summary_cell(results.summary(each)) for each in (case, shared)]
        rows.append((case.name, *both, ratio_cell(results.ratio(shared))))
    header = ("condition", "direct [s]", "shared [s]", "time ratio")
    return Table(header, tuple(rows), "Arms in which assistance could do harm", right_aligned=True)


def floor_table(results: Results) -> Table:
    """Return the ratios of an operator without motor noise, beside those of the three operators."""
    rows = []
    for task in PRINTED:
        condition = Condition(task, "shared")
        if results.has(condition, noise_free=True):
            ratios = (
                results.ratio(condition),
                results.noise_free_ratio(condition),
                results.floor_ratio(condition),
            )
            rows.append((condition.name, *map(ratio_cell, ratios)))
    header = ("shared", "operators", "noise-free in both modes", "noise-free shared, operators direct")
    return Table(header, tuple(rows), "Time ratios of an operator without motor noise", right_aligned=True)


def measure_table(results: Results) -> Table:
    """Return the other measures of each mode at a round trip of 1 s: means of successful runs."""
    rows = []
    for condition in results.conditions:
        if condition.round_trip == 1.0 and not condition.loss:
            cells = [_measure_cell(results, condition, measure) for measure in MEASURES]
            rows.append((f"{condition.name}, {condition.mode}", _error_cell(results, condition), *cells))
    header = ("condition", "end error", *(label for label, _ in MEASURES.values()))
    return Table(header, tuple(rows), "Other measures of successful runs, means", right_aligned=True)


def _measure_cell(results: Results, condition: Condition, measure: str) -> str:
    value = results.mean(condition, measure)
    return NONE if isnan(value) else MEASURES[measure][1](value)


def _error_cell(results: Results, condition: Condition) -> str:
    """Return the mean end error of all runs, including failed ones."""
    value = results.mean(condition, "error", only_successes=False)
    if TASKS[condition.task].unit == "rad" and condition.arm != "aside":
        return f"{degrees(value):.1f} deg"
    return f"{1000 * value:.1f} mm"


def measure_ratio_table(results: Results) -> Table:
    """Return the ratios of path, open-loop moves and effort to direct control at a round trip of 1 s."""
    rows = []
    for case in cases(results):
        if case.round_trip == 1.0 and not case.loss:
            for mode in ASSISTED[::2]:  # in autonomous control the hand rests
                condition = replace(case, mode=mode)
                ratios = [results.ratio(condition, measure) for measure in RATIO_MEASURES]
                cells = [ratio_cell(ratio).replace("slower", "more") for ratio in ratios]
                rows.append((f"{case.name}, {mode}", *cells))
    header = ("condition", "path", "open-loop moves", "effort")
    return Table(header, tuple(rows), "Other ratios to direct control", right_aligned=True)


def to_markdown(tables: Sequence[Table]) -> str:
    """Return tables as Markdown.

    Args:
        tables: Tables with a header.
    """
    texts = []
    for table in tables:
        lines = ["| " + " | ".join(row) + " |" for row in (table.header, *table.rows)]
        lines.insert(1, "| --- " + "| ---: " * (len(table.header) - 1) + "|")
        texts.append("\n".join([f"**{table.caption}**", "", *lines]))
    return "\n\n".join(texts) + "\n"
