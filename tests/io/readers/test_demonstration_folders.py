"""Import of the project's own folders: rows that `read_demonstrations` refuses are repaired."""

from pathlib import Path

import numpy as np
import pytest

from pilotfish.demonstrations import (
    build_demonstration,
    demonstration,
    frame_from_pose,
    moving_frame_from_poses,
    pose_layout,
    suggest_settings,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.io import read_demonstrations, write_demonstrations
from pilotfish.io.readers import demonstration_folders, read_recordings

LAYOUT = pose_layout()


def pose_rows(rng: np.random.Generator, steps: int = 12) -> np.ndarray:
    angle = np.linspace(0.2, 0.9, steps) + rng.uniform(0, 0.3)
    zero = np.zeros(steps)
    return np.c_[np.cumsum(rng.normal(size=(steps, 3)), axis=0), np.cos(angle), np.sin(angle), zero, zero]


def write(folder: Path, rng: np.random.Generator) -> list:
    pose = Pose(rng.normal(size=3), np.array([0.6, 0.0, 0.0, 0.8]))
    given = [
        demonstration(pose_rows(rng), 0.1, LAYOUT, [frame_from_pose("cup", LAYOUT, pose)], name)
        for name in ("a", "b")
    ]
    write_demonstrations(given, folder)
    return given


def imported(folder: Path) -> list:
    recordings = list(read_recordings(folder))
    settings, questions = suggest_settings(recordings)
    assert questions == ()
    return [build_demonstration(recording, settings) for recording in recordings]


def test_read_folder_and_import_are_equal(rng, tmp_path: Path):
    given = write(tmp_path / "set", rng)
    assert demonstration_folders.recognises(tmp_path / "set")
    for demo, (found, conversion) in zip(given, imported(tmp_path / "set"), strict=True):
        assert (found.name, found.period, found.layout) == (demo.name, demo.period, demo.layout)
        np.testing.assert_allclose(found.x, demo.x, atol=1e-12)
        np.testing.assert_allclose(found.frames[0].A, demo.frames[0].A, atol=1e-12)
        np.testing.assert_allclose(found.frames[0].b, demo.frames[0].b, atol=1e-12)
        assert conversion.lines == ()


TOML = """format = "pilotfish demonstrations"
version = 1
period = 0.1
[[layout]]
name = "position"
quantity = "position"
size = 3
unit = "mm"
[[layout]]
name = "orientation"
quantity = "quaternion"
size = 4
unit = "1"
[[demonstration]]
name = "a"
file = "a.csv"
"""
HEADER = ",".join(LAYOUT.names)


def write_table(folder: Path, header: str, rows: np.ndarray) -> Path:
    folder.mkdir()
    (folder / "demonstrations.toml").write_text(TOML)
    np.savetxt(folder / "a.csv", rows, fmt="%.12g", delimiter=",", header=header, comments="")
    return folder


def test_uneven_times_sign_changes_and_units_are_repaired(rng, tmp_path: Path):
    """Reading names each; the import resamples, makes signs continuous, and converts mm."""
    x = pose_rows(rng)
    times = 0.1 * np.arange(12) + 0.02 * np.sin(np.arange(12))
    signed = x.copy()
    signed[6:, 3:] *= -1
    folder = write_table(tmp_path / "set", f"time [s],{HEADER}", np.c_[times, signed])
    with pytest.raises(InvalidInput, match=r"'time \[s\]': times ascend by .* period of 0.1 s"):
        read_demonstrations(folder)
    ((found, conversion),) = imported(folder)
    expected = np.interp(times[0] + found.period * np.arange(len(found.x)), times, x[:, 0]) / 1000
    np.testing.assert_allclose(found.x[:, 0], expected, atol=1e-9)
    lines = " ".join(conversion.lines)
    assert all(text in lines for text in ("resampled", "changed its sign", "mm converted to m"))


def test_times_that_agree_with_the_period_and_units_in_the_header_are_read(rng, tmp_path: Path):
    """The motions that `reproduce` writes have both."""
    x, header = pose_rows(rng), HEADER.replace("position x", "position x [mm]")
    folder = write_table(tmp_path / "set", f"time [s],{header}", np.c_[0.1 * np.arange(12), x])
    (found,) = read_demonstrations(folder)
    np.testing.assert_allclose(found.x, x, atol=1e-9)


def test_moving_frames_are_refused(rng, tmp_path: Path):
    x = pose_rows(rng)
    poses = [Pose(row[:3], row[3:]) for row in x]
    moving = moving_frame_from_poses("cup", LAYOUT, poses)
    write_demonstrations([demonstration(x, 0.1, LAYOUT, [moving])], tmp_path / "set")
    with pytest.raises(InvalidInput, match="frame 'cup' moves"):
        list(read_recordings(tmp_path / "set"))
