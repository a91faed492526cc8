"""Session of `pilotfish stream`: learn from events until the stream ends, fails or is stopped.

Pipeline. Each stage is a generator; a later stage requests the next event from the earlier one:

    read_chunks -> split_lines -> parse_lines -> take_rows -> stop_at_rejection -> attach_first_rows
        -> regroup_batches -> run

Demonstrations of a folder or data set enter at take_rows. Nothing runs in the background: while the session
waits for input, the process waits in `select` in `read_chunks`, for at most WAIT_INTERVAL. After that time an
"idle" event passes through the pipeline, so that the status line, periodic saves and signals are handled
although no data arrives.

First rows. Scales and penalties that were not given are estimated from the first rows. `attach_first_rows`
holds them back until there are enough of them, or until the first demonstration, the stream or the session
ends. The model is then created from them and learns them as any others. What arrives later changes neither
scales nor penalties, so the result depends on the rows only, never on arrival times.

Batches. The learner assigns a mini-batch of datapoints before it updates subspaces, so batch boundaries
change the result. `regroup_batches` holds rows back until a batch is full; boundaries depend only on the
rows and on where demonstrations begin, never on arrival times. `batch_slices` cuts at multiples of
--every, but only between batches.

Invariants:
    - The model is complete after every event: it is the model of all datapoints before, bit for bit as
      `online.observe_stream` gives it. It can therefore be saved at any time.
    - A rejected line changes no state but the counters.
    - `datapoints` of the model counts all datapoints of its life, `observed` those of this session.

Signals. Inside the session, a signal sets the number that `stopped` returns (`catch_signals`). It raises no
exception, because an exception inside an update would lose the datapoints of the batch. `read_chunks` checks
`stopped` before and after each wait; the stages after it then see the end of the stream, and the rows that
wait for a full batch are learned. A last line without a line break is dropped, because it may be
incomplete. The command then writes its files, prints the summary and exits with 128 plus the signal number.
After a signal, printing no longer waits for a reader.

Failures. InvalidInput from a source ends the session; the rows before it are learned and saved. A periodic
save that fails is reported, and the session continues. If a reader of --every closes its pipe, the session
continues only if it writes files.

Keep in step: a new kind of event needs a case in `StreamSession.observe`, and in `take_rows` and
`regroup_batches` if it carries datapoints.
"""

import time
from collections.abc import Callable, Iterable

import numpy as np

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
from pilotfish.cli.stream.lines import ColumnHeader, RejectedLine, Rows, StreamEvent
from pilotfish.cli.stream.outputs import SessionOutputs
from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    pose_layout,
    position_layout,
)
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.kernels import Assignments
from pilotfish.models import online
from pilotfish.validation import short_list

MAX_REPORTED_LINES = 10  # rejected lines that are reported in full
ModelFactory = Callable[[ColumnHeader], online.OnlineModel | None]  # None for a stream without rows


class StreamSession:
    """Online model that learns from events, with counters, a status line and periodic saves.

    Attributes:
        model: Model of all datapoints so far; None until its columns are known.
        outputs: Files to save.
        every: Interval between printed lines [datapoints]; None prints none.
        stopped: Returns the number of the signal that stops the session, or 0.
        observed: Number of datapoints of this session.
        rejected: Number of rejected lines.
        rejected_lines: The first MAX_REPORTED_LINES rejected lines.
        merged: Number of clusters that were merged into another one.
        forgotten: Number of clusters that were removed.
        history: Progress at each multiple of `every`, for programs.
    """

    def __init__(
        self,
        model: online.OnlineModel | None,
        outputs: SessionOutputs,
        every: int | None,
        stopped: Callable[[], int] = lambda: 0,
    ) -> None:
        self.model, self.outputs, self.every, self.stopped = model, outputs, every, stopped
        self.observed = self.rejected = self.merged = self.forgotten = 0
        self.rejected_lines: list[RejectedLine] = []
        self.history: list[dict[str, float]] = []
        self._is_interactive = is_interactive()
        self._first_time: float | None = None  # monotonic clock [s] before the first datapoint
        self._last_time = 0.0  # after the last datapoint
        self._printed = self._saved = (0.0, 0)  # time [s] and datapoints of the last status line, and save

    @property
    def rate(self) -> float:
        """Datapoints per second."""
        seconds = self._last_time - self._first_time if self._first_time is not None else 0.0
        return self.observed / seconds if seconds > 0.0 else 0.0

    @property
    def status(self) -> str:
        """The model in one line."""
        if self.model is None or not self.model.clusters:
            return "no datapoint yet"
        d = self.model.dimensions
        dimensions = f"{d.min()}" if d.min() == d.max() else f"{d.min()} to {d.max()}"
        return (
            f"{self.model.datapoints} datapoints, {self.model.clusters} clusters, dimensions {dimensions}, "
            f"{self.rate:.0f} datapoints/s"
        )

    def run(self, events: Iterable[StreamEvent], create_model: ModelFactory) -> None:
        """Observe all events in order.

        Args:
            events: Events of the stream.
            create_model: Creates the model when the columns are known.

        Raises:
            InvalidInput: If the stream fails; the model has learned the events before the failure.
        """
        for event in events:
            self.observe(event, create_model)
            self._print_and_save()
            if self.every and self._has_no_output():
                return

    def observe(self, event: StreamEvent, create_model: ModelFactory) -> None:
        """Update the model and the counters with one event."""
        match event:
            case ColumnHeader():
                if self.model is None:
                    self.model = create_model(event)
                if self.model is not None:
                    validate_columns(self.model, event)
            case np.ndarray():  # before the text, which it cannot be compared with
                self._observe_rows(event)
            case Demonstration():
                self._record_update(*online.observe_demonstration(self._start_clock(), event))
            case "new demonstration":
                if self.model is not None:
                    self.model = online.begin_demonstration(self.model)
            case RejectedLine():
                self._record_rejection(event)

    def print_note(self, text: str) -> None:
        """Print a line on stderr in place of the status line."""
        self.clear_status()
        print_note(text)

    def clear_status(self) -> None:
        """Remove the status line."""
        if self._is_interactive and self._printed[1]:
            print_on_stderr(CLEAR_LINE, newline=False)

    def to_json(self) -> dict[str, object]:
        """Return the counters as a JSON object."""
        return {
            "observed": self.observed,
            "rejected": self.rejected,
            "rejected_lines": [{"line": r.line, "reason": r.reason} for r in self.rejected_lines],
            "merged": self.merged,
            "forgotten": self.forgotten,
            "datapoints_per_second": self.rate,
        }

    def to_rows(self) -> list[tuple[str, str]]:
        """Return the counters as keys and values, for people."""
        return [
            ("observed", f"{self.observed} datapoints, {self.rate:.0f} per second"),
            ("rejected", f"{self.rejected} lines"),
            ("merged", f"{self.merged} clusters, {self.forgotten} forgotten"),
        ]

    def _observe_rows(self, rows: Rows) -> None:
        model = self._start_clock()
        x = rows.reshape(len(rows), len(model.frame_names), model.layout.width)
        for part in batch_slices(len(rows), model.datapoints, self.every, model.parameters.batch):
            assert self.model is not None
            self._record_update(*online.observe_stream(self.model, x[part]))

    def _start_clock(self) -> online.OnlineModel:
        if self._first_time is None:
            self._first_time = time.monotonic()
        assert self.model is not None, "a column header comes before rows"
        return self.model

    def _record_update(self, model: online.OnlineModel, assignments: Assignments) -> None:
        count = len(assignments.cluster_ids)
        self.model, self._last_time = model, time.monotonic()
        self.observed += count
        self.merged += int(np.sum(assignments.removed[:, 2] >= 0))
        self.forgotten += int(np.sum(assignments.removed[:, 2] < 0))
        if self.every and model.datapoints // self.every > (model.datapoints - count) // self.every:
            self._report_progress(model)

    def _record_rejection(self, rejected: RejectedLine) -> None:
        self.rejected += 1
        if self.rejected <= MAX_REPORTED_LINES:
            self.rejected_lines.append(rejected)
            rest = "; further lines are only counted" if self.rejected == MAX_REPORTED_LINES else ""
            self.print_note(f"line {rejected.line} is rejected: {rejected.reason}{rest}")

    def _report_progress(self, model: online.OnlineModel) -> None:
        """Print a line of --every, or keep it for --json."""
        if not is_json_output():
            self.clear_status()
            print_line(self.status, self.stopped)
            return
        self.history.append(
            {
                "datapoints": model.datapoints,
                "clusters": model.clusters,
                "dimensions": int(model.dimensions.sum()),
                "datapoints_per_second": self.rate,
            }
        )

    def _print_and_save(self) -> None:
        """Update the status line and save the files, if they are due."""
        now = time.monotonic()
        time_printed, observed_printed = self._printed
        is_due = now >= time_printed + WAIT_INTERVAL and self.observed > observed_printed
        if self._is_interactive and is_due:
            print_progress(self.status)
            self._printed = (now, self.observed)
        if self.outputs.interval and self.observed > self._saved[1]:
            since = self._saved[0] or self._first_time or now
            if now >= since + self.outputs.interval:
                self._save(now)

    def _save(self, now: float) -> None:
        assert self.model is not None
        try:
            self.outputs.save(self.model)
        except SkillError as error:  # the final save may succeed
            self.print_note(f"not saved at {self.model.datapoints} datapoints: {error}")
        self._saved = (now, self.observed)

    def _has_no_output(self) -> bool:
        return not (self.outputs.model or self.outputs.skill) and print_failure() is not None


def infer_layout(columns: ColumnHeader) -> Layout:
    """Return the layout of rows: a position or pose, with or without velocities, if the names are theirs."""
    known = (position_layout(2), position_layout(3), pose_layout())
    for layout in (*known, *(coordinates.differentiate() for coordinates in known)):
        if layout.names == columns.names:
            return layout
    if columns.names:
        return Layout(tuple(Part(name, Quantity.SCALAR, 1, "1") for name in columns.names))
    return Layout((Part("column", Quantity.SCALAR, columns.width, "1"),))


def validate_columns(model: online.OnlineModel, columns: ColumnHeader) -> None:
    """Raise InvalidInput unless the columns are those of the model, once for each frame."""
    names = model.layout.names * len(model.frame_names)
    if columns.width != len(names) or (columns.names and columns.names != names):
        given = short_list(columns.names) if columns.names else f"{columns.width} numbers"
        raise InvalidInput(
            f"the rows have the columns {given}, expected those of the model: {', '.join(names[:32])}"
        )
