"""pilotfish data import: two logs with uneven times become demonstrations; open questions stop it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

import pilotfish as pf
from pilotfish.cli.commands import data_import
from pilotfish.demonstrations import Layout, Part, Quantity, demonstration, frame_from_pose
from pilotfish.geometry import Pose, normalise
from pilotfish.io import read_demonstrations, write_demonstrations

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
ROBOT = "stamp,pose.position.x,pose.position.y,pose.position.z,qx,qy,qz,qw,gripper"
OBJECTS = "stamp,cup.x,cup.y,cup.z,cup.qx,cup.qy,cup.qz,cup.qw"


def write_table(path: Path, header: str, rows: np.ndarray) -> None:
    lines = [",".join(f"{value:.9f}" for value in row) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")


def write_logs(folder: Path, rng: np.random.Generator, header: str = ROBOT) -> list[np.ndarray]:
    """Write two executions, each a log of the robot and one of the cup; return the positions of the cup."""
    folder.mkdir()
    cups = []
    for m in range(2):
        t = np.cumsum(rng.uniform(0.03, 0.036, 60))
        s, cup = t / t[-1], rng.uniform(0.3, 0.6, 3)
        q = normalise(np.column_stack([0.4 * s, 0.0 * s, 0.0 * s, 1.0 + 0.0 * s]))
        rows = np.column_stack([1.7e9 + t, np.outer(1.0 - s, [0.2, 0.0, 0.3]) + np.outer(s, cup), q, s > 0.9])
        write_table(folder / f"demo{m}_robot.csv", header, rows)
        poses = np.tile(np.r_[cup, 0.0, 0.0, 0.0, 1.0], (20, 1))
        write_table(folder / f"demo{m}_objects.csv", OBJECTS, np.column_stack([1.7e9 + t[::3], poses]))
        cups.append(cup)
    return cups


def test_uneven_logs_of_robot_and_object_become_demonstrations(
    run_json: RunJson, tmp_path: Path, rng: np.random.Generator
):
    cups = write_logs(tmp_path / "logs", rng)
    found = run_json("data", "import", "logs", "--out", "cup")
    demos = pf.load("cup")
    assert [demo.name for demo in demos] == ["demo0", "demo1"]
    assert demos[0].layout.names[-1] == "gripper"
    assert set(np.unique(demos[0].x[:, 7])) == {0.0, 1.0}
    for demo, cup in zip(demos, cups, strict=True):
        assert demo.period == pytest.approx(0.033, abs=0.002)
        np.testing.assert_allclose(demo.frames[0].b[:3], cup, atol=1e-6)  # type: ignore[union-attr]
        line = demo.x[:, :3] - [0.2, 0.0, 0.3]
        share = line @ (cup - [0.2, 0.0, 0.3]) / np.sum((cup - [0.2, 0.0, 0.3]) ** 2)
        np.testing.assert_allclose(line, np.outer(share, cup - [0.2, 0.0, 0.3]), atol=1e-6)
        q = normalise(np.column_stack([np.ones_like(share), 0.4 * share, 0 * share, 0 * share]))
        assert np.abs(demo.x[:, 3:7] - q).max() < 1e-4  # w first, on the great circle
    assert any("Hz" in line for line in found["conversions"]["demo0"])


def test_open_question_stops_until_it_is_answered(
    run_json: RunJson, run_failing: Callable[..., str], tmp_path: Path, rng: np.random.Generator
):
    write_logs(tmp_path / "logs", rng, ROBOT.replace("qx,qy,qz,qw", "q0,q1,q2,q3"))
    message = run_failing("data", "import", "logs", "--out", "cup")
    assert "w x y z or x y z w" in message
    assert "--order" in message
    assert not (tmp_path / "cup").exists()
    run_json("data", "import", "logs", "--out", "cup", "--order", "wxyz")
    run_json("data", "import", "logs", "--out", "accepted", "--accept")
    np.testing.assert_array_equal(pf.load("cup")[0].x, pf.load("accepted")[0].x)


def test_saved_settings_give_the_same_demonstrations(
    run_json: RunJson, tmp_path: Path, rng: np.random.Generator
):
    write_logs(tmp_path / "logs", rng)
    found = run_json("data", "import", "logs", "--save-settings", "cup.toml")
    assert found["questions"] == []
    run_json("data", "import", "logs", "--settings", "cup.toml", "--out", "a")
    run_json("data", "import", "logs", "--out", "b")
    for one, other in zip(pf.load("a"), pf.load("b"), strict=True):
        np.testing.assert_array_equal(one.x, other.x)


def test_length_unit_period_and_moving_frame(run_json: RunJson, tmp_path: Path, rng: np.random.Generator):
    write_logs(tmp_path / "logs", rng)
    run_json("data", "import", "logs", "--out", "m")
    options = ("--length-unit", "mm", "--period", "0.05", "--moving", "cup")
    run_json("data", "import", "logs", "--out", "mm", *options)
    (metres, *_), (millimetres, *_) = pf.load("m"), pf.load("mm")
    assert millimetres.period == 0.05
    np.testing.assert_allclose(millimetres.x[0, :3], metres.x[0, :3] / 1000.0)
    assert millimetres.frames[0].is_moving


@pytest.mark.parametrize("form", ["lerobot", "robomimic", "mcap"])
def test_export_is_restored_number_for_number(run_json: RunJson, data_folder: Path, form: str):
    run_json("data", "export", "valve", "valve")
    run_json("data", "export", "valve", "exported", "--format", form)
    run_json("data", "import", "exported", "--out", "again")
    for one, other in zip(pf.load("valve"), pf.load("again"), strict=True):
        assert (one.layout, one.period, one.name) == (other.layout, other.period, other.name)
        np.testing.assert_array_equal(one.x, other.x)
        for frame, same in zip(one.frames, other.frames, strict=True):
            np.testing.assert_array_equal(frame.b, same.b)  # type: ignore[union-attr]


def test_folder_of_demonstrations_is_exported_too(
    run_json: RunJson, run_failing: Callable[..., str], data_folder: Path
):
    run_json("data", "export", "synthetic valve", "mine")
    run_json("data", "export", "mine", "bags", "--format", "mcap")
    assert "exists" in run_failing("data", "export", "mine", "bags", "--format", "mcap")
    run_json("data", "export", "mine", "bags", "--format", "mcap", "--force")
    assert "unknown" in run_failing("data", "export", "valva", "x")


def test_nothing_to_write_existing_output_and_unknown_frame_are_refused(
    run_command_line: RunCommand, run_failing: Callable[..., str], tmp_path: Path, rng: np.random.Generator
):
    write_logs(tmp_path / "logs", rng)
    result = run_command_line("data", "import", "logs")
    assert result.exit_code == 2
    assert "--out FOLDER" in result.stderr
    assert "'cop'" in run_failing("data", "import", "logs", "--out", "a", "--moving", "cop")
    (tmp_path / "cup.toml").write_text("")
    assert "--force" in run_failing("data", "import", "logs", "--save-settings", "cup.toml")
    assert "missing" in run_failing("data", "import", "nowhere", "--out", "a")


def test_notes_columns_left_out_and_assumed_units_are_listed(
    run_command_line: RunCommand, run_json: RunJson, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    names = [f"sensor {letter} status" for letter in "abcdefghijklmnopqrstuvwxy"]
    (tmp_path / "logs").mkdir()
    rows = np.column_stack([np.arange(5) / 10, *[np.arange(5) / 50] * 28])
    write_table(tmp_path / "logs" / "a.csv", ",".join(["time", "x", "y", "z", *names]), rows)
    read = data_import.read_recordings
    monkeypatch.setattr(
        data_import,
        "read_recordings",
        lambda *args, **options: [
            replace(r, notes=("row 9 is cut off",) * 2) for r in read(*args, **options)
        ],
    )
    found = run_json("data", "import", "logs", "--out", "a")
    assert found["left_out"] == names
    assert found["notes"] == ["row 9 is cut off"]
    for options in (("--out", "b"), ("--save-settings", "b.toml")):
        text = run_command_line("data", "import", "logs", *options).stdout
        assert all(name in " ".join(text.split()) for name in names)
        assert text.count("row 9 is cut off") == 1
        assert "m (assumed)" in text
    text = run_command_line("data", "import", "logs", "--out", "c", "--length-unit", "mm").stdout
    assert "assumed" not in text


def test_length_unit_fills_only_units_that_the_file_does_not_state(run_json: RunJson, tmp_path: Path):
    rows = np.column_stack([np.arange(5) / 10, *[np.arange(5) / 50] * 6])
    write_table(tmp_path / "a.csv", "time,x [cm],y [cm],z [cm],cup_x,cup_y,cup_z", rows + 0.5)
    run_json("data", "import", "a.csv", "--out", "a", "--length-unit", "mm")
    demo = pf.load("a")[0]
    np.testing.assert_allclose(demo.x[0], 0.005)
    np.testing.assert_allclose(demo.frames[0].b, 0.0005)  # type: ignore[union-attr]


def test_length_unit_is_not_the_answer_if_only_some_positions_are_in_question(
    run_failing: Callable[..., str], tmp_path: Path
):
    metres = np.arange(5) / 50
    rows = np.column_stack([np.arange(5) / 10, *[metres] * 3, *[1000.0 * metres + 400.0] * 3])
    write_table(tmp_path / "a.csv", "time,x,y,z,cup_x,cup_y,cup_z", rows)
    message = run_failing("data", "import", "a.csv", "--out", "a")
    assert "--settings" in message
    assert "--length-unit" not in message
    assert "in m, cm or mm?" in run_failing("data", "import", "a.csv", "--out", "a", "--length-unit", "mm")


def test_base_frame_precedes_the_objects(
    run_json: RunJson, run_failing: Callable[..., str], tmp_path: Path, rng: np.random.Generator
):
    write_logs(tmp_path / "logs", rng)
    run_json("data", "import", "logs", "--out", "plain")
    run_json("data", "import", "logs", "--out", "cup", "--base-frame", "base")
    for demo, plain in zip(pf.load("cup"), pf.load("plain"), strict=True):
        assert [frame.name for frame in demo.frames] == ["base", "cup"]
        assert demo.frames[0].is_world
        np.testing.assert_array_equal(demo.x, plain.x)
        np.testing.assert_array_equal(demo.frames[1].A, plain.frames[0].A)
    assert "the name of an object" in run_failing(
        "data", "import", "logs", "--out", "new", "--base-frame", "cup"
    )
    assert not (tmp_path / "new").exists()


def test_base_frame_of_recordings_without_objects_is_the_only_frame(run_json: RunJson, tmp_path: Path):
    (tmp_path / "a.csv").write_text("time [s],x [m],y [m],z [m]\n0,0,0,0\n0.1,0,0,1\n0.2,0,1,2\n")
    run_json("data", "import", "a.csv", "--out", "a", "--base-frame", "base")
    assert [frame.name for frame in pf.load("a")[0].frames] == ["base"]


def test_own_folder_keeps_its_names_and_quantities(run_json, tmp_path: Path):
    """Names of parts and frames that would mean something else in a log, and a joint, stay what they are."""
    layout = Layout(
        (
            Part("left hand", Quantity.POSITION, 3, "m"),
            Part("grasp", Quantity.ORIENTATION, 4, "1"),
            Part("joint", Quantity.SCALAR, 1, "rad"),
            Part("push", Quantity.VECTOR, 3, "N"),
        )
    )
    rng = np.random.default_rng(0)
    given = []
    for name in ("a", "b"):
        x = np.hstack([rng.normal(size=(20, 3)), np.tile([0.6, 0.0, 0.8, 0.0], (20, 1)), rng.random((20, 4))])
        frames = [
            frame_from_pose(frame, layout, Pose(rng.normal(size=3), np.array([0.8, 0.0, 0.0, 0.6])))
            for frame in ("tool holder", "cube")
        ]
        given.append(demonstration(x, 0.05, layout, frames, name))
    write_demonstrations(given, tmp_path / "set")
    run_json("data", "import", "set", "--out", "again")
    for demo, found in zip(given, read_demonstrations(tmp_path / "again"), strict=True):
        assert (found.layout, found.name, found.period) == (demo.layout, demo.name, demo.period)
        np.testing.assert_allclose(found.x, demo.x, atol=1e-12)
        for mine, other in zip(demo.frames, found.frames, strict=True):
            assert mine.name == other.name
            np.testing.assert_allclose(other.A, mine.A, atol=1e-9)
            np.testing.assert_allclose(other.b, mine.b, atol=1e-9)
