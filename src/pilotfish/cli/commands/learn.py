"""pilotfish learn: learn a skill from demonstrations."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from pilotfish import models
from pilotfish.cli.options.cluster import ClusterProgress, cluster_demonstrations, cluster_option
from pilotfish.cli.options.demonstrations import (
    demonstration_files,
    load_demonstrations,
    only_option,
    prepare_demonstrations,
    riemannian_option,
    select_demonstrations,
)
from pilotfish.cli.options.durations import DURATION_NAMES, DYNAMICS, duration_model
from pilotfish.cli.options.learning import regularisation_option, seed_option
from pilotfish.cli.options.structures import StructureType, structure_syntax_list
from pilotfish.cli.output.diagnostics import format_diagnostic
from pilotfish.cli.output.motion_notes import name_options
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_writable_file,
)
from pilotfish.cli.output.skill_descriptions import (
    format_columns,
    format_dynamics,
    skill_to_json,
    state_blocks,
)
from pilotfish.cli.output.tables import key_value_table
from pilotfish.cli.output.terminal import print_note, progress_bar
from pilotfish.demonstrations import Demonstration, diagnose
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.io import content_hash, save_skill
from pilotfish.models import (
    MAX_STATES,
    VITERBI,
    Censoring,
    DemonstrationGroup,
    DurationModel,
    EMSettings,
    Fit,
    KMeans,
    Partitions,
    TimeBins,
    default_structure,
    relevance,
    select_frames,
    structure_notes,
)

INITIALISATIONS = ("time-bins", "k-means")
RESTART_JITTER = 0.5  # of the bin edges, as a fraction of a bin, with more than one restart


@click.command(
    epilog=example_epilog("pilotfish learn dataset:valve --only 0-3 --structure semi-tied --out valve.skill")
)
@click.argument("folder")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Skill file to write.")
@click.option(
    "--states",
    type=click.IntRange(1, MAX_STATES),
    help="Number of states.  [default: 30, or one for every two steps of a short demonstration]",
)
@click.option(
    "--structure",
    type=StructureType(),
    help=f"Covariance structure: {structure_syntax_list()}.  [default: diagonal; full with --states]",
)
@click.option(
    "--dynamics",
    type=click.Choice(DYNAMICS),
    default="semi-markov",
    show_default=True,
    help="Model of the order of states; `reproduce` needs an order, which a mixture does not have.",
)
@click.option(
    "--durations",
    type=click.Choice(DURATION_NAMES),
    help="Durations of semi-Markov states: those on the Viterbi path of a Markov model, or a distribution "
    f"that is fitted by EM.  [default: {VITERBI}]",
)
@click.option(
    "--censoring",
    type=click.Choice([censoring.value for censoring in Censoring]),
    help="End of a demonstration at which a state may be cut off, for fitted durations.  [default: right]",
)
@riemannian_option
@click.option(
    "--drop-distractors",
    is_flag=True,
    help="Learn again without the frames whose relevance is 0 in every state.",
)
@click.option(
    "--initialisation",
    type=click.Choice(INITIALISATIONS),
    help="Initial states of EM: equal time bins of each demonstration, or clusters of datapoints.  [default: "
    "both, of which the likelier is kept; time-bins with --restarts]",
)
@regularisation_option
@click.option(
    "--max-iterations",
    type=click.IntRange(1, EMSettings.MAX_ITERATIONS),
    default=200,
    show_default=True,
    help="Maximum number of EM iterations per restart.",
)
@click.option(
    "--restarts",
    type=click.IntRange(1, EMSettings.MAX_RESTARTS),
    default=1,
    show_default=True,
    help="Number of EM runs, of which the most likely result is kept; above 1, time bins are random.",
)
@seed_option
@only_option
@cluster_option
@click.option(
    "--velocities/--no-velocities",
    default=True,
    show_default=True,
    help="Add velocities to demonstrations without them; `reproduce` needs them.",
)
@click.option("--force", is_flag=True, help="Replace an existing skill file.")
@print_result
def learn(folder: str, out: Path, force: bool, **options: Any) -> CommandResult:
    """Learn a skill from the demonstrations in FOLDER and write it to a file.

    FOLDER may also be a LeRobot data set that `pilotfish data export` wrote, or dataset:NAME; `pilotfish data
    list` lists the names.
    """
    require_writable_file(out, force=force, inputs=demonstration_files(Path(folder)))
    durations = _choose_duration_model(options["dynamics"], options["durations"], options["censoring"])
    dropped_frames: tuple[str, ...] = ()
    if options["cluster"]:
        progress = ClusterProgress()
        with cluster_demonstrations(folder, options, progress) as parts:
            fit = _fit(parts, durations, options, progress)
    else:
        demonstrations = prepare_demonstrations(
            select_demonstrations(load_demonstrations(folder), options["only"]),
            riemannian=options["riemannian"],
            velocities=options["velocities"],
        )
        _print_warnings(demonstrations, folder)
        fit = _fit(demonstrations, durations, options)
        if options["drop_distractors"]:
            fit, dropped_frames = _drop_distractors(fit, demonstrations, durations, options)
    save_skill(fit.skill, out, overwrite=force, use_free_name=True)
    structure = options["structure"] or default_structure(options["states"], options["dynamics"])
    notes = [*map(name_options, fit.active_bounds), *structure_notes(fit.skill)]
    for note in notes:
        print_note(f"note: {note}")
    return _to_result(fit, dropped_frames, out, structure, notes)


def _choose_duration_model(
    dynamics: str, durations: str | None, censoring: str | None
) -> DurationModel | None:
    if dynamics != models.SemiMarkovChain.name:
        given = {"--durations": durations, "--censoring": censoring}
        if names := [name for name, value in given.items() if value]:
            raise click.UsageError(
                f"{names[0]} needs --dynamics semi-markov, but the dynamics are {dynamics}"
            )
    if censoring and (durations or VITERBI) == VITERBI:
        names_with_censoring = ", ".join(DURATION_NAMES[1:])
        raise click.UsageError(
            f"--censoring needs --durations {names_with_censoring}; {VITERBI} does not model censoring"
        )
    return duration_model(durations or VITERBI, censoring or Censoring.RIGHT)


def _fit(
    demonstrations: Sequence[Demonstration] | Partitions[DemonstrationGroup],
    durations: DurationModel | None,
    options: Mapping[str, Any],
    progress: ClusterProgress | None = None,
) -> Fit:
    restarts, max_iterations = options["restarts"], options["max_iterations"]
    name = options["initialisation"] or ("time-bins" if restarts > 1 else None)
    initialisation: KMeans | TimeBins | None = None
    if name:
        bins = TimeBins(RESTART_JITTER if restarts > 1 else 0.0)
        initialisation = KMeans() if name == "k-means" else bins
    with progress_bar(max_iterations * (restarts if name else len(INITIALISATIONS)), "learning") as advance:
        if progress:
            progress.advance = advance
        return models.learn(
            demonstrations,
            dynamics=options["dynamics"],
            durations=durations,
            states=options["states"],
            rng=np.random.default_rng(options["seed"]),
            structure=options["structure"],
            initialisation=initialisation,
            settings=EMSettings(
                regularisation=options["regularisation"],
                max_iterations=max_iterations,
                restarts=restarts,
                callback=progress.on_iteration if progress else _report_iteration(advance),
            ),
        )


def _report_iteration(advance: Callable[..., None]) -> Callable[[int, float], None]:
    return lambda _, log_likelihood: advance(f"log-likelihood {log_likelihood:.6g}")


def _drop_distractors(
    fit: Fit,
    demonstrations: Sequence[Demonstration],
    durations: DurationModel | None,
    options: Mapping[str, Any],
) -> tuple[Fit, tuple[str, ...]]:
    """Learn again without the distractors and return their names; return the fit itself if there are none."""
    if len(fit.skill.frame_names) < 2:
        return fit, ()
    frame_relevance = relevance(fit.skill, demonstrations)
    if not (dropped_frames := frame_relevance.distractors):
        return fit, ()
    refitted = _fit(select_frames(demonstrations, frame_relevance), durations, options)
    note = f"dropped frames of relevance 0: {', '.join(dropped_frames)}"
    skill = replace(refitted.skill, provenance=replace(refitted.skill.provenance, note=note))
    return replace(refitted, skill=skill), dropped_frames


def _print_warnings(demonstrations: Sequence[Demonstration], source: str) -> None:
    for diagnostic in diagnose(demonstrations):
        if diagnostic.severity == "warning":  # learning reports errors
            print_note(format_diagnostic(diagnostic, source))


def _to_result(
    fit: Fit, dropped_frames: Sequence[str], out: Path, structure: CovarianceStructure, notes: Sequence[str]
) -> CommandResult:
    skill, convergence, provenance = fit.skill, fit.convergence, fit.skill.provenance
    parameters = structure.fitted_parameter_count(skill.covariances)
    digest = content_hash(skill)
    data = {
        "file": str(out),
        "content_hash": digest,
        **skill_to_json(skill),
        "reason": convergence.reason,
        "dropped_states": list(convergence.dropped),
        "dropped_frames": list(dropped_frames),
        "covariance_parameters": parameters,
        "notes": list(notes),
    }
    rows = [
        ("demonstrations", f"{len(provenance.demonstrations)}, {provenance.datapoints} datapoints"),
        ("columns", f"{format_columns(skill.layout)}, every {skill.period:g} s"),
        ("log-likelihood", f"{provenance.log_likelihood:.6g} after {convergence.iterations} iterations"),
        ("converged" if convergence.converged else "not converged", convergence.reason),
        ("dropped states", ", ".join(convergence.dropped) or "none"),
        ("dropped frames", ", ".join(dropped_frames) or "none"),
        ("dynamics", format_dynamics(skill)),
        ("covariances", f"{structure.label}, {parameters} parameters"),
        ("file", str(out)),
        ("content hash", digest),
    ]
    return CommandResult([*state_blocks(skill), key_value_table(rows)], data)
