"""pilotfish select: choose the number of states, the structure and the durations of a model."""

import time
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import click
import numpy as np

from pilotfish.cli.options.candidates import parse_candidates
from pilotfish.cli.options.demonstrations import (
    load_demonstrations,
    only_option,
    prepare_demonstrations,
    riemannian_option,
    select_demonstrations,
)
from pilotfish.cli.options.durations import CANDIDATE_NAMES
from pilotfish.cli.options.learning import regularisation_option, seed_option
from pilotfish.cli.options.structures import structure_syntax_list
from pilotfish.cli.output.figures import require_matplotlib, save_figure, validate_figure_path
from pilotfish.cli.output.motion_notes import name_options
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_writable_file,
)
from pilotfish.cli.output.tables import Table, key_value_table
from pilotfish.cli.output.terminal import progress_bar
from pilotfish.demonstrations import Demonstration
from pilotfish.models import VITERBI, Candidate, EMSettings, Score, Selection
from pilotfish.models import select as score_candidates

HEADER = (
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


@click.command(
    name="select",
    epilog=example_epilog(
        "pilotfish select dataset:valve --only 0-3 --states 4:8 --structures full,diagonal --out scores.png"
    ),
)
@click.argument("folder")
@click.option(
    "--states", default="3:10", show_default=True, help="Numbers of states, such as 7, 3:10 or 3,5,8:12."
)
@click.option(
    "--structures",
    default="full,diagonal,semi-tied",
    show_default=True,
    help=f"Covariance structures, separated by commas: {structure_syntax_list()}.",
)
@click.option(
    "--durations",
    default=VITERBI,
    show_default=True,
    help=f"Durations or dynamics, separated by commas: {', '.join(CANDIDATE_NAMES)}.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    callback=validate_figure_path,
    help="Plot of the scores to write, as .png, .svg or .pdf.",
)
@regularisation_option
@click.option(
    "--max-iterations",
    type=click.IntRange(1, EMSettings.MAX_ITERATIONS),
    default=200,
    show_default=True,
    help="Maximum number of EM iterations per fit.",
)
@seed_option
@only_option
@click.option(
    "--velocities/--no-velocities",
    default=True,
    show_default=True,
    help="Add velocities to demonstrations without them.",
)
@riemannian_option
@click.option("--force", is_flag=True, help="Replace an existing plot.")
@print_result
def select(
    folder: str, states: str, structures: str, durations: str, out: Path | None, **options: Any
) -> CommandResult:
    """Compare models of the demonstrations in FOLDER by cross-validation and select one.

    Every combination of state count, structure and durations is learned from all demonstrations but one, and
    scored on that one, for each demonstration in turn. FOLDER may also be dataset:NAME.
    """
    candidates = parse_candidates(states, structures, durations)
    if out:
        require_matplotlib()
    require_writable_file(out, force=options["force"])
    demonstrations = prepare_demonstrations(
        select_demonstrations(load_demonstrations(folder), options["only"]),
        riemannian=options["riemannian"],
        velocities=options["velocities"],
    )
    settings = EMSettings(regularisation=options["regularisation"], max_iterations=options["max_iterations"])
    selection, seconds = _score_candidates(demonstrations, candidates, settings, options["seed"])
    best = selection.best  # raises if no candidate could be learned
    if out:
        from pilotfish import plots

        save_figure(plots.model_selection(selection), out, overwrite=options["force"])
    return _to_result(selection, best, seconds, out)


def _score_candidates(
    demonstrations: Sequence[Demonstration],
    candidates: Sequence[Candidate],
    settings: EMSettings,
    seed: int,
) -> tuple[Selection, dict[int, float]]:
    """Return the scores, and the CPU time [s] of each candidate by its id."""
    seconds: dict[int, float] = {}
    with progress_bar(len(candidates), "selecting") as advance:
        last_time = [time.process_time()]

        def record_time(candidate: Candidate) -> None:
            now = time.process_time()
            seconds[id(candidate)] = now - last_time.pop()
            last_time.append(now)
            advance(candidate.label)

        rng = np.random.default_rng(seed)
        selection = score_candidates(
            demonstrations, candidates, rng=rng, settings=settings, callback=record_time
        )
    return selection, seconds


def _to_result(
    selection: Selection, best: Score, seconds: dict[int, float], out: Path | None
) -> CommandResult:
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
        "selected": _score_to_json(best, seconds),
        "highest_held_out": selection.highest_held_out.candidate.label,
        "lowest_bic": selection.lowest_bic.candidate.label,
        "scores": [_score_to_json(score, seconds) for score in selection.scores],
        "failures": [{**_candidate_to_json(c), "reason": reason} for c, reason in selection.failures],
        "plot": str(out) if out else None,
    }
    return CommandResult([Table(HEADER, tuple(rows)), key_value_table(notes)], data)


def _score_row(score: Score, seconds: float, mark: str) -> tuple[str, ...]:
    candidate = score.candidate
    dropped = candidate.states - score.states
    return (
        f"{candidate.states}" + (f" ({dropped} dropped)" if dropped else ""),
        candidate.structure.label,
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
        "structure": candidate.structure.label,
        "durations": candidate.dynamics_label,
    }


def _score_to_json(score: Score, seconds: dict[int, float]) -> dict[str, Any]:
    return {
        **_candidate_to_json(score.candidate),
        "learned_states": score.states,
        "parameters": score.parameters,
        "log_likelihood": _finite_or_none(score.log_likelihood),
        "bic": _finite_or_none(score.bic),
        "notes": list(map(name_options, score.notes)),
        "held_out_log_likelihood": [_finite_or_none(value) for value in score.held_out.tolist()],
        "mean": _finite_or_none(score.held_out_mean),
        "standard_error": _finite_or_none(score.standard_error),
        "cpu_seconds": seconds[id(score.candidate)],
    }


def _finite_or_none(value: float) -> float | None:
    """Return None for infinity, which JSON lacks: a demonstration that the model of the others excludes."""
    return value if isfinite(value) else None
