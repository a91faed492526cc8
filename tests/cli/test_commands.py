"""Each command does what its help says."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

from pilotfish.cli.options.learners import DISTRIBUTIONS
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
    learn_semi_markov,
)

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]


def test_every_data_set_of_the_list_is_described(run_json: RunJson):
    """What list names, info knows."""
    listed = run_json("data", "list")["datasets"]
    assert set(datasets.names()) < set(listed)
    for name in listed:
        assert run_json("data", "info", name)["about"] == listed[name]


def test_what_is_exported_is_what_is_learned_from(run_json: RunJson, tmp_path: Path):
    """A data set written to a folder gives the same skill as by its name."""
    run_json("data", "export", "synthetic valve", "copy")
    learned = ["--states", "2", "--max-iterations", "2", "--only", "0"]
    run_json("learn", "copy", *learned, "--out", "a")
    run_json("learn", "dataset:synthetic valve", *learned, "--out", "b")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_sound_folder_is_found_sound(run_json: RunJson, folder: Path):
    """The report counts what is there; a frame that never moves is worth a note, and no more."""
    report = run_json("data", "check", folder)
    assert [demo["name"] for demo in report["demonstrations"]] == [f"reach {m}" for m in range(5)]
    assert {finding["severity"] for finding in report["diagnostics"]} <= {"note"}


def test_a_folder_that_cannot_be_learned_from_has_exit_code_one(run_command_line: RunCommand, folder: Path):
    """A script may rely on the code; the text says why."""
    manifest = json.loads((folder / "demonstrations.json").read_text())
    manifest["demonstration"][1]["frames"][1]["name"] = "mug"
    del manifest["sha256"]
    (folder / "demonstrations.json").write_text(json.dumps(manifest))
    result = run_command_line("data", "check", folder)
    assert (result.exit_code, result.stderr) == (1, "")
    assert "error: demonstration 1 (reach 1)" in result.stdout


def test_learning_by_command_is_learning_by_function(run_json: RunJson, folder: Path, tmp_path: Path):
    """The file holds the skill that pf.learn finds, and the answer is about it."""
    output = run_json("learn", folder, "--states", "3", "--only", "0-2,4", "--out", "reach.skill")
    shown = [add_derivatives(demo) for demo in read_demonstrations(folder)]
    fit = learn([*shown[:3], shown[4]], states=3, rng=np.random.default_rng(0))
    assert (
        output["content_hash"]
        == content_hash(fit.skill)
        == content_hash(open_skill(tmp_path / "reach.skill"))
    )
    assert output["log_likelihood"] == fit.log_likelihoods[-1]
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
def test_every_dynamics_and_structure_is_learned_and_shown(
    run_command_line: RunCommand,
    run_json: RunJson,
    folder: Path,
    tmp_path: Path,
    name: str,
    kind: type,
    structure: str,
    label: str,
):
    """What is asked for is what stands in the file, and show tells it, to people too."""
    chosen = ["--dynamics", name, "--structure", structure, "--states", "2", "--max-iterations", "3"]
    run_json("learn", folder, *chosen, "--out", "skill")
    assert isinstance(open_skill(tmp_path / "skill").dynamics, kind)
    shown = run_json("show", "skill")
    assert (shown["dynamics"], len(shown["states"])) == (name, 2)
    assert shown["structure"] == label
    assert shown["content_hash"] in run_command_line("show", "skill").stdout


def test_tying_is_what_was_asked_for(run_json: RunJson, folder: Path, tmp_path: Path):
    """Half tied, the file says one half."""
    tied = ["--structure", "semi-tied:0.5", "--states", "2", "--max-iterations", "2"]
    assert run_json("learn", folder, *tied, "--out", "skill")["structure"] == "semi-tied(0.5)"
    assert {c.tying for c in open_skill(tmp_path / "skill").covariances} == {0.5}  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "law", ["gaussian", "log-normal", "gamma", "poisson", "negative-binomial", "histogram"]
)
def test_durations_of_every_law_are_learned_together_with_all_else(
    run_json: RunJson, folder: Path, tmp_path: Path, distribution: str
):
    """The file holds what pf.models.learn_semi_markov finds, durations of the law asked for."""
    chosen = ["--durations", distribution, "--censoring", "none", "--states", "2", "--max-iterations", "4"]
    output = run_json("learn", folder, *chosen, "--out", "skill")
    duration_model = DurationModel(DISTRIBUTIONS[distribution], Censoring(left=False, last=False))
    demos = [add_derivatives(demo) for demo in read_demonstrations(folder)]
    fit = learn_semi_markov(
        demos,
        states=2,
        rng=np.random.default_rng(0),
        duration_model=duration_model,
        settings=EMSettings(max_iterations=4),
    )
    assert output["content_hash"] == content_hash(fit.skill)


def test_orientations_on_their_sphere_have_three_deviations(run_json: RunJson, folder: Path, tmp_path: Path):
    """--riemannian learns what pf.on_sphere makes of the recordings: twelve deviations of thirteen columns."""
    run_json("learn", folder, "--riemannian", "--states", "2", "--max-iterations", "3", "--out", "skill")
    skill = open_skill(tmp_path / "skill")
    assert (skill.width, skill.covariances[0].dense.shape[-1]) == (13, 12)
    assert skill.layout == add_derivatives(to_sphere(read_demonstrations(folder)[0])).layout


def test_speeds_are_added_only_where_wanted_and_missing(run_json: RunJson, folder: Path):
    """Seven columns become fourteen, or stay seven; those that are there stay as they are."""
    small = ["--states", "2", "--max-iterations", "2", "--out"]
    assert len(run_json("learn", folder, *small, "with")["columns"]) == 14
    assert len(run_json("learn", folder, "--no-velocities", *small, "without")["columns"]) == 7
    assert len(run_json("learn", "dataset:synthetic valve", "--only", "0", *small, "own")["columns"]) == 14


def test_demonstrations_that_look_odd_are_named_before_learning(run_command_line: RunCommand, folder: Path):
    """The same recording twice is learned from, and remarked on stderr."""
    manifest = json.loads((folder / "demonstrations.json").read_text())
    first, second = manifest["demonstration"][:2]
    (folder / second["file"]).write_bytes((folder / first["file"]).read_bytes())
    second["sha256"] = first["sha256"]
    del manifest["sha256"]
    (folder / "demonstrations.json").write_text(json.dumps(manifest))
    result = run_command_line("learn", folder, "--states", "2", "--out", "skill")
    assert result.exit_code == 0
    assert "warning: demonstration 1 (reach 1) has the same rows" in result.stderr


def test_show_names_the_frame_in_which_a_state_is_precise(run_json: RunJson, skill: Path):
    """Reaches begin at home and end at the cup: there the frames of each are the precise ones."""
    states = run_json("show", skill)["states"]
    first = max(states, key=lambda state: state["initial"])
    last = next(state for state in states if not state["next"])
    assert (first["most_precise_frame"], last["most_precise_frame"]) == ("home", "cup")
    assert last["spread"]["cup"] < last["spread"]["home"]


def test_show_draws_the_skill(run_json: RunJson, skill: Path, tmp_path: Path):
    """A picture for each aspect; pictures that are there stay without --force."""
    pytest.importorskip("matplotlib")
    output = run_json("show", skill, "--plots", tmp_path / "pictures")
    assert output["not_plotted"] == {}
    assert {Path(file).name for file in output["plots"]} == {
        "deviations.png",
        "states.png",
        "filtered_state_probs.png",
    }
    assert all(Path(file).read_bytes().startswith(b"\x89PNG") for file in output["plots"])
    assert run_json("show", skill, "--plots", tmp_path / "pictures", "--force")["plots"]


def read_motion(path: Path) -> tuple[list[str], np.ndarray]:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array(rows, dtype=float)


def test_replay_ends_where_the_cup_stands_now(run_json: RunJson, skill: Path, frames: Path, tmp_path: Path):
    """The cup was never there; the hand comes to it all the same, and the files hold that motion."""
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


def test_the_gains_make_the_motion(run_json: RunJson, skill: Path, frames: Path, tmp_path: Path):
    """Who applies the controller of the NPZ file to unit masses gets the motion of the CSV file."""
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
    """The orientation brought back to unit length."""
    return np.concatenate([x[:3], x[3:7] / np.linalg.norm(x[3:7]), x[7:]])


def test_softer_effort_and_more_slack_are_obeyed(run_json: RunJson, skill: Path, frames: Path):
    """A dear effort accelerates less."""
    replay = ["reproduce", skill, "--frames", frames, "--horizon", "20"]
    dear, cheap = (run_json(*replay, "--control-cost", price)["max_acceleration"] for price in ("900", "1"))
    assert dear["position"] < cheap["position"]
    loose, tight = (
        run_json(*replay, "--covariance-regularisation", covariance_regularisation)["distance_to_reference"]
        for covariance_regularisation in ("1", "1e-4")
    )
    assert tight["position"]["mean"] < loose["position"]["mean"]


def test_a_skill_of_the_world_alone_needs_no_frames(
    run_json: RunJson, tmp_path: Path, reach_demonstrations: tuple[Demonstration, ...]
):
    """Nothing stands anywhere, so nothing is asked."""
    layout = position_layout()
    write_demonstrations(
        [demonstration(demo.x[:, :3], demo.period, layout) for demo in reach_demonstrations],
        tmp_path / "world",
    )
    run_json("learn", "world", "--states", "2", "--out", "skill")
    assert run_json("reproduce", "skill", "--horizon", "5")["steps"] == 5
