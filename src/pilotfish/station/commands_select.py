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

from pilotfish.demonstrations import Demonstration
from pilotfish.models import MOST_ITERATIONS, Candidate, EMSettings, Failure, Score, Selection
from pilotfish.models import select as score_all
from pilotfish.station.answers import (
    Answer,
    answering,
    example,
    finite,
    plain_table,
    require_new,
    table,
)
from pilotfish.station.candidates import candidates
from pilotfish.station.learners import LEARNERS
from pilotfish.station.output import a_person_watches, progress_bar
from pilotfish.station.pictures import a_picture, require_matplotlib, save_picture
from pilotfish.station.sources import a_choice, chosen, prepared, recordings
from pilotfish.station.structure_names import structure_names

HEAD = ("states", "structure", "durations", "parameters", "log-lik.", "BIC", "held out", "+-", "CPU [s]", "")


@dataclass(frozen=True, slots=True)
class Choices:
    """What the options say."""

    folder: str
    states: str
    structures: str
    durations: str
    out: Path | None
    regularisation: float
    iterations: int
    seed: int
    only: str
    speeds: bool
    sphere: bool
    force: bool


@click.command(
    name="select",
    epilog=example(
        "pilotfish select dataset:valve --only 0-3 --states 4:8 --structures full,diagonal --out sizes.png"
    ),
)
@click.argument("folder")
@click.option("--states", default="3:10", show_default=True, help="How many states: 7, 3:10 or 3,5,8:12.")
@click.option(
    "--structures",
    default="full,diagonal,semi-tied",
    show_default=True,
    help=f"What covariances may look like, with commas between: {structure_names()}.",
)
@click.option(
    "--durations",
    default="counted",
    show_default=True,
    help=f"What is made of time, with commas between: {', '.join(LEARNERS)}.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    callback=a_picture,
    help="The picture to draw: .png, .svg or .pdf.",
)
@click.option(
    "--regularisation",
    type=click.FloatRange(min=0.0),
    callback=finite,
    default=1e-5,
    show_default=True,
    help="Added to every variance [unit squared].",
)
@click.option(
    "--iterations",
    type=click.IntRange(1, MOST_ITERATIONS),
    default=200,
    show_default=True,
    help="At most so many for each fit.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of all chance.")
@click.option(
    "--only",
    default="",
    callback=a_choice,
    help="Which demonstrations, such as 0-3 or 0,2.  [default: all]",
)
@click.option(
    "--speeds/--no-speeds",
    default=True,
    show_default=True,
    help="Add the speed of every column where the recording has none.",
)
@click.option(
    "--sphere/--flat",
    default=False,
    show_default=True,
    help="Whether unit quaternions are orientations on their sphere, or four numbers like any others.",
)
@click.option("--force", is_flag=True, help="Replace the picture if it is there already.")
@answering
def select(**options: Any) -> Answer:
    """Find out which model suits the recordings in FOLDER: how many states, which structure and durations.

    Every combination is learned from all demonstrations but one, and scored by the one, for each in turn.
    FOLDER may also be dataset:NAME.
    """
    asked = Choices(**options)
    tried = candidates(asked.states, asked.structures, asked.durations)
    if asked.out:
        require_matplotlib()
    require_new(asked.out, force=asked.force)
    demonstrations = prepared(
        chosen(recordings(asked.folder), asked.only), sphere=asked.sphere, speeds=asked.speeds
    )
    selection, seconds = _scored(demonstrations, tried, asked)
    best = selection.best
    if asked.out:
        from pilotfish import plots  # needs matplotlib

        save_picture(plots.model_sizes(selection), asked.out, overwrite=asked.force)
    return _answer(selection, best, seconds, asked)


def _scored(
    demonstrations: Sequence[Demonstration], tried: Sequence[Candidate], asked: Choices
) -> tuple[Selection, dict[Candidate, float]]:
    """The scores, and the CPU seconds that each candidate took, its failures included."""
    settings = EMSettings(regularisation=asked.regularisation, max_iterations=asked.iterations)
    seconds: dict[Candidate, float] = {}
    with _progress(len(tried)) as tell:
        begun = [time.process_time()]

        def note(result: Score | Failure) -> None:
            now = time.process_time()
            seconds[result.candidate] = now - begun.pop()
            begun.append(now)
            tell(result.candidate.label)

        rng = np.random.default_rng(asked.seed)
        return score_all(demonstrations, tried, rng=rng, settings=settings, watch=note), seconds


@contextmanager
def _progress(candidates_to_try: int) -> Iterator[Callable[[str], None]]:
    """What to call with the name of each candidate that is done; a person who watches sees a bar."""
    if not a_person_watches():
        yield lambda _: None
        return
    with progress_bar(candidates_to_try, "selecting") as advance:
        yield advance


def _answer(selection: Selection, best: Score, seconds: dict[Candidate, float], asked: Choices) -> Answer:
    marks = {id(selection.lowest_bic): "lowest BIC", id(selection.likeliest): "highest"}
    marks[id(best)] = "chosen"
    rows = [_row(score, seconds[score.candidate], marks.get(id(score), "")) for score in selection.scores]
    notes = [("chosen", best.candidate.label)]
    notes += [("failed", f"{f.candidate.label}: {' '.join(f.reason.split())}") for f in selection.failures]
    notes += [("picture", str(asked.out))] if asked.out else []
    facts = {
        "chosen": _facts(best, seconds),
        "highest": selection.likeliest.candidate.label,
        "lowest_bic": selection.lowest_bic.candidate.label,
        "scores": [_facts(score, seconds) for score in selection.scores],
        "failures": [{**_named(f.candidate), "reason": f.reason} for f in selection.failures],
        "picture": str(asked.out) if asked.out else None,
    }
    return Answer(f"{table(HEAD, rows)}\n\n{plain_table(notes)}", facts)


def _row(score: Score, seconds: float, mark: str) -> list[str]:
    candidate = score.candidate
    dropped = candidate.states - score.states
    return [
        f"{candidate.states}" + (f" ({dropped} dropped)" if dropped else ""),
        candidate.structure.label,
        candidate.durations,
        str(score.parameters),
        f"{score.log_likelihood:.0f}",
        f"{score.bic:.0f}",
        f"{score.mean:.2f}",
        f"{score.standard_error:.2f}",
        f"{seconds:.2f}",
        mark,
    ]


def _named(candidate: Candidate) -> dict[str, Any]:
    return {
        "states": candidate.states,
        "structure": candidate.structure.label,
        "durations": candidate.durations,
    }


def _facts(score: Score, seconds: dict[Candidate, float]) -> dict[str, Any]:
    return {
        **_named(score.candidate),
        "learned_states": score.states,
        "parameters": score.parameters,
        "log_likelihood": _number(score.log_likelihood),
        "bic": _number(score.bic),
        "held_out": [_number(value) for value in score.held_out.tolist()],
        "mean": _number(score.mean),
        "standard_error": _number(score.standard_error),
        "cpu_seconds": seconds[score.candidate],
    }


def _number(value: float) -> float | None:
    """JSON has no infinity: a demonstration that is impossible under the model of the others is null."""
    return value if isfinite(value) else None
