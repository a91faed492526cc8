"""Reproductions of the published recordings agree with the published numbers."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import pilotfish as pf

FOLDER = Path(__file__).parents[2] / "reproductions"
TOLERANCE = 1.05


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"reproduce_{name}", FOLDER / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("alpha", [0.0, 0.5, 1.0])
def test_valve_errors_are_at_most_published(data_folder, alpha):
    valve, demonstrations = script("valve"), pf.datasets.valve()
    train, test, parameters, _ = valve.THESIS[alpha]
    skill = valve.learn_skill(demonstrations[:4], valve.structure(alpha)).skill
    assert valve.mean_error(skill, demonstrations[:4]) <= TOLERANCE * train
    assert valve.mean_error(skill, demonstrations[4:]) <= TOLERANCE * test
    assert 2 * valve.structure(alpha).parameter_count(7, 14) == parameters


def test_valve_frames_are_precise_at_grasp_and_release(data_folder):
    valve = script("valve")
    skill = valve.learn_skill(pf.datasets.valve()[:4], pf.structures.Full()).skill
    for frame, state in ((0, 2), (1, 4)):
        log_volumes = np.linalg.slogdet(skill.covariances[frame].dense[:, :7, :7])[1]
        assert log_volumes.argmin() == state


def test_zshape_first_and_third_stroke_share_directions(data_folder):
    rows, _ = script("zshape").semi_tied(pf.datasets.zshape())
    assert rows[0]["semi-tied correlation 0-2"] > 0.9
    assert max(rows[0]["semi-tied correlation 0-1"], rows[0]["semi-tied correlation 1-2"]) < 0.3


@pytest.mark.slow  # runs the reproduction
@pytest.mark.parametrize("name", ["valve", "zshape"])
def test_reproduction_writes_outputs(data_folder, tmp_path, name):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    command = [sys.executable, FOLDER / f"{name}.py", "--json", report, "--out", pictures]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    assert json.loads(report.read_text())["rows"]
    assert len(list(pictures.glob("*.png"))) >= 10


@pytest.mark.slow  # runs the reproduction
def test_durations_are_recovered(tmp_path):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    options = ["--json", report, "--out", pictures, "--seeds", "2"]
    command = [sys.executable, FOLDER / "durations.py", *options]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    first, *_, last = json.loads(report.read_text())["rows"]
    error = "error of the means [fraction]"
    assert last[f"fitted {error}"] < 0.5 * first[f"fitted {error}"]
    assert last[f"fitted {error}"] < 0.5 * last[f"counted {error}"]
    assert last["counted bias of the means [fraction]"] < 0.0
    assert (pictures / "durations.png").stat().st_size > 10_000


def test_valve_choice_follows_protocol(data_folder):
    choice, valve, demonstrations = script("valve_choice"), script("valve"), pf.datasets.valve()
    train, test = demonstrations[:4], demonstrations[4:]
    skill, powers = choice.learn_skill(train, 7, pf.structures.SemiTied(), 1e-5)
    assert powers.shape == (2, 7)
    for own_start in (False, True):
        errors = [choice.squared_errors(skill, None, d, 2e-3, 9.0, own_start).mean() for d in test]
        np.testing.assert_allclose(np.mean(errors), valve.mean_error(skill, test, own_start=own_start))
