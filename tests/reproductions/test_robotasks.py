"""Robotasks reproductions start and end at the frames, and demonstrations start and end at rest."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pilotfish.geometry import angle

FOLDER = Path(__file__).parents[2] / "reproductions"


@pytest.mark.parametrize("sphere", [False, True])
def test_reproduce_starts_and_ends_at_frames(data_folder, robotasks, sphere):
    data = robotasks.to_representation(robotasks.load_demonstrations("openbox"), sphere)
    skill, demonstration = robotasks.learn_skill(data[::2]).skill, data[1]
    done = robotasks.reproduce(skill, demonstration)
    assert np.linalg.norm(done.poses[-1, :3] - demonstration.x[-1, :3]) < 0.03
    assert np.degrees(angle(done.poses[-1, 3:], demonstration.x[-1, 3:7])) < 3.0
    for still in (0, -1):
        assert done.metres < np.sqrt(np.mean((demonstration.x[:, :3] - demonstration.x[still, :3]) ** 2) * 3)
        turned = robotasks.root_mean_square(angle(demonstration.x[:, 3:7], demonstration.x[still, 3:7]))
        assert done.degrees < np.degrees(turned)


def test_demonstrations_start_and_end_at_rest(data_folder, robotasks):
    for demonstration in robotasks.load_demonstrations("pouring"):
        for frame, row in zip(demonstration.frames, (0, -1), strict=True):
            local = np.linalg.solve(frame.A, demonstration.x[row] - frame.b)
            np.testing.assert_allclose(local[:7], [0, 0, 0, 1, 0, 0, 0], atol=1e-9)


@pytest.mark.slow  # runs the reproduction
def test_robotasks_writes_outputs(data_folder, tmp_path):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    command = [sys.executable, FOLDER / "robotasks.py", "--json", report, "--out", pictures]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    rows = json.loads(report.read_text())["rows"]
    assert len(rows) == 8
    assert all(0 < row["test [m]"] < 0.1 and 0 < row["test [deg]"] < 20 for row in rows)
    assert len(list(pictures.glob("*.png"))) == 4
