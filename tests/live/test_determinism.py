"""Public results have the same bits in every process, whatever the addresses of memory."""

import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
PROCESSES = 8

pytestmark = pytest.mark.slow  # eight processes compute everything


def environment(number: int) -> dict[str, str]:
    """Return the environment of one process: own hash seed, heap, stack and fill of freed memory."""
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(TOP / "src"), str(TOP / "tests" / "shared")]),
        "PYTHONHASHSEED": str(number),
        "OPENBLAS_NUM_THREADS": "1",
        "MALLOC_PERTURB_": str(37 * number % 256),
        "MALLOC_TOP_PAD_": str(4096 * number + 16),
        "MALLOC_MMAP_THRESHOLD_": str(2 ** (12 + 2 * number)),
        "STACK_PADDING": "x" * (16 * number),
    }


def run(command: list[str], number: int) -> str:
    finished = subprocess.run(
        command, env=environment(number), cwd=TOP, capture_output=True, text=True, check=False
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


def test_public_results_eight_processes_have_equal_bits():
    script = [sys.executable, str(TOP / "tests" / "shared" / "determinism_results.py")]
    with ThreadPoolExecutor(2) as pool:
        outputs = list(pool.map(lambda n: run([*script, str(n)], n), range(PROCESSES)))
    first, *others = (dict(line.split("\t") for line in output.splitlines()) for output in outputs)
    assert len(first) >= 31
    different = [name for name in first if any(other[name] != first[name] for other in others)]
    assert not different
    assert all(set(other) == set(first) for other in others)


def test_learn_command_four_runs_write_equal_content(data_folder, tmp_path):
    """Semi-tied covariances once depended on an address."""
    learn = [sys.executable, "-m", "pilotfish", "learn", "dataset:valve", "--only", "0-3"]
    learn += ["--structure", "semi-tied", "--seed", "5"]
    hashes = set()
    for number in range(4):
        run([*learn, "--out", str(tmp_path / f"{number}.skill")], number)
        text = run([sys.executable, "-m", "pilotfish", "show", str(tmp_path / f"{number}.skill")], number)
        hashes.update(re.findall(r"^content hash\s+(\S+)", text, re.MULTILINE))
    assert len(hashes) == 1
