"""LeRobot data sets, versions 2.0, 2.1 and 3.0, without torch.

Each episode is a recording with a signal per numeric feature, such as "observation.state" and "action". The
text of the task and other texts per row are labels. Videos and images are not decoded: notes name them.

Memory. Rows are decoded in batches, and an episode is released before the next one is built. A data set of
any size therefore takes the memory of one episode and one batch. Episodes must be stored one after another,
as LeRobot stores them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import Recording, Signal
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_descriptions import KEY
from pilotfish.io.optional_libraries import require_library
from pilotfish.io.readers.lerobot_metadata import (
    BATCH_ROWS,
    FETCH,
    Metadata,
    data_files,
    is_data_set,
    iter_descriptions,
    name_errors,
    read_lengths,
    read_metadata,
    read_tasks,
    require_same_episode,
    select_row_groups,
)
from pilotfish.types import Array, Float

FORMAT = "LeRobot"
MAX_ENTRIES = 2**27  # numbers of one episode
BUFFER_BYTES = 2**20  # of one column; without a buffer, pyarrow reads all of its bytes in a row group


def recognises(path: Path) -> bool:
    """Return whether path is the folder of a LeRobot data set.

    Args:
        path: File or folder; only `meta/info.json` is read.
    """
    return is_data_set(path)


def read(path: Path) -> Iterator[Recording]:
    """Read the episodes of a data set, one at a time.

    Args:
        path: Folder with `meta` and `data`.

    Returns:
        Iterator of recordings, named "episode 0" onwards. Each signal has the times of `timestamp`, if the
        data set has them.

    Raises:
        InvalidInput: If the metadata is damaged or pyarrow is not installed. The iterator raises it for a
            damaged file, or an episode that is incomplete.
    """
    metadata = read_metadata(path)
    tasks, lengths = read_tasks(path, metadata), read_lengths(path, metadata)
    return _iter_recordings(path, metadata, tasks, lengths, data_files(path, metadata))


def read_episodes(path: Path, lengths: Mapping[int, int]) -> Iterator[Recording]:
    """Read some episodes of a data set; files and row groups without them are passed over.

    Args:
        path: Folder with `meta` and `data`.
        lengths: Number of rows of each episode to read, as `read_lengths` returns.

    Returns:
        Iterator of recordings, as `read` returns.

    Raises:
        InvalidInput: As `read`.
    """
    metadata = read_metadata(path)
    files, tasks = data_files(path, metadata), read_tasks(path, metadata)
    return _iter_recordings(path, metadata, tasks, dict(lengths), files, frozenset(lengths))


@dataclass(slots=True)
class _Episode:
    """Rows of one episode, in parts."""

    number: int
    rows: int = 0
    entries: int = 0
    parts: list[dict[str, Any]] = field(default_factory=list)

    def append(self, part: dict[str, Any]) -> None:
        self.parts.append(part)
        self.entries += sum(np.size(values) for values in part.values())
        if self.entries > MAX_ENTRIES:
            raise InvalidInput(
                f"episode {self.number} has more than {MAX_ENTRIES} numbers; split it into shorter episodes"
            )


def _iter_recordings(
    path: Path,
    metadata: Metadata,
    tasks: dict[int, str],
    lengths: dict[int, int],
    files: list[Path],
    wanted: frozenset[int] | None = None,
) -> Iterator[Recording]:
    descriptions = iter_descriptions(path, wanted)
    described = next(descriptions, None)
    remaining, finished = dict(lengths), set[int]()
    for episode in _iter_episodes(files, metadata, lengths, wanted):
        if episode.number in finished:
            raise InvalidInput(
                f"{path}: episode {episode.number} has more rows than its metadata states; {FETCH}"
            )
        while described is not None and described[0] < episode.number:
            described = next(descriptions, None)
        text = described[1] if described is not None and described[0] == episode.number else None
        recording = _build_recording(episode, metadata, tasks, text)
        episode.parts.clear()  # released before the next episode is read, as the recording below
        with name_errors(path):
            require_same_episode(recording, lengths, episode.number)
        finished.add(episode.number)
        remaining.pop(episode.number, None)
        yield recording
        del recording
    if missing := [number for number, rows in remaining.items() if rows]:
        raise InvalidInput(
            f"{path} lacks episode {missing[0]} ({len(missing)} in all), which its metadata lists; {FETCH}"
        )


def _iter_episodes(
    files: list[Path], metadata: Metadata, lengths: dict[int, int], wanted: frozenset[int] | None
) -> Iterator[_Episode]:
    """Group consecutive rows by episode, across batches and files; yield each at its stated length."""
    episode: _Episode | None = None
    for file in files:
        for numbers, columns in _iter_batches(file, metadata, wanted):
            starts = np.flatnonzero(np.diff(numbers, prepend=numbers[0] - 1))
            for start, end in zip(starts, [*starts[1:], len(numbers)], strict=True):
                if wanted is not None and int(numbers[start]) not in wanted:
                    continue
                if episode is None or episode.number != numbers[start]:
                    if episode is not None:
                        yield episode
                    episode = _Episode(int(numbers[start]))
                with name_errors(file):
                    episode.append({name: values[start:end] for name, values in columns.items()})
                episode.rows += int(end - start)
                if episode.rows == lengths.get(episode.number):
                    yield episode
                    episode = None
    if episode is not None:
        yield episode


def _iter_batches(
    file: Path, metadata: Metadata, wanted: frozenset[int] | None
) -> Iterator[tuple[Any, dict[str, Any]]]:
    """Yield the episode of each row, and the columns by name, for some rows at a time."""
    row_groups = None if wanted is None else select_row_groups(file, wanted)
    if row_groups == []:
        return
    parquet = require_library("pyarrow.parquet", "LeRobot data sets")
    widths = {feature.name: len(feature.columns) for feature in metadata.features}
    options = {"buffer_size": BUFFER_BYTES, "pre_buffer": False, "page_checksum_verification": True}
    with name_errors(file), parquet.ParquetFile(file, **options) as table:
        present = set(table.schema_arrow.names)
        if missing := [name for name in ("episode_index", *widths, *metadata.texts) if name not in present]:
            raise InvalidInput(f"it lacks column {missing[0]!r}, which info.json lists; {FETCH}")
        extra = [name for name in ("timestamp", "task_index") if name in present]
        batch_rows = max(1, min(BATCH_ROWS, MAX_ENTRIES // sum(widths.values())))
        names = ["episode_index", *widths, *extra, *metadata.texts]
        for batch in table.iter_batches(batch_rows, row_groups=row_groups, columns=names):
            batch.validate(full=True)
            if not len(batch):
                continue
            columns: dict[str, Any] = {
                name: _to_matrix(batch.column(name), name, width) for name, width in widths.items()
            }
            if "timestamp" in present:
                columns["timestamp"] = _to_matrix(batch.column("timestamp"), "timestamp", 1)[:, 0]
            if "task_index" in present:
                columns["task_index"] = _to_integers(batch.column("task_index"), "task_index")
            columns |= {name: np.array(batch.column(name).to_pylist(), object) for name in metadata.texts}
            yield _to_integers(batch.column("episode_index"), "episode_index"), columns


def _to_matrix(column: Any, name: str, width: int) -> Float[Array, "T D"]:
    """Return a column of numbers, or of equally long and possibly nested lists, as a matrix."""
    arrow, compute = (require_library(f"pyarrow{part}", "LeRobot data sets") for part in ("", ".compute"))
    rows = len(column)
    while arrow.types.is_list(kind := column.type) or arrow.types.is_fixed_size_list(kind):
        lengths = compute.min_max(compute.list_value_length(column)).as_py()
        if column.null_count or lengths["min"] != lengths["max"]:
            raise InvalidInput(f"column {name!r} has rows of different lengths; {FETCH}")
        column = column.flatten()
    if column.null_count:
        raise InvalidInput(f"column {name!r} lacks a value in {column.null_count} places; {FETCH}")
    is_number = arrow.types.is_floating(kind) or arrow.types.is_integer(kind) or arrow.types.is_boolean(kind)
    if not is_number or len(column) != rows * width:
        raise InvalidInput(
            f"column {name!r} has {len(column)} items of {kind} in {rows} rows, not {width} each"
        )
    return np.asarray(column.to_numpy(zero_copy_only=False), np.float64).reshape(rows, width)


def _to_integers(column: Any, name: str) -> Any:
    arrow = require_library("pyarrow", "LeRobot data sets")
    if column.null_count or not arrow.types.is_integer(column.type):
        raise InvalidInput(f"{name} is of type {column.type}, expected a whole number in each row; {FETCH}")
    return column.to_numpy(zero_copy_only=False).astype(np.int64)


def _build_recording(
    episode: _Episode, metadata: Metadata, tasks: dict[int, str], description: str | None
) -> Recording:
    def join(name: str) -> Any:
        return np.concatenate([part[name] for part in episode.parts])

    present = episode.parts[0].keys()
    times = join("timestamp") if "timestamp" in present else None
    signals = tuple(
        Signal(feature.name, join(feature.name), feature.columns, ("",) * len(feature.columns), times)
        for feature in metadata.features
    )
    labels = {
        name: tuple("" if text is None else str(text) for text in join(name)) for name in metadata.texts
    }
    attributes = {"robot_type": metadata.robot} if metadata.robot else {}
    if tasks and "task_index" in present:
        labels["task"] = tuple(tasks.get(index, "") for index in join("task_index").tolist())
        attributes["task"] = labels["task"][0]
    if description is not None:
        attributes[KEY] = description
    return Recording(
        name=f"episode {episode.number}",
        signals=signals,
        labels=labels,
        period=metadata.period,
        format=f"{FORMAT} {metadata.version}",
        attributes=attributes,
        notes=metadata.notes,
    )
