"""What all tests share: checked annotations, seeds, the limit on run time, the folder of recordings."""

import os
from collections.abc import Iterator
from ctypes.util import find_library
from pathlib import Path

import numpy as np
import pytest
from annotations import check_annotations
from hypothesis import settings
from jaxtyping import install_import_hook

if find_library("OSMesa"):  # it draws without a screen; MuJoCo asks once, when it is imported
    os.environ.setdefault("MUJOCO_GL", "osmesa")

# From here on every annotation in pilotfish is checked at every call. The hook sees what is on the path,
# hence `pythonpath = ["src"]` in pyproject.toml; test_house.py proves that it is at work.
install_import_hook("pilotfish", "beartype.beartype")

settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, database=None, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")

pytest_plugins = ["command_fixtures"]  # of the commands and the simulation

SLOW_AFTER = 10.0  # CPU seconds
LIVE = Path(__file__).parent / "live"
_began = pytest.StashKey[float]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of this suite."""
    parser.addoption(
        "--seeds", type=int, default=1, help="number of seeds that each test using rng runs with"
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
    """Mark live tests slow: they wait for processes, installs and disks. Start slow tests first, so that no
    worker is left alone with one at the end.
    """
    for item in items:
        if LIVE in item.path.parents:
            item.add_marker("slow")
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Note when the test began."""
    item.stash[_began] = _cpu_seconds()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Fail a test that takes too long, fixtures included, unless it is marked slow."""
    result = yield
    spent, limit = _cpu_seconds() - item.stash[_began], item.config.getoption("slow_after")
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


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Run a test without checks of annotations: in physics they cost five to eight times the physics."""
    with check_annotations(False):
        yield


@pytest.fixture
def checked() -> Iterator[None]:
    """Check annotations in a test whose module is unchecked."""
    with check_annotations(True):
        yield


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of real recordings that PILOTFISH_DATA names; without it the test is skipped."""
    named = os.environ.get("PILOTFISH_DATA")
    if not named:
        pytest.skip("PILOTFISH_DATA names no folder of recordings")
    folder = Path(named)
    assert folder.is_dir(), f"PILOTFISH_DATA is {named!r}, expected a folder; unset it to skip these tests"
    return folder
