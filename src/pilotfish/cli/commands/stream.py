"""pilotfish stream: learn an online model while datapoints arrive."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np

from pilotfish.cli.options.demonstrations import (
    DATASET_PREFIX,
    demonstration_files,
    load_demonstrations,
    only_option,
    prepare_demonstrations,
    select_demonstrations,
)
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_finite_option,
    require_writable_file,
)
from pilotfish.cli.output.skill_descriptions import state_blocks
from pilotfish.cli.output.tables import key_value_table
from pilotfish.cli.output.terminal import print_note
from pilotfish.cli.stream.batches import demonstration_events, regroup_batches, stop_at_rejection, take_rows
from pilotfish.cli.stream.learner_options import (
    Options,
    build_maintenance,
    build_settings,
    given_options,
    learner_options,
)
from pilotfish.cli.stream.lines import ColumnHeader, StreamEvent, read_stream
from pilotfish.cli.stream.model_descriptions import online_model_rows, online_model_to_json
from pilotfish.cli.stream.outputs import SessionOutputs
from pilotfish.cli.stream.session import ModelFactory, StreamSession, infer_layout
from pilotfish.cli.stream.signals import SIGNAL_EXIT_OFFSET, catch_signals
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io import is_folder, open_stream, resolve_path
from pilotfish.models import MAX_STATES, learn, online

PERIOD, STATES, SEED = 0.01, 7, 0  # defaults; None means not given, because each option excludes others
FILE = click.Path(path_type=Path)
Events = Callable[[Callable[[], int]], Iterator[StreamEvent]]  # from a function that returns whether to stop


@click.command(
    epilog=example_epilog(
        "pilotfish stream dataset:valve --from-batch 4 --out valve.stream --skill online.skill",
        "robot | pilotfish stream - --learner dp-gmm --cluster .04 --noise 1e-4 --out now.stream",
    )
)
@click.argument("source")
@click.option("--out", type=FILE, help="Stream file to write: the online model, which --resume continues.")
@click.option("--skill", type=FILE, help="Skill file to write: the online model, converted to a skill.")
@click.option("--resume", type=FILE, help="Stream file to continue, with its penalties and period.")
@learner_options
@click.option(
    "--period",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=require_finite_option,
    help=f"Time between rows of numbers [s].  [default: {PERIOD}]",
)
@click.option("--rows", type=click.IntRange(min=1), help="Maximum number of datapoints to read.")
@click.option(
    "--every", type=click.IntRange(min=1), help="Number of datapoints after which a progress line is printed."
)
@click.option(
    "--from-batch",
    type=click.IntRange(min=1),
    help="Number of demonstrations from which an initial model is learned offline, and from which penalties "
    "that are not given are estimated; the other demonstrations are streamed.",
)
@click.option(
    "--states",
    type=click.IntRange(1, MAX_STATES),
    help=f"Number of states of the initial model of --from-batch.  [default: {STATES}]",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    help=f"Seed of the random number generator of --from-batch.  [default: {SEED}]",
)
@only_option
@click.option(
    "--velocities/--no-velocities",
    default=None,
    help="Add velocities to demonstrations without them; `reproduce` needs them.  [default: velocities]",
)
@click.option("--strict", is_flag=True, help="Stop at the first rejected line, with exit code 1.")
@click.option(
    "--save-every",
    type=click.FloatRange(min=0.0),
    callback=require_finite_option,
    default=0.0,
    help="Time between saves of the files [s].  [default: only at the end]",
)
@click.option("--force", is_flag=True, help="Replace existing files, also the file of --resume.")
@print_result
def stream(source: str, **options: Any) -> CommandResult:
    """Learn an online model from SOURCE, one datapoint at a time.

    SOURCE is - for rows of numbers on standard input, a file of such rows, a folder of demonstrations, or
    dataset:NAME. Each datapoint is used once. Ctrl-C ends the stream and keeps what was learned.
    """
    is_recorded = source.startswith(DATASET_PREFIX) or is_folder(source)
    _validate_options(is_recorded, options)
    _validate_outputs(source, options)
    resumed = open_stream(options["resume"]) if options["resume"] else None
    outputs = SessionOutputs(options["out"], options["skill"], options["save_every"], options["force"])
    open_events = _open_demonstrations if is_recorded else _open_rows
    settings, model, create_model, events = open_events(source, resumed, options)
    with catch_signals() as stopped:
        session = StreamSession(model, outputs, options["every"], stopped)
        failure = _run(session, events(stopped), create_model, settings.maintenance.batch, options)
        may_be_empty = options["from_batch"] or source == os.devnull
        if session.model is None or not session.model.clusters or not (session.observed or may_be_empty):
            return _report_no_datapoint(session)
        return _finish(session, session.model, failure, options["strict"])


def _open_rows(
    source: str, resumed: online.OnlineModel | None, options: Options
) -> tuple[online.OnlineSettings, online.OnlineModel | None, ModelFactory, Events]:
    """Return settings, model, model factory and events of rows of numbers."""
    settings = resumed.settings if resumed else build_settings(options)
    width = len(resumed.frame_names) * resumed.layout.width if resumed else None

    def create_model(columns: ColumnHeader) -> online.OnlineModel:
        return online.online_model(settings, infer_layout(columns), options["period"] or PERIOD)

    return settings, resumed, create_model, lambda stopped: read_stream(source, width, stopped)


def _open_demonstrations(
    source: str, resumed: online.OnlineModel | None, options: Options
) -> tuple[online.OnlineSettings, online.OnlineModel, ModelFactory, Events]:
    """Return settings, model, model factory and events of demonstrations."""
    demonstrations = prepare_demonstrations(
        select_demonstrations(load_demonstrations(source), options["only"]),
        riemannian=False,
        velocities=options["velocities"] is not False,
    )
    if batch := options["from_batch"]:
        model = _fit_batch(demonstrations, batch, options)
        demonstrations = demonstrations[batch:]
    else:
        model = resumed or _empty_model(demonstrations[0], build_settings(options))
    return (
        model.settings,
        model,
        lambda _: model,
        lambda stopped: demonstration_events(demonstrations, stopped),
    )


def _empty_model(demo: Demonstration, settings: online.OnlineSettings) -> online.OnlineModel:
    return online.online_model(settings, demo.layout, demo.period, tuple(frame.name for frame in demo.frames))


def _fit_batch(demonstrations: tuple[Demonstration, ...], batch: int, options: Options) -> online.OnlineModel:
    """Learn the initial model of --from-batch from the first demonstrations."""
    if batch > len(demonstrations):
        raise InvalidInput(
            f"--from-batch is {batch}, expected at most {len(demonstrations)}, the number of demonstrations"
        )
    first = demonstrations[:batch]
    rng = np.random.default_rng(options["seed"] or SEED)
    skill = learn(first, states=options["states"] or STATES, rng=rng).skill
    estimate = online.estimate_penalties(skill, first, maintenance=build_maintenance(options))
    return online.from_batch_fit(skill, first, build_settings(options, estimate))


def _run(
    session: StreamSession,
    events: Iterator[StreamEvent],
    create_model: ModelFactory,
    batch: int,
    options: Options,
) -> InvalidInput | None:
    """Run the session; return the failure that ended the stream, if datapoints came before it."""
    events = take_rows(events, options["rows"])
    if options["strict"]:
        events = stop_at_rejection(events)
    try:
        session.run(regroup_batches(events, batch), create_model)
    except InvalidInput as error:
        if not session.observed:
            raise
        return error
    finally:
        session.clear_status()
    return None


def _finish(
    session: StreamSession, model: online.OnlineModel, failure: InvalidInput | None, strict: bool
) -> CommandResult:
    """Write the files and describe the model."""
    files = session.outputs.save(model)
    skill = online.to_skill(model)
    stopped = session.stopped()  # also a signal that arrived while the files were written
    if failure:
        session.print_note(f"the stream failed: {failure}")
    data = {
        **online_model_to_json(model, skill),
        **session.to_json(),
        "history": session.history,
        "files": files,
        "error": str(failure) if failure else None,
        "stopped": signal.Signals(stopped).name if stopped else None,
    }
    rows = [*online_model_rows(model), *session.to_rows(), *files.items()]
    has_failed = failure is not None or session.outputs.was_renamed or (strict and session.rejected > 0)
    exit_code = SIGNAL_EXIT_OFFSET + stopped if stopped else int(has_failed)
    return CommandResult([*state_blocks(skill), key_value_table(rows)], data, exit_code)


def _report_no_datapoint(session: StreamSession) -> CommandResult:
    """Raise InvalidInput because no datapoint arrived, unless a signal stopped the stream."""
    if stopped := session.stopped():
        print_note("stopped before the first datapoint; no file was written")
        return CommandResult((), session.to_json(), exit_code=SIGNAL_EXIT_OFFSET + stopped)
    if session.rejected_lines:
        first = session.rejected_lines[0]
        raise InvalidInput(
            f"all {session.rejected} lines were rejected; line {first.line}: {first.reason}; "
            "no file was written"
        )
    raise InvalidInput(
        "the stream has no datapoint, expected at least one row of numbers; no file was written"
    )


def _validate_options(is_recorded: bool, options: Options) -> None:
    """Raise click.UsageError if options exclude each other or do not suit the source."""
    batch_only = given_options(options, ("states", "seed"))
    recorded_only = [
        *given_options(options, ("from_batch", "velocities")),
        *(["--only"] if options["only"] else []),
    ]
    fixed = [*given_options(options), *given_options(options, ("from_batch", "period"))]
    if options["resume"] and fixed:
        raise click.UsageError(
            f"{fixed[0]} is stored in the file of --resume; omit it, or start without --resume"
        )
    if recorded_only and not is_recorded:
        raise click.UsageError(
            f"{recorded_only[0]} needs a folder of demonstrations or dataset:NAME, not rows of numbers"
        )
    if batch_only and not options["from_batch"]:
        raise click.UsageError(f"{batch_only[0]} needs --from-batch, which learns an initial model offline")
    if is_recorded and options["period"]:
        raise click.UsageError("--period needs rows of numbers; demonstrations have their own period")
    if options["save_every"] and not (options["out"] or options["skill"]):
        raise click.UsageError("--save-every needs --out or --skill, the file to save")


def _validate_outputs(source: str, options: Options) -> None:
    """Check that outputs replace no input; the model may replace the file of --resume with --force."""
    inputs = demonstration_files(Path(source)) if is_folder(source) else [Path(source)]
    out, resume = options["out"], options["resume"]
    if resume and not (out and resolve_path(out) == resolve_path(resume)):
        inputs.append(resume)
    require_writable_file(out, options["skill"], force=options["force"], inputs=inputs)
