"""Calling side of a worker: starts the process of a library and sends requests over pipes."""

import json
import os
import select
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

HERE = Path(__file__).parent
TIMEOUT = 900.0  # s for one request
THREADS = ("OPENBLAS", "OMP", "MKL", "BLIS", "NUMEXPR", "VECLIB_MAXIMUM")


class WorkerError(Exception):
    """A library failed; the message is its own."""


def timed_environment() -> dict[str, str]:
    """Return the environment of timed processes: one thread for linear algebra, cached bytecode."""
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return inherited | {f"{library}_NUM_THREADS": "1" for library in THREADS} | {"JAX_PLATFORMS": "cpu"}


class Worker:
    """Long-lived process with one library."""

    def __init__(self, python: Path, library: str, environment: Mapping[str, str]) -> None:
        self._library = library
        self._output = tempfile.TemporaryFile("w+")  # noqa: SIM115 - closed with the worker
        self._process = subprocess.Popen(
            [str(python), str(HERE / "worker.py"), library],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._output,
            text=True,
            env=environment,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def ask(self, do: str, **details: object) -> dict[str, Any]:
        """Send a request and return the reply.

        Raises:
            WorkerError: If the library failed, ended or did not reply in time.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps({"do": do, "library": self._library, **details}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise WorkerError(self._last_output()) from None
        if not select.select([self._process.stdout], [], [], TIMEOUT)[0]:
            self.close()
            raise WorkerError(f"no reply in {TIMEOUT:.0f} s")
        line = self._process.stdout.readline()
        if not line:
            raise WorkerError(self._last_output())
        reply: dict[str, Any] = json.loads(line)
        if "error" in reply:
            raise WorkerError(reply["error"])
        return reply

    def close(self) -> None:
        if self._process.poll() is None:
            self._process.terminate()
            self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe and not pipe.closed:
                pipe.close()
        self._output.close()

    def _last_output(self) -> str:
        code = self._process.wait()
        self._output.seek(0)
        lines = self._output.read().strip().splitlines() or ["without output"]
        return f"the process ended with {code}: {lines[-1]}"
