"""pilotfish stream: learn an online model while datapoints arrive."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
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
from pilotfish.cli.stream.batches import (
    attach_first_rows,
    demonstration_events,
    regroup_batches,
    stop_at_rejection,
    take_rows,
)
from pilotfish.cli.stream.learner_options import (
    Options,
    build_maintenance,
    build_settings,
    given_options,
    given_scales,
    learner_options,
    missing_penalties,
)
from pilotfish.cli.stream.lines import ColumnHeader, StreamEvent, read_stream
from pilotfish.cli.stream.model_descriptions import format_settings, online_model_rows, online_model_to_json
from pilotfish.cli.stream.outputs import SessionOutputs
from pilotfish.cli.stream.session import ModelFactory, StreamSession, infer_layout
from pilotfish.cli.stream.signals import SIGNAL_EXIT_OFFSET, catch_signals
from pilotfish.demonstrations import Demonstration, Layout, Quantity, demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io import is_folder, open_stream, resolve_path
from pilotfish.models import MAX_STATES, learn, online

PERIOD, STATES, SEED = 0.01, 7, 0  # defaults; None means not given, because each option excludes others
FROM_BATCH, FIRST_ROWS = 4, 200
FILE = click.Path(path_type=Path)
Events = Callable[[Callable[[], int]], Iterator[StreamEvent]]  # from a function that returns whether to stop


@click.command(
    epilog=example_epilog(
        "pilotfish stream dataset:valve --out valve.stream --skill online.skill",
        "robot | pilotfish stream - --out now.stream",
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
    type=click.IntRange(min=0),
    help="Number of demonstrations from which an initial model is learned offline, and from which scales and "
    "penalties that are not given are estimated; the others are streamed. 0 starts from nothing.  "
    f"[default: {FROM_BATCH}; 0 if all penalties are given]",
)
@click.option(
    "--first-rows",
    type=click.IntRange(min=1),
    help="Number of rows from which scales and penalties that are not given are estimated; less if the first "
    f"demonstration is shorter.  [default: {FIRST_ROWS}]",
)
@click.option(
    "--states",
    type=click.IntRange(1, MAX_STATES),
    help="Number of states of the initial model of --from-batch, or of the first rows from which penalties "
    f"are estimated.  [default: {STATES}]",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    help=f"Seed of the random number generator of --states.  [default: {SEED}]",
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

    Columns of different units are scaled, and penalties are estimated, from the first rows or demonstrations.
    """
    is_recorded = source.startswith(DATASET_PREFIX) or is_folder(source)
    _validate_options(is_recorded, options)
    _validate_outputs(source, options)
    resumed = open_stream(options["resume"]) if options["resume"] else None
    outputs = SessionOutputs(options["out"], options["skill"], options["save_every"], options["force"])
    open_events = _open_demonstrations if is_recorded else _open_rows
    maintenance = resumed.settings.maintenance if resumed else build_maintenance(options)
    model, create_model, first_rows, events = open_events(source, resumed, options)
    with catch_signals() as stopped:
        session = StreamSession(model, outputs, options["every"], stopped)
        chosen = attach_first_rows(_limit_events(events(stopped), options), first_rows)
        failure = _run(session, regroup_batches(chosen, maintenance.batch), create_model)
        may_be_empty = is_recorded or source == os.devnull
        if session.model is None or not session.model.clusters or not (session.observed or may_be_empty):
            return _report_no_datapoint(session)
        return _finish(session, session.model, failure, options["strict"])


def _open_rows(
    source: str, resumed: online.OnlineModel | None, options: Options
) -> tuple[online.OnlineModel | None, ModelFactory, int, Events]:
    """Return model, model factory, number of rows that the factory needs, and events of rows of numbers."""
    width = len(resumed.frame_names) * resumed.layout.width if resumed else None
    missing, scales = missing_penalties(options), given_scales(options)
    if resumed or not (missing or scales is True):
        given = scales if isinstance(scales, tuple) else None
        settings = resumed.settings if resumed else build_settings(options, scales=given)

        def create_model(columns: ColumnHeader) -> online.OnlineModel:
            return online.online_model(settings, infer_layout(columns), options["period"] or PERIOD)

        return resumed, create_model, 0, lambda stopped: read_stream(source, width, stopped)

    def create_scaled_model(columns: ColumnHeader) -> online.OnlineModel | None:
        return _model_of_first_rows(columns, options)

    count = options["first_rows"] or FIRST_ROWS
    return None, create_scaled_model, count, lambda stopped: read_stream(source, None, stopped)


def _model_of_first_rows(columns: ColumnHeader, options: Options) -> online.OnlineModel | None:
    """Return an empty model with scales and penalties estimated from the first rows; None without rows."""
    if columns.first_rows is None:
        return None
    layout, period = infer_layout(columns), options["period"] or PERIOD
    plain = Layout(tuple(replace(part, quantity=Quantity.SCALAR) for part in layout.parts))
    first = demonstration(columns.first_rows, period, plain, name="first rows")
    settings = _estimate_settings([first], options)
    print_note(
        f"from the first {len(first.x)} rows: {format_settings(settings, layout)}; --no-scale, --scales and "
        "the penalties change it"
    )
    return online.online_model(settings, layout, period)


def _estimate_settings(first: Sequence[Demonstration], options: Options) -> online.OnlineSettings:
    """Return settings with the scales and penalties that were not given estimated from demonstrations."""
    scales = given_scales(options)
    if not missing_penalties(options):
        chosen = online.estimate_scales(first) if scales is True else scales or None
        return build_settings(options, scales=chosen)
    estimate = online.estimate_settings(
        first,
        states=options["states"] or STATES,
        rng=np.random.default_rng(options["seed"] or SEED),
        maintenance=build_maintenance(options),
        scales=scales,
    )
    return build_settings(options, estimate)


def _open_demonstrations(
    source: str, resumed: online.OnlineModel | None, options: Options
) -> tuple[online.OnlineModel, ModelFactory, int, Events]:
    """Return model, model factory, no rows that the factory needs, and events of demonstrations."""
    demonstrations = prepare_demonstrations(
        select_demonstrations(load_demonstrations(source), options["only"]),
        riemannian=False,
        velocities=options["velocities"] is not False,
    )
    if resumed:
        model = resumed
    elif batch := _batch_size(len(demonstrations), options):
        model = _fit_batch(demonstrations[:batch], options)
        demonstrations = demonstrations[batch:]
    else:
        model = _empty_model(demonstrations[0], _estimate_settings(demonstrations[:FROM_BATCH], options))
    return model, lambda _: model, 0, lambda stopped: demonstration_events(demonstrations, stopped)


def _batch_size(available: int, options: Options) -> int:
    """Return the number of demonstrations of the initial model."""
    given: int | None = options["from_batch"]
    if given is None:
        return min(FROM_BATCH, available) if missing_penalties(options) else 0
    if given > available:
        raise InvalidInput(
            f"--from-batch is {given}, expected at most {available}, the number of demonstrations"
        )
    return given


def _empty_model(demo: Demonstration, settings: online.OnlineSettings) -> online.OnlineModel:
    return online.online_model(settings, demo.layout, demo.period, tuple(frame.name for frame in demo.frames))


def _fit_batch(first: tuple[Demonstration, ...], options: Options) -> online.OnlineModel:
    """Learn the initial model of --from-batch from the first demonstrations."""
    rng = np.random.default_rng(options["seed"] or SEED)
    skill = learn(first, states=options["states"] or STATES, rng=rng).skill
    estimate = online.estimate_penalties(
        skill, first, maintenance=build_maintenance(options), scales=given_scales(options)
    )
    return online.from_batch_fit(skill, first, build_settings(options, estimate))


def _limit_events(events: Iterator[StreamEvent], options: Options) -> Iterator[StreamEvent]:
    """Return the events up to the limits of --rows and --strict."""
    events = take_rows(events, options["rows"])
    return stop_at_rejection(events) if options["strict"] else events


def _run(
    session: StreamSession, events: Iterator[StreamEvent], create_model: ModelFactory
) -> InvalidInput | None:
    """Run the session; return the failure that ended the stream, if datapoints came before it."""
    try:
        session.run(events, create_model)
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
    estimate_only = given_options(options, ("states", "seed"))
    is_estimated = bool(missing_penalties(options)) and not options["resume"]
    given_scales(options)
    recorded_only = [
        *given_options(options, ("from_batch", "velocities")),
        *(["--only"] if options["only"] else []),
    ]
    fixed = [*given_options(options), *given_options(options, ("from_batch", "first_rows", "period"))]
    if options["resume"] and fixed:
        raise click.UsageError(
            f"{fixed[0]} is stored in the file of --resume; omit it, or start without --resume"
        )
    if recorded_only and not is_recorded:
        raise click.UsageError(
            f"{recorded_only[0]} needs a folder of demonstrations or dataset:NAME, not rows of numbers"
        )
    if estimate_only and not (options["from_batch"] or is_estimated):
        raise click.UsageError(
            f"{estimate_only[0]} needs --from-batch, which learns an initial model offline, or estimated "
            "penalties"
        )
    if options["first_rows"] and is_recorded:
        raise click.UsageError("--first-rows needs rows of numbers; for demonstrations give --from-batch")
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
