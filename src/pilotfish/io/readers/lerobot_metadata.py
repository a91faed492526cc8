"""Metadata of a LeRobot data set: rate, features, tasks and lengths of episodes.

Versions 2.0 and 2.1 have JSON lines and one Parquet file per episode, version 3 has Parquet files that many
episodes share. Paths are found by their names: the templates of `info.json` are not evaluated.
"""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from math import prod
from pathlib import Path
from typing import Any

from pilotfish.demonstrations import Recording
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_descriptions import KEY, MAX_DESCRIPTION_BYTES
from pilotfish.io.optional_libraries import require_library
from pilotfish.io.paths import is_file, is_folder, open_regular_file, read_file
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.validation import first_duplicate, require_count, require_number, require_printable, short_repr

MAX_INFO_BYTES = 2**22
MAX_LINE_BYTES = 2**22
MAX_EPISODES, MAX_TASKS, MAX_WIDTH = 10_000_000, 1_000_000, 10_000
MAX_TASK_LENGTH = 10_000  # characters
BATCH_ROWS = 4096
NUMERIC = {
    "bool",
    "float16",
    "float32",
    "float64",
    *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)),
}
INDEX_FEATURES = ("timestamp", "frame_index", "episode_index", "index", "task_index")
SUPPORTED = ("v2.0", "v2.1", "v3.0")
FIRST_NUMBER = re.compile(rb'\{"episode_index":([0-9]{1,9}),')
FILE_NUMBER = re.compile(r"episode_([0-9]{1,9})\.parquet")
FETCH = "fetch the data set again"


@dataclass(frozen=True, slots=True)
class Feature:
    """One numeric feature of a data set.

    Attributes:
        name: Name, such as "observation.state".
        columns: Name of each of its numbers.
    """

    name: str
    columns: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Metadata:
    """What `info.json` states.

    Attributes:
        version: Version of the format, such as "v3.0".
        period: Time between two rows [s].
        features: Numeric features.
        texts: Names of the features that have a text per row.
        robot: Type of the robot; may be empty.
        notes: Features that are left out.
    """

    version: str
    period: float
    features: tuple[Feature, ...]
    texts: tuple[str, ...]
    robot: str
    notes: tuple[str, ...]

    @property
    def is_v3(self) -> bool:
        """Whether episodes share files."""
        return self.version.startswith("v3")


def is_data_set(folder: Path) -> bool:
    """Return whether a folder has the `meta/info.json` of a LeRobot data set."""
    try:
        info = folder / "meta" / "info.json"
        return is_file(info) and b'"codebase_version"' in read_file(info, "info.json", MAX_INFO_BYTES)
    except InvalidInput:
        return False


def read_metadata(folder: Path) -> Metadata:
    """Read `meta/info.json`.

    Args:
        folder: Folder of the data set.

    Raises:
        InvalidInput: If it is missing, damaged or of a version that is not supported.
    """
    file = folder / "meta" / "info.json"
    with name_errors(file):
        info = json.loads(read_file(file, "info.json of a LeRobot data set", MAX_INFO_BYTES))
        if not isinstance(info, dict) or not isinstance(info.get("features"), dict):
            raise InvalidInput("it has no table of features")
        if (version := info.get("codebase_version")) not in SUPPORTED:
            raise InvalidInput(
                f"codebase_version is {short_repr(version)}, expected one of {', '.join(SUPPORTED)}; convert "
                "the data set with LeRobot's own script"
            )
        period = 1.0 / require_number(info.get("fps"), "fps", 1e-6, 1e9)
        features, texts, notes = _parse_features(info["features"])
        robot = info.get("robot_type")
        robot = require_printable(robot, "robot_type") if isinstance(robot, str) else ""
    return Metadata(version, period, features, texts, robot, notes)


def read_tasks(folder: Path, metadata: Metadata) -> dict[int, str]:
    """Return the text of each task by its index; empty if the data set lists none.

    Args:
        folder: Folder of the data set.
        metadata: Its metadata.

    Raises:
        InvalidInput: If the file is damaged.
    """
    file = folder / "meta" / ("tasks.parquet" if metadata.is_v3 else "tasks.jsonl")
    if not is_file(file):
        return {}
    tasks: dict[int, str] = {}
    rows = _iter_parquet_tasks(file) if metadata.is_v3 else _iter_json_lines(file)
    with name_errors(file):
        for row in rows:
            index = require_count(row.get("task_index"), "task_index", MAX_TASKS)
            tasks[index] = require_printable(row.get("task"), f"task {index}", MAX_TASK_LENGTH)
            if len(tasks) > MAX_TASKS:
                raise InvalidInput(f"it has more than {MAX_TASKS} tasks")
    return tasks


def read_lengths(folder: Path, metadata: Metadata) -> dict[int, int]:
    """Return the stated number of rows of each episode; empty if the data set lists none.

    Args:
        folder: Folder of the data set.
        metadata: Its metadata.

    Raises:
        InvalidInput: If a file is damaged.
    """
    lengths: dict[int, int] = {}
    for file in _episode_lists(folder, metadata):
        is_parquet = file.suffix == ".parquet"
        columns = ["episode_index", "length"]
        with name_errors(file):
            for row in _iter_parquet(file, columns) if is_parquet else _iter_json_lines(file):
                episode = require_count(row.get("episode_index"), "episode_index", MAX_EPISODES)
                lengths[episode] = require_count(row.get("length"), f"the length of episode {episode}", 2**62)
    return lengths


def iter_descriptions(folder: Path, wanted: frozenset[int] | None = None) -> Iterator[tuple[int, str]]:
    """Yield the number of each episode that this project exported, and its description.

    Args:
        folder: Folder of the data set.
        wanted: Numbers of episodes; lines of others, as this project writes them, are not parsed.

    Raises:
        InvalidInput: If a line cannot be read.
    """
    file = folder / "meta" / f"{KEY}.jsonl"
    if not is_file(file):
        return
    with name_errors(file):
        for row in _iter_json_lines(file, MAX_DESCRIPTION_BYTES, wanted):
            episode = require_count(row.get("episode_index"), "episode_index", MAX_EPISODES)
            yield episode, json.dumps(row.get("description"), separators=(",", ":"))


def data_files(folder: Path, metadata: Metadata) -> list[Path]:
    """Return the Parquet files of rows, in order.

    Args:
        folder: Folder of the data set.
        metadata: Its metadata.

    Raises:
        InvalidInput: If the data set has none.
    """
    name = "file-*.parquet" if metadata.is_v3 else "episode_*.parquet"
    found = _sorted_files(folder / "data", name)
    if not found:
        raise InvalidInput(f"{folder} has no data/chunk-*/{name}; {FETCH}, with its data folder")
    return found


def select_row_groups(file: Path, wanted: frozenset[int]) -> list[int] | None:
    """Return the row groups of a file that may have rows of some episodes; None if it does not state that.

    Args:
        file: Parquet file of rows.
        wanted: Numbers of the episodes.

    Raises:
        InvalidInput: If the file is damaged.
    """
    if (number := FILE_NUMBER.fullmatch(file.name)) is not None:  # versions 2.0 and 2.1
        return None if int(number[1]) in wanted else []
    with name_errors(file):
        state = file.stat()
        ranges = _episode_ranges(file, state.st_size, state.st_mtime_ns)
    if None in ranges:
        return None
    low, high = min(wanted, default=0), max(wanted, default=-1)
    return [n for n, limits in enumerate(ranges) if limits and limits[0] <= high and limits[1] >= low]


@lru_cache(maxsize=1024)
def _episode_ranges(file: Path, size: int, changed: int) -> tuple[tuple[int, int] | None, ...]:
    """Return the smallest and largest episode of each row group; size and time of change tell files apart."""
    parquet = require_library("pyarrow.parquet", "LeRobot data sets")
    with parquet.ParquetFile(file) as table:
        names = table.schema_arrow.names
        if "episode_index" not in names:
            return (None,)
        column = [table.metadata.schema.column(n).path for n in range(table.metadata.num_columns)].index(
            "episode_index"
        )
        groups = [table.metadata.row_group(n).column(column) for n in range(table.num_row_groups)]
        limits = [group.statistics if group.is_stats_set else None for group in groups]
        return tuple((s.min, s.max) if s is not None and s.has_min_max else None for s in limits)


@contextmanager
def name_errors(file: Path) -> Iterator[None]:
    """Turn each error of reading a file into InvalidInput that names the file."""
    arrow = require_library("pyarrow", "LeRobot data sets")
    try:
        yield
    except InvalidInput as error:
        prefix = "" if str(error).startswith(str(file)) else f"{file}: "
        raise InvalidInput(f"{prefix}{error}") from error
    except (*READ_ERRORS, RecursionError, arrow.ArrowException) as error:
        raise InvalidInput(f"{file}: damaged, or not of a LeRobot data set: {error}; {FETCH}") from error


def require_same_episode(recording: Recording, lengths: dict[int, int], episode: int) -> None:
    """Raise InvalidInput if an episode has another number of rows than the metadata states."""
    rows, stated = len(recording.signals[0].values), lengths.get(episode)
    if stated is not None and stated != rows:
        raise InvalidInput(f"episode {episode} has {rows} rows, but its metadata states {stated}; {FETCH}")


def _parse_features(table: dict[str, Any]) -> tuple[tuple[Feature, ...], tuple[str, ...], tuple[str, ...]]:
    features, texts, notes = [], [], []
    for name, fields in table.items():
        require_printable(name, "the name of a feature")
        if name in INDEX_FEATURES:
            continue
        if not isinstance(fields, dict) or not isinstance(fields.get("shape", []), list | tuple):
            raise InvalidInput(f"feature {name!r} is {short_repr(fields)}, expected dtype and shape")
        dtype = str(fields.get("dtype"))
        shape = [require_count(n, f"a size of feature {name!r}", 2**40) for n in fields.get("shape") or [1]]
        if dtype == "string":
            texts.append(name)
        elif dtype not in NUMERIC or not 1 <= prod(shape) <= MAX_WIDTH:
            notes.append(f"{name} is left out: {short_repr(dtype)[1:-1]} of shape {tuple(shape)}")
        else:
            features.append(Feature(name, _column_names(fields.get("names"), prod(shape))))
    if not features:
        raise InvalidInput("it has no numeric feature, expected observation.state or action")
    return tuple(features), tuple(texts), tuple(notes)


def _column_names(names: Any, width: int) -> tuple[str, ...]:
    """Return the stated names if there is one per column and none is repeated, otherwise numbers."""
    flat = list(_iter_texts(names))
    if len(flat) != width or first_duplicate(flat) is not None:
        return tuple(map(str, range(width)))
    return tuple(require_printable(name, "the name of a column") for name in flat)


def _iter_texts(names: Any, depth: int = 0) -> Iterator[str]:
    """Yield the texts in nested lists and tables, in order; `names` has had all of these forms."""
    if isinstance(names, str):
        yield names
    elif isinstance(names, list | dict) and depth < 4:
        for item in names.values() if isinstance(names, dict) else names:
            yield from _iter_texts(item, depth + 1)


def _sorted_files(folder: Path, name: str) -> list[Path]:
    """Return regular files `chunk-*/NAME`, sorted; chunks and files are numbered with leading zeros."""
    if not is_folder(folder):
        return []
    with name_errors(folder):
        found = [file for file in folder.glob(f"chunk-*/{name}") if is_file(file)]
    return sorted(
        found, key=lambda file: (len(file.parent.name), file.parent.name, len(file.name), file.name)
    )


def _episode_lists(folder: Path, metadata: Metadata) -> list[Path]:
    if metadata.is_v3:
        return _sorted_files(folder / "meta" / "episodes", "file-*.parquet")
    file = folder / "meta" / "episodes.jsonl"
    return [file] if is_file(file) else []


def _iter_json_lines(
    file: Path, max_bytes: int = MAX_LINE_BYTES, wanted: frozenset[int] | None = None
) -> Iterator[dict[str, Any]]:
    with open_regular_file(file, "JSON lines of a LeRobot data set") as lines:
        for number in count(1):
            if not (line := lines.readline(max_bytes + 1)):
                return
            if len(line) > max_bytes:
                raise InvalidInput(f"line {number} has more than {max_bytes} bytes")
            if not line.strip() or (wanted is not None and _is_of_other(line, wanted)):
                continue
            row = json.loads(line)
            if not isinstance(row, dict):
                raise InvalidInput(f"line {number} is {short_repr(row)}, expected a JSON object")
            yield row


def _is_of_other(line: bytes, wanted: frozenset[int]) -> bool:
    """Return whether a line begins with the number of an episode that is not wanted."""
    found = FIRST_NUMBER.match(line)
    return found is not None and int(found[1]) not in wanted


def _iter_parquet(file: Path, columns: list[str]) -> Iterator[dict[str, Any]]:
    parquet = require_library("pyarrow.parquet", "LeRobot data sets")
    with parquet.ParquetFile(file) as table:
        for batch in table.iter_batches(BATCH_ROWS, columns=columns):
            batch.validate(full=True)
            yield from batch.to_pylist()


def _iter_parquet_tasks(file: Path) -> Iterator[dict[str, Any]]:
    """Yield index and text of each task; the text is the index of a pandas table, whose name varies."""
    parquet = require_library("pyarrow.parquet", "LeRobot data sets")
    with parquet.ParquetFile(file) as table:
        names = [name for name in table.schema_arrow.names if name != "task_index"]
    text = next((name for name in ("task", "__index_level_0__") if name in names), None)
    if text is None:
        raise InvalidInput(f"it has the columns {short_repr(names)}, expected a column of task texts")
    for row in _iter_parquet(file, ["task_index", text]):
        yield {"task_index": row.get("task_index"), "task": row.get(text)}
