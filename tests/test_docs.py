"""The documentation speaks of what exists."""

import importlib
import re
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pilotfish as pf
from pilotfish import plots

DOCS = Path(__file__).parents[1] / "docs"
THESIS_MAP = (DOCS / "thesis-map.md").read_text(encoding="utf-8")
PICTURES = (DOCS / "pictures.md").read_text(encoding="utf-8")
DRAWING = set(plots.__all__) - {"MOST_STATES", "state_colour"}


def test_every_name_of_the_thesis_map_is_public_in_its_package():
    names = set(re.findall(r"`([a-z]+)\.([A-Za-z_]+)`", THESIS_MAP))
    packages = {package: importlib.import_module(f"pilotfish.{package}") for package, _ in names}
    assert len(names) >= 50
    assert {(package, name) for package, name in names if name not in packages[package].__all__} == set()


def test_every_picture_has_its_section_in_the_docs():
    """docs/pictures.md explains each function of the room that draws, and no other."""
    assert set(re.findall(r"^### `(\w+)\(", PICTURES, re.MULTILINE)) == DRAWING


@pytest.mark.slow  # draws fourteen pictures with checks of annotations: 14 CPU seconds
def test_the_pictures_of_the_docs_are_drawn_as_written(data_folder, tmp_path, monkeypatch):
    """The block of docs/pictures.md, run in an empty folder, leaves one picture for each function."""
    (block,) = re.findall(r"```python\n(.*?)```", PICTURES, re.DOTALL)
    program = tmp_path / "pictures.py"
    program.write_text(block, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(program))
    assert {path.stem.replace("-", "_") for path in tmp_path.glob("*.png")} == DRAWING


def program(page: str) -> dict[str, Any]:
    """The names that are left when the Python blocks of a page have run as one program."""
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    exec("\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL)), names)  # noqa: S102 - our own text
    return names


def test_every_page_is_found_from_the_index():
    """docs/index.md links each page beside it, and every link of every page leads to a file."""
    pages = sorted(DOCS.glob("*.md"))
    links = {
        page.name: re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
        for page in pages
    }
    assert {page.name for page in pages} - {"index.md"} <= set(links["index.md"])
    missing = [
        f"{page}: {link}" for page, all_of in links.items() for link in all_of if not (DOCS / link).exists()
    ]
    assert not missing


def test_the_program_about_choosing_a_model_picks_one_and_hears_frames_as_they_matter(data_folder):
    names = program("choosing-a-model")
    assert names["selection"].best.candidate.structure == pf.structures.Diagonal()
    assert names["found"].distractors == ()
    assert names["found"].values.shape == (2, 7)
    assert all(len(d.frames) == 2 for d in names["fewer"])


def test_the_program_about_durations_is_as_much_likelier_as_the_page_says(data_folder):
    names = program("durations")
    shown = names["demonstrations"]
    exact, counted = (pf.log_likelihood(s, shown).sum() for s in (names["fit"].skill, names["counted"]))
    assert 14.0 < exact - counted < 16.0
    durations = names["durations"]
    assert np.exp(durations.log_table(durations.max_duration(1e-8))).sum(axis=0) == pytest.approx(1.0)


def test_the_program_about_orientations_gives_unit_quaternions_and_the_widths_that_it_tells(data_folder):
    names = program("orientations")
    skill, x = names["fit"].skill, names["x"]
    assert skill.width == 13
    assert skill.covariances[0].dense.shape == (7, 12, 12)
    assert x.shape == (200, 13)
    np.testing.assert_allclose(np.linalg.norm(x[:, 3:7], axis=1), 1.0, rtol=1e-12)


def test_the_program_of_regression_and_via_points_runs_and_passes_the_point(data_folder):
    """The Python blocks of the page are one program; its motion keeps what the page promises."""
    names = program("regression-and-via-points")
    x = names["motion"].x
    assert np.linalg.norm(x[40, :3] - [0.44, -0.95, 0.31]) < 1e-3
    assert names["told"].means.shape == (200, 13)


def test_the_program_of_the_world_to_act_in_records_whoever_leads_and_steps_an_environment():
    names = program("physics")
    assert len(names["recording"].demonstration.x) == 12  # a second, ten rows each, and what settles
    assert not names["info"]["success"]


def test_the_front_door_tells_what_each_of_its_names_is_for():
    """The docstring of pilotfish sorts every name by the step of the way that it belongs to."""
    told = set(re.findall(r"\w+", str(pf.__doc__)))
    assert set(pf.__all__) <= told
