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
    demonstration,
    on_sphere,
    position_layout,
    read_folder,
    with_derivatives,
    write_folder,
)
from pilotfish.models import (
    Censoring,
    EMSettings,
    MarkovChain,
    SemiMarkovChain,
    Timing,
    Weights,
    learn,
    learn_semi_markov,
)
from pilotfish.station.learners import LAWS
from pilotfish.store import content_hash, datasets, open_skill

Runs = Callable[..., Result]
Facts = Callable[..., dict[str, Any]]


def test_every_data_set_of_the_list_is_described(facts: Facts):
    """What list names, info knows."""
    listed = facts("data", "list")["datasets"]
    assert set(datasets.names()) < set(listed)
    for name in listed:
        assert facts("data", "info", name)["about"] == listed[name]


def test_what_is_exported_is_what_is_learned_from(facts: Facts, tmp_path: Path):
    """A data set written to a folder gives the same skill as by its name."""
    facts("data", "export", "synthetic valve", "copy")
    learned = ["--states", "2", "--iterations", "2", "--only", "0"]
    facts("learn", "copy", *learned, "--out", "a")
    facts("learn", "dataset:synthetic valve", *learned, "--out", "b")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_sound_folder_is_found_sound(facts: Facts, folder: Path):
    """The report counts what is there; a frame that never moves is worth a note, and no more."""
    report = facts("data", "check", folder)
    assert [demo["name"] for demo in report["demonstrations"]] == [f"reach {m}" for m in range(5)]
    assert {finding["severity"] for finding in report["findings"]} <= {"note"}


def test_a_folder_that_cannot_be_learned_from_has_exit_code_one(run: Runs, folder: Path):
    """A script may rely on the code; the text says why."""
    manifest = json.loads((folder / "demonstrations.json").read_text())
    manifest["demonstration"][1]["frames"][1]["name"] = "mug"
    del manifest["sha256"]
    (folder / "demonstrations.json").write_text(json.dumps(manifest))
    result = run("data", "check", folder)
    assert (result.exit_code, result.stderr) == (1, "")
    assert "error: demonstration 1 (reach 1)" in result.stdout


def test_learning_by_command_is_learning_by_function(facts: Facts, folder: Path, tmp_path: Path):
    """The file holds the skill that pf.learn finds, and the answer is about it."""
    told = facts("learn", folder, "--states", "3", "--only", "0-2,4", "--out", "reach.skill")
    shown = [with_derivatives(demo) for demo in read_folder(folder)]
    fit = learn([*shown[:3], shown[4]], states=3, rng=np.random.default_rng(0))
    assert told["content"] == content_hash(fit.skill) == content_hash(open_skill(tmp_path / "reach.skill"))
    assert told["log_likelihood"] == fit.trace[-1]
    assert told["demonstrations"] == ["reach 0", "reach 1", "reach 2", "reach 4"]
    assert (told["converged"], told["reason"]) == (fit.outcome.converged, fit.outcome.reason)
    assert told["covariance_parameters"] == 2 * 3 * 14 * 15 // 2


@pytest.mark.parametrize(
    ("name", "kind"), [("semi-markov", SemiMarkovChain), ("markov", MarkovChain), ("mixture", Weights)]
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
    run: Runs, facts: Facts, folder: Path, tmp_path: Path, name: str, kind: type, structure: str, label: str
):
    """What is asked for is what stands in the file, and show tells it, to people too."""
    chosen = ["--dynamics", name, "--structure", structure, "--states", "2", "--iterations", "3"]
    facts("learn", folder, *chosen, "--out", "skill")
    assert isinstance(open_skill(tmp_path / "skill").dynamics, kind)
    shown = facts("show", "skill")
    assert (shown["dynamics"], len(shown["states"])) == (name, 2)
    assert shown["structure"] == label
    assert shown["content"] in run("show", "skill").stdout


def test_tying_is_what_was_asked_for(facts: Facts, folder: Path, tmp_path: Path):
    """Half tied, the file says one half."""
    tied = ["--structure", "semi-tied:0.5", "--states", "2", "--iterations", "2"]
    assert facts("learn", folder, *tied, "--out", "skill")["structure"] == "semi-tied(0.5)"
    assert {c.tying for c in open_skill(tmp_path / "skill").covariances} == {0.5}  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "law", ["normal", "log-normal", "gamma", "poisson", "negative-binomial", "histogram"]
)
def test_durations_of_every_law_are_learned_together_with_all_else(
    facts: Facts, folder: Path, tmp_path: Path, law: str
):
    """The file holds what pf.learn_semi_markov finds, durations of the law asked for."""
    chosen = ["--durations", law, "--censored", "none", "--states", "2", "--iterations", "4"]
    told = facts("learn", folder, *chosen, "--out", "skill")
    timing = Timing(LAWS[law], Censoring(first=False, last=False))
    demos = [with_derivatives(demo) for demo in read_folder(folder)]
    fit = learn_semi_markov(
        demos, states=2, rng=np.random.default_rng(0), timing=timing, settings=EMSettings(max_iterations=4)
    )
    assert told["content"] == content_hash(fit.skill)


def test_orientations_on_their_sphere_have_three_deviations(facts: Facts, folder: Path, tmp_path: Path):
    """--sphere learns what pf.on_sphere makes of the recordings: twelve deviations of thirteen columns."""
    facts("learn", folder, "--sphere", "--states", "2", "--iterations", "3", "--out", "skill")
    skill = open_skill(tmp_path / "skill")
    assert (skill.width, skill.covariances[0].dense.shape[-1]) == (13, 12)
    assert skill.layout == with_derivatives(on_sphere(read_folder(folder)[0])).layout


def test_speeds_are_added_only_where_wanted_and_missing(facts: Facts, folder: Path):
    """Seven columns become fourteen, or stay seven; those that are there stay as they are."""
    small = ["--states", "2", "--iterations", "2", "--out"]
    assert len(facts("learn", folder, *small, "with")["columns"]) == 14
    assert len(facts("learn", folder, "--no-speeds", *small, "without")["columns"]) == 7
    assert len(facts("learn", "dataset:synthetic valve", "--only", "0", *small, "own")["columns"]) == 14


def test_demonstrations_that_look_odd_are_named_before_learning(run: Runs, folder: Path):
    """The same recording twice is learned from, and remarked on stderr."""
    manifest = json.loads((folder / "demonstrations.json").read_text())
    first, second = manifest["demonstration"][:2]
    (folder / second["file"]).write_bytes((folder / first["file"]).read_bytes())
    second["sha256"] = first["sha256"]
    del manifest["sha256"]
    (folder / "demonstrations.json").write_text(json.dumps(manifest))
    result = run("learn", folder, "--states", "2", "--out", "skill")
    assert result.exit_code == 0
    assert "warning: demonstration 1 (reach 1) has the same rows" in result.stderr


def test_show_names_the_frame_in_which_a_state_is_precise(facts: Facts, skill: Path):
    """Reaches begin at home and end at the cup: there the frames of each are the precise ones."""
    states = facts("show", skill)["states"]
    first = max(states, key=lambda state: state["initial"])
    last = next(state for state in states if not state["next"])
    assert (first["precise_frame"], last["precise_frame"]) == ("home", "cup")
    assert last["spread"]["cup"] < last["spread"]["home"]


def test_show_draws_the_skill(facts: Facts, skill: Path, tmp_path: Path):
    """A picture for each aspect; pictures that are there stay without --force."""
    pytest.importorskip("matplotlib")
    told = facts("show", skill, "--pictures", tmp_path / "pictures")
    assert told["not_drawn"] == {}
    assert {Path(file).name for file in told["pictures"]} == {"deviations.png", "states.png", "occupancy.png"}
    assert all(Path(file).read_bytes().startswith(b"\x89PNG") for file in told["pictures"])
    assert facts("show", skill, "--pictures", tmp_path / "pictures", "--force")["pictures"]


def motion_in(path: Path) -> tuple[list[str], np.ndarray]:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array(rows, dtype=float)


def test_replay_ends_where_the_cup_stands_now(facts: Facts, skill: Path, frames: Path, tmp_path: Path):
    """The cup was never there; the hand comes to it all the same, and the files hold that motion."""
    files = ["--out", "motion.csv", "--gains", "gains.npz", "--picture", "motion.svg"]
    told = facts("replay", skill, "--frames", frames, "--horizon", "40", *files)
    header, rows = motion_in(tmp_path / "motion.csv")
    assert header[:2] == ["time [s]", "position x [m]"]
    assert header[-1] == "orientation z' [1/s]"
    np.testing.assert_allclose(rows[:, 0], 0.1 * np.arange(40), rtol=1e-12)
    assert told["final"]["position"] == rows[-1, 1:4].tolist()
    np.testing.assert_allclose(
        rows[-1, 1:4], [0.5, 0.2, 0.15], atol=0.05
    )  # m; the noise of five demonstrations
    np.testing.assert_allclose(np.linalg.norm(told["final"]["orientation"]), 1.0, rtol=1e-12)
    assert (tmp_path / "motion.svg").read_text().startswith("<?xml")


def test_the_gains_make_the_motion(facts: Facts, skill: Path, frames: Path, tmp_path: Path):
    """Who applies the controller of the NPZ file to unit masses gets the motion of the CSV file."""
    facts("replay", skill, "--frames", frames, "--horizon", "9", "--out", "m.csv", "--gains", "g.npz")
    _, rows = motion_in(tmp_path / "m.csv")
    x = rows[0, 1:]
    with np.load(tmp_path / "g.npz") as c:
        for t in range(8):
            u = c["feedforwards"][t] - c["gains"][t] @ (x - c["targets"][t])
            h, p, v = float(c["period"]), x[:7], x[7:]
            x = np.concatenate([p + h * v + 0.5 * h * h * u, v + h * u])
            np.testing.assert_allclose(in_the_file(x), rows[t + 1, 1:], rtol=1e-9, atol=1e-12)


def in_the_file(x: np.ndarray) -> np.ndarray:
    """The orientation brought back to unit length."""
    return np.concatenate([x[:3], x[3:7] / np.linalg.norm(x[3:7]), x[7:]])


def test_softer_effort_and_more_slack_are_obeyed(facts: Facts, skill: Path, frames: Path):
    """A dear effort accelerates less."""
    replay = ["replay", skill, "--frames", frames, "--horizon", "20"]
    dear, cheap = (facts(*replay, "--effort", price)["largest_acceleration"] for price in ("900", "1"))
    assert dear["position"] < cheap["position"]
    loose, tight = (facts(*replay, "--slack", slack)["distance_to_reference"] for slack in ("1", "1e-4"))
    assert tight["position"]["mean"] < loose["position"]["mean"]


def test_a_skill_of_the_world_alone_needs_no_frames(
    facts: Facts, tmp_path: Path, reaches: tuple[Demonstration, ...]
):
    """Nothing stands anywhere, so nothing is asked."""
    layout = position_layout()
    write_folder([demonstration(demo.x[:, :3], demo.period, layout) for demo in reaches], tmp_path / "world")
    facts("learn", "world", "--states", "2", "--out", "skill")
    assert facts("replay", "skill", "--horizon", "5")["steps"] == 5
