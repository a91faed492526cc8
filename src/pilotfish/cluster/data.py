"""Demonstrations on the workers of a Dask cluster.

Each group of demonstrations is read by a worker and stays there, also as views and resampled. Functions
travel to the workers, results come back and are used in the order of the groups. Reading and every function
are pure: Dask repeats the work of a lost worker on another one, with the same result.

Memory. Dask writes parts to the disk of a worker that runs short of memory. This process holds the results of
one call at a time, and what `DemonstrationSummary` has of each demonstration.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from pilotfish.cluster.libraries import require_distributed
from pilotfish.demonstrations import BuildSettings, Demonstration
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io import GroupFiles, list_groups, read_group
from pilotfish.models import PARTITION_SIZE, DemonstrationGroup, Partitions

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)
S = TypeVar("S")
Prepare = Callable[[Sequence[Demonstration]], Sequence[Demonstration]]
Progress = Callable[[int, int], None]


class ClusterPartitions(Partitions[T_co]):
    """A data set in parts on the workers of a cluster, which `learn` takes as demonstrations."""

    def __init__(self, client: Any, futures: Sequence[Any], progress: Progress | None = None) -> None:
        self._client = client
        self._futures = list(futures)
        self._progress = progress

    def map(self, function: Callable[[T_co], S]) -> Iterator[S]:
        """Apply a function to every part on its worker, and return the results in the order of the parts.

        Args:
            function: A pure function that can be pickled.

        Returns:
            The results, each when it is ready.
        """
        with _name_failures():
            tasks = self._submit(function)
            try:
                yield from self._in_order(tasks)
            finally:
                for task in tasks:
                    task.release()

    def transform(self, function: Callable[[T_co], S]) -> Partitions[S]:
        """Apply a function to every part, and keep the results on the workers.

        Args:
            function: A pure function that can be pickled.

        Returns:
            The results, in parts on the workers.
        """
        with _name_failures():
            return ClusterPartitions(self._client, self._submit(function), self._progress)

    def _submit(self, function: Callable[[T_co], Any]) -> list[Any]:
        # A task of its own, so that a worker receives the function once; it is repeated if it is lost.
        shared = self._client.submit(_return, function, pure=False)
        count = len(self._futures)
        return list(self._client.map(_apply, [shared] * count, self._futures, pure=False))

    def _in_order(self, tasks: Sequence[Any]) -> Iterator[Any]:
        """Yield the results in the order of the tasks, whichever is ready first."""
        position = {task.key: n for n, task in enumerate(tasks)}
        early: dict[int, Any] = {}
        given = 0
        ready = require_distributed().as_completed(tasks, with_results=True)
        for done, (task, result) in enumerate(ready, start=1):
            early[position[task.key]] = result
            if self._progress:
                self._progress(done, len(tasks))
            while given in early:
                yield early.pop(given)
                given += 1


def open_set(
    client: Any,
    path: str | Path,
    *,
    prepare: Prepare | None = None,
    settings: BuildSettings | None = None,
    progress: Progress | None = None,
) -> ClusterPartitions[DemonstrationGroup]:
    """Let the workers of a cluster read a folder of demonstrations or a LeRobot data set.

    Args:
        client: Client from `connect`.
        path: Folder of the set, which every worker must have at the same path.
        prepare: A pure function of the demonstrations of a group, which is applied where they are read.
        settings: Columns of a LeRobot data set that another program wrote.
        progress: Called with the numbers of finished and of all parts after each part.

    Returns:
        The set in parts, for `learn`.

    Raises:
        InvalidInput: If the manifest or the metadata of the set cannot be used. A damaged demonstration is
            reported by the first use of the set.
    """
    groups = list_groups(Path(path).absolute(), PARTITION_SIZE, settings)
    futures = client.map(partial(_read, prepare=prepare), groups, pure=False)
    return ClusterPartitions(client, futures, progress)


def _read(files: GroupFiles, prepare: Prepare | None) -> DemonstrationGroup:
    try:
        demonstrations: Sequence[Demonstration] = read_group(files)
        if prepare:
            demonstrations = prepare(demonstrations)
    except InvalidInput as error:
        worker = require_distributed().get_worker().address
        numbers = f"demonstrations {files.start} to {files.stop - 1}"
        raise InvalidInput(f"{numbers}, read by worker {worker}: {error}") from error
    return DemonstrationGroup(files.start, tuple(demonstrations))


def _return(function: Any) -> Any:
    return function


def _apply(function: Callable[[T], S], part: T) -> S:
    return function(part)


@contextmanager
def _name_failures() -> Iterator[None]:
    """Turn the end of the cluster, and of too many workers, into SkillError."""
    distributed = require_distributed()
    lost = (distributed.CancelledError, distributed.comm.CommClosedError, TimeoutError)
    try:
        yield
    except distributed.scheduler.KilledWorker as error:
        raise SkillError(
            "a part of the demonstrations ended several workers one after another, perhaps for lack of "
            "memory; start workers with more memory"
        ) from error
    except lost as error:
        raise SkillError(f"the cluster was lost: {error or type(error).__name__}; start it again") from error
