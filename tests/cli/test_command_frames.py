"""pilotfish frames, calibrate and markers."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import Result
from marker_images import UNIT, facing_pose, marker_image

from pilotfish.geometry import Pose
from pilotfish.vision import Marker

RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]
RunCommand = Callable[..., Result]
MARKERS = """
format = "pilotfish markers"
version = 1
[camera]
width = 640
height = 480
fx = 600.0
fy = 610.0
cx = 315.0
cy = 243.0
[[marker]]
id = 3
side = 0.1
frame = "tray"
"""


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Folder of five images of a moving marker, hidden in the third, and markers.toml beside it."""
    (tmp_path / "markers.toml").write_text(MARKERS)
    folder = tmp_path / "images"
    folder.mkdir()
    marker = Marker(3, 0.1, "tray", Pose(np.zeros(3), UNIT))
    for n in range(5):
        placed = [(marker, facing_pose((0.01 * n, 0.0, 0.6), 0.4))] if n != 2 else []
        cv2.imwrite(str(folder / f"{n}.png"), marker_image(placed))
    return folder


def test_table_has_a_row_for_each_image(recording: Path, run_json: RunJson):
    out, picture = recording.parent / "frames.csv", recording.parent / "axes.png"
    options = (
        "--markers",
        str(recording.parent / "markers.toml"),
        "--out",
        str(out),
        "--picture",
        str(picture),
    )
    result = run_json("frames", str(recording), *options, "--period", "0.1")
    assert result["images"] == 5
    assert result["frames"]["tray"]["found"] == pytest.approx(0.8)
    assert result["frames"]["tray"]["rejections"] == {"marker not found": 1}
    np.testing.assert_allclose(result["frames"]["tray"]["gaps"], [[0.2, 0.2]])
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [row["tray visible"] for row in rows] == ["1", "1", "0", "1", "1"]
    assert rows[2]["tray x [m]"] == ""
    np.testing.assert_allclose(
        [float(row["tray x [m]"]) for row in rows if row["tray x [m]"]], [0.0, 0.01, 0.03, 0.04], atol=0.002
    )
    assert cv2.imread(str(picture)).shape == (480, 640, 3)


def test_mistakes_are_one_line(recording: Path, run_failing: RunFailing):
    folder = recording.parent
    options = ("--markers", str(folder / "markers.toml"), "--out", str(folder / "frames.csv"))
    assert "period" in run_failing("frames", str(recording), *options)
    assert "does not exist" in run_failing("frames", str(folder / "none.mp4"), *options)
    (folder / "markers.toml").write_text(MARKERS.replace("side", "sides"))
    assert "did you mean 'side'" in run_failing("frames", str(recording), *options, "--period", "0.1")
    assert not (folder / "frames.csv").exists()


def test_markers_are_written_once(
    tmp_path: Path, run_json: RunJson, run_failing: RunFailing, run_command_line: RunCommand
):
    options = ("markers", "--ids", "0-2,7", "--side", "0.05", "--out", str(tmp_path / "m.pdf"))
    assert run_json(*options)["ids"] == [0, 1, 2, 7]
    assert "exists" in run_failing(*options)
    refused = run_command_line("markers", "--ids", "5-2", *options[3:])
    assert refused.exit_code == 2
    assert "not a list of numbers" in refused.stderr


def test_calibration_without_boards_is_refused(recording: Path, run_failing: RunFailing):
    out = recording.parent / "camera.toml"
    options = ("--board", "9x6", "--square", "0.025", "--out", str(out))
    assert "0 views show the board" in run_failing("calibrate", str(recording), *options)
    assert not out.exists()
