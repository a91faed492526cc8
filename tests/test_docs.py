"""The documentation speaks of what exists."""

import importlib
import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from pilotfish import plots

DOCS = Path(__file__).parents[1] / "docs"
THESIS_MAP = (DOCS / "thesis-map.md").read_text(encoding="utf-8")
PICTURES = (DOCS / "pictures.md").read_text(encoding="utf-8")
DRAWING = set(plots.__all__) - {"MOST_STATES", "state_colour"}
NAMES = sorted(set(re.findall(r"`([a-z]+)\.([A-Za-z_]+)`", THESIS_MAP)))


@pytest.mark.parametrize(("room", "name"), NAMES, ids=".".join)
def test_every_name_of_the_thesis_map_is_public_in_its_room(room, name):
    assert name in importlib.import_module(f"pilotfish.{room}").__all__


def test_every_picture_has_its_section_in_the_docs():
    """docs/pictures.md explains each function of the room that draws, and no other."""
    assert set(re.findall(r"^### `(\w+)\(", PICTURES, re.MULTILINE)) == DRAWING


@pytest.mark.slow
def test_the_pictures_of_the_docs_are_drawn_as_written(data_folder, tmp_path, monkeypatch):
    """The block of docs/pictures.md, run in an empty folder, leaves one picture for each function."""
    (block,) = re.findall(r"```python\n(.*?)```", PICTURES, re.DOTALL)
    program = tmp_path / "pictures.py"
    program.write_text(block, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(program))
    assert {path.stem.replace("-", "_") for path in tmp_path.glob("*.png")} == DRAWING


@pytest.mark.slow
def test_the_program_of_regression_and_via_points_runs_and_passes_the_point(data_folder):
    """The Python blocks of the page are one program; its motion keeps what the page promises."""
    page = (DOCS / "regression-and-via-points.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    exec("\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL)), names)  # noqa: S102 - our own text
    x = names["motion"].x  # type: ignore[attr-defined]
    assert np.linalg.norm(x[40, :3] - [0.44, -0.95, 0.31]) < 1e-3
    assert names["told"].means.shape == (200, 13)  # type: ignore[attr-defined]
