"""Options --workers and --cluster of independent computations, and the processes that they use.

Processes are spawned, not forked, so that no thread or lock of this process is copied in an unknown state.
They ignore Ctrl-C, which this process answers, and end when this process ends, also if it is killed.
"""

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process

import click

from pilotfish.cluster import connect

MAX_WORKERS = 1024
workers_option = click.option(
    "--workers",
    type=click.IntRange(1, MAX_WORKERS),
    help="Number of processes, which does not change the result.  [default: one for each core]",
)


@contextmanager
def process_pool(workers: int | str | None, jobs: int) -> Iterator[Executor | None]:
    """Start processes for independent computations.

    Args:
        workers: Value of --workers or --cluster; None takes one process for each core.
        jobs: Number of computations.

    Yields:
        The processes; None to compute in this one.
    """
    if isinstance(workers, str):
        with connect(workers) as client:
            yield client.get_executor(pure=False)
        return
    count = min(core_count() if workers is None else workers, jobs)
    if count < 2:
        yield None
        return
    pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=_start_worker)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def require_one_pool(workers: int | None, cluster: str | None) -> int | str | None:
    """Return the argument of `process_pool` for both options.

    Raises:
        click.UsageError: If both are given.
    """
    if workers is not None and cluster is not None:
        raise click.UsageError("--workers and --cluster exclude each other; give one of them")
    return cluster or workers


def core_count() -> int:
    """Return the number of cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        return os.cpu_count() or 1


def _start_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_exit_with_parent, daemon=True).start()


def _exit_with_parent() -> None:
    if parent := parent_process():
        parent.join()
        os._exit(1)
