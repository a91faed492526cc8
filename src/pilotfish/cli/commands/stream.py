"""pilotfish stream: a model that grows while datapoints arrive, and the skill that it is."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import click
import numpy as np

from pilotfish.cli.options.sources import (
    DATASET_PREFIX,
    load_demonstrations,
    prepare_demonstrations,
    recording_files,
    select_demonstrations,
    validate_selection,
)
from pilotfish.cli.output.answers import (
    CommandResult,
    example_epilog,
    print_result,
    require_finite_option,
    require_writable_file,
)
from pilotfish.cli.output.terminal import print_note
from pilotfish.cli.stream.batches import demonstration_events, regroup_batches, stop_at_rejection, take_rows
from pilotfish.cli.stream.descriptions import described, online_model_facts, session_facts, session_rows
from pilotfish.cli.stream.lines import ColumnHeader, StreamEvent, read_stream
from pilotfish.cli.stream.options import learner_options
from pilotfish.cli.stream.session import OutputFiles, SessionMonitor, StreamSession, infer_layout, run_session
from pilotfish.cli.stream.settings import LearnerOptions, build_maintenance, build_settings, option_name
from pilotfish.cli.stream.signals import SIGNAL_EXIT_OFFSET, catch_signals
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io import is_folder, open_stream, resolve_path
from pilotfish.models import MAX_STATES, learn, online

PERIOD, STATES, SEED = 0.01, 7, 0


@dataclass(frozen=True, slots=True)
class StreamOptions:
    """What the options say, but for those of the learner; None is not given."""

    source: str
    out: Path | None
    skill: Path | None
    resume: Path | None
    period: float | None
    rows: int | None
    every: int | None
    from_batch: int | None
    states: int | None
    seed: int | None
    only: str
    velocities: bool | None
    strict: bool
    save_every: float
    force: bool

    @property
    def recorded(self) -> bool:
        """Whether SOURCE holds recordings, not rows."""
        return self.source.startswith(DATASET_PREFIX) or is_folder(self.source)


FILE = click.Path(path_type=Path)


@click.command(
    epilog=example_epilog(
        "pilotfish stream dataset:valve --from-batch 4 --out valve.stream --skill grown.skill",
        "robot | pilotfish stream - --learner dp-gmm --cluster .04 --noise 1e-4 --out now.stream",
    )
)
@click.argument("source")
@click.option("--out", type=FILE, help="The stream file to write: the model, to go on from.")
@click.option("--skill", type=FILE, help="The skill file to write: what the model reads out as.")
@click.option("--resume", type=FILE, help="A stream file to go on from; it has the penalties and the period.")
@learner_options
@click.option(
    "--period",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=require_finite_option,
    help=f"The time between rows of numbers [s].  [default: {PERIOD}]",
)
@click.option("--rows", type=click.IntRange(min=1), help="Stop after so many datapoints.")
@click.option("--every", type=click.IntRange(min=1), help="Print a line each so many datapoints.")
@click.option(
    "--from-batch",
    type=click.IntRange(min=1),
    help="Of recordings, learn the first so many at once, begin from that, and stream the rest; penalties "
    "that are not given are guessed from them.",
)
@click.option(
    "--states",
    type=click.IntRange(1, MAX_STATES),
    help=f"How many states --from-batch learns.  [default: {STATES}]",
)
@click.option(
    "--seed", type=click.IntRange(min=0), help=f"Seed of all chance of --from-batch.  [default: {SEED}]"
)
@click.option(
    "--only",
    default="",
    callback=validate_selection,
    help="Which recordings, such as 0-3 or 0,2.  [default: all]",
)
@click.option(
    "--velocities/--no-velocities",
    default=None,
    help="Add the speed of every column where the recording has none; replay needs it.  [default: velocities]",
)
@click.option("--strict", is_flag=True, help="Stop at the first line that is refused, with exit code 1.")
@click.option(
    "--save-every",
    type=click.FloatRange(min=0.0),
    callback=require_finite_option,
    default=0.0,
    help="Write the files every so many seconds too.  [default: at the end alone]",
)
@click.option("--force", is_flag=True, help="Replace files that are there already, that of --resume too.")
@print_result
def stream(**options: Any) -> CommandResult:
    """Learn from SOURCE datapoint by datapoint, each used once and dropped, and keep what has grown.

    SOURCE is - for rows of numbers on standard input, a file of such rows, a folder of recordings, or
    dataset:NAME. Ctrl-C ends the stream; what was learned is kept.
    """
    learner = {field.name: options.pop(field.name) for field in fields(LearnerOptions)}
    choice, learner_choice = StreamOptions(**options), LearnerOptions(**learner)
    _validate_options(choice, learner_choice)
    _validate_outputs(choice)
    session = StreamSession(open_stream(choice.resume) if choice.resume else None)
    stream_source = (_recording_source if choice.recorded else _row_source)(session, choice, learner_choice)
    outputs = OutputFiles(choice.out, choice.skill, choice.save_every, choice.force)
    with catch_signals() as stopped:
        monitor = SessionMonitor(session, outputs, choice.every, stopped)
        stream_error = _run(stream_source, monitor, choice, stopped)
        return _finish(monitor, choice, stream_error)


@dataclass(frozen=True, slots=True)
class StreamSource:
    """Where datapoints come from, and the model that their columns begin."""

    settings: online.OnlineSettings
    create_model: Callable[[ColumnHeader], online.OnlineModel]
    events: Callable[[Callable[[], int]], Iterator[StreamEvent]]


def _row_source(
    session: StreamSession, choice: StreamOptions, learner_choice: LearnerOptions
) -> StreamSource:
    """Rows of numbers; the model begins when the first of them tells how wide they are."""
    model = session.model
    settings = model.settings if model else build_settings(learner_choice)
    width = len(model.frame_names) * model.layout.width if model else None

    def create_model(columns: ColumnHeader) -> online.OnlineModel:
        return online.online_model(settings, infer_layout(columns), choice.period or PERIOD)

    return StreamSource(settings, create_model, lambda stopped: read_stream(choice.source, width, stopped))


def _recording_source(
    session: StreamSession, choice: StreamOptions, learner_choice: LearnerOptions
) -> StreamSource:
    """Recordings, some of which the model may begin with."""
    shown: Sequence[Demonstration] = prepare_demonstrations(
        select_demonstrations(load_demonstrations(choice.source), choice.only),
        riemannian=False,
        velocities=choice.velocities is not False,
    )
    if choice.from_batch:
        model, shown = _fit_first_batch(shown, choice.from_batch, choice, learner_choice)
    else:
        model = session.model or _empty_model(shown[0], build_settings(learner_choice))
    session.model = model
    return StreamSource(model.settings, lambda _: model, lambda stopped: demonstration_events(shown, stopped))


def _empty_model(demo: Demonstration, settings: online.OnlineSettings) -> online.OnlineModel:
    return online.online_model(settings, demo.layout, demo.period, tuple(frame.name for frame in demo.frames))


def _fit_first_batch(
    shown: Sequence[Demonstration], first: int, choice: StreamOptions, learner_choice: LearnerOptions
) -> tuple[online.OnlineModel, Sequence[Demonstration]]:
    """What the first recordings teach at once, as a model, and those that are left."""
    if first > len(shown):
        raise InvalidInput(
            f"--from-batch is {first}, but there are {len(shown)} recordings; say at most that"
        )
    batch = shown[:first]
    states, seed = choice.states or STATES, choice.seed or SEED
    skill = learn(batch, states=states, rng=np.random.default_rng(seed)).skill
    estimated = online.estimate_penalties(skill, batch, maintenance=build_maintenance(learner_choice))
    return online.from_batch_fit(skill, batch, build_settings(learner_choice, estimated)), shown[first:]


def _run(
    stream_source: StreamSource, monitor: SessionMonitor, choice: StreamOptions, stopped: Callable[[], int]
) -> InvalidInput | None:
    """Learns until the stream ends or breaks, or is stopped; what broke it."""
    events = take_rows(stream_source.events(stopped), choice.rows)
    learner_choice = stop_at_rejection(events) if choice.strict else events
    try:
        run_session(
            regroup_batches(learner_choice, stream_source.settings.maintenance.batch),
            stream_source.create_model,
            monitor,
        )
    except InvalidInput as error:
        if not monitor.session.observed:
            raise
        return error
    finally:
        monitor.clear()
    return None


def _finish(
    monitor: SessionMonitor, choice: StreamOptions, stream_error: InvalidInput | None
) -> CommandResult:
    """The files are written; what has grown, and how the stream ended."""
    session, model = monitor.session, monitor.session.model
    begun = choice.from_batch or choice.source == os.devnull  # there may be nothing to observe
    if model is None or not model.clusters or not (session.observed or begun):
        return _report_no_datapoint(session, monitor.stopped())
    files = monitor.outputs.save(model)
    skill = online.to_skill(model)
    stopped = monitor.stopped()  # a signal that comes while files are written counts too
    if stream_error:
        monitor.print_note(f"the stream broke: {stream_error}")
    rows = [*session_rows(session), *files.items()]
    facts = {
        **online_model_facts(model, skill),
        **session_facts(session),
        "history": monitor.history,
        "files": files,
        "error": str(stream_error) if stream_error else None,
        "stopped": signal.Signals(stopped).name if stopped else None,
    }
    failed = stream_error is not None or monitor.outputs.renamed or (choice.strict and session.rejected > 0)
    return CommandResult(
        described(model, skill, rows),
        facts,
        exit_code=SIGNAL_EXIT_OFFSET + stopped if stopped else int(failed),
    )


def _report_no_datapoint(session: StreamSession, stopped: int) -> CommandResult:
    """No datapoint came: a refusal, unless someone stopped the stream.    Raises: InvalidInput."""
    if stopped:
        print_note("stopped before the first datapoint; no file was written")
        return CommandResult("", session_facts(session), exit_code=SIGNAL_EXIT_OFFSET + stopped)
    if session.rejected_lines:
        first = session.rejected_lines[0]
        raise InvalidInput(
            f"none of {session.rejected} lines is a datapoint: line {first.line}: {first.reason}; no file was "
            "written"
        )
    raise InvalidInput("no datapoint came, expected at least one row of numbers; no file was written")


def _validate_options(choice: StreamOptions, learner_choice: LearnerOptions) -> None:
    """Raises: click.UsageError, when options are at odds with the source or each other."""
    batched = _given(choice, "states", "seed")
    recorded = [*_given(choice, "from_batch", "velocities"), *(["--only"] if choice.only else [])]
    fixed = [*learner_choice.given, *_given(choice, "from_batch", "period")]
    if choice.resume and fixed:
        raise click.UsageError(f"{fixed[0]} is as the file of --resume has it; leave it out, or begin anew")
    if recorded and not choice.recorded:
        raise click.UsageError(
            f"{recorded[0]} goes with a folder of recordings or dataset:NAME, not with rows"
        )
    if batched and not choice.from_batch:
        raise click.UsageError(f"{batched[0]} goes with --from-batch, which learns some recordings at once")
    if choice.recorded and choice.period:
        raise click.UsageError("--period goes with rows of numbers; recordings have their own")
    if choice.save_every and not (choice.out or choice.skill):
        raise click.UsageError("--save-every goes with --out or --skill, which name what to save")


def _given(choice: StreamOptions, *names: str) -> list[str]:
    return [option_name(name) for name in names if getattr(choice, name) is not None]


def _validate_outputs(choice: StreamOptions) -> None:
    """No output is what is read, but for the file of --resume, which the model may replace by force."""
    source = Path(choice.source)
    read = recording_files(source) if is_folder(source) else [source]
    if choice.resume and not (choice.out and resolve_path(choice.out) == resolve_path(choice.resume)):
        read.append(choice.resume)
    require_writable_file(choice.out, choice.skill, force=choice.force, inputs=read)
