"""Situation files: signs of quaternions, frames by pose or matrix, TOML and JSON."""

import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pilotfish.demonstrations import Layout, Part, Quantity, demonstration, frame_from_pose
from pilotfish.geometry import pose
from pilotfish.io.situations import read_start
from pilotfish.io.skill_file import open_skill
from pilotfish.models import adapt, learn

RunJson = Callable[..., dict[str, Any]]


@pytest.fixture
def reproduce_positions(run_json: RunJson, skill: Path, tmp_path: Path) -> Callable[..., np.ndarray]:
    """Return a function from frames and start to the final position and orientation."""

    def final_pose(frames: object, start: object = None) -> np.ndarray:
        (tmp_path / "f.json").write_text(json.dumps(frames))
        options = ["--frames", "f.json", "--horizon", "8"]
        if start is not None:
            (tmp_path / "s.json").write_text(json.dumps(start))
            options += ["--start", "s.json"]
        final = run_json("reproduce", skill, *options)["final"]
        return np.concatenate([final["position"], final["orientation"]])

    return final_pose


def same_pose(a: np.ndarray, b: np.ndarray) -> bool:
    """Return whether poses are equal up to the sign of the quaternion."""
    q = a[3:] * np.sign(a[3:] @ b[3:])
    return np.allclose(a[:3], b[:3], atol=1e-9) and np.allclose(q, b[3:], atol=1e-9)


def negate_quaternion(frame: dict[str, Any]) -> dict[str, Any]:
    return {**frame, "quaternion": [-value for value in frame["quaternion"]]}


CUP = {"name": "cup", "position": [0.5, 0.2, 0.1], "quaternion": [0.9659258, 0.0, 0.0, 0.2588190]}
HOME = {"name": "home", "position": [0.0, 0.0, 0.0], "quaternion": [1.0, 0.0, 0.0, 0.0]}


def test_reproduce_sign_of_frame_quaternion_has_no_effect(reproduce_positions: Callable[..., np.ndarray]):
    expected = reproduce_positions([HOME, CUP])
    for home, cup in itertools.product((HOME, negate_quaternion(HOME)), (CUP, negate_quaternion(CUP))):
        assert same_pose(reproduce_positions([home, cup]), expected)
        assert same_pose(reproduce_positions([cup, home]), expected)


def test_reproduce_sign_of_start_quaternion_has_no_effect(reproduce_positions: Callable[..., np.ndarray]):
    position, quaternion = [0.1, -0.3, 0.3], [0.9800666, 0.1986693, 0.0, 0.0]
    expected = reproduce_positions([HOME, CUP], {"position": position, "quaternion": quaternion})
    negative = [-value for value in quaternion]
    assert same_pose(
        reproduce_positions([HOME, CUP], {"position": position, "quaternion": negative}), expected
    )
    for q in (quaternion, negative):
        q = (np.array(q) / np.linalg.norm(q)).tolist()
        assert same_pose(reproduce_positions([HOME, CUP], {"x": [*position, *q, *[0.0] * 7]}), expected)


@pytest.mark.parametrize("width", [7, 14])
def test_read_frames_matrix_equals_pose(
    reproduce_positions: Callable[..., np.ndarray], skill: Path, width: int
):
    layout = open_skill(skill).layout
    cup = frame_from_pose("cup", layout, pose(CUP["position"], CUP["quaternion"]))
    given = {"name": "cup", "A": cup.A[:width, :width].tolist(), "b": cup.b[:width].tolist()}
    expected = reproduce_positions([HOME, CUP])
    assert same_pose(reproduce_positions([HOME, given]), expected)
    assert same_pose(reproduce_positions({"frames": [given, negate_quaternion(HOME)]}), expected)


def test_read_frames_toml_equals_json(run_json: RunJson, skill: Path, frames: Path, tmp_path: Path):
    lines = [f"[[frames]]\n{key}" for key in map(_toml, json.loads(frames.read_text()))]
    (tmp_path / "now.toml").write_text("\n".join(lines))
    by_json, by_toml = (run_json("reproduce", skill, "--frames", f) for f in (frames, tmp_path / "now.toml"))
    assert by_json == by_toml


def _toml(table: dict[str, Any]) -> str:
    return "\n".join(f"{key} = {json.dumps(value)}" for key, value in table.items())


@pytest.mark.parametrize("text", ["gripper = 0.08", "gripper = [0.08]"])
def test_read_start_of_one_column_is_a_number_or_a_list(text: str, tmp_path: Path):
    """A start names the gripper as a user writes it."""
    layout = Layout((Part("position", Quantity.POSITION, 2, "m"), Part("gripper", Quantity.SCALAR, 1, "m")))
    rng = np.random.default_rng(0)
    given = [demonstration(rng.normal(size=(12, 3)).cumsum(axis=0), 0.1, layout) for _ in range(2)]
    model = adapt(learn(given, states=2, rng=rng).skill, given[0].frames)
    (tmp_path / "start.toml").write_text(f"position = [1.0, 2.0]\n{text}\n")
    np.testing.assert_array_equal(read_start(tmp_path / "start.toml", model), [1.0, 2.0, 0.08])
