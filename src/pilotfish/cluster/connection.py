"""Connection to a Dask scheduler, or a local one with worker processes that end with this process."""

import logging
import os
import re
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from pilotfish.cluster.libraries import require_distributed
from pilotfish.errors import InvalidInput
from pilotfish.validation import require_type, short_repr

LOCAL = re.compile("local(:[0-9]{1,4})?")
REMOTE = re.compile(r"(tcp|tls|ws|wss)://[^\s/]+:[0-9]{1,5}")
MAX_LOCAL_WORKERS = 1024
TIMEOUT = 5.0  # s, until an address counts as unreachable


@contextmanager
def connect(address: str) -> Iterator[Any]:
    """Connect to a cluster; leaving the context disconnects, and ends the processes of a local one.

    Args:
        address: "tcp://host:port" of a scheduler; "local" or "local:2" starts worker processes on this
            machine, one for each core or the given number.

    Yields:
        The client, of class `distributed.Client`.

    Raises:
        InvalidInput: If the address cannot be used or reached, a worker has another version of pilotfish or
            none, or Dask is not installed.

    Example:
        >>> with connect("local:2") as client:  # doctest: +SKIP
        ...     fit = pf.learn(open_set(client, "many"), rng=np.random.default_rng(0))
    """
    workers = _parse_address(address)
    distributed = require_distributed()
    with ExitStack() as stack:
        stack.enter_context(_quiet_logs())
        if workers:
            with _block_interrupts():
                cluster = distributed.LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address="127.0.0.1:0",  # any free port
                    silence_logs=logging.CRITICAL,
                )
            stack.callback(cluster.close)
            client = distributed.Client(cluster)
        else:
            client = _open_client(distributed, address)
        stack.callback(client.close)
        _require_same_version(client, address)
        yield client


@contextmanager
def _block_interrupts() -> Iterator[None]:
    """Start threads and processes that Ctrl-C does not reach: they inherit the mask of this thread.

    This process answers Ctrl-C and ends them. One that arrives in the meantime is delivered at the end.
    """
    if not hasattr(signal, "pthread_sigmask"):  # not on every system
        yield
        return
    previous = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous)


def _parse_address(address: str) -> int:
    """Return the number of local workers, or 0 for the address of a scheduler."""
    require_type(address, "address", str, "give a text such as 'local:2'")
    if LOCAL.fullmatch(address):
        number = address.removeprefix("local").removeprefix(":")
        count = int(number) if number else len(os.sched_getaffinity(0))
        if 1 <= count <= MAX_LOCAL_WORKERS:
            return count
    elif REMOTE.fullmatch(address):
        return 0
    raise InvalidInput(
        f"the address of the cluster is {short_repr(address)}, expected 'tcp://host:port' of a Dask "
        f"scheduler, 'local', or 'local:2' with 1 to {MAX_LOCAL_WORKERS} workers"
    )


def _open_client(distributed: Any, address: str) -> Any:
    try:
        return distributed.Client(address, timeout=TIMEOUT)
    except (OSError, TimeoutError, ValueError) as error:
        raise InvalidInput(
            f"no Dask scheduler answers at {address} within {TIMEOUT:g} s; start one with 'dask scheduler', "
            "or check host, port and firewall"
        ) from error


def _require_same_version(client: Any, address: str) -> None:
    """Raise unless every worker has the pilotfish of this process, which reads and learns there."""
    try:
        expected = version("pilotfish")
    except PackageNotFoundError:  # run from a source tree, as the workers then are too
        expected = ""
    found = client.run(version, "pilotfish", on_error="return")
    if not found:
        raise InvalidInput(
            f"the cluster at {address} has no workers; start some with 'dask worker {address}'"
        )
    for worker, answer in found.items():
        if expected and not isinstance(answer, str):
            raise InvalidInput(
                f"worker {worker} has no pilotfish; install it there: pip install '.[scale,io]' in the clone"
            )
        if expected and answer != expected:
            raise InvalidInput(
                f"worker {worker} has pilotfish {answer}, but this is {expected}; install the same version "
                "there"
            )


@contextmanager
def _quiet_logs() -> Iterator[None]:
    """Silence the messages of Dask in this process: errors are raised, and lost workers are replaced."""
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(level)
