"""pilotfish select: which model is the right size for recordings."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import click
import numpy as np

from pilotfish.cli.options.candidates import parse_candidates
from pilotfish.cli.options.learners import CANDIDATE_NAMES
from pilotfish.cli.options.sources import (
    load_demonstrations,
    prepare_demonstrations,
    select_demonstrations,
    validate_selection,
)
from pilotfish.cli.options.structures import structure_syntax_list
from pilotfish.cli.output.answers import (
    CommandResult,
    example_epilog,
    format_key_values,
    format_table,
    print_result,
    require_finite_option,
    require_writable_file,
)
from pilotfish.cli.output.pictures import require_matplotlib, save_figure, validate_figure_path
from pilotfish.cli.output.terminal import is_interactive, progress_bar
from pilotfish.demonstrations import Demonstration
from pilotfish.models import MAX_ITERATIONS, Candidate, EMSettings, Score, Selection
from pilotfish.models import select as score_candidates

HEADER = (
    "states",
    "structure",
    "durations",
    "parameters",
    "log-lik.",
    "BIC",
    "held out",
    "+-",
    "CPU [s]",
    "",
)


@dataclass(frozen=True, slots=True)
class SelectOptions:
    """What the options say."""

    folder: str
    states: str
    structures: str
    durations: str
    out: Path | None
    regularisation: float
    max_iterations: int
    seed: int
    only: str
    velocities: bool
    riemannian: bool
    force: bool


@click.command(
    name="select",
    epilog=example_epilog(
        "pilotfish select dataset:valve --only 0-3 --states 4:8 --structures full,diagonal --out sizes.png"
    ),
)
@click.argument("folder")
@click.option("--states", default="3:10", show_default=True, help="How many states: 7, 3:10 or 3,5,8:12.")
@click.option(
    "--structures",
    default="full,diagonal,semi-tied",
    show_default=True,
    help=f"What covariances may look like, with commas between: {structure_syntax_list()}.",
)
@click.option(
    "--durations",
    default="counted",
    show_default=True,
    help=f"What is made of time, with commas between: {', '.join(CANDIDATE_NAMES)}.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    callback=validate_figure_path,
    help="The picture to draw: .png, .svg or .pdf.",
)
@click.option(
    "--regularisation",
    type=click.FloatRange(min=0.0),
    callback=require_finite_option,
    default=1e-5,
    show_default=True,
    help="Added to every variance [unit squared].",
)
@click.option(
    "--max-iterations",
    type=click.IntRange(1, MAX_ITERATIONS),
    default=200,
    show_default=True,
    help="At most so many for each fit.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of the random number generator.",
)
@click.option(
    "--only",
    default="",
    callback=validate_selection,
    help="Which demonstrations, such as 0-3 or 0,2.  [default: all]",
)
@click.option(
    "--velocities/--no-velocities",
    default=True,
    show_default=True,
    help="Add the speed of every column where the recording has none.",
)
@click.option(
    "--riemannian/--euclidean",
    default=False,
    show_default=True,
    help="Whether unit quaternions are orientations on their sphere, or four numbers like any others.",
)
@click.option("--force", is_flag=True, help="Replace the picture if it is there already.")
@print_result
def select(**options: Any) -> CommandResult:
    """Find out which model suits the recordings in FOLDER: how many states, which structure and durations.

    Every combination is learned from all demonstrations but one, and scored by the one, for each in turn.
    FOLDER may also be dataset:NAME.
    """
    arguments = SelectOptions(**options)
    candidates = parse_candidates(arguments.states, arguments.structures, arguments.durations)
    if arguments.out:
        require_matplotlib()
    require_writable_file(arguments.out, force=arguments.force)
    demonstrations = prepare_demonstrations(
        select_demonstrations(load_demonstrations(arguments.folder), arguments.only),
        riemannian=arguments.riemannian,
        velocities=arguments.velocities,
    )
    selection, seconds = _score_candidates(demonstrations, candidates, arguments)
    best = selection.best
    if arguments.out:
        from pilotfish import plots  # needs matplotlib

        save_figure(plots.model_selection(selection), arguments.out, overwrite=arguments.force)
    return _to_result(selection, best, seconds, arguments)


def _score_candidates(
    demonstrations: Sequence[Demonstration], candidates: Sequence[Candidate], arguments: SelectOptions
) -> tuple[Selection, dict[Candidate, float]]:
    """The scores, and the CPU seconds that each candidate took, its failures included."""
    settings = EMSettings(regularisation=arguments.regularisation, max_iterations=arguments.max_iterations)
    seconds: dict[Candidate, float] = {}
    with _progress(len(candidates)) as advance:
        last_time = [time.process_time()]

        def record_time(candidate: Candidate) -> None:
            now = time.process_time()
            seconds[candidate] = now - last_time.pop()
            last_time.append(now)
            advance(candidate.label)

        rng = np.random.default_rng(arguments.seed)
        return score_candidates(
            demonstrations, candidates, rng=rng, settings=settings, callback=record_time
        ), seconds


@contextmanager
def _progress(n_candidates: int) -> Iterator[Callable[[str], None]]:
    """What to call with the name of each candidate that is done; a person who watches sees a bar."""
    if not is_interactive():
        yield lambda _: None
        return
    with progress_bar(n_candidates, "selecting") as advance:
        yield advance


def _to_result(
    selection: Selection, best: Score, seconds: dict[Candidate, float], arguments: SelectOptions
) -> CommandResult:
    marks = {id(selection.lowest_bic): "lowest BIC", id(selection.highest_held_out): "highest"}
    marks[id(best)] = "selected"
    rows = [
        _format_score(score, seconds[score.candidate], marks.get(id(score), "")) for score in selection.scores
    ]
    notes = [("selected", best.candidate.label)]
    notes += [
        ("failed", f"{candidate.label}: {' '.join(reason.split())}")
        for candidate, reason in selection.failures
    ]
    notes += [("plot", str(arguments.out))] if arguments.out else []
    facts = {
        "selected": _score_to_json(best, seconds),
        "highest_likelihood": selection.highest_held_out.candidate.label,
        "lowest_bic": selection.lowest_bic.candidate.label,
        "scores": [_score_to_json(score, seconds) for score in selection.scores],
        "failures": [
            {**_candidate_to_json(candidate), "reason": reason} for candidate, reason in selection.failures
        ],
        "plot": str(arguments.out) if arguments.out else None,
    }
    return CommandResult(f"{format_table(HEADER, rows)}\n\n{format_key_values(notes)}", facts)


def _format_score(score: Score, seconds: float, mark: str) -> list[str]:
    candidate = score.candidate
    dropped = candidate.states - score.states
    return [
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
    ]


def _candidate_to_json(candidate: Candidate) -> dict[str, Any]:
    return {
        "states": candidate.states,
        "structure": candidate.structure.label,
        "durations": candidate.dynamics_label,
    }


def _score_to_json(score: Score, seconds: dict[Candidate, float]) -> dict[str, Any]:
    return {
        **_candidate_to_json(score.candidate),
        "learned_states": score.states,
        "parameters": score.parameters,
        "log_likelihood": _finite_or_none(score.log_likelihood),
        "bic": _finite_or_none(score.bic),
        "held_out_log_likelihood": [_finite_or_none(value) for value in score.held_out.tolist()],
        "mean": _finite_or_none(score.held_out_mean),
        "standard_error": _finite_or_none(score.standard_error),
        "cpu_seconds": seconds[score.candidate],
    }


def _finite_or_none(value: float) -> float | None:
    """JSON has no infinity: a demonstration that is impossible under the model of the others is null."""
    return value if isfinite(value) else None
