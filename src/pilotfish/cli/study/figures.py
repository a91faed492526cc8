"""Figures of the study."""

from collections.abc import Callable
from dataclasses import replace
from math import degrees
from typing import TYPE_CHECKING

import numpy as np

from pilotfish.cli.study.results import DIRECT, Results
from pilotfish.cli.study.tables import ASSISTED, LIMITS, MODES, PRINTED, cases
from pilotfish.environments import TASKS
from pilotfish.simulation import Condition

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = dict(zip(MODES, ("#4d4d4d", "#0072b2", "#d55e00", "#009e73"), strict=True))
TIME_CAPTION = (
    "Mean time of successful runs and success in each mode, against the round trip. Dashed, with open "
    "markers: the operator's view is displaced by 3 cm and turned by 5 degrees."
)
RATIO_CAPTION = (
    "Time relative to direct control in pairs that both succeeded, with 95 % intervals. An open circle means "
    "no gain: the interval contains 1. No pairs: direct control never succeeded. Black marks: table 6.2."
)
ARM_CAPTION = (
    "Success, and time relative to direct control, with the skill of a neighbouring object and with an "
    "operator who aims 10 cm aside. Dotted: the largest ratio that is accepted."
)
MARKERS = dict(zip(MODES, "osD^", strict=True))


def study_figures(results: Results) -> dict[str, tuple["Figure", str]]:
    """Return the figures by name, each with its caption.

    Args:
        results: Finished runs.
    """
    figures = {
        "time": (draw_times(results), TIME_CAPTION),
        "ratios": (draw_ratios(results), RATIO_CAPTION),
        "measures": (
            draw_measures(results),
            "Other measures at a round trip of 1 s: means of successful runs; of all runs for the end error.",
        ),
    }
    if list(cases(results, arms=True)):
        figures["arms"] = (draw_arms(results), ARM_CAPTION)
    return figures


def draw_times(results: Results) -> "Figure":
    """Draw time and success against the round trip for each mode."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    panels = figure.subplots(2, len(PRINTED), sharex=True, sharey="row", height_ratios=(2.0, 1.0))
    for column, task in enumerate(PRINTED):
        for index, mode in enumerate(MODES):
            for view_off in (False, True):
                _draw_mode(panels[:, column], results, Condition(task, mode, view_off=view_off), index)
        panels[0, column].set(title=task)
        panels[1, column].set(xlabel="round trip [s]", ylim=(-0.05, 1.05))
    panels[0, 0].set(ylabel="time [s]")
    panels[0, 0].set_ylim(bottom=0.0)
    panels[1, 0].set(ylabel="success")
    handles = panels[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper center", ncols=len(MODES))
    return figure


def _draw_mode(
    panels: "np.ndarray[tuple[int], np.dtype[np.object_]]", results: Results, condition: Condition, index: int
) -> None:
    found = [each for each in results.conditions if each == replace(condition, round_trip=each.round_trip)]
    if not found:
        return
    x = np.array([each.round_trip for each in found]) + 0.012 * (index - 1.5)
    style = {
        "color": COLOURS[condition.mode],
        "linestyle": "--" if condition.view_off else "-",
        "marker": MARKERS[condition.mode],
        "markersize": 5,
        "markerfacecolor": "white" if condition.view_off else COLOURS[condition.mode],
    }
    label = None if condition.view_off else condition.mode
    panels[0].plot(x, [results.mean(each, "time") for each in found], label=label, **style)
    shares = [results.successes(each) / len(results.runs(each)) for each in found]
    panels[1].plot(x, shares, **style)


def draw_ratios(results: Results) -> "Figure":
    """Draw the time ratios of all standard conditions with their intervals."""
    from matplotlib.figure import Figure

    rows = list(cases(results))
    figure = Figure(figsize=(9.0, 1.2 + 0.3 * len(rows)), layout="constrained")
    panels = figure.subplots(1, len(ASSISTED), sharex=True, sharey=True)
    for axes, mode in zip(panels, ASSISTED, strict=True):
        for y, case in enumerate(rows):
            condition = replace(case, mode=mode)
            _draw_interval(axes, y, results, condition)
            if (limit := LIMITS.get((case.task, mode))) and case == Condition(case.task, DIRECT):
                axes.plot([limit, limit], [y - 0.35, y + 0.35], color="black", linewidth=1.5)
        axes.axvline(1.0, color="black", linewidth=0.8)
        axes.set(title=mode, xlabel="time / time in direct control")
        axes.grid(axis="x", alpha=0.3)
    panels[0].set_yticks(range(len(rows)), [case.name for case in rows])
    panels[0].invert_yaxis()
    return figure


def _draw_interval(axes: "Axes", y: float, results: Results, condition: Condition) -> None:
    ratio = results.ratio(condition)
    if not ratio.pairs:
        place = axes.get_yaxis_transform()
        axes.text(0.5, y, "no pairs", transform=place, ha="center", va="center", color="gray", fontsize=8)
        return
    colour = COLOURS[condition.mode]
    is_no_gain = ratio.verdict == "no gain"
    axes.plot([ratio.low, ratio.high], [y, y], color=colour, linewidth=2.0)
    axes.plot(
        ratio.value, y, "o", color=colour, markerfacecolor="white" if is_no_gain else colour, markersize=5
    )


def draw_measures(results: Results) -> "Figure":
    """Draw the other measures at a round trip of 1 s."""
    from matplotlib.figure import Figure

    measures: dict[str, Callable[[Condition], float]] = {
        "path / straight path": lambda each: results.mean(each, "path_ratio"),
        "end error [mm; valve: deg]": lambda each: _end_error(results, each),
        "open-loop moves": lambda each: results.mean(each, "submovements"),
        "path of the hand [m]": lambda each: results.mean(each, "effort"),
        "hand to target [m]": lambda each: results.mean(each, "disagreement"),
        "data, both ways [kB]": lambda each: (
            1e-3 * (results.mean(each, "bytes_forward") + results.mean(each, "bytes_backward"))
        ),
    }
    rows = [case for case in cases(results) if case.round_trip == 1.0 and not case.loss]
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    for axes, (label, measure) in zip(figure.subplots(3, 2, sharex=True).flat, measures.items(), strict=True):
        for n, mode in enumerate(MODES):
            values = [measure(replace(case, mode=mode)) for case in rows]
            places = np.arange(len(rows)) + 0.2 * (n - 1.5)
            axes.bar(places, values, 0.18, color=COLOURS[mode], label=mode)
        labels = [case.name.replace(", 1 s", "") for case in rows]
        style = {"rotation": 25, "ha": "right", "rotation_mode": "anchor"}
        axes.set_xticks(range(len(rows)), labels, **style)
        axes.set(ylabel=label)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(MODES))
    return figure


def _end_error(results: Results, condition: Condition) -> float:
    """Return the mean error at the end in all runs [degrees or mm]."""
    value = results.mean(condition, "error", only_successes=False)
    return degrees(value) if TASKS[condition.task].unit == "rad" else 1000.0 * value


def draw_arms(results: Results) -> "Figure":
    """Draw success and time ratio in the two arms."""
    from matplotlib.figure import Figure

    rows = list(cases(results, arms=True))
    figure = Figure(figsize=(9.0, 1.4 + 0.5 * len(rows)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for y, case in enumerate(rows):
        for offset, mode in ((-0.18, DIRECT), (0.18, "shared")):
            condition = replace(case, mode=mode)
            share = results.successes(condition) / len(results.runs(condition))
            label = None if y else mode
            left.barh(y + offset, share, 0.34, color=COLOURS[mode], label=label)
        _draw_interval(right, y, results, replace(case, mode="shared"))
    left.set_yticks(range(len(rows)), [case.name for case in rows])
    left.invert_yaxis()
    left.set(xlabel="success", xlim=(0.0, 1.0))
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    right.axvline(1.0, color="black", linewidth=0.8)
    right.axvline(1.1, color="black", linewidth=0.8, linestyle=":")
    right.set(xlabel="shared: time / time in direct control")
    return figure
