"""Writer of LeRobot data sets of version 3, without torch.

`observation.state` is the row of each step and `action` that of the next, as a controller of positions takes
it; the last one is repeated. Both are float64, so that no digit is lost, and LeRobot converts them. The file
`meta/pilotfish.jsonl`, which LeRobot ignores, has the descriptions that make an import exact.

Demonstrations are written one at a time, a row group each. A file of rows is closed at about 100 MB.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_descriptions import KEY, describe_demonstration
from pilotfish.io.optional_libraries import require_library
from pilotfish.io.readers.lerobot import recognises
from pilotfish.io.writers.exported_demonstrations import export_folder, iter_alike, next_rows
from pilotfish.types import Array, Float
from pilotfish.validation import require_printable

VERSION = "v3.0"
FILE_BYTES = 100_000_000  # of numbers in one file
FILES_PER_CHUNK = 1000
STATE, ACTION = "observation.state", "action"
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
PURPOSE = "LeRobot data sets"


def write(
    demonstrations: Iterable[Demonstration],
    path: str | Path,
    *,
    overwrite: bool = False,
    task: str = "demonstration",
    robot: str = "unknown",
) -> None:
    """Write a data set of version 3, from which an import restores each demonstration exactly.

    Args:
        demonstrations: At least one; all share layout and period. A generator is read one at a time.
        path: Folder to write.
        overwrite: Whether a LeRobot data set may be replaced; no other folder ever is.
        task: Text of the task, which language-conditioned policies read.
        robot: Type of the robot.

    Raises:
        InvalidInput: If the demonstrations differ in layout or period, path cannot be written or exists, or
            pyarrow is not installed.
    """
    require_library("pyarrow", PURPOSE)
    require_printable(task, "task", 10_000)
    require_printable(robot, "robot")
    with export_folder(path, recognises, "LeRobot", overwrite=overwrite) as folder:
        (folder / "meta").mkdir()
        with _DataSet(folder) as data_set:
            for demo in iter_alike(demonstrations):
                data_set.append(demo)
        assert data_set.first is not None
        _write_tasks(folder, task)
        _write_episodes(folder, data_set.episodes, task)
        _write_json(folder / "meta" / "info.json", _info(data_set, data_set.first, robot))
        _write_json(folder / "meta" / "stats.json", data_set.statistics())


@dataclass(slots=True)
class _DataSet:
    """Files of rows that are being written, and what the metadata must state about them."""

    folder: Path
    first: Demonstration | None = None
    rows: int = 0
    episodes: list[dict[str, int]] = field(default_factory=list)
    sums: dict[str, Any] = field(default_factory=dict)
    file_number: int = -1
    file_bytes: int = 0
    table: Any = None
    descriptions: IO[str] | None = None

    def __enter__(self) -> "_DataSet":
        self.descriptions = (self.folder / "meta" / f"{KEY}.jsonl").open("w", encoding="ascii")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self.table is not None:
            self.table.close()
        if self.descriptions is not None:
            self.descriptions.close()

    def append(self, demo: Demonstration) -> None:
        """Write one episode."""
        self.first = self.first or demo
        batch = _episode_table(demo, len(self.episodes), self.rows)
        if self.table is None or self.file_bytes > FILE_BYTES:
            self._open_next(batch.schema)
        self.table.write_table(batch, row_group_size=max(1, len(demo.x)))
        self.file_bytes += batch.nbytes
        self.episodes.append(
            {
                "episode_index": len(self.episodes),
                "length": len(demo.x),
                "data/chunk_index": self.file_number // FILES_PER_CHUNK,
                "data/file_index": self.file_number % FILES_PER_CHUNK,
                "dataset_from_index": self.rows,
                "dataset_to_index": self.rows + len(demo.x),
            }
        )
        self.rows += len(demo.x)
        self._describe(demo)

    def _describe(self, demo: Demonstration) -> None:
        assert self.descriptions is not None
        description = describe_demonstration(demo, [(STATE, n) for n in range(demo.layout.width)])
        episode = len(self.episodes) - 1
        self.descriptions.write(f'{{"episode_index":{episode},"description":{description}}}\n')
        for name, x in ((STATE, demo.x), (ACTION, next_rows(demo.x))):
            self.sums[name] = _add_statistics(self.sums.get(name), x)

    def _open_next(self, schema: Any) -> None:
        if self.table is not None:
            self.table.close()
        self.file_number, self.file_bytes = self.file_number + 1, 0
        chunk, file = divmod(self.file_number, FILES_PER_CHUNK)
        target = self.folder / DATA_PATH.format(chunk_index=chunk, file_index=file)
        target.parent.mkdir(parents=True, exist_ok=True)
        parquet = require_library("pyarrow.parquet", PURPOSE)
        self.table = parquet.ParquetWriter(target, schema, write_page_checksum=True)

    def statistics(self) -> dict[str, dict[str, list[float]]]:
        """Return smallest and largest value, mean and standard deviation of each column."""
        return {
            name: {
                "min": low.tolist(),
                "max": high.tolist(),
                "mean": mean.tolist(),
                "std": np.sqrt(squares / count).tolist(),
                "count": [count],
            }
            for name, (count, low, high, mean, squares) in self.sums.items()
        }


def _add_statistics(before: Any, x: Float[Array, "T D"]) -> Any:
    """Return count, minimum, maximum, mean and sum of squared deviations of all rows so far.

    Source:
        Chan, Golub & LeVeque 1983, The American Statistician 37(3), eq. 2.1: merging of two samples.
    """
    mean = x.mean(axis=0)
    squares = np.square(x - mean).sum(axis=0)
    if before is None:
        return len(x), x.min(axis=0), x.max(axis=0), mean, squares
    count, low, high, old_mean, old_squares = before
    total, difference = count + len(x), mean - old_mean
    squares = old_squares + squares + difference**2 * (count * len(x) / total)
    mean = old_mean + difference * (len(x) / total)
    return total, np.minimum(low, x.min(axis=0)), np.maximum(high, x.max(axis=0)), mean, squares


def _episode_table(demo: Demonstration, episode: int, start: int) -> Any:
    arrow = require_library("pyarrow", PURPOSE)
    (steps, width), rows = demo.x.shape, np.arange(len(demo.x))

    def vectors(x: Float[Array, "T D"]) -> Any:
        return arrow.FixedSizeListArray.from_arrays(arrow.array(np.ravel(x)), width)

    return arrow.table(
        {
            STATE: vectors(demo.x),
            ACTION: vectors(next_rows(demo.x)),
            "timestamp": arrow.array((rows * demo.period).astype(np.float32)),
            "frame_index": arrow.array(rows),
            "episode_index": arrow.array(np.full(steps, episode)),
            "index": arrow.array(rows + start),
            "task_index": arrow.array(np.zeros(steps, np.int64)),
        }
    )


def _write_tasks(folder: Path, task: str) -> None:
    """Write `tasks.parquet` as pandas does: the text of the task is the index of the table."""
    arrow, parquet = require_library("pyarrow", PURPOSE), require_library("pyarrow.parquet", PURPOSE)
    fields = [("task_index", "int64", "int64"), ("task", "unicode", "object")]
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": dtype, "metadata": None}
        for name, kind, dtype in fields
    ]
    index = {"name": None, "field_name": None, "pandas_type": "unicode", "numpy_type": "object"}
    pandas = {
        "index_columns": ["task"],
        "column_indexes": [{**index, "metadata": {"encoding": "UTF-8"}}],
        "columns": columns,
        "creator": {"library": "pyarrow", "version": arrow.__version__},
        "pandas_version": "2.2.0",
    }
    table = arrow.table({"task_index": arrow.array([0], arrow.int64()), "task": [task]})
    table = table.replace_schema_metadata({"pandas": json.dumps(pandas)})
    parquet.write_table(table, folder / "meta" / "tasks.parquet")


def _write_episodes(folder: Path, episodes: list[dict[str, int]], task: str) -> None:
    arrow, parquet = require_library("pyarrow", PURPOSE), require_library("pyarrow.parquet", PURPOSE)
    columns: dict[str, Any] = {name: [episode[name] for episode in episodes] for name in episodes[0]}
    columns["tasks"] = [[task]] * len(episodes)
    columns |= {f"meta/episodes/{name}_index": [0] * len(episodes) for name in ("chunk", "file")}
    target = folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    target.parent.mkdir(parents=True)
    parquet.write_table(arrow.table(columns), target)


def _info(data_set: _DataSet, first: Demonstration, robot: str) -> dict[str, Any]:
    rate = 1.0 / first.period
    fps = round(rate) if round(rate) and abs(rate - round(rate)) < 1e-6 * rate else rate
    vector = {"dtype": "float64", "shape": [first.layout.width], "names": list(first.layout.names)}
    number = {"dtype": "int64", "shape": [1], "names": None}
    indices = dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), number)
    return {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": len(data_set.episodes),
        "total_frames": data_set.rows,
        "total_tasks": 1,
        "chunks_size": FILES_PER_CHUNK,
        "data_files_size_in_mb": FILE_BYTES // 10**6,
        "video_files_size_in_mb": 200,
        "fps": fps,
        "splits": {"train": f"0:{len(data_set.episodes)}"},
        "data_path": DATA_PATH,
        "video_path": None,
        "features": {
            STATE: vector,
            ACTION: vector,
            "timestamp": {"dtype": "float32", "shape": [1], "names": None},
            **indices,
        },
    }


def _write_json(file: Path, content: dict[str, Any]) -> None:
    try:
        file.write_text(json.dumps(content, indent=4, allow_nan=False) + "\n", encoding="utf-8")
    except ValueError as error:
        raise InvalidInput(
            f"{file.name} cannot be written: {error}; check the magnitude of the rows"
        ) from error
