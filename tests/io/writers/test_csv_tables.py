"""CSV export: an import returns the same demonstration, by the names of columns or by the settings."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    Layout,
    MovingFrame,
    Part,
    Quantity,
    add_derivatives,
    build_demonstration,
    demonstration,
    frame,
    frame_from_pose,
    moving_frame_from_poses,
    position_layout,
    suggest_settings,
    world_frame,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, normalise
from pilotfish.io import read_import_settings, write_demonstrations
from pilotfish.io.readers import read_recordings
from pilotfish.io.writers import csv_tables, export_demonstrations

RunJson = Callable[..., dict[str, Any]]
LAYOUT = Layout(
    (
        Part("position", Quantity.POSITION, 3, "m"),
        Part("orientation", Quantity.QUATERNION, 4, "1"),
        Part("gripper", Quantity.SCALAR, 1, "1"),
    )
)


def random_demo(rng: np.random.Generator, name: str = "reach", period: float = 0.05) -> Demonstration:
    steps = int(rng.integers(10, 40))
    q = normalise(np.eye(4)[0] + np.cumsum(rng.normal(0.0, 0.02, (steps, 4)), axis=0))
    x = np.hstack([rng.normal(size=(steps, 3)), q, (np.arange(steps) > 6)[:, None]])
    cup = frame_from_pose("cup", LAYOUT, Pose(rng.normal(size=3), normalise(rng.normal(size=4))))
    base = frame("base", world_frame(8).A, world_frame(8).b)
    return demonstration(x, period, LAYOUT, [base, cup], name)


def require_near(found: Demonstration, demo: Demonstration) -> None:
    assert found.layout == demo.layout
    assert found.period == pytest.approx(demo.period, abs=1e-12)
    np.testing.assert_allclose(found.x, demo.x, rtol=0, atol=1e-9)
    assert [f.name for f in found.frames] == [f.name for f in demo.frames]
    for given, expected in zip(found.frames, demo.frames, strict=True):
        assert type(given) is type(expected)
        np.testing.assert_allclose(given.A, expected.A, rtol=0, atol=1e-9)
        np.testing.assert_allclose(given.b, expected.b, rtol=0, atol=1e-9)


@pytest.mark.parametrize("period", [0.05, 0.002, 1 / 30])
def test_import_of_names_is_near_and_asks_nothing(rng: np.random.Generator, period: float, tmp_path: Path):
    demos = [random_demo(rng, f"reach {n}", period) for n in range(3)]
    export_demonstrations(demos, tmp_path / "out", "csv")
    recordings = list(read_recordings(tmp_path / "out"))
    settings, questions = suggest_settings(recordings)
    assert questions == ()
    for recording, demo in zip(recordings, demos, strict=True):
        require_near(build_demonstration(recording, settings)[0], demo)


def test_import_with_settings_is_near_for_parts_that_names_do_not_reveal(rng: np.random.Generator, tmp_path):
    """Two positions, joints beside a pose, a moving frame, and a period that is not that of a whole rate."""
    layout = Layout(
        (
            Part("left position", Quantity.POSITION, 3, "m"),
            Part("right orientation", Quantity.ORIENTATION, 4, "1"),
            Part("joints", Quantity.SCALAR, 2, "rad"),
            Part("push", Quantity.VECTOR, 3, "N"),
        )
    )
    q = normalise(np.eye(4)[0] + np.cumsum(rng.normal(0.0, 0.02, (20, 4)), axis=0))
    x = np.hstack([rng.normal(size=(20, 3)), q, rng.normal(size=(20, 5))])
    poses = [Pose(rng.normal(size=3), turn) for turn in q]
    demo = demonstration(x, 0.0333, layout, [moving_frame_from_poses("belt", layout, poses)], "both")
    csv_tables.write([demo], tmp_path / "out")
    (recording,) = read_recordings(tmp_path / "out")
    settings = read_import_settings(tmp_path / "out" / "import.toml")
    assert isinstance(demo.frames[0], MovingFrame)
    require_near(build_demonstration(recording, settings)[0], demo)


def test_command_export_and_import_return_the_demonstrations(
    run_json: RunJson, rng: np.random.Generator, tmp_path: Path
):
    demos = [random_demo(rng, f"reach {n}") for n in range(3)]
    write_demonstrations(demos, tmp_path / "set")
    run_json("data", "export", "set", "tables", "--format", "csv")
    run_json("data", "import", "tables", "--out", "back")
    for found, demo in zip(pf.load("back"), demos, strict=True):
        require_near(found, demo)


def test_command_export_with_period_resamples_in_every_format(
    run_json: RunJson, rng: np.random.Generator, tmp_path: Path
):
    demos = [add_derivatives(random_demo(rng, f"reach {n}")) for n in range(2)]
    write_demonstrations(demos, tmp_path / "set")
    for form in ("csv", "pilotfish", "lerobot", "robomimic", "mcap"):
        found = run_json("data", "export", "set", f"{form}-out", "--format", form, "--period", "0.01")
        assert "resampled from 0.05 s to 0.01 s" in found["notes"][0]
        run_json("data", "import", f"{form}-out", "--out", f"{form}-back")
        for back, demo in zip(pf.load(f"{form}-back"), demos, strict=True):
            assert back.period == pytest.approx(0.01)
            np.testing.assert_allclose(back.x[::5, :8], demo.x[:, :8], rtol=0, atol=1e-9)


def test_header_has_units_and_rows_have_times_and_poses(rng: np.random.Generator, tmp_path: Path):
    demo = random_demo(rng, "Cup, left")
    csv_tables.write([demo], tmp_path / "out")
    with (tmp_path / "out" / "0001-cup-left.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = list(csv.reader(file))
    assert header[:2] == ["time [s]", "position x [m]"]
    assert header[-7:] == [
        "cup x [m]", "cup y [m]", "cup z [m]", "cup qw [1]", "cup qx [1]", "cup qy [1]", "cup qz [1]",
    ]  # fmt: skip
    numbers = np.array(rows, dtype=float)
    np.testing.assert_array_equal(numbers[:, 1:9], demo.x)
    np.testing.assert_allclose(numbers[:, 0], 0.05 * np.arange(len(demo.x)), atol=1e-12)
    np.testing.assert_array_equal(numbers[:, -7:-4], np.tile(demo.frames[1].b[:3], (len(demo.x), 1)))


def test_planar_demonstrations_without_objects_are_exported(tmp_path: Path):
    demo = demonstration(np.random.default_rng(0).normal(size=(9, 2)), 0.1, position_layout(2))
    csv_tables.write([demo], tmp_path / "out")
    (recording,) = read_recordings(tmp_path / "out")
    require_near(build_demonstration(recording, suggest_settings([recording])[0])[0], demo)


def test_frames_that_are_not_poses_are_refused(rng: np.random.Generator, tmp_path: Path):
    x = random_demo(rng).x
    scaled = Frame("cup", 2.0 * np.eye(8), np.zeros(8))
    mirrored = Frame("cup", np.diag([-1.0, 1, 1, 1, 1, 1, 1, 1]), np.zeros(8))
    planar = demonstration(x[:, :2], 0.1, position_layout(2), [frame("cup", np.eye(2), [1.0, 2.0])])
    bad = [
        demonstration(x[:, :3], 0.1, position_layout(3), [frame("cup", 2.0 * np.eye(3), np.ones(3))]),
        planar,
    ]
    for demo in bad:
        with pytest.raises(InvalidInput, match="table has poses: use the format pilotfish"):
            csv_tables.write([demo], tmp_path / "out")
    for given in (scaled, mirrored):
        with pytest.raises(InvalidInput, match="not the pose"):
            csv_tables.write([demonstration(x, 0.1, LAYOUT, [given])], tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_existing_and_foreign_folders_are_kept(rng: np.random.Generator, tmp_path: Path):
    target = tmp_path / "out"
    csv_tables.write([random_demo(rng)], target)
    with pytest.raises(InvalidInput, match="exists"):
        csv_tables.write([random_demo(rng)], target)
    csv_tables.write([random_demo(rng, "new")], target, overwrite=True)
    assert (target / "0001-new.csv").exists()
    (target / "thesis.tex").write_text("mine")
    with pytest.raises(InvalidInput, match="no CSV data"):
        csv_tables.write([random_demo(rng)], target, overwrite=True)
    assert (target / "thesis.tex").read_text() == "mine"
    with pytest.raises(InvalidInput, match="no demonstrations"):
        csv_tables.write([], tmp_path / "empty")
