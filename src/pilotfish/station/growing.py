"""A model while a stream flows through it: what it learned and refused, what is shown and kept meanwhile."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout, position_layout
from pilotfish.errors import InvalidInput, NameTaken, SkillError
from pilotfish.models import online
from pilotfish.station.answers import write_each
from pilotfish.station.output import (
    CLEAR,
    PATIENCE,
    a_person_watches,
    as_json,
    print_failure,
    print_on_stderr,
    progress,
    remark,
    say,
)
from pilotfish.station.stream_lines import Break, Columns, Piece, Refusal, Rows, Shown
from pilotfish.station.stream_pieces import cuts
from pilotfish.store import save_skill, save_stream
from pilotfish.types import Array, Float
from pilotfish.validation import short_list

TOLD = 10  # refusals that are told in full
Make = Callable[[Columns], online.OnlineModel]


@dataclass(slots=True, eq=False)
class Growth:
    """A model, None before it is known what its columns are, and what became of the stream so far."""

    model: online.OnlineModel | None
    observed: int = 0
    refused: int = 0
    refusals: list[Refusal] = field(default_factory=list)  # the first of them
    merged: int = 0
    forgotten: int = 0
    begun: float | None = None  # the clock at the first datapoint, and after the last
    ended: float = 0.0

    @property
    def rate(self) -> float:
        """Datapoints a second."""
        seconds = self.ended - self.begun if self.begun is not None else 0.0
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
class Outputs:
    """Files for the model and the skill that it is, every so many seconds; 0 is at the end alone.

    A file that this stream has written is replaced by the next; any other only by force.
    """

    model: Path | None
    skill: Path | None
    seconds: float = 0.0
    force: bool = False
    own: set[Path] = field(default_factory=set)
    taken: bool = False  # a file of this name appeared: the stream goes on under another one

    def keep(self, model: online.OnlineModel) -> dict[str, str]:
        """Write the files, each also when another fails, and return them.    Raises: SkillError."""
        writes = []
        if out := self.model:
            writes.append(lambda: self._write("model", out, partial(save_stream, model)))
        if skill := self.skill:
            writes.append(lambda: self._write("skill", skill, partial(_save_read_out, model)))
        write_each(*writes)
        named = {"out": self.model, "skill": self.skill}
        return {name: str(path) for name, path in named.items() if path}

    def _write(self, name: str, path: Path, save: Callable[..., None]) -> None:
        try:
            save(path, overwrite=self.force or path in self.own, beside=True)
        except NameTaken as error:
            self.taken = True
            setattr(self, name, error.path)
            self.own.add(error.path)
            raise
        self.own.add(path)


def _save_read_out(model: online.OnlineModel, path: Path, *, overwrite: bool, beside: bool) -> None:
    save_skill(online.read_out(model), path, overwrite=overwrite, beside=beside)


class Watch:
    """Looks at a growth every now and then: shows it to a person, keeps it in files.

    stopped tells whether a signal asked to stop; then no line waits for a reader any more.
    """

    def __init__(
        self, growth: Growth, outputs: Outputs, every: int | None, stopped: Callable[[], int] = lambda: 0
    ) -> None:
        self.growth, self.outputs, self.every, self.stopped = growth, outputs, every, stopped
        self.live = a_person_watches()
        self.shown = self.kept = (0.0, 0)  # when, and at how many datapoints
        self.marks: list[dict[str, float]] = []

    def look(self) -> None:
        """Shows and keeps what is due."""
        now, growth = time.monotonic(), self.growth
        if self.live and growth.observed > self.shown[1] and now >= self.shown[0] + PATIENCE:
            progress(growth.line)
            self.shown = (now, growth.observed)
        if self.outputs.seconds and growth.observed > self.kept[1]:
            since = self.kept[0] or growth.begun or now
            if now >= since + self.outputs.seconds:
                self._keep(now)

    def tell(self, text: str) -> None:
        """A line on stderr, in place of the one that is updated."""
        self.clear()
        remark(text)

    def clear(self) -> None:
        if self.live and self.shown[1]:
            print_on_stderr(CLEAR, newline=False)

    def mark(self) -> None:
        """A line of growth, each so many datapoints."""
        growth, model = self.growth, self.growth.model
        assert model is not None
        if as_json():
            self.marks.append(
                {
                    "datapoints": model.datapoints,
                    "clusters": model.clusters,
                    "dimensions": int(model.dimensions.sum()),
                    "datapoints_per_second": growth.rate,
                }
            )
        else:
            self.clear()
            say(growth.line, self.stopped)

    @property
    def pointless(self) -> bool:
        """Whether no result reaches anyone: the stream writes no file and its lines cannot be printed."""
        return not (self.outputs.model or self.outputs.skill) and print_failure() is not None

    def _keep(self, now: float) -> None:
        model = self.growth.model
        assert model is not None
        try:
            self.outputs.keep(model)
        except SkillError as error:  # perhaps there is room again at the end
            self.tell(f"not saved at {model.datapoints} datapoints: {error}")
        self.kept = (now, self.growth.observed)


def grow(pieces: Iterable[Piece], make: Make, watch: Watch) -> None:
    """All pieces are learned, in their order; make gives the model once columns are known.

    Raises: InvalidInput, when the stream breaks; what was learned before is in the growth.
    """
    growth = watch.growth
    for piece in pieces:
        match piece:
            case Columns():
                if growth.model is None:
                    growth.model = make(piece)
                require_columns(growth.model, piece)
            case Rows(x):
                learn_rows(watch, x)
            case Shown(demonstration):
                note(watch, *online.observe_demonstration(known(watch), demonstration))
            case Break():
                if growth.model is not None:
                    growth.model = online.begin_demonstration(growth.model)
            case Refusal():
                refuse(watch, piece)
        watch.look()
        if watch.every and watch.pointless:
            return


def learn_rows(watch: Watch, x: Float[Array, "N *rest"]) -> None:
    """The growth after these datapoints."""
    model = known(watch)
    seen = x.reshape(len(x), len(model.frame_names), model.layout.width)
    for cut in cuts(len(x), model.datapoints, watch.every, model.rules.batch):
        note(watch, *online.observe_stream(known(watch), seen[cut]))


def known(watch: Watch) -> online.OnlineModel:
    """The model that is about to learn; the clock runs from its first datapoint on."""
    growth = watch.growth
    growth.begun = growth.begun if growth.begun is not None else time.monotonic()
    assert growth.model is not None, "columns come before rows"
    return growth.model


def note(watch: Watch, model: online.OnlineModel, went: online.Assignments) -> None:
    """The model is now this one, whose last datapoints went there."""
    growth, count = watch.growth, len(went.identities)
    growth.model, growth.ended = model, time.monotonic()
    growth.observed += count
    growth.merged += int(np.sum(went.gone[:, 2] >= 0))
    growth.forgotten += int(np.sum(went.gone[:, 2] < 0))
    if watch.every and model.datapoints // watch.every > (model.datapoints - count) // watch.every:
        watch.mark()


def refuse(watch: Watch, refusal: Refusal) -> None:
    growth = watch.growth
    growth.refused += 1
    if growth.refused <= TOLD:
        growth.refusals.append(refusal)
        more = "; more are counted, not told" if growth.refused == TOLD else ""
        watch.tell(f"line {refusal.line} is refused: {refusal.reason}{more}")


def layout_of(columns: Columns) -> Layout:
    """What bare rows are: a position or pose, also with speeds, when their names say so; else numbers."""
    known = (position_layout(2), position_layout(3), pose_layout())
    for layout in (*known, *(plain.differentiated() for plain in known)):
        if layout.names == columns.names:
            return layout
    if columns.names:
        return Layout(tuple(Part(name, Quantity.SCALAR, 1, "1") for name in columns.names))
    return Layout((Part("column", Quantity.SCALAR, columns.width, "1"),))


def require_columns(model: online.OnlineModel, columns: Columns) -> None:
    """Raises: InvalidInput, when the rows are of other columns than the model."""
    names = model.layout.names * len(model.frame_names)
    if columns.width != len(names) or (columns.names and columns.names != names):
        told = short_list(columns.names) if columns.names else f"{columns.width} numbers"
        raise InvalidInput(f"the rows have {told}, expected those of the model: {', '.join(names[:32])}")
