"""Fixtures and hooks of all tests: annotation checks, seeds, time limit, folder of recordings."""

import os
from collections.abc import Iterator
from ctypes.util import find_library
from pathlib import Path

import numpy as np
import pytest
from annotations import check_annotations
from hypothesis import settings
from jaxtyping import config, install_import_hook

if find_library("OSMesa"):  # renders without a display; MuJoCo reads the variable once, on import
    os.environ.setdefault("MUJOCO_GL", "osmesa")

# The hook makes every function of pilotfish check its annotations at each call. It needs the source on the
# path, hence `pythonpath = ["src"]` in pyproject.toml; test_repository.py tests that it works. Checks make
# many tests slower, so they are off, also while fixtures of modules and sessions are set up.
# `set_annotation_checks` and `checked` turn them on.
install_import_hook("pilotfish", "beartype.beartype")
config.update("jaxtyping_disable", True)

settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, database=None, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") else "local")

pytest_plugins = ["command_fixtures"]  # of commands and simulation

SLOW_AFTER = 10.0  # CPU seconds
LIVE = Path(__file__).parent / "live"
_start_time = pytest.StashKey[float]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of this suite."""
    parser.addoption(
        "--seeds", type=int, default=1, help="number of seeds that each test using rng runs with"
    )
    parser.addoption(
        "--check-annotations",
        action="store_true",
        help="check annotations at every call of pilotfish; of a test that uses rng, for its first seed only",
    )
    parser.addoption(
        "--slow-after",
        type=float,
        default=SLOW_AFTER,
        help="CPU seconds after which a test that is not marked slow fails; 0: no limit",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run each test that uses `rng`, and does not name its own seeds, once per seed."""
    own = [mark.args[0] for mark in metafunc.definition.iter_markers("parametrize")]
    if "rng" in metafunc.fixturenames and "rng" not in own:
        seeds = range(metafunc.config.getoption("seeds"))
        metafunc.parametrize("rng", seeds, indirect=True, ids=lambda seed: f"seed{seed}")


@pytest.hookimpl(tryfirst=True)  # before items are deselected by their marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark live tests slow: they wait for processes, installs and disks.

    Slow tests start first, so that no worker has one alone at the end.
    """
    for item in items:
        if LIVE in item.path.parents:
            item.add_marker("slow")
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Store the CPU time at the start of the test."""
    item.stash[_start_time] = _cpu_seconds()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Fail a test that exceeds the time limit, fixtures included, unless it is marked slow."""
    result = yield
    spent, limit = _cpu_seconds() - item.stash[_start_time], item.config.getoption("slow_after")
    if 0.0 < limit < spent and item.get_closest_marker("slow") is None:
        pytest.fail(
            f"took {spent:.1f} CPU seconds, expected at most {limit:g}: make it or its fixtures faster, "
            "or mark it slow and give the reason",
            pytrace=False,
        )
    return result


def _cpu_seconds() -> float:
    """Return the CPU time of this process and of its finished children.

    Unlike the time on a clock it does not grow when other programs use the machine.
    """
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """Return a generator; with `--seeds N` each test that uses it runs with N seeds."""
    return np.random.default_rng(request.param)


@pytest.fixture(autouse=True)
def set_annotation_checks(request: pytest.FixtureRequest) -> Iterator[None]:
    """Check annotations if `--check-annotations` asks for it; further seeds test numbers, not types."""
    callspec = getattr(request.node, "callspec", None)
    first_seed = callspec is None or callspec.indices.get("rng", 0) == 0
    with check_annotations(first_seed and request.config.getoption("check_annotations")):
        yield


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Run a test without annotation checks: in physics they cost five to eight times the physics."""
    with check_annotations(False):
        yield


@pytest.fixture
def checked() -> Iterator[None]:
    """Check annotations in a test whatever the options, and also if its module is unchecked."""
    with check_annotations(True):
        yield


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Return the folder of real recordings that PILOTFISH_DATA names; skip the test without it."""
    name = os.environ.get("PILOTFISH_DATA")
    if not name:
        pytest.skip("PILOTFISH_DATA names no folder of recordings")
    folder = Path(name)
    assert folder.is_dir(), f"PILOTFISH_DATA is {name!r}, expected a folder; unset it to skip these tests"
    return folder
