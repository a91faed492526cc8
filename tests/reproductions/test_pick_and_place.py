"""The protocol of the pick-and-place rows, on movements made by hand, and once on those of the simulation."""

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
    sys.modules[spec.name] = module  # a dataclass looks itself up there
    spec.loader.exec_module(module)
    return module


def movement(level: int, rng: np.random.Generator, rows: int) -> pf.Demonstration:
    """From above the plate over the obstacle, turning a little, the grip shut on the way."""
    where = situation_for_level(level, rng)
    obstacle = obstacle_pose(level)
    points = np.stack(
        [where.plate.position, obstacle.position + np.array([0.0, 0.0, 0.1]), [0.66, -0.1, -0.1]]
    )
    share = np.linspace(0.0, 2.0, rows)
    place = np.stack([np.interp(share, [0, 1, 2], points[:, axis]) for axis in range(3)], axis=1)
    turn = 0.5 * rng.uniform(-0.2, 0.2) * share
    quaternion = np.stack([0.0 * turn, np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
    grip = ((share > 0.2) & (share < 1.8)).astype(float)[:, None]
    x = np.concatenate([place + 0.002 * rng.standard_normal(place.shape), quaternion, grip], axis=1)
    frames = [
        frame_from_pose("plate", LAYOUT, where.plate),
        frame_from_pose("obstacle", LAYOUT, obstacle),
    ]
    return pf.demonstration(x, 0.1, LAYOUT, frames, f"level {level}")


def test_resample_keeps_ends(script, rng):
    for rows in (120, 200, 231):
        shown = movement(3, rng, rows)
        rowed = script.resample_to_horizon(shown)
        assert rowed.x.shape == (200, 8)
        assert rowed.period == 0.1
        np.testing.assert_allclose(rowed.x[[0, -1]], shown.x[[0, -1]], atol=1e-12)


def test_drop_grip_keeps_pose_in_frames(script, rng):
    shown = movement(2, rng, 50)
    pose = script.drop_grip(shown)
    np.testing.assert_allclose(views([pose]).x, views([shown]).x[..., :7], atol=1e-12)
    assert pf.add_derivatives(pose).layout.width == 14


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_weighted_skill_adapts_like_weights(script, rng, alpha):
    shown = [
        pf.add_derivatives(script.resample_to_horizon(movement(level, rng, 150))) for level in (0, 2, 4, 6)
    ]
    skill = script.learn_skill(shown, script.structure(alpha), 5).skill
    powers = rng.uniform(0.1, 1.0, (2, 5))
    powers[0, 1] = powers[1, 3] = 0.0
    there = pf.add_derivatives(movement(5, rng, 60)).frames
    told = adapt(skill, there, relevance=powers)
    hearing = adapt(script.weighted(skill, powers), there)
    np.testing.assert_allclose(hearing.means, told.means, atol=2e-3)
    weighted = powers.min(axis=0) > 0.0
    np.testing.assert_allclose(hearing.means[weighted], told.means[weighted], atol=1e-9)
    np.testing.assert_allclose(
        hearing.covariances[weighted], told.covariances[weighted], rtol=1e-6, atol=1e-12
    )


def test_new_situations_differ_from_demonstrations(script):
    where = [
        situation_for_level(level, np.random.default_rng([1, script.DEMONSTRATION_STREAM, level]))
        for level in range(8)
    ]
    demonstrations_by_situation = [
        script.SituationDemonstration(situation_from_seed, movement(0, np.random.default_rng(0), 20))
        for situation_from_seed in where
    ]
    group_situations = script.group_situations(demonstrations_by_situation, 1, len(script.NEW_LEVELS))
    assert [w.level for w in group_situations["tests"]] == [1, 3, 5, 7]
    new = [*group_situations["new, between"], *group_situations["new, beyond"]]
    assert len(new) == 16
    assert not {w.level for w in new} & {0, 2, 4, 6}
    assert all(0 < w.level < 6 for w in group_situations["new, between"])
    assert all(not 0 <= w.level <= 6 for w in group_situations["new, beyond"])
    places = np.array([w.plate.position[:2] for w in (*where, *new)])
    apart = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(len(places))
    assert apart.min() > 1e-6


@pytest.mark.slow  # records eight demonstrations in physics and runs the reproduction
def test_pick_and_place_writes_outputs(tmp_path):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    options = ["--json", report, "--out", pictures, "--situations", "0"]
    command = [sys.executable, FOLDER / "pick_and_place.py", *options]
    subprocess.run(command, check=True, capture_output=True, timeout=1200)
    told = json.loads(report.read_text())
    rows = told["rows"]
    assert [row["covariance_parameters"] for row in rows] == [1470, 1470, 588]
    for row in rows:
        assert row["train_mse"] < row["test_mse"] < row["thesis"]["test_mse"]
        assert row["train_mse"] < row["thesis"]["train_mse"]
    assert rows[0]["test_mse"] > max(rows[1]["test_mse"], rows[2]["test_mse"])
    assert {row["situations"] for row in told["physics"]} == {"tests"}
    assert len(told["physics"]) == 6
    for name in ("figure-4.7", "execution"):
        assert (pictures / f"{name}.png").stat().st_size > 10_000
