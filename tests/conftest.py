"""What every law shares: annotations that are checked, seeds, and the folder of real recordings."""

import os
from ctypes.util import find_library
from pathlib import Path

import numpy as np
import pytest
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


@pytest.fixture(params=range(3), ids=lambda seed: f"seed{seed}")
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """Randomness; every law that asks for it is tried with several seeds."""
    return np.random.default_rng(request.param)


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of real recordings that PILOTFISH_DATA names; without it the law is skipped."""
    named = os.environ.get("PILOTFISH_DATA")
    if not named:
        pytest.skip("PILOTFISH_DATA names no folder of recordings")
    folder = Path(named)
    assert folder.is_dir(), f"PILOTFISH_DATA is {named!r}, expected a folder; unset it to skip these laws"
    return folder
