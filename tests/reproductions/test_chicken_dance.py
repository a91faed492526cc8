"""The dance is regenerated from time and from half of the body."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageChops

import pilotfish as pf


@pytest.fixture(scope="module")
def dance(data_folder, chicken_dance):
    return chicken_dance.add_time_column(pf.demonstrations.resample(pf.datasets.chicken_dance()[0], 500))


def test_parameter_counts_equal_published():
    assert pf.structures.Full().parameter_count(75, 94) == 334_875
    assert pf.structures.SemiTied(1.0).parameter_count(75, 94) == 15_886


def test_bone_lengths_are_constant(data_folder, chicken_dance):
    (recorded,) = pf.datasets.chicken_dance()
    names = [part.name for part in recorded.layout.parts]
    bones = chicken_dance.bones()
    assert len(bones) == 27
    joined = {names[0]}
    while more := {n for bone in bones for n in bone if joined & set(bone)} - joined:
        joined |= more
    assert joined == set(names)
    for here, there in bones:
        gap = recorded.x[:, recorded.layout.columns(here)] - recorded.x[:, recorded.layout.columns(there)]
        lengths = np.linalg.norm(gap, axis=1)
        assert 0.02 < lengths[0] < 0.5  # m
        assert np.ptp(lengths) < 1e-9


def test_regenerate_keeps_inputs(dance, chicken_dance):
    columns = chicken_dance.input_columns("half", dance.layout)
    names = [dance.layout.names[c] for c in columns]
    assert names[0] == "time"
    assert len(names) == 34
    assert not [name for name in names if name.startswith(("Right", "R"))]
    skill = chicken_dance.learn_skill(dance, "full", 3).skill
    made = chicken_dance.regenerate(skill, dance.x, columns)
    np.testing.assert_array_equal(made[:, columns], dance.x[:, columns])
    assert np.abs(made - dance.x).max() > 1e-3


def test_one_component_equals_least_squares(dance, chicken_dance):
    skill = chicken_dance.learn_skill(dance, "full", 1).skill
    made = chicken_dance.regenerate(skill, dance.x, np.array([0]))
    seconds, body = dance.x[:, 0] - dance.x[:, 0].mean(), dance.x[:, 1:] - dance.x[:, 1:].mean(axis=0)
    slope = seconds @ body / (seconds @ seconds + len(seconds) * 1e-4)
    np.testing.assert_allclose(made[:, 1:], dance.x[:, 1:].mean(axis=0) + np.outer(seconds, slope), atol=1e-9)


def test_more_components_reduce_error(dance, chicken_dance):
    rows = {
        (label, states): chicken_dance.measure_mixture(dance, label, states)
        for label in ("semi-tied(1)", "full")
        for states in (5, 20)
    }
    for task in ("time", "half"):
        for label in ("semi-tied(1)", "full"):
            assert rows[label, 20]["mse"][task] < 0.5 * rows[label, 5]["mse"][task]
        assert rows["full", 20]["mse"][task] < rows["semi-tied(1)", 20]["mse"][task]
    tied, free = rows["semi-tied(1)", 20], rows["full", 20]
    assert tied["covariance_parameters"] < 0.2 * free["covariance_parameters"]
    assert tied["mean_component_correlation"] > 1.2 * free["mean_component_correlation"]
    assert tied["rms_cm"]["unseen"] < 1.2 * free["rms_cm"]["unseen"] < 5.0


@pytest.mark.slow  # runs the reproduction: 21 CPU seconds
def test_chicken_dance_writes_outputs(data_folder, tmp_path):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    script = Path(__file__).parents[2] / "reproductions" / "chicken_dance.py"
    command = [sys.executable, script, "--components", "3", "--json", report, "--out", pictures]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    assert {row["components"] for row in json.loads(report.read_text())["rows"]} == {3}
    assert len(list(pictures.glob("*.png"))) == 3
    assert (pictures / "dance.gif").stat().st_size < 4_000_000
    with Image.open(pictures / "dance.gif") as film:
        assert film.n_frames == 125
        first = film.convert("RGB")
        film.seek(60)
        assert ImageChops.difference(first, film.convert("RGB")).getbbox()
