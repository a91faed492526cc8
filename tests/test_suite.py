"""Hooks of this suite: seeds, annotation checks, and the time limit of tests that are not marked slow."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import config

TESTS = Path(__file__).parent
LIMITED = """
import subprocess, sys, time
import pytest

BUSY = "import time; began = time.process_time()\\nwhile time.process_time() - began < 0.5: pass"

def busy():
    exec(BUSY, {})

@pytest.fixture
def expensive():
    busy()

def test_busy():
    busy()

def test_busy_child():
    subprocess.run([sys.executable, "-c", BUSY], check=True)

def test_busy_fixture(expensive):
    pass

def test_waiting():
    time.sleep(0.5)

def test_random(rng):
    assert 0.0 <= rng.random() < 1.0

@pytest.mark.slow
def test_marked():
    busy()
"""
ANNOTATED = """
import pytest
from jaxtyping import config

@pytest.fixture(scope="module")
def checked_in_module():
    return not config.jaxtyping_disable

def test_module(checked_in_module):
    assert checked_in_module

def test_plain():
    assert not config.jaxtyping_disable

def test_random(rng):
    assert not config.jaxtyping_disable

def test_checked(checked):
    assert not config.jaxtyping_disable

def test_unchecked(unchecked):
    assert not config.jaxtyping_disable

def test_last():
    assert not config.jaxtyping_disable
"""

Run = Callable[..., dict[str, str]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Return a function that runs a program with this conftest and returns the outcome of each test."""
    (tmp_path / "conftest.py").write_text((TESTS / "conftest.py").read_text(encoding="utf-8"))
    (tmp_path / "pytest.ini").write_text(f"[pytest]\npythonpath = {TESTS / 'shared'}\nmarkers = slow: x\n")

    def run_program(program: str, *options: str) -> dict[str, str]:
        (tmp_path / "test_program.py").write_text(program)
        left_out = [f"-pno:{name}" for name in ("cacheprovider", "xdist", "command_fixtures")]
        command = [sys.executable, "-m", "pytest", "-v", *left_out, *options]
        ran = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True, timeout=120)
        lines = [line.split() for line in ran.stdout.splitlines() if line.startswith("test_program.py::")]
        return {words[0].partition("::")[2]: words[1] for words in lines}

    return run_program


@pytest.mark.slow  # runs pytest in another process and measures CPU time
def test_slow_after_counts_children_and_fixtures_and_seeds_repeat_tests_that_use_rng(run: Run):
    outcomes = run(LIMITED, "--seeds", "3", "--slow-after", "0.4")
    failed = {"test_busy", "test_busy_child", "test_busy_fixture"}
    assert {name for name, outcome in outcomes.items() if outcome == "FAILED"} == failed
    passed = {"test_waiting", "test_marked", *(f"test_random[seed{n}]" for n in range(3))}
    assert {name for name, outcome in outcomes.items() if outcome == "PASSED"} == passed
    assert next(iter(outcomes)) == "test_marked"  # slow tests start first


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ((), {"test_checked"}),
        (("--check-annotations",), {"test_plain", "test_random[seed0]", "test_checked", "test_last"}),
    ],
)
def test_annotations_are_checked_on_request_and_for_the_first_seed_only(
    run: Run, options: tuple[str, ...], expected: set[str]
):
    outcomes = run(ANNOTATED, "--seeds", "2", *options)
    assert {name for name, outcome in outcomes.items() if outcome == "PASSED"} == expected
    assert {name for name, outcome in outcomes.items() if outcome == "FAILED"} == {
        "test_module",
        "test_plain",
        "test_random[seed0]",
        "test_random[seed1]",
        "test_checked",
        "test_unchecked",
        "test_last",
    } - expected


def test_annotations_in_this_run_are_checked_as_requested(
    request: pytest.FixtureRequest, rng: np.random.Generator
):
    first_seed = request.node.callspec.id == "seed0"
    assert config.jaxtyping_disable != (request.config.getoption("check_annotations") and first_seed)
