"""Each command does what its help says."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

from pilotfish.demonstrations import (
    Demonstration,
    add_derivatives,
    demonstration,
    position_layout,
    to_sphere,
)
from pilotfish.io import datasets
from pilotfish.io.demonstration_folder import read_demonstrations, write_demonstrations
from pilotfish.io.skill_file import content_hash, open_skill
from pilotfish.models import (
    Censoring,
    DurationModel,
    EMSettings,
    MarkovChain,
    MixtureWeights,
    SemiMarkovChain,
    learn,
)
from pilotfish.models.durations import DISTRIBUTIONS

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]


def test_data_info_describes_every_listed_data_set(run_json: RunJson):
    listed = run_json("data", "list")["datasets"]
    assert set(datasets.names()) < set(listed)
    for name in listed:
        assert run_json("data", "info", name)["description"] == listed[name]


def test_exported_data_set_gives_same_skill(run_json: RunJson, tmp_path: Path):
    run_json("data", "export", "synthetic valve", "copy")
    learned = ["--states", "2", "--max-iterations", "2", "--only", "0"]
    run_json("learn", "copy", *learned, "--out", "a")
    run_json("learn", "dataset:synthetic valve", *learned, "--out", "b")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_data_check_valid_folder_has_no_problems(run_json: RunJson, folder: Path):
    report = run_json("data", "check", folder)
    assert [demo["name"] for demo in report["demonstrations"]] == [f"reach {m}" for m in range(5)]
    assert {finding["severity"] for finding in report["diagnostics"]} <= {"note"}


def test_data_check_error_has_exit_code_1(run_command_line: RunCommand, folder: Path):
    manifest = json.loads((folder / "demonstrations.json").read_text())
    manifest["demonstration"][1]["frames"][1]["name"] = "mug"
    del manifest["sha256"]
    (folder / "demonstrations.json").write_text(json.dumps(manifest))
    result = run_command_line("data", "check", folder)
    assert (result.exit_code, result.stderr) == (1, "")
    assert "error: demonstration 1 (reach 1)" in result.stdout


def test_learn_command_equals_function(run_json: RunJson, folder: Path, tmp_path: Path):
    output = run_json("learn", folder, "--states", "3", "--only", "0-2,4", "--out", "reach.skill")
    demonstrations = [add_derivatives(demo) for demo in read_demonstrations(folder)]
    fit = learn([*demonstrations[:3], demonstrations[4]], states=3, rng=np.random.default_rng(0))
    assert (
        output["content_hash"]
        == content_hash(fit.skill)
        == content_hash(open_skill(tmp_path / "reach.skill"))
    )
    assert output["log_likelihood"] == fit.skill.provenance.log_likelihood
    assert output["demonstrations"] == ["reach 0", "reach 1", "reach 2", "reach 4"]
    assert (output["converged"], output["reason"]) == (fit.convergence.converged, fit.convergence.reason)
    assert output["covariance_parameters"] == 2 * 3 * 14 * 15 // 2


@pytest.mark.parametrize(
    ("name", "kind"), [("semi-markov", SemiMarkovChain), ("markov", MarkovChain), ("mixture", MixtureWeights)]
)
@pytest.mark.parametrize(
    ("structure", "label"),
    [
        ("full", "full"),
        ("diagonal", "diagonal"),
        ("spherical", "spherical"),
        ("semi-tied", "semi-tied(1)"),
        ("mfa:2", "MFA(2)"),
        ("hddc:0.9", "HDDC(0.9)"),
        ("mlt:2", "MLT(2)"),
    ],
)
def test_learn_every_dynamics_and_structure(
    run_command_line: RunCommand,
    run_json: RunJson,
    folder: Path,
    tmp_path: Path,
    name: str,
    kind: type,
    structure: str,
    label: str,
):
    chosen = ["--dynamics", name, "--structure", structure, "--states", "2", "--max-iterations", "3"]
    run_json("learn", folder, *chosen, "--out", "skill")
    assert isinstance(open_skill(tmp_path / "skill").dynamics, kind)
    output = run_json("show", "skill")
    assert (output["dynamics"], len(output["states"])) == (name, 2)
    assert output["structure"] == label
    assert output["content_hash"] in run_command_line("show", "skill").stdout


def test_learn_semi_tied_tying_factor(run_json: RunJson, folder: Path, tmp_path: Path):
    tied = ["--structure", "semi-tied:0.5", "--states", "2", "--max-iterations", "2"]
    assert run_json("learn", folder, *tied, "--out", "skill")["structure"] == "semi-tied(0.5)"
    assert {c.tying for c in open_skill(tmp_path / "skill").covariances} == {0.5}  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "distribution", ["gaussian", "log-normal", "gamma", "poisson", "negative-binomial", "histogram"]
)
def test_learn_every_duration_distribution_equals_function(
    run_json: RunJson, folder: Path, tmp_path: Path, distribution: str
):
    chosen = ["--durations", distribution, "--censoring", "none", "--states", "2", "--max-iterations", "4"]
    output = run_json("learn", folder, *chosen, "--out", "skill")
    pseudocount = {"pseudocount": 1.0} if distribution == "histogram" else {}
    durations = DurationModel(DISTRIBUTIONS[distribution], Censoring.NONE, options=pseudocount)
    demos = [add_derivatives(demo) for demo in read_demonstrations(folder)]
    fit = learn(
        demos,
        states=2,
        rng=np.random.default_rng(0),
        durations=durations,
        settings=EMSettings(max_iterations=4),
    )
    assert output["content_hash"] == content_hash(fit.skill)


def test_learn_riemannian_orientation_has_three_tangent_columns(
    run_json: RunJson, folder: Path, tmp_path: Path
):
    run_json("learn", folder, "--riemannian", "--states", "2", "--max-iterations", "3", "--out", "skill")
    skill = open_skill(tmp_path / "skill")
    assert (skill.width, skill.covariances[0].dense.shape[-1]) == (13, 12)
    assert skill.layout == add_derivatives(to_sphere(read_demonstrations(folder)[0])).layout


def test_learn_velocities_are_added_if_missing(run_json: RunJson, folder: Path):
    small = ["--states", "2", "--max-iterations", "2", "--out"]
    assert len(run_json("learn", folder, *small, "with")["columns"]) == 14
    assert len(run_json("learn", folder, "--no-velocities", *small, "without")["columns"]) == 7
    assert len(run_json("learn", "dataset:synthetic valve", "--only", "0", *small, "own")["columns"]) == 14


def test_learn_prints_warnings(run_command_line: RunCommand, folder: Path):
    manifest = json.loads((folder / "demonstrations.json").read_text())
    first, second = manifest["demonstration"][:2]
    (folder / second["file"]).write_bytes((folder / first["file"]).read_bytes())
    second["sha256"] = first["sha256"]
    del manifest["sha256"]
    (folder / "demonstrations.json").write_text(json.dumps(manifest))
    result = run_command_line("learn", folder, "--states", "2", "--out", "skill")
    assert result.exit_code == 0
    assert "warning: demonstration 1 (reach 1) has the same rows" in result.stderr


def test_show_most_precise_frame_of_states(run_json: RunJson, skill: Path):
    states = run_json("show", skill)["states"]
    first = max(states, key=lambda state: state["initial"])
    last = next(state for state in states if not state["transitions"])
    assert (first["most_precise_frame"], last["most_precise_frame"]) == ("home", "cup")
    assert last["mean_deviation"]["cup"] < last["mean_deviation"]["home"]


def test_show_writes_plots(run_json: RunJson, skill: Path, tmp_path: Path):
    pytest.importorskip("matplotlib")
    output = run_json("show", skill, "--plots", tmp_path / "plots")
    assert output["not_plotted"] == {}
    assert {Path(file).name for file in output["plots"]} == {
        "deviations.png",
        "states.png",
        "forward-variable.png",
    }
    assert all(Path(file).read_bytes().startswith(b"\x89PNG") for file in output["plots"])
    assert run_json("show", skill, "--plots", tmp_path / "plots", "--force")["plots"]


def read_motion(path: Path) -> tuple[list[str], np.ndarray]:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array(rows, dtype=float)


def test_reproduce_ends_at_new_frame(run_json: RunJson, skill: Path, frames: Path, tmp_path: Path):
    files = ["--out", "motion.csv", "--gains", "gains.npz", "--plot", "motion.svg"]
    output = run_json("reproduce", skill, "--frames", frames, "--horizon", "40", *files)
    header, rows = read_motion(tmp_path / "motion.csv")
    assert header[:2] == ["time [s]", "position x [m]"]
    assert header[-1] == "orientation z' [1/s]"
    np.testing.assert_allclose(rows[:, 0], 0.1 * np.arange(40), rtol=1e-12)
    assert output["final"]["position"] == rows[-1, 1:4].tolist()
    np.testing.assert_allclose(
        rows[-1, 1:4], [0.5, 0.2, 0.15], atol=0.05
    )  # m; the noise of five demonstrations
    np.testing.assert_allclose(np.linalg.norm(output["final"]["orientation"]), 1.0, rtol=1e-12)
    assert (tmp_path / "motion.svg").read_text().startswith("<?xml")


def test_gains_file_reproduces_motion(run_json: RunJson, skill: Path, frames: Path, tmp_path: Path):
    run_json("reproduce", skill, "--frames", frames, "--horizon", "9", "--out", "m.csv", "--gains", "g.npz")
    _, rows = read_motion(tmp_path / "m.csv")
    x = rows[0, 1:]
    with np.load(tmp_path / "g.npz") as c:
        for t in range(8):
            u = c["feedforwards"][t] - c["gains"][t] @ (x - c["targets"][t])
            h, p, v = float(c["period"]), x[:7], x[7:]
            x = np.concatenate([p + h * v + 0.5 * h * h * u, v + h * u])
            np.testing.assert_allclose(normalise_as_written(x), rows[t + 1, 1:], rtol=1e-9, atol=1e-12)


def normalise_as_written(x: np.ndarray) -> np.ndarray:
    """Normalise the quaternion, as the motion file does."""
    return np.concatenate([x[:3], x[3:7] / np.linalg.norm(x[3:7]), x[7:]])


def test_control_cost_and_regularisation_change_motion(run_json: RunJson, skill: Path, frames: Path):
    reproduce = ["reproduce", skill, "--frames", frames, "--horizon", "20"]
    high, low = (run_json(*reproduce, "--control-cost", cost)["max_acceleration"] for cost in ("900", "1"))
    assert high["position"] < low["position"]
    loose, tight = (
        run_json(*reproduce, "--covariance-regularisation", value)["distance_to_reference"]
        for value in ("1", "1e-4")
    )
    assert tight["position"]["mean"] < loose["position"]["mean"]


def test_reproduce_world_frame_needs_no_frames(
    run_json: RunJson, tmp_path: Path, reach_demonstrations: tuple[Demonstration, ...]
):
    layout = position_layout()
    write_demonstrations(
        [demonstration(demo.x[:, :3], demo.period, layout) for demo in reach_demonstrations],
        tmp_path / "world",
    )
    run_json("learn", "world", "--states", "2", "--out", "skill")
    assert run_json("reproduce", "skill", "--horizon", "5")["steps"] == 5


def test_learn_notes_name_options_in_text_and_json(
    run_command_line: RunCommand, run_json: Callable[..., dict[str, Any]], folder: Path
):
    """Full covariances of few datapoints, and a regularisation of more than the variances."""
    arguments = ["learn", folder, "--structure", "full", "--states", "8", "--regularisation", "10"]
    notes = run_json(*arguments, "--out", "one.skill")["notes"]
    assert any("--regularisation is 10, which is the variance of" in note for note in notes)
    assert any(
        "datapoints for full covariances of 14 columns, expected at least 42" in note for note in notes
    )
    stderr = run_command_line(*arguments, "--out", "two.skill").stderr
    assert all(f"note: {note}" in stderr for note in notes)
    assert run_json("learn", folder, "--out", "three.skill")["notes"] == []
