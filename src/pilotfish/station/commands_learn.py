"""pilotfish learn: from recordings to a skill in a file."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from pilotfish.demonstrations import Demonstration, Severity, check
from pilotfish.gaussians import Structure
from pilotfish.models import (
    MOST_ITERATIONS,
    MOST_RESTARTS,
    MOST_STATES,
    EMSettings,
    Fit,
    KMeans,
    Learner,
    Start,
    TimeBins,
    fitted_parameters,
    relevance,
    select_frames,
)
from pilotfish.station.answers import (
    Answer,
    answering,
    example,
    finite,
    plain_table,
    require_new,
)
from pilotfish.station.descriptions import columns_text, skill_facts, states_table, time_text
from pilotfish.station.learners import CENSORINGS, COUNTED, LAWS, LEARNERS, semi_markov_learner
from pilotfish.station.output import a_person_watches, progress_bar, remark
from pilotfish.station.sources import a_choice, chosen, prepared, recordings, recordings_in
from pilotfish.station.structure_names import StructureType, structure_names
from pilotfish.store import content_hash, save_skill

SEMI_MARKOV = "semi-markov"
DYNAMICS = (SEMI_MARKOV, "markov", "mixture")
STARTS = ("time-bins", "k-means")
JITTER = 0.5  # share of a bin, when several beginnings are tried


@dataclass(frozen=True, slots=True)
class Choices:
    """What the options say."""

    folder: str
    out: Path
    states: int
    structure: Structure
    dynamics: str
    durations: str | None
    censored: str | None
    sphere: bool
    drop_distractors: bool
    start: str
    regularisation: float
    iterations: int
    restarts: int
    seed: int
    only: str
    speeds: bool
    force: bool


@click.command(
    epilog=example("pilotfish learn dataset:valve --only 0-3 --structure semi-tied --out valve.skill")
)
@click.argument("folder")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="The skill file to write.")
@click.option(
    "--states", type=click.IntRange(1, MOST_STATES), default=7, show_default=True, help="How many states."
)
@click.option(
    "--structure",
    type=StructureType(),
    default="full",
    show_default=True,
    help=f"What covariances may look like: {structure_names()}. Semi-tied states share their directions, mfa "
    "and its kin have few factors each.",
)
@click.option(
    "--dynamics",
    type=click.Choice(DYNAMICS),
    default="semi-markov",
    show_default=True,
    help="How states follow one another; replay needs an order in time, which a mixture has not.",
)
@click.option(
    "--durations",
    type=click.Choice((COUNTED, *LAWS)),
    help="How long semi-markov states last: counted along the best path of a Markov fit, or of a law that is "
    "fitted together with all else.  [default: counted]",
)
@click.option(
    "--censored",
    type=click.Choice(tuple(CENSORINGS)),
    help="Which visits recordings cut off, where durations are fitted.  [default: last]",
)
@click.option(
    "--sphere/--flat",
    default=False,
    show_default=True,
    help="Whether unit quaternions are orientations on their sphere, or four numbers like any others.",
)
@click.option(
    "--drop-distractors",
    is_flag=True,
    help="Learn twice, the second time without the frames that matter at no state.",
)
@click.option(
    "--start",
    type=click.Choice(STARTS),
    default="time-bins",
    show_default=True,
    help="The first guess: demonstrations cut into equal times, or clusters of points.",
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
    help="At most so many iterations from each beginning.",
)
@click.option(
    "--restarts",
    type=click.IntRange(1, MOST_RESTARTS),
    default=1,
    show_default=True,
    help="Beginnings to try; the most likely result wins. Above 1, time bins are cut at random.",
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
    help="Add the speed of every column where the recording has none; replay needs it.",
)
@click.option("--force", is_flag=True, help="Replace the skill file if it is there already.")
@answering
def learn(**options: Any) -> Answer:
    """Learn a skill from the recordings in FOLDER and write it to a file.

    FOLDER may also be dataset:NAME; `pilotfish data list` shows the names.
    """
    asked = Choices(**options)
    require_new(asked.out, force=asked.force, inputs=recordings_in(Path(asked.folder)))
    learner = _learner(asked)
    demonstrations = prepared(
        chosen(recordings(asked.folder), asked.only), sphere=asked.sphere, speeds=asked.speeds
    )
    _warn(demonstrations)
    fit = _fit(demonstrations, learner, asked)
    gone: tuple[str, ...] = ()
    if asked.drop_distractors:
        fit, gone = _without_distractors(fit, demonstrations, learner, asked)
    save_skill(fit.skill, asked.out, overwrite=asked.force, beside=True)
    return _answer(fit, gone, asked)


def _without_distractors(
    fit: Fit, demonstrations: Sequence[Demonstration], learner: Learner, asked: Choices
) -> tuple[Fit, tuple[str, ...]]:
    """Learned anew without the frames that matter at no state, which are named; the same when all matter."""
    if len(fit.skill.frame_names) < 2:
        return fit, ()
    relevant = relevance(fit.skill, demonstrations)
    if not (gone := relevant.distractors):
        return fit, ()
    again = _fit(select_frames(demonstrations, relevant), learner, asked)
    note = f"frames left out, they matter at no state: {', '.join(gone)}"
    skill = replace(again.skill, provenance=replace(again.skill.provenance, note=note))
    return replace(again, skill=skill), gone


def _learner(asked: Choices) -> Learner:
    timed = {"--durations": asked.durations, "--censored": asked.censored}
    if asked.dynamics != SEMI_MARKOV:
        if given := [name for name, value in timed.items() if value]:
            raise click.UsageError(f"{given[0]} goes with --dynamics semi-markov, not {asked.dynamics}")
        return LEARNERS[asked.dynamics]
    durations = asked.durations or COUNTED
    if asked.censored and durations == COUNTED:
        raise click.UsageError(f"--censored goes with --durations {', '.join(LAWS)}; counting is as it is")
    return semi_markov_learner(durations, asked.censored or "last")


def _fit(demonstrations: Sequence[Demonstration], learner: Learner, asked: Choices) -> Fit:
    start: Start = KMeans() if asked.start == "k-means" else TimeBins(JITTER if asked.restarts > 1 else 0.0)
    settings = EMSettings(
        regularisation=asked.regularisation, max_iterations=asked.iterations, restarts=asked.restarts
    )
    with _progress(settings) as watched:
        return learner(
            demonstrations,
            states=asked.states,
            rng=np.random.default_rng(asked.seed),
            structure=asked.structure,
            start=start,
            settings=watched,
        )


@contextmanager
def _progress(settings: EMSettings) -> Iterator[EMSettings]:
    """The same settings; a bar on stderr follows the iterations when a person watches."""
    if not a_person_watches():
        yield settings
        return
    with progress_bar(settings.max_iterations * settings.restarts, "learning") as advance:
        yield replace(settings, watch=lambda _, gain: advance(f"log-likelihood {gain:.6g}"))


def _warn(demonstrations: Sequence[Demonstration]) -> None:
    for finding in check(demonstrations):
        if finding.severity is Severity.WARNING:  # an error is refused by learning
            remark(f"{finding.severity.value}: {finding.place} {finding.message}")


def _answer(fit: Fit, gone: Sequence[str], asked: Choices) -> Answer:
    skill, outcome, structure = fit.skill, fit.outcome, asked.structure
    parameters = fitted_parameters(structure, skill.covariances)
    name = content_hash(skill)
    facts = {
        "file": str(asked.out),
        "content": name,
        **skill_facts(skill),
        "reason": outcome.reason,
        "dropped": list(outcome.dropped),
        "frames_left_out": list(gone),
        "covariance_parameters": parameters,
    }
    ended = "converged" if outcome.converged else "not converged"
    rows = [
        (
            "demonstrations",
            f"{len(skill.provenance.demonstrations)}, {skill.provenance.datapoints} datapoints",
        ),
        ("columns", f"{columns_text(skill.layout)}, every {skill.period:g} s"),
        ("log-likelihood", f"{skill.provenance.log_likelihood:.6g} after {outcome.iterations} iterations"),
        (ended, outcome.reason),
        ("dropped", ", ".join(outcome.dropped) or "no state"),
        *([("frames left out", ", ".join(gone) or "none")] if asked.drop_distractors else []),
        ("time", time_text(skill)),
        ("covariances", f"{structure.label}, {parameters} parameters"),
        ("file", str(asked.out)),
        ("content", name),
    ]
    return Answer(f"{states_table(skill)}\n\n{plain_table(rows)}", facts)
