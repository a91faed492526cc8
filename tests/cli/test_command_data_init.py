"""pilotfish data init: the template is accepted by check, learn and reproduce, and explains every key."""

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

import pilotfish as pf
from pilotfish.errors import InvalidInput
from pilotfish.io import write_folder_template
from pilotfish.io.frame_tables import KNOWN_KEYS

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]


def test_template_is_checked_learned_and_reproduced_without_problems(run_json: RunJson, tmp_path: Path):
    written = run_json("data", "init", "task")
    assert written["manifest"] == "task/demonstrations.toml"
    assert run_json("data", "check", "task")["diagnostics"] == []
    run_json("learn", "task", "--out", "task.skill")
    base = {"name": "base", "position": [0, 0, 0], "quaternion": [1, 0, 0, 0]}
    cup = {"name": "cup", "position": [0.5, 0.1, 0.15], "rpy": [0, 0, 0.3]}
    (tmp_path / "now.json").write_text(json.dumps({"frames": [base, cup]}))
    found = run_json("reproduce", "task.skill", "--frames", "now.json")
    np.testing.assert_allclose(found["final"]["position"], cup["position"], atol=0.01)
    turn = 2.0 * np.arctan2(found["final"]["orientation"][3], found["final"]["orientation"][0])
    assert turn == pytest.approx(0.3, abs=0.05)
    assert found["final"]["gripper"] == pytest.approx([1.0], abs=1e-3)


def test_template_ends_at_the_frames_of_its_manifest(tmp_path: Path):
    """The second cup is given by rpy, the first by a quaternion: both are the pose of the hand at the end."""
    write_folder_template(tmp_path / "task")
    for demo in pf.load(tmp_path / "task"):
        cup = demo.frames[1]
        np.testing.assert_allclose(demo.x[-1, :3], cup.b[:3], atol=2e-3)  # type: ignore[union-attr]
        local = np.linalg.solve(cup.A, demo.x[-1] - cup.b)  # type: ignore[union-attr]
        np.testing.assert_allclose(local[3:7], [1.0, 0.0, 0.0, 0.0], atol=0.02)


def test_template_comments_name_every_key(tmp_path: Path):
    write_folder_template(tmp_path / "task")
    text = (tmp_path / "task" / "demonstrations.toml").read_text(encoding="utf-8")
    comments = " ".join(line.partition("#")[2] for line in text.splitlines())
    keys = {"name", "quantity", "size", "unit", "derivative", "file", "frames", *KNOWN_KEYS}
    assert not [key for key in keys if key not in comments.split() and f"{key}," not in comments.split()]
    for quantity in ("position", "quaternion", "orientation", "vector", "scalar"):
        assert f'"{quantity}"' in comments
    assert "w x y z" in comments
    assert tomllib.loads(text)["version"] == 1


@pytest.mark.parametrize(
    ("columns", "width"), [("position", 3), ("position,gripper", 4), ("orientation, position", 7)]
)
def test_template_has_the_chosen_columns(run_json: RunJson, columns: str, width: int, tmp_path: Path):
    run_json("data", "init", "task", "--columns", columns)
    demos = pf.load(tmp_path / "task")
    assert [part.name for part in demos[0].layout.parts] == columns.replace(" ", "").split(",")
    assert demos[0].layout.width == width
    assert run_json("data", "check", "task")["diagnostics"] == []


def test_template_refuses_an_existing_folder_without_force(
    run_json: RunJson, run_failing: Callable[..., str], tmp_path: Path
):
    run_json("data", "init", "task")
    (tmp_path / "task" / "reach-1.csv").write_text("mine")
    assert "task exists" in run_failing("data", "init", "task")
    assert (tmp_path / "task" / "reach-1.csv").read_text() == "mine"
    run_json("data", "init", "task", "--force")
    assert len(pf.load(tmp_path / "task")) == 2
    (tmp_path / "task" / "thesis.tex").write_text("mine")
    assert "thesis.tex" in run_failing("data", "init", "task", "--force")
    assert (tmp_path / "task" / "thesis.tex").exists()


@pytest.mark.parametrize("columns", ["", "gripper", "position,position", "position,force"])
def test_template_refuses_unusable_columns(run_command_line: RunCommand, columns: str, tmp_path: Path):
    result = run_command_line("data", "init", "task", "--columns", columns)
    assert result.exit_code == 2
    assert "--columns" in result.stderr
    assert not list(tmp_path.iterdir())
    with pytest.raises(InvalidInput, match="columns"):
        write_folder_template(tmp_path / "task", columns=columns.split(","))


@pytest.mark.parametrize("command", [("data", "check", "."), ("learn", ".", "--out", "a.skill")])
def test_folder_without_manifest_names_import_and_init(run_failing: Callable[..., str], command: Any):
    message = run_failing(*command)
    assert "pilotfish data import . --out NEW converts recordings" in message
    assert "pilotfish data init NEW writes a template" in message


def test_file_in_place_of_a_folder_names_import(run_failing: Callable[..., str], tmp_path: Path):
    (tmp_path / "a.csv").write_text("time [s],x [m]\n0,0\n1,1\n")
    message = run_failing("data", "check", "a.csv")
    assert "a.csv is not a folder" in message
    assert "pilotfish data import a.csv --out NEW converts recordings" in message
    assert "check the name" in run_failing("data", "check", "missing")
