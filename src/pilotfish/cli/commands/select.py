"""pilotfish select: choose the number of states, the structure and the frames of a model."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from pilotfish.cli.commands.record import find_task
from pilotfish.cli.options.candidates import parse_candidates
from pilotfish.cli.options.cluster import cluster_option
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
from pilotfish.cli.options.workers import process_pool, require_one_pool, workers_option
from pilotfish.cli.output.figures import require_matplotlib, save_figure, validate_figure_path
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_writable_file,
)
from pilotfish.cli.output.selections import learn_command, likelihood_result, reproduction_result
from pilotfish.cli.output.terminal import progress_bar
from pilotfish.demonstrations import Demonstration
from pilotfish.models import VITERBI, Candidate, EMSettings, Selection
from pilotfish.models import select as score_candidates
from pilotfish.planning import (
    MAX_FOLDS,
    ReproductionSelection,
    default_candidates,
    select_by_reproduction,
)
from pilotfish.rendering import require_mujoco

if TYPE_CHECKING:
    from pilotfish.environments import Task

REPRODUCTION, LIKELIHOOD = "reproduction", "likelihood"
STATES = {REPRODUCTION: "15,20,30,40", LIKELIHOOD: "3:10"}
STRUCTURES = {REPRODUCTION: "diagonal,semi-tied", LIKELIHOOD: "full,diagonal,semi-tied"}
DEFAULT_SITUATIONS = 10


@click.command(
    name="select",
    epilog=example_epilog("pilotfish select dataset:valve --only 0-3 --out scores.png"),
)
@click.argument("folder")
@click.option(
    "--by",
    type=click.Choice((REPRODUCTION, LIKELIHOOD)),
    default=REPRODUCTION,
    show_default=True,
    help="Score of held-out demonstrations: errors of their reproductions, or their log-likelihood.",
)
@click.option(
    "--task",
    help="Task that the demonstrations show; models are then compared by success in simulated physics.",
)
@click.option(
    "--situations",
    type=click.IntRange(1, 10_000),
    help=f"Number of random situations of --task.  [default: {DEFAULT_SITUATIONS}]",
)
@click.option(
    "--states",
    help="Numbers of states, such as 7, 3:10 or 3,5,8:12.  [default: a few around that of `learn`; "
    f"{STATES[LIKELIHOOD]} by likelihood]",
)
@click.option(
    "--structures",
    help=f"Covariance structures, separated by commas: {structure_syntax_list()}.  [default: those that the "
    f"data support of full, diagonal, semi-tied; all three by likelihood]",
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
@workers_option
@cluster_option
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
def select(folder: str, by: str, out: Path | None, **options: Any) -> CommandResult:
    """Compare models of the demonstrations in FOLDER by cross-validation and select one.

    Every model is learned without some demonstrations, and scored on those, until each was held out once.
    The default of `learn` is kept unless another model reproduces significantly better.
    FOLDER may also be dataset:NAME.
    """
    if by == LIKELIHOOD and options["task"]:
        raise click.UsageError("--task compares by success, not by likelihood; leave out one of --task, --by")
    if options["situations"] and not options["task"]:
        raise click.UsageError("--situations needs a task to perform; give --task NAME")
    parse_candidates(*_candidate_options(by, options))  # reports mistakes before anything is read
    task = _find_task(options["task"]) if options["task"] else None
    if out:
        require_matplotlib()
    require_writable_file(out, force=options["force"])
    demonstrations = prepare_demonstrations(
        select_demonstrations(load_demonstrations(folder), options["only"]),
        riemannian=options["riemannian"],
        velocities=options["velocities"],
    )
    settings = EMSettings(regularisation=options["regularisation"], max_iterations=options["max_iterations"])
    candidates = _choose_candidates(demonstrations, by, options)
    selection, seconds = _score_candidates(demonstrations, candidates, settings, by, task, options)
    best = selection.best  # raises if no candidate could be learned
    if out:
        from pilotfish import plots

        plot: Callable[[Any], Any] = (
            plots.model_selection if by == LIKELIHOOD else plots.reproduction_selection
        )
        save_figure(plot(selection), out, overwrite=options["force"])
    if isinstance(selection, Selection):
        return likelihood_result(selection, seconds, out)
    commands = learn_command(best.candidate, folder, options)
    return reproduction_result(selection, commands, sum(seconds.values()), out)


def _find_task(name: str) -> "Task[Any]":
    require_mujoco()
    return find_task(name)


def _candidate_options(by: str, options: dict[str, Any]) -> tuple[str, str, str]:
    """Return the values of --states, --structures and --durations."""
    return (
        options["states"] or STATES[by],
        options["structures"] or STRUCTURES[by],
        options["durations"],
    )


def _choose_candidates(
    demonstrations: Sequence[Demonstration], by: str, options: dict[str, Any]
) -> list[Candidate]:
    """Return the candidates of the options, or those of `default_candidates` if none is given."""
    given = options["states"], options["structures"], options["durations"] != VITERBI
    if by == LIKELIHOOD or any(given):
        return parse_candidates(*_candidate_options(by, options))
    candidates = default_candidates(demonstrations)
    return [c for c in candidates if not (options["task"] and c.frames == "relevance")]


def _score_candidates(
    demonstrations: Sequence[Demonstration],
    candidates: Sequence[Candidate],
    settings: EMSettings,
    by: str,
    task: "Task[Any] | None",
    options: dict[str, Any],
) -> tuple[Selection | ReproductionSelection, dict[int, float]]:
    """Return the scores, and the time of each candidate by its id [s]: CPU time by likelihood."""
    seconds: dict[int, float] = dict.fromkeys(map(id, candidates), 0.0)
    clock = time.process_time if by == LIKELIHOOD else time.perf_counter
    count = options["situations"] or DEFAULT_SITUATIONS
    per_candidate = 1 if by == LIKELIHOOD else count if task else min(MAX_FOLDS, len(demonstrations))
    jobs = per_candidate * (len(candidates) + 1)
    with progress_bar(jobs, "selecting") as advance:
        last_time = [clock()]

        def record_time(candidate: Candidate) -> None:
            now = clock()
            seconds[id(candidate)] = seconds.get(id(candidate), 0.0) + now - last_time.pop()
            last_time.append(now)
            advance(candidate.label)

        rng = np.random.default_rng(options["seed"])
        common: dict[str, Any] = {"settings": settings, "callback": record_time}
        if by == LIKELIHOOD:
            return score_candidates(demonstrations, candidates, rng=rng, **common), seconds
        score = partial(select_by_reproduction, rng=rng)
        if task:
            from pilotfish.simulation import select_by_success

            score = partial(select_by_success, task=task, situations=count, seed=options["seed"])
        workers = require_one_pool(options["workers"], options["cluster"])
        with process_pool(workers, jobs) as executor:
            return score(demonstrations, candidates, executor=executor, **common), seconds
