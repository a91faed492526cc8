"""A model while a stream flows through it: what it learned and refused, what is shown and kept meanwhile."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from pilotfish.cli.output.answers import write_all
from pilotfish.cli.output.terminal import (
    CLEAR_LINE,
    WAIT_INTERVAL,
    is_interactive,
    is_json_output,
    print_failure,
    print_line,
    print_note,
    print_on_stderr,
    print_progress,
)
from pilotfish.cli.stream.batches import batch_slices
from pilotfish.cli.stream.lines import (
    ColumnHeader,
    DemonstrationBreak,
    DemonstrationRows,
    RejectedLine,
    Rows,
    StreamEvent,
)
from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout, position_layout
from pilotfish.errors import InvalidInput, OutputExists, SkillError
from pilotfish.io import save_skill, save_stream
from pilotfish.kernels import Assignments
from pilotfish.models import online
from pilotfish.types import Array, Float
from pilotfish.validation import short_list

MAX_REPORTED_LINES = 10  # refusals that are told in full
ModelFactory = Callable[[ColumnHeader], online.OnlineModel]


@dataclass(slots=True, eq=False)
class StreamSession:
    """A model, None before it is known what its columns are, and what became of the stream so far."""

    model: online.OnlineModel | None
    observed: int = 0
    rejected: int = 0
    rejected_lines: list[RejectedLine] = field(default_factory=list)  # the first of them
    merged: int = 0
    forgotten: int = 0
    started: float | None = None  # the clock at the first datapoint, and after the last
    ended: float = 0.0

    @property
    def rate(self) -> float:
        """Datapoints a second."""
        seconds = self.ended - self.started if self.started is not None else 0.0
        return self.observed / seconds if seconds > 0.0 else 0.0

    @property
    def line(self) -> str:
        """The model in one line."""
        if self.model is None or not self.model.clusters:
            return "no datapoint yet"
        d = self.model.dimensions
        dimensions = f"{d.min()}" if d.min() == d.max() else f"{d.min()} to {d.max()}"
        return (
            f"{self.model.datapoints} datapoints, {self.model.clusters} clusters, dimensions {dimensions}, "
            f"{self.rate:.0f} datapoints/s"
        )


@dataclass(slots=True)
class OutputFiles:
    """Files for the model and the skill that it is, every so many seconds; 0 is at the end alone.

    A file that this stream has written is replaced by the next; any other only by force.
    """

    model: Path | None
    skill: Path | None
    seconds: float = 0.0
    force: bool = False
    written_paths: set[Path] = field(default_factory=set)
    renamed: bool = False  # a file of this name appeared: the stream goes on under another one

    def save(self, model: online.OnlineModel) -> dict[str, str]:
        """Write the files, each also when another fails, and return them.    Raises: SkillError."""
        writes = []
        if out := self.model:
            writes.append(lambda: self._write("model", out, partial(save_stream, model)))
        if skill := self.skill:
            writes.append(lambda: self._write("skill", skill, partial(_save_skill, model)))
        write_all(*writes)
        named = {"out": self.model, "skill": self.skill}
        return {name: str(path) for name, path in named.items() if path}

    def _write(self, name: str, path: Path, save: Callable[..., None]) -> None:
        try:
            save(path, overwrite=self.force or path in self.written_paths, use_free_name=True)
        except OutputExists as error:
            self.renamed = True
            setattr(self, name, error.path)
            self.written_paths.add(error.path)
            raise
        self.written_paths.add(path)


def _save_skill(model: online.OnlineModel, path: Path, *, overwrite: bool, use_free_name: bool) -> None:
    save_skill(online.to_skill(model), path, overwrite=overwrite, use_free_name=use_free_name)


class SessionMonitor:
    """Looks at a growth every now and then: shows it to a person, keeps it in files.

    stopped tells whether a signal asked to stop; then no line waits for a reader any more.
    """

    def __init__(
        self,
        session: StreamSession,
        outputs: OutputFiles,
        every: int | None,
        stopped: Callable[[], int] = lambda: 0,
    ) -> None:
        self.session, self.outputs, self.every, self.stopped = session, outputs, every, stopped
        self.live = is_interactive()
        self.shown = self.kept = (0.0, 0)  # when, and at how many datapoints
        self.history: list[dict[str, float]] = []

    def update(self) -> None:
        """Shows and keeps what is due."""
        now, session = time.monotonic(), self.session
        if self.live and session.observed > self.shown[1] and now >= self.shown[0] + WAIT_INTERVAL:
            print_progress(session.line)
            self.shown = (now, session.observed)
        if self.outputs.seconds and session.observed > self.kept[1]:
            since = self.kept[0] or session.started or now
            if now >= since + self.outputs.seconds:
                self._keep(now)

    def print_note(self, text: str) -> None:
        """A line on stderr, in place of the one that is updated."""
        self.clear()
        print_note(text)

    def clear(self) -> None:
        if self.live and self.shown[1]:
            print_on_stderr(CLEAR_LINE, newline=False)

    def record_progress(self) -> None:
        """A line of growth, each so many datapoints."""
        session, model = self.session, self.session.model
        assert model is not None
        if is_json_output():
            self.history.append(
                {
                    "datapoints": model.datapoints,
                    "clusters": model.clusters,
                    "dimensions": int(model.dimensions.sum()),
                    "datapoints_per_second": session.rate,
                }
            )
        else:
            self.clear()
            print_line(session.line, self.stopped)

    @property
    def has_no_output(self) -> bool:
        """Whether no result reaches anyone: the stream writes no file and its lines cannot be printed."""
        return not (self.outputs.model or self.outputs.skill) and print_failure() is not None

    def _keep(self, now: float) -> None:
        model = self.session.model
        assert model is not None
        try:
            self.outputs.save(model)
        except SkillError as error:  # perhaps there is room again at the end
            self.print_note(f"not saved at {model.datapoints} datapoints: {error}")
        self.kept = (now, self.session.observed)


def run_session(events: Iterable[StreamEvent], create_model: ModelFactory, monitor: SessionMonitor) -> None:
    """All pieces are learned, in their order; make gives the model once columns are known.

    Raises: InvalidInput, when the stream breaks; what was learned before is in the growth.
    """
    session = monitor.session
    for event in events:
        match event:
            case ColumnHeader():
                if session.model is None:
                    session.model = create_model(event)
                validate_columns(session.model, event)
            case Rows(x):
                learn_rows(monitor, x)
            case DemonstrationRows(demonstration):
                record_update(monitor, *online.observe_demonstration(require_model(monitor), demonstration))
            case DemonstrationBreak():
                if session.model is not None:
                    session.model = online.begin_demonstration(session.model)
            case RejectedLine():
                record_rejection(monitor, event)
        monitor.update()
        if monitor.every and monitor.has_no_output:
            return


def learn_rows(monitor: SessionMonitor, x: Float[Array, "N *rest"]) -> None:
    """The growth after these datapoints."""
    model = require_model(monitor)
    seen = x.reshape(len(x), len(model.frame_names), model.layout.width)
    for cut in batch_slices(len(x), model.datapoints, monitor.every, model.parameters.batch):
        record_update(monitor, *online.observe_stream(require_model(monitor), seen[cut]))


def require_model(monitor: SessionMonitor) -> online.OnlineModel:
    """The model that is about to learn; the clock runs from its first datapoint on."""
    session = monitor.session
    session.started = session.started if session.started is not None else time.monotonic()
    assert session.model is not None, "columns come before rows"
    return session.model


def record_update(monitor: SessionMonitor, model: online.OnlineModel, went: Assignments) -> None:
    """The model is now this one, whose last datapoints went there."""
    session, count = monitor.session, len(went.cluster_ids)
    session.model, session.ended = model, time.monotonic()
    session.observed += count
    session.merged += int(np.sum(went.removed[:, 2] >= 0))
    session.forgotten += int(np.sum(went.removed[:, 2] < 0))
    if monitor.every and model.datapoints // monitor.every > (model.datapoints - count) // monitor.every:
        monitor.record_progress()


def record_rejection(monitor: SessionMonitor, rejected_line: RejectedLine) -> None:
    session = monitor.session
    session.rejected += 1
    if session.rejected <= MAX_REPORTED_LINES:
        session.rejected_lines.append(rejected_line)
        more = "; more are counted, not told" if session.rejected == MAX_REPORTED_LINES else ""
        monitor.print_note(f"line {rejected_line.line} is refused: {rejected_line.reason}{more}")


def infer_layout(columns: ColumnHeader) -> Layout:
    """What bare rows are: a position or pose, also with speeds, when their names say so; else numbers."""
    known = (position_layout(2), position_layout(3), pose_layout())
    for layout in (*known, *(plain.differentiate() for plain in known)):
        if layout.names == columns.names:
            return layout
    if columns.names:
        return Layout(tuple(Part(name, Quantity.SCALAR, 1, "1") for name in columns.names))
    return Layout((Part("column", Quantity.SCALAR, columns.width, "1"),))


def validate_columns(model: online.OnlineModel, columns: ColumnHeader) -> None:
    """Raises: InvalidInput, when the rows are of other columns than the model."""
    names = model.layout.names * len(model.frame_names)
    if columns.width != len(names) or (columns.names and columns.names != names):
        told = short_list(columns.names) if columns.names else f"{columns.width} numbers"
        raise InvalidInput(f"the rows have {told}, expected those of the model: {', '.join(names[:32])}")
