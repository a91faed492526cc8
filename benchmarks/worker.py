"""Process of one library: reads requests as lines of JSON and replies with lines of JSON.

`python worker.py LIBRARY`. Arrays come from .npy files in the folder of a request.
"""

import gc
import importlib
import importlib.metadata
import json
import os
import platform
import resource
import sys
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from peer_libraries import LIBRARIES
from prepared import Answer, Prepared

Reply = dict[str, Any]  # JSON object
RESET = Path("/proc/self/clear_refs")


def serve(library: str) -> None:
    """Reply until stdin ends. Output of the library goes to stderr, so that stdout has replies only."""
    replies = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    warnings.simplefilter("ignore")  # deprecations of a peer
    calls: dict[str, Prepared] = {}
    adapter = None
    for line in sys.stdin:
        request = json.loads(line)
        try:
            if adapter is None:
                adapter = importlib.import_module(f"libraries.{library}")
            reply = ACTIONS[request["do"]](adapter, calls, request)
        except Exception as error:  # noqa: BLE001 - the outermost loop: a library that fails is reported
            traceback.print_exc()
            reply = {"error": f"{type(error).__name__}: {error}"}
        replies.write(json.dumps(reply) + "\n")


def introduce(adapter: Any, calls: dict[str, Prepared], request: Reply) -> Reply:
    versions = version_of(LIBRARIES[request["library"]].distribution), version_of("numpy")
    python = platform.python_version()
    return {"version": versions[0], "numpy": versions[1], "python": python, "remark": adapter.remark()}


def version_of(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:  # run from a source tree that was never installed
        return "not installed"


def prepare(adapter: Any, calls: dict[str, Prepared], request: Reply) -> Reply:
    calls[request["call"]] = getattr(adapter, request["function"])(Path(request["folder"]))
    return {}


def run(adapter: Any, calls: dict[str, Prepared], request: Reply) -> Reply:
    """Measure a number of consecutive calls, and return the time of one unit of work [s]."""
    prepared, repeats = calls[request["call"]], request["repeats"]
    reset_peak_memory()
    before = peak_mb()
    result, cpu, wall = timed(prepared.run, repeats)
    spent, peak = process_time(), peak_mb()
    answer: Answer = prepared.answer(result)
    share = 1.0 / (repeats * answer.units)
    return {
        "cpu": cpu * share,
        "wall": wall * share,
        "call_cpu": cpu / repeats,
        "result": spent,
        "answer": answer.value,
        "begin": answer.begin,
        "remark": answer.remark,
        "peak_mb": peak,
        "grown_mb": peak - before,
    }


def timed(call: Callable[[], Any], repeats: int) -> tuple[Any, float, float]:
    gc.collect()
    gc.disable()
    wall, cpu = perf_counter(), process_time()
    for _ in range(repeats):
        result = call()
    spent = process_time() - cpu, perf_counter() - wall
    gc.enable()
    return result, *spent


def reset_peak_memory() -> None:
    """Reset the peak memory, if the kernel allows it."""
    if RESET.exists():
        RESET.write_text("5")


def peak_mb() -> float:
    """Return the peak memory of this process since the reset [MB]; Linux counts it in KiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


ACTIONS = {"introduce": introduce, "prepare": prepare, "run": run}

if __name__ == "__main__":
    serve(sys.argv[1])
