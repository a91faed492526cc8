"""Option --cluster, and demonstrations on a cluster."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from time import monotonic
from typing import Any

import click

from pilotfish.cli.options.demonstrations import DATASET_PREFIX, prepare_demonstrations
from pilotfish.cluster import ClusterPartitions, connect, open_set
from pilotfish.models import DemonstrationGroup

NOT_ON_CLUSTER = ("only", "drop_distractors")  # options that need all rows in this process
cluster_option = click.option(
    "--cluster",
    metavar="ADDRESS",
    help="Dask cluster that does the work: tcp://HOST:PORT of its scheduler, or local:2 to start two worker "
    "processes here. It does not change the result.",
)


class ClusterProgress:
    """Text after the progress bar: log-likelihood, time, and parts of the present step that are done."""

    def __init__(self) -> None:
        self.advance: Callable[..., None] = lambda *_: None
        self._start = monotonic()
        self._text = ""

    def on_iteration(self, _: int, log_likelihood: float) -> None:
        """Report the end of an iteration."""
        self._text = f"log-likelihood {log_likelihood:.6g}, {monotonic() - self._start:.0f} s"
        self.advance(self._text)

    def on_part(self, done: int, total: int) -> None:
        """Report a part of the demonstrations."""
        parts = f"{done} of {total} parts"
        self.advance(f"{self._text}, {parts}" if self._text else parts, 0)


@contextmanager
def cluster_demonstrations(
    folder: str, options: Mapping[str, Any], progress: ClusterProgress
) -> Iterator[ClusterPartitions[DemonstrationGroup]]:
    """Connect to the cluster of --cluster, whose workers read the demonstrations.

    Args:
        folder: Folder of demonstrations or LeRobot data set.
        options: Options of the command.
        progress: Reports parts that are done.

    Yields:
        The demonstrations, in the columns to learn.

    Raises:
        click.UsageError: If an option needs the demonstrations in this process.
        SkillError: If the cluster or the demonstrations cannot be used.
    """
    for name in NOT_ON_CLUSTER:
        if options[name]:
            option = f"--{name.replace('_', '-')}"
            raise click.UsageError(f"{option} reads all demonstrations in one process; leave out --cluster")
    if folder.startswith(DATASET_PREFIX):
        raise click.UsageError(
            f"--cluster reads a folder, not {folder}; write it with `pilotfish data export`"
        )
    prepare = partial(
        prepare_demonstrations, riemannian=options["riemannian"], velocities=options["velocities"]
    )
    with connect(options["cluster"]) as client:
        yield open_set(client, folder, prepare=prepare, progress=progress.on_part)
