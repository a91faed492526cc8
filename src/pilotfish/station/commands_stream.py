"""pilotfish stream: a model that grows while datapoints arrive, and the skill that it is."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import click
import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.models import MOST_STATES, learn, online
from pilotfish.station.answers import Answer, answering, example, finite, require_new
from pilotfish.station.growing import Growth, Outputs, Watch, grow, layout_of
from pilotfish.station.output import remark
from pilotfish.station.sources import PREFIX, a_choice, chosen, prepared, recordings, recordings_in
from pilotfish.station.stops import SIGNALLED, stops
from pilotfish.station.stream_descriptions import described, growth_facts, growth_rows, model_facts
from pilotfish.station.stream_lines import Columns, Piece, rows_arriving
from pilotfish.station.stream_options import learner_options
from pilotfish.station.stream_pieces import (
    first_rows,
    in_batches,
    pieces_of_recordings,
    until_refused,
)
from pilotfish.station.stream_settings import Wanted, option, settings_of, upkeep_of
from pilotfish.store import open_stream
from pilotfish.validation import is_folder, resolve_path

PERIOD, STATES, SEED = 0.01, 7, 0


@dataclass(frozen=True, slots=True)
class Choices:
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
    speeds: bool | None
    strict: bool
    save_every: float
    force: bool

    @property
    def recorded(self) -> bool:
        """Whether SOURCE holds recordings, not rows."""
        return self.source.startswith(PREFIX) or is_folder(self.source)


FILE = click.Path(path_type=Path)


@click.command(
    epilog=example(
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
    callback=finite,
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
    type=click.IntRange(1, MOST_STATES),
    help=f"How many states --from-batch learns.  [default: {STATES}]",
)
@click.option(
    "--seed", type=click.IntRange(min=0), help=f"Seed of all chance of --from-batch.  [default: {SEED}]"
)
@click.option(
    "--only", default="", callback=a_choice, help="Which recordings, such as 0-3 or 0,2.  [default: all]"
)
@click.option(
    "--speeds/--no-speeds",
    default=None,
    help="Add the speed of every column where the recording has none; replay needs it.  [default: speeds]",
)
@click.option("--strict", is_flag=True, help="Stop at the first line that is refused, with exit code 1.")
@click.option(
    "--save-every",
    type=click.FloatRange(min=0.0),
    callback=finite,
    default=0.0,
    help="Write the files every so many seconds too.  [default: at the end alone]",
)
@click.option("--force", is_flag=True, help="Replace files that are there already, that of --resume too.")
@answering
def stream(**options: Any) -> Answer:
    """Learn from SOURCE datapoint by datapoint, each used once and dropped, and keep what has grown.

    SOURCE is - for rows of numbers on standard input, a file of such rows, a folder of recordings, or
    dataset:NAME. Ctrl-C ends the stream; what was learned is kept.
    """
    learner = {field.name: options.pop(field.name) for field in fields(Wanted)}
    asked, wanted = Choices(**options), Wanted(**learner)
    _require_fitting(asked, wanted)
    _require_new(asked)
    growth = Growth(open_stream(asked.resume) if asked.resume else None)
    flow = (_recorded if asked.recorded else _live)(growth, asked, wanted)
    outputs = Outputs(asked.out, asked.skill, asked.save_every, asked.force)
    with stops() as stopped:
        watch = Watch(growth, outputs, asked.every, stopped)
        trouble = _grown(flow, watch, asked, stopped)
        return _ended(watch, asked, trouble)


@dataclass(frozen=True, slots=True)
class Flow:
    """Where datapoints come from, and the model that their columns begin."""

    settings: online.OnlineSettings
    begin: Callable[[Columns], online.OnlineModel]
    arriving: Callable[[Callable[[], int]], Iterator[Piece]]


def _live(growth: Growth, asked: Choices, wanted: Wanted) -> Flow:
    """Rows of numbers; the model begins when the first of them tells how wide they are."""
    model = growth.model
    settings = model.settings if model else settings_of(wanted)
    width = len(model.frame_names) * model.layout.width if model else None

    def begin(columns: Columns) -> online.OnlineModel:
        return online.online_model(settings, layout_of(columns), asked.period or PERIOD)

    return Flow(settings, begin, lambda stopped: rows_arriving(asked.source, width, stopped))


def _recorded(growth: Growth, asked: Choices, wanted: Wanted) -> Flow:
    """Recordings, some of which the model may begin with."""
    shown: Sequence[Demonstration] = prepared(
        chosen(recordings(asked.source), asked.only), sphere=False, speeds=asked.speeds is not False
    )
    if asked.from_batch:
        model, shown = _from_batch(shown, asked.from_batch, asked, wanted)
    else:
        model = growth.model or _empty(shown[0], settings_of(wanted))
    growth.model = model
    return Flow(model.settings, lambda _: model, lambda stopped: pieces_of_recordings(shown, stopped))


def _empty(demo: Demonstration, settings: online.OnlineSettings) -> online.OnlineModel:
    return online.online_model(settings, demo.layout, demo.period, tuple(frame.name for frame in demo.frames))


def _from_batch(
    shown: Sequence[Demonstration], first: int, asked: Choices, wanted: Wanted
) -> tuple[online.OnlineModel, Sequence[Demonstration]]:
    """What the first recordings teach at once, as a model, and those that are left."""
    if first > len(shown):
        raise InvalidInput(
            f"--from-batch is {first}, but there are {len(shown)} recordings; say at most that"
        )
    batch = shown[:first]
    states, seed = asked.states or STATES, asked.seed or SEED
    skill = learn(batch, states=states, rng=np.random.default_rng(seed)).skill
    guessed = online.penalties_from(skill, batch, upkeep=upkeep_of(wanted))
    return online.begin_from(skill, batch, settings_of(wanted, guessed)), shown[first:]


def _grown(flow: Flow, watch: Watch, asked: Choices, stopped: Callable[[], int]) -> InvalidInput | None:
    """Learns until the stream ends or breaks, or is stopped; what broke it."""
    arriving = first_rows(flow.arriving(stopped), asked.rows)
    wanted = until_refused(arriving) if asked.strict else arriving
    try:
        grow(in_batches(wanted, flow.settings.upkeep.batch), flow.begin, watch)
    except InvalidInput as error:
        if not watch.growth.observed:
            raise
        return error
    finally:
        watch.clear()
    return None


def _ended(watch: Watch, asked: Choices, trouble: InvalidInput | None) -> Answer:
    """The files are written; what has grown, and how the stream ended."""
    growth, model = watch.growth, watch.growth.model
    begun = asked.from_batch or asked.source == os.devnull  # there may be nothing to observe
    if model is None or not model.clusters or not (growth.observed or begun):
        return _nothing(growth, watch.stopped())
    files = watch.outputs.keep(model)
    skill = online.read_out(model)
    stopped = watch.stopped()  # a signal that comes while files are written counts too
    if trouble:
        watch.tell(f"the stream broke: {trouble}")
    rows = [*growth_rows(growth), *files.items()]
    facts = {
        **model_facts(model, skill),
        **growth_facts(growth),
        "growth": watch.marks,
        "files": files,
        "trouble": str(trouble) if trouble else None,
        "stopped": signal.Signals(stopped).name if stopped else None,
    }
    failed = trouble is not None or watch.outputs.taken or (asked.strict and growth.refused > 0)
    return Answer(described(model, skill, rows), facts, code=SIGNALLED + stopped if stopped else int(failed))


def _nothing(growth: Growth, stopped: int) -> Answer:
    """No datapoint came: a refusal, unless someone stopped the stream.    Raises: InvalidInput."""
    if stopped:
        remark("stopped before the first datapoint; no file was written")
        return Answer("", growth_facts(growth), code=SIGNALLED + stopped)
    if growth.refusals:
        first = growth.refusals[0]
        raise InvalidInput(
            f"none of {growth.refused} lines is a datapoint: line {first.line}: {first.reason}; no file was "
            "written"
        )
    raise InvalidInput("no datapoint came, expected at least one row of numbers; no file was written")


def _require_fitting(asked: Choices, wanted: Wanted) -> None:
    """Raises: click.UsageError, when options are at odds with the source or each other."""
    batched = _given(asked, "states", "seed")
    recorded = [*_given(asked, "from_batch", "speeds"), *(["--only"] if asked.only else [])]
    fixed = [*wanted.given, *_given(asked, "from_batch", "period")]
    if asked.resume and fixed:
        raise click.UsageError(f"{fixed[0]} is as the file of --resume has it; leave it out, or begin anew")
    if recorded and not asked.recorded:
        raise click.UsageError(
            f"{recorded[0]} goes with a folder of recordings or dataset:NAME, not with rows"
        )
    if batched and not asked.from_batch:
        raise click.UsageError(f"{batched[0]} goes with --from-batch, which learns some recordings at once")
    if asked.recorded and asked.period:
        raise click.UsageError("--period goes with rows of numbers; recordings have their own")
    if asked.save_every and not (asked.out or asked.skill):
        raise click.UsageError("--save-every goes with --out or --skill, which name what to save")


def _given(asked: Choices, *names: str) -> list[str]:
    return [option(name) for name in names if getattr(asked, name) is not None]


def _require_new(asked: Choices) -> None:
    """No output is what is read, but for the file of --resume, which the model may replace by force."""
    source = Path(asked.source)
    read = recordings_in(source) if is_folder(source) else [source]
    if asked.resume and not (asked.out and resolve_path(asked.out) == resolve_path(asked.resume)):
        read.append(asked.resume)
    require_new(asked.out, asked.skill, force=asked.force, inputs=read)
