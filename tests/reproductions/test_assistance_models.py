"""Table 5.1 and the figures of assistance: joint models, their sizes, trials, and what is drawn."""

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from matplotlib.figure import Figure
from online_valve import parameters_of

import pilotfish as pf
from pilotfish.assistance import assisted_skill
from pilotfish.demonstrations import views
from pilotfish.geometry import Pose, exp_map
from pilotfish.models import semi_markov_parameter_count

FOLDER = Path(__file__).parents[2] / "reproductions"
SUBSPACES = {"screwdriver": (4, 3, 4), "carabiner": (5, 5, 4, 3)}  # dimensions that the thesis found


def run(name: str, *options: object) -> str:
    command = [sys.executable, "-W", "ignore", FOLDER / f"{name}.py", *map(str, options)]
    return subprocess.run(command, check=True, capture_output=True, timeout=600, text=True).stdout


def test_augment_input_stays_output_moves_with_frame(joint_models: ModuleType, rng):
    given = pf.io.synthetic_valve(rng)[:2]
    augmented = views([joint_models.augment(demonstration) for demonstration in given]).x
    alone = views(given).x[:, :, :7]
    world = np.concatenate([demonstration.x[:, :7] for demonstration in given])
    for p in range(len(augmented)):
        np.testing.assert_allclose(augmented[p, :, :7], world, atol=1e-12)
        np.testing.assert_allclose(augmented[p, :, 7:], alone[p], atol=1e-12)


def test_joint_on_sphere_output_equals_coordinates_of_output_skill(joint_models: ModuleType, rng):
    """The marginal on S^3 does not depend on the order of taking it and of leaving R^4."""
    augmented = [joint_models.augment(demonstration) for demonstration in pf.io.synthetic_valve(rng)[:4]]
    joint = joint_models.learn_batch(augmented, 4, pf.structures.Full())
    on_sphere = joint_models.joint_on_sphere(joint)
    alone = assisted_skill(joint_models.output_skill(joint)).skill
    np.testing.assert_allclose(on_sphere.means[:, :, 7:], alone.means, atol=1e-12)
    for p, covariances in enumerate(alone.covariances):
        output = on_sphere.covariances[p].dense[:, 6:, 6:]
        np.testing.assert_allclose(output, covariances.dense, rtol=1e-9, atol=1e-14)


def test_tangent_map_equals_finite_difference_of_exp_map(joint_models: ModuleType, rng):
    mean, starts = rng.normal(size=14), (3, 10)
    for start in starts:
        mean[start : start + 4] /= np.linalg.norm(mean[start : start + 4])
    step = 1e-6 * rng.normal(size=12)
    deviation = exp_map(mean, step, starts) - exp_map(mean, -step, starts)
    np.testing.assert_allclose(joint_models.tangent_map(mean) @ deviation, 2.0 * step, atol=1e-14)


@pytest.mark.parametrize("task", sorted(SUBSPACES))
def test_parameter_counts_equal_printed(assistance_models: ModuleType, task: str):
    K = len(SUBSPACES[task])
    for model, (parameters, *_) in assistance_models.PRINTED[task].items():
        if model == "SOSC":
            assert parameters_of(K, 1, 14, sum(SUBSPACES[task])) == parameters
        else:
            structure = assistance_models.STRUCTURES[model]
            assert semi_markov_parameter_count(structure, K, 14) == parameters


def test_switch_time_is_repeated_and_within_the_motion(joint_models: ModuleType):
    shares = [joint_models.switch_time((seed, n), 10.0) / 10.0 for seed in range(20) for n in range(5)]
    assert joint_models.EARLIEST <= min(shares) < 0.1
    assert 0.7 < max(shares) <= joint_models.LATEST
    assert joint_models.switch_time((1, 1), 10.0) == pytest.approx(10.0 * shares[6])


def test_summarise_uses_direct_trials_for_every_model(assistance_models: ModuleType):
    ending, size = assistance_models.Ending, assistance_models.Size
    endings = [ending("screwdriver", "", "direct", error, success=False) for error in (0.1, 0.3)]
    for model, error in (("full", 0.01), ("MFA", 0.02)):
        endings += [
            ending("screwdriver", model, mode, error, success=True) for mode in assistance_models.MODES
        ]
    sizes = [size("screwdriver", "full", 3, 372), size("screwdriver", "MFA", 3, 267)]
    row = assistance_models.summarise("screwdriver", "MFA", endings, sizes)
    assert row["direct"] == {
        "mean": pytest.approx(0.2),
        "deviation": pytest.approx(0.1),
        "completed": 0,
        "of": 2,
    }
    assert row["carried"]["mean"] == 0.02
    assert row["parameters"] == [267]


def test_draw_paths_marks_switch_and_objects(assistance_figures: ModuleType):
    draw = assistance_figures.draw
    line = np.linspace(0.0, 1.0, 11)[:, None] * np.ones(3)
    actual, observed = (Pose(np.full(3, x), np.array([1.0, 0.0, 0.0, 0.0])) for x in (0.5, 0.7))
    axes = Figure().add_subplot()
    draw.draw_paths(axes, draw.Paths(line, line + 0.1, {"a": actual}, {"a": observed}, 4), (0, 2), "title")
    points = {
        (each.get_marker(), each.get_color()): np.array(each.get_xydata())
        for each in axes.lines
        if len(np.atleast_1d(each.get_xdata())) == 1
    }
    np.testing.assert_allclose(points["x", "black"], [[0.5, 0.5]])
    np.testing.assert_allclose(points["s", draw.ACTUAL], [[0.5, 0.5]])
    np.testing.assert_allclose(points["s", draw.OBSERVED], [[0.7, 0.7]])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "z [m]")


@pytest.mark.slow  # records seven demonstrations and operates in physics: 30 CPU seconds
def test_assistance_models_carried_is_nearer_than_direct(tmp_path):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    options = ["--tasks", "screwdriver", "--models", "full", "SOSC", "--situations", 1, "--seeds", 1]
    printed = run("assistance_models", "--json", report, "--out", pictures, *options)
    rows = json.loads(report.read_text())["rows"]
    assert [row["model"] for row in rows] == ["full", "SOSC"]
    assert all(row["carried"]["mean"] < 0.2 * row["direct"]["mean"] for row in rows), rows
    assert "N 372" in printed
    assert (pictures / "table_5_1.png").is_file()


@pytest.mark.slow  # operates in physics: 60 CPU seconds
def test_assistance_figures_writes_every_figure(data_folder, tmp_path):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    run("assistance_figures", "--json", report, "--out", pictures)
    names = json.loads(report.read_text())["figures"]
    assert sorted(names) == sorted(path.stem for path in pictures.glob("*.png"))
    for number in ("5_10", "5_11", "5_12", "6_1", "6_6", "6_7", "6_8"):
        assert any(name.startswith(f"figure_{number}_") for name in names), number
