"""Fixtures: random demonstrations, and a folder of demonstrations as a person would write it."""

from pathlib import Path

import numpy as np
import pytest
from random_demonstrations import DemonstrationMaker

TOML = """
format = "pilotfish demonstrations"
version = 1
period = 0.5 # s

[[layout]]
name = "position"
quantity = "position"
size = 2
unit = "m"

[[demonstration]]
name = "first"
file = "first.csv"
frames = [{ name = "cup", A = [[1, 0], [0, 2]], b = [0.5, 0] }]

[[demonstration]]
file = "second.csv"
frames = [{ name = "cup", A = [[1, 0], [0, 2]], b = [0, 0] }]
"""
CSV = "position x,position y\n0,1\n2,3.5\n-4e-3,5\n"


@pytest.fixture
def make(rng: np.random.Generator) -> DemonstrationMaker:
    return DemonstrationMaker(rng)


@pytest.fixture
def manual_folder(tmp_path: Path) -> Path:
    """Return a folder of two demonstrations with a TOML manifest and CSV files."""
    (tmp_path / "demonstrations.toml").write_text(TOML)
    for name in ("first", "second"):
        (tmp_path / f"{name}.csv").write_text(CSV)
    return tmp_path
