"""The pick-and-place protocol on constructed movements, and once on simulated demonstrations."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

pytest.importorskip("mujoco")

import pilotfish as pf
from pilotfish.demonstrations import Layout, Part, Quantity, frame_from_pose, pose_layout, views
from pilotfish.environments.tasks.plate import obstacle_pose, situation_for_level
from pilotfish.models import adapt

FOLDER = Path(__file__).parents[2] / "reproductions"
LAYOUT = Layout((*pose_layout().parts, Part("grip", Quantity.SCALAR, 1, "1")))


@pytest.fixture(scope="session")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("reproduce_pick_and_place", FOLDER / "pick_and_place.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look themselves up there
    spec.loader.exec_module(module)
    return module


def movement(level: int, rng: np.random.Generator, rows: int) -> pf.Demonstration:
    """Return a movement from above the plate over the obstacle, with a rotation and a closed grip."""
    situation = situation_for_level(level, rng)
    obstacle = obstacle_pose(level)
    points = np.stack(
        [situation.plate.position, obstacle.position + np.array([0.0, 0.0, 0.1]), [0.66, -0.1, -0.1]]
    )
    share = np.linspace(0.0, 2.0, rows)
    positions = np.stack([np.interp(share, [0, 1, 2], points[:, axis]) for axis in range(3)], axis=1)
    turn = 0.5 * rng.uniform(-0.2, 0.2) * share
    quaternion = np.stack([0.0 * turn, np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    grip = ((share > 0.2) & (share < 1.8)).astype(float)[:, None]
    x = np.concatenate([positions + 0.002 * rng.standard_normal(positions.shape), quaternion, grip], axis=1)
    frames = [
        frame_from_pose("plate", LAYOUT, situation.plate),
        frame_from_pose("obstacle", LAYOUT, obstacle),
    ]
    return pf.demonstration(x, 0.1, LAYOUT, frames, f"level {level}")


def test_resample_keeps_ends(script, rng):
    for rows in (120, 200, 231):
        original = movement(3, rng, rows)
        resampled = script.resample_to_horizon(original)
        assert resampled.x.shape == (200, 8)
        assert resampled.period == 0.1
        np.testing.assert_allclose(resampled.x[[0, -1]], original.x[[0, -1]], atol=1e-12)


def test_drop_grip_keeps_pose_in_frames(script, rng):
    original = movement(2, rng, 50)
    pose = script.drop_grip(original)
    np.testing.assert_allclose(views([pose]).x, views([original]).x[..., :7], atol=1e-12)
    assert pf.add_derivatives(pose).layout.width == 14


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_weighted_skill_adapts_like_weights(script, rng, alpha):
    demonstrations = [
        pf.add_derivatives(script.resample_to_horizon(movement(level, rng, 150))) for level in (0, 2, 4, 6)
    ]
    skill = script.learn_skill(demonstrations, script.structure(alpha), 5).skill
    weights = rng.uniform(0.1, 1.0, (2, 5))
    weights[0, 1] = weights[1, 3] = 0.0
    frames = pf.add_derivatives(movement(5, rng, 60)).frames
    expected = adapt(skill, frames, relevance=weights)
    actual = adapt(script.weight_frames(skill, weights), frames)
    np.testing.assert_allclose(actual.means, expected.means, atol=2e-3)
    positive = weights.min(axis=0) > 0.0
    np.testing.assert_allclose(actual.means[positive], expected.means[positive], atol=1e-9)
    np.testing.assert_allclose(
        actual.covariances[positive], expected.covariances[positive], rtol=1e-6, atol=1e-12
    )


def test_new_situations_differ_from_demonstrations(script):
    situations = [
        situation_for_level(level, np.random.default_rng([1, script.DEMONSTRATION_STREAM, level]))
        for level in range(8)
    ]
    recorded = [
        script.SituationDemonstration(situation, movement(0, np.random.default_rng(0), 20))
        for situation in situations
    ]
    groups = script.group_situations(recorded, 1, len(script.NEW_LEVELS))
    assert [w.level for w in groups["tests"]] == [1, 3, 5, 7]
    new = [*groups["new, between"], *groups["new, beyond"]]
    assert len(new) == 16
    assert not {w.level for w in new} & {0, 2, 4, 6}
    assert all(0 < w.level < 6 for w in groups["new, between"])
    assert all(not 0 <= w.level <= 6 for w in groups["new, beyond"])
    places = np.array([w.plate.position[:2] for w in (*situations, *new)])
    distances = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(len(places))
    assert distances.min() > 1e-6


@pytest.mark.slow  # records eight demonstrations in physics and runs the reproduction
def test_pick_and_place_writes_outputs(tmp_path):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    options = ["--json", report, "--out", pictures, "--situations", "0"]
    command = [sys.executable, FOLDER / "pick_and_place.py", *options]
    subprocess.run(command, check=True, capture_output=True, timeout=1200)
    numbers = json.loads(report.read_text())
    rows = numbers["rows"]
    assert [row["covariance_parameters"] for row in rows] == [1470, 1470, 588]
    for row in rows:
        assert row["train_mse"] < row["test_mse"] < row["thesis"]["test_mse"]
        assert row["train_mse"] < row["thesis"]["train_mse"]
    assert rows[0]["test_mse"] > max(rows[1]["test_mse"], rows[2]["test_mse"])
    assert {row["situations"] for row in numbers["physics"]} == {"tests"}
    assert len(numbers["physics"]) == 6
    for name in ("figure-4.7", "execution"):
        assert (pictures / f"{name}.png").stat().st_size > 10_000
