"""pilotfish learn: from recordings to a skill in a file."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from pilotfish import models
from pilotfish.cli.options.learners import VITERBI, duration_model
from pilotfish.cli.options.sources import (
    load_demonstrations,
    prepare_demonstrations,
    recording_files,
    select_demonstrations,
    validate_selection,
)
from pilotfish.cli.options.structures import StructureType, structure_syntax_list
from pilotfish.cli.output.answers import (
    CommandResult,
    example_epilog,
    format_key_values,
    print_result,
    require_finite_option,
    require_writable_file,
)
from pilotfish.cli.output.descriptions import format_columns, format_dynamics, format_states, skill_to_json
from pilotfish.cli.output.terminal import is_interactive, print_note, progress_bar
from pilotfish.demonstrations import Demonstration, diagnose
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.io import content_hash, save_skill
from pilotfish.models import (
    MAX_ITERATIONS,
    MAX_RESTARTS,
    MAX_STATES,
    Censoring,
    DurationModel,
    EMSettings,
    Fit,
    Initialisation,
    KMeans,
    TimeBins,
    fitted_covariance_parameter_count,
    relevance,
    select_frames,
)
from pilotfish.models.durations import DISTRIBUTIONS

SEMI_MARKOV = "semi-markov"
DYNAMICS = (SEMI_MARKOV, "markov", "mixture")
INITIALISATIONS = ("time-bins", "k-means")
RESTART_JITTER = 0.5  # share of a bin, when several beginnings are tried


@dataclass(frozen=True, slots=True)
class LearnOptions:
    """What the options say."""

    folder: str
    out: Path
    states: int
    structure: CovarianceStructure
    dynamics: str
    durations: str | None
    censoring: str | None
    riemannian: bool
    drop_distractors: bool
    initialisation: str
    regularisation: float
    max_iterations: int
    restarts: int
    seed: int
    only: str
    velocities: bool
    force: bool


@click.command(
    epilog=example_epilog("pilotfish learn dataset:valve --only 0-3 --structure semi-tied --out valve.skill")
)
@click.argument("folder")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="The skill file to write.")
@click.option(
    "--states", type=click.IntRange(1, MAX_STATES), default=7, show_default=True, help="How many states."
)
@click.option(
    "--structure",
    type=StructureType(),
    default="full",
    show_default=True,
    help=f"What covariances may look like: {structure_syntax_list()}. Semi-tied states share their directions, mfa "
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
    type=click.Choice((VITERBI, *DISTRIBUTIONS)),
    help="How long semi-markov states last: counted along the best path of a Markov fit, or of a law that is "
    "fitted together with all else.  [default: counted]",
)
@click.option(
    "--censoring",
    type=click.Choice(tuple(Censoring)),
    help="Which visits recordings cut off, where durations are fitted.  [default: right]",
)
@click.option(
    "--riemannian/--euclidean",
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
    "--initialisation",
    type=click.Choice(INITIALISATIONS),
    default="time-bins",
    show_default=True,
    help="The first guess: demonstrations cut into equal times, or clusters of points.",
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
    help="At most so many iterations from each beginning.",
)
@click.option(
    "--restarts",
    type=click.IntRange(1, MAX_RESTARTS),
    default=1,
    show_default=True,
    help="Beginnings to try; the most likely result wins. Above 1, time bins are cut at random.",
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
    help="Add the speed of every column where the recording has none; replay needs it.",
)
@click.option("--force", is_flag=True, help="Replace the skill file if it is there already.")
@print_result
def learn(**options: Any) -> CommandResult:
    """Learn a skill from the recordings in FOLDER and write it to a file.

    FOLDER may also be dataset:NAME; `pilotfish data list` shows the names.
    """
    arguments = LearnOptions(**options)
    require_writable_file(
        arguments.out, force=arguments.force, inputs=recording_files(Path(arguments.folder))
    )
    durations = _duration_model(arguments)
    demonstrations = prepare_demonstrations(
        select_demonstrations(load_demonstrations(arguments.folder), arguments.only),
        riemannian=arguments.riemannian,
        velocities=arguments.velocities,
    )
    _print_warnings(demonstrations)
    fit = _fit(demonstrations, durations, arguments)
    dropped_frames: tuple[str, ...] = ()
    if arguments.drop_distractors:
        fit, dropped_frames = _drop_distractors(fit, demonstrations, durations, arguments)
    save_skill(fit.skill, arguments.out, overwrite=arguments.force, use_free_name=True)
    return _to_result(fit, dropped_frames, arguments)


def _drop_distractors(
    fit: Fit,
    demonstrations: Sequence[Demonstration],
    durations: DurationModel | None,
    arguments: LearnOptions,
) -> tuple[Fit, tuple[str, ...]]:
    """Learned anew without the frames that matter at no state, which are named; the same when all matter."""
    if len(fit.skill.frame_names) < 2:
        return fit, ()
    frame_relevance = relevance(fit.skill, demonstrations)
    if not (dropped_frames := frame_relevance.distractors):
        return fit, ()
    refitted = _fit(select_frames(demonstrations, frame_relevance), durations, arguments)
    note = f"dropped frames, they matter at no state: {', '.join(dropped_frames)}"
    skill = replace(refitted.skill, provenance=replace(refitted.skill.provenance, note=note))
    return replace(refitted, skill=skill), dropped_frames


def _duration_model(arguments: LearnOptions) -> DurationModel | None:
    duration_options = {"--durations": arguments.durations, "--censoring": arguments.censoring}
    if arguments.dynamics != SEMI_MARKOV:
        if given := [name for name, value in duration_options.items() if value]:
            raise click.UsageError(f"{given[0]} goes with --dynamics semi-markov, not {arguments.dynamics}")
        return None
    durations = arguments.durations or VITERBI
    if arguments.censoring and durations == VITERBI:
        raise click.UsageError(
            f"--censoring goes with --durations {', '.join(DISTRIBUTIONS)}; counting is as it is"
        )
    return duration_model(durations, arguments.censoring or "right")


def _fit(
    demonstrations: Sequence[Demonstration], durations: DurationModel | None, arguments: LearnOptions
) -> Fit:
    initialisation: Initialisation = (
        KMeans()
        if arguments.initialisation == "k-means"
        else TimeBins(RESTART_JITTER if arguments.restarts > 1 else 0.0)
    )
    settings = EMSettings(
        regularisation=arguments.regularisation,
        max_iterations=arguments.max_iterations,
        restarts=arguments.restarts,
    )
    with _progress(settings) as monitored:
        return models.learn(
            demonstrations,
            states=arguments.states,
            rng=np.random.default_rng(arguments.seed),
            dynamics=arguments.dynamics,
            durations=durations,
            structure=arguments.structure,
            initialisation=initialisation,
            settings=monitored,
        )


@contextmanager
def _progress(settings: EMSettings) -> Iterator[EMSettings]:
    """The same settings; a bar on stderr follows the iterations when a person watches."""
    if not is_interactive():
        yield settings
        return
    with progress_bar(settings.max_iterations * settings.restarts, "learning") as advance:
        yield replace(settings, callback=lambda _, gain: advance(f"log-likelihood {gain:.6g}"))


def _print_warnings(demonstrations: Sequence[Demonstration]) -> None:
    for finding in diagnose(demonstrations):
        if finding.severity == "warning":  # an error is refused by learning
            print_note(f"{finding.severity}: {finding.location} {finding.message}")


def _to_result(fit: Fit, dropped_frames: Sequence[str], arguments: LearnOptions) -> CommandResult:
    skill, convergence, structure = fit.skill, fit.convergence, arguments.structure
    parameters = fitted_covariance_parameter_count(structure, skill.covariances)
    name = content_hash(skill)
    facts = {
        "file": str(arguments.out),
        "content_hash": name,
        **skill_to_json(skill),
        "reason": convergence.reason,
        "dropped_states": list(convergence.dropped),
        "dropped_frames": list(dropped_frames),
        "covariance_parameters": parameters,
    }
    status = "converged" if convergence.converged else "not converged"
    rows = [
        (
            "demonstrations",
            f"{len(skill.provenance.demonstrations)}, {skill.provenance.datapoints} datapoints",
        ),
        ("columns", f"{format_columns(skill.layout)}, every {skill.period:g} s"),
        (
            "log-likelihood",
            f"{skill.provenance.log_likelihood:.6g} after {convergence.iterations} iterations",
        ),
        (status, convergence.reason),
        ("dropped", ", ".join(convergence.dropped) or "no state"),
        *([("dropped frames", ", ".join(dropped_frames) or "none")] if arguments.drop_distractors else []),
        ("time", format_dynamics(skill)),
        ("covariances", f"{structure.label}, {parameters} parameters"),
        ("file", str(arguments.out)),
        ("content hash", name),
    ]
    return CommandResult(f"{format_states(skill)}\n\n{format_key_values(rows)}", facts)
