"""Results of `pilotfish select`: tables, recommendation and JSON."""

import shlex
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.cli.options.structures import structure_text
from pilotfish.cli.output.motion_notes import name_options
from pilotfish.cli.output.results import CommandResult
from pilotfish.cli.output.tables import Table, key_value_table
from pilotfish.models import Candidate, Score, Selection, SemiMarkovChain
from pilotfish.planning import DEFAULT_CANDIDATE, ReproductionScore, ReproductionSelection

LIKELIHOOD_HEADER = (
    "states",
    "structure",
    "durations",
    "parameters",
    "log-lik.",
    "BIC",
    "held out",
    "std. error",
    "CPU [s]",
    "",
)
DEFAULT = "default"


def learn_command(candidate: Candidate, folder: str, options: Mapping[str, Any]) -> list[str]:
    """Return the command lines that learn and reproduce a candidate.

    Args:
        candidate: The candidate.
        folder: Folder of the demonstrations, or dataset:NAME.
        options: Options of `select`; those that `learn` has too are kept.
    """
    words = ["pilotfish", "learn", folder]
    words += ["--states", str(candidate.states)] if candidate.states else []
    words += ["--structure", structure_text(candidate.structure)] if candidate.structure else []
    if candidate.dynamics != SemiMarkovChain.name:
        words += ["--dynamics", candidate.dynamics]
    elif candidate.durations:
        words += ["--durations", candidate.durations.distribution.name]
    words += ["--only", options["only"]] if options["only"] else []
    words += ["--riemannian"] if options["riemannian"] else []
    words += [] if options["velocities"] else ["--no-velocities"]
    given = options["regularisation"]
    words += [] if given is None else ["--regularisation", f"{given:g}"]
    lines = [shlex.join([*words, "--out", "my.skill"])]
    if candidate.frames == "relevance":
        reproduce = ["pilotfish", "reproduce", "my.skill", "--relevance", folder, "--frames", "now.json"]
        lines.append(shlex.join(reproduce))
    return lines


def reproduction_result(
    selection: ReproductionSelection, commands: Sequence[str], seconds: float, out: Path | None
) -> CommandResult:
    """Return the table of a selection by reproduction, and the command lines of its choice.

    Args:
        selection: Scores of the candidates.
        commands: Command lines of the choice, from `learn_command`.
        seconds: Time that the selection took [s].
        out: Plot that was written.
    """
    best = selection.best
    kept = best is selection.default
    measures = tuple(best.measures)
    header = ("states", "structure", "durations", "frames", "score", "gain", *measures, "")
    rows = []
    for score in selection.scores:
        marks = {"selected": best, DEFAULT: selection.default, "lowest": selection.lowest}
        mark = ", ".join(name for name, marked in marks.items() if score is marked)
        rows.append(_reproduction_row(selection, score, mark))
    executions = f" and {selection.executions} executions" if selection.executions else ""
    notes = [
        ("selected", best.candidate.label + (": no other is significantly better" if kept else "")),
        *(("lowest", text) for text in chance_notes(selection)),
        ("cost", f"{selection.fits} fits{executions} in {seconds:.0f} s"),
        *(("edge", text) for text in edge_notes(selection)),
        *(("failed", f"{c.label}: {' '.join(reason.split())}") for c, reason in selection.failures),
        *(("run", line) for line in commands),
        *([("plot", str(out))] if out else []),
    ]
    data = {
        "by": "reproduction",
        "selected": _reproduction_to_json(best),
        "default_kept": kept,
        "edge": selection.edge,
        "fits": selection.fits,
        "executions": selection.executions,
        "commands": list(commands),
        "scores": [_reproduction_to_json(score) for score in selection.scores],
        "failures": _failures_to_json(selection.failures),
        "plot": str(out) if out else None,
    }
    return CommandResult([Table(header, tuple(rows)), key_value_table(notes)], data)


def chance_notes(selection: ReproductionSelection) -> list[str]:
    """Return a note if a candidate has a lower score than the choice, but possibly by chance.

    Args:
        selection: Scores of the candidates.
    """
    lowest = selection.lowest
    if lowest is selection.best or lowest.mean >= selection.best.mean:
        return []
    gain, error = selection.gain(lowest)
    note = f"{lowest.candidate.label}: better by {gain:.3f} +- {error:.3f}, which may be chance with "
    return [f"{note}{len(lowest.values)} held out; more of them tell"]


def edge_notes(selection: ReproductionSelection) -> list[str]:
    """Return a note if the choice has the largest or smallest number of states that were tried.

    Args:
        selection: Scores of the candidates.
    """
    if not (edge := selection.edge):
        return []
    states = selection.best.states
    fewer, more = f"{max(1, states // 2)}:{states}", f"{states}:{round(1.5 * states)}"
    return [f"the {edge} number of states tried; try --states {more if edge == 'largest' else fewer}"]


def _reproduction_row(
    selection: ReproductionSelection, score: ReproductionScore, mark: str
) -> tuple[str, ...]:
    candidate = score.candidate
    gain = ""
    if selection.default is not None and score is not selection.default:
        gain = "{:+.3f} +- {:.3f}".format(*selection.gain(score))
    return (
        str(score.states),
        candidate.fitted_structure.label,
        candidate.dynamics_label,
        candidate.frames,
        f"{score.mean:.3f}",
        gain,
        *(f"{values.mean():.3g}" for values in score.measures.values()),
        mark,
    )


def _reproduction_to_json(score: ReproductionScore) -> dict[str, Any]:
    return {
        **_candidate_to_json(score.candidate),
        "states": score.states,
        "frames": score.candidate.frames,
        "default": score.candidate == DEFAULT_CANDIDATE,
        "values": score.values.tolist(),
        "mean": score.mean,
        "standard_error": score.standard_error,
        **{name: float(np.mean(values)) for name, values in score.measures.items()},
    }


def _failures_to_json(failures: Sequence[tuple[Candidate, str]]) -> list[dict[str, Any]]:
    return [{**_candidate_to_json(c), "reason": reason} for c, reason in failures]


def likelihood_result(selection: Selection, seconds: dict[int, float], out: Path | None) -> CommandResult:
    """Return the table of a selection by likelihood.

    Args:
        selection: Scores of the candidates.
        seconds: CPU time of each candidate by its id [s].
        out: Plot that was written.
    """
    best = selection.best
    marks = {id(selection.lowest_bic): "lowest BIC", id(selection.highest_held_out): "highest held out"}
    marks[id(best)] = "selected"
    rows = [
        _score_row(score, seconds[id(score.candidate)], marks.get(id(score), ""))
        for score in selection.scores
    ]
    notes = [("selected", best.candidate.label)]
    notes += [("failed", f"{c.label}: {' '.join(reason.split())}") for c, reason in selection.failures]
    notes += [("note", name_options(note)) for note in best.notes]
    notes += [("plot", str(out))] if out else []
    data = {
        "by": "likelihood",
        "selected": _score_to_json(best, seconds),
        "highest_held_out": selection.highest_held_out.candidate.label,
        "lowest_bic": selection.lowest_bic.candidate.label,
        "scores": [_score_to_json(score, seconds) for score in selection.scores],
        "failures": _failures_to_json(selection.failures),
        "plot": str(out) if out else None,
    }
    return CommandResult([Table(LIKELIHOOD_HEADER, tuple(rows)), key_value_table(notes)], data)


def _score_row(score: Score, seconds: float, mark: str) -> tuple[str, ...]:
    candidate = score.candidate
    dropped = (candidate.states or score.states) - score.states
    return (
        f"{candidate.states or DEFAULT}" + (f" ({dropped} dropped)" if dropped else ""),
        candidate.fitted_structure.label,
        candidate.dynamics_label,
        str(score.parameters),
        f"{score.log_likelihood:.0f}",
        f"{score.bic:.0f}",
        f"{score.held_out_mean:.2f}",
        f"{score.standard_error:.2f}",
        f"{seconds:.2f}",
        mark,
    )


def _candidate_to_json(candidate: Candidate) -> dict[str, Any]:
    return {
        "states": candidate.states,
        "structure": candidate.fitted_structure.label,
        "durations": candidate.dynamics_label,
    }


def _score_to_json(score: Score, seconds: dict[int, float]) -> dict[str, Any]:
    return {
        **_candidate_to_json(score.candidate),
        "learned_states": score.states,
        "parameters": score.parameters,
        "log_likelihood": _finite_or_none(score.log_likelihood),
        "bic": _finite_or_none(score.bic),
        "held_out_log_likelihood": [_finite_or_none(value) for value in score.held_out.tolist()],
        "notes": list(map(name_options, score.notes)),
        "mean": _finite_or_none(score.held_out_mean),
        "standard_error": _finite_or_none(score.standard_error),
        "cpu_seconds": seconds[id(score.candidate)],
    }


def _finite_or_none(value: float) -> float | None:
    """Return None for infinity, which JSON lacks: a demonstration that the model of the others excludes."""
    return value if isfinite(value) else None
