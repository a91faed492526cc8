"""Frame relevance: `show --relevance`, `reproduce --relevance` and `learn --drop-distractors`."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

from pilotfish.demonstrations import (
    Demonstration,
    add_derivatives,
    demonstration,
    frame_from_pose,
    position_layout,
)
from pilotfish.geometry import pose, quaternion_exp
from pilotfish.io.demonstration_folder import write_demonstrations
from pilotfish.io.skill_file import open_skill
from pilotfish.models import relevance

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]
STEPS = 24


def distractor_demonstration(rng: np.random.Generator, name: str) -> Demonstration:
    """Move a hand from a box to a cup; the pose of a clock is random and irrelevant."""
    layout, s = position_layout(), np.linspace(0.0, 1.0, STEPS)
    share = (s**2 * (3.0 - 2.0 * s))[:, None]
    places = [0.3 * rng.normal(size=3) + [1.0 * n, 0.0, 0.0] for n in range(3)]
    turns = [quaternion_exp(np.array([0.0, 0.0, rng.uniform(-1.5, 1.5)])) for _ in range(3)]
    x = (1.0 - share) * places[0] + share * places[1] + 0.004 * rng.normal(size=(STEPS, 3))
    frames = [
        frame_from_pose(name, layout, pose(place, turn))
        for name, place, turn in zip(("box", "cup", "clock"), places, turns, strict=True)
    ]
    return demonstration(x, 0.1, layout, frames, name)


@pytest.fixture(scope="session")
def distractor_demonstrations() -> tuple[Demonstration, ...]:
    rng = np.random.default_rng(4)
    return tuple(distractor_demonstration(rng, f"fetch {m}") for m in range(8))


@pytest.fixture
def distractor_folder(tmp_path: Path, distractor_demonstrations: tuple[Demonstration, ...]) -> Path:
    write_demonstrations(distractor_demonstrations, tmp_path / "fetches")
    return tmp_path / "fetches"


def test_drop_distractors_removes_distractor(
    run_json: RunJson, run_command_line: RunCommand, distractor_folder: Path
):
    run_json("learn", distractor_folder, "--states", "3", "--out", "all.skill")
    output = run_json("show", "all.skill", "--relevance", distractor_folder)
    assert output["distractors"] == ["clock"]
    assert set(output["relevance"]["clock"]) == {0.0}
    assert (
        "Relevance 0 in every state: clock."
        in run_command_line("show", "all.skill", "--relevance", distractor_folder).stdout
    )
    learn = ["learn", distractor_folder, "--states", "3", "--out"]
    refitted = run_json(*learn, "few.skill", "--drop-distractors")
    assert (refitted["frames"], refitted["dropped_frames"]) == (["box", "cup"], ["clock"])
    assert refitted["note"] == "dropped frames of relevance 0: clock"
    again = run_json("show", "few.skill", "--relevance", distractor_folder)
    assert (set(again["relevance"]), again["distractors"]) == ({"box", "cup"}, [])


def test_drop_distractors_without_distractor_changes_nothing(
    run_json: RunJson, run_command_line: RunCommand, folder: Path
):
    once = run_json("learn", folder, "--states", "3", "--out", "once.skill")
    twice = run_json("learn", folder, "--states", "3", "--out", "twice.skill", "--drop-distractors")
    assert twice["dropped_frames"] == []
    assert twice["content_hash"] == once["content_hash"]


def test_relevance_uses_training_demonstrations(
    run_json: RunJson,
    distractor_folder: Path,
    distractor_demonstrations: tuple[Demonstration, ...],
    tmp_path: Path,
):
    run_json("learn", distractor_folder, "--states", "2", "--only", "1-5", "--out", "few.skill")
    output = run_json("show", "few.skill", "--relevance", distractor_folder)
    demonstrations = [add_derivatives(demo) for demo in distractor_demonstrations[1:6]]
    expected = relevance(open_skill(tmp_path / "few.skill"), demonstrations)
    for p, name in enumerate(expected.frame_names):
        np.testing.assert_allclose(output["relevance"][name], expected.values[p], atol=1e-6)
        np.testing.assert_allclose(output["relevance_costs"][name], expected.costs[p], atol=1e-6)


def test_relevance_of_riemannian_skill(run_json: RunJson, folder: Path):
    run_json("learn", folder, "--states", "3", "--riemannian", "--out", "s.skill")
    output = run_json("show", "s.skill", "--relevance", folder)
    assert set(output["relevance"]) == {"home", "cup"}
    assert np.max([output["relevance"][name] for name in ("home", "cup")], axis=0).tolist() == [1.0] * 3


def test_relevance_is_plotted(run_json: RunJson, folder: Path):
    pytest.importorskip("matplotlib")
    run_json("learn", folder, "--states", "3", "--out", "r.skill")
    output = run_json("show", "r.skill", "--relevance", folder, "--plots", "plots")
    assert any(path.endswith("relevance.png") for path in output["plots"])


def test_relevance_of_wrong_demonstrations_or_one_frame_is_rejected(
    run_json: RunJson,
    run_failing: RunFailing,
    folder: Path,
    distractor_folder: Path,
    distractor_demonstrations: tuple[Demonstration, ...],
):
    run_json("learn", folder, "--states", "2", "--out", "reach.skill")
    assert "name the folder that the skill was learned from" in run_failing(
        "show", "reach.skill", "--relevance", distractor_folder
    )
    write_demonstrations(
        [replace(demo, frames=demo.frames[:1]) for demo in distractor_demonstrations],
        distractor_folder,
        overwrite=True,
    )
    run_json("learn", distractor_folder, "--states", "2", "--out", "one.skill")
    assert "expected at least two" in run_failing("show", "one.skill", "--relevance", distractor_folder)
    assert (
        run_json("learn", distractor_folder, "--states", "2", "--out", "o.skill", "--drop-distractors")[
            "dropped_frames"
        ]
        == []
    )


@pytest.mark.parametrize(
    ("durations", "name"),
    [
        ("viterbi", "gaussian"),
        *(
            (distribution,) * 2
            for distribution in (
                "gaussian",
                "log-normal",
                "gamma",
                "poisson",
                "negative-binomial",
                "histogram",
            )
        ),
    ],
)
def test_duration_distribution_is_named(
    run_json: RunJson, run_command_line: RunCommand, folder: Path, durations: str, name: str
):
    learned = run_json("learn", folder, "--states", "2", "--durations", durations, "--out", "d.skill")
    assert learned["durations"] == name
    assert run_json("show", "d.skill")["durations"] == name
    assert f"semi-markov, {name} durations" in run_command_line("show", "d.skill").stdout


def test_markov_model_has_no_duration_distribution(run_json: RunJson, folder: Path):
    assert (
        run_json("learn", folder, "--states", "2", "--dynamics", "markov", "--out", "m")["durations"] is None
    )


def test_reproduce_with_relevance_ignores_distractor(
    run_command_line: RunCommand, distractor_folder: Path, tmp_path: Path
):
    """Moving the clock changes the motion of equal frames, and not that of weighted ones."""
    learn = ("learn", distractor_folder, "--states", "3", "--out", "all.skill")
    assert run_command_line(*learn).exit_code == 0
    motions = {}
    for place in (0.0, 5.0):
        positions = {"box": [0.0, 0.0, 0.0], "cup": [1.0, 0.0, 0.0], "clock": [2.0, place, 0.0]}
        poses = [{"name": n, "position": p, "quaternion": [1, 0, 0, 0]} for n, p in positions.items()]
        (tmp_path / "now.json").write_text(json.dumps(poses))
        for name, weights in (("equal", ()), ("weighted", ("--relevance", distractor_folder))):
            file = tmp_path / f"{name}{place}.csv"
            line = ("reproduce", "all.skill", "--frames", "now.json", *weights, "--out", file)
            assert run_command_line(*line).exit_code == 0
            motions[name, place] = np.loadtxt(file, delimiter=",", skiprows=1)
    np.testing.assert_allclose(motions["weighted", 0.0], motions["weighted", 5.0], atol=1e-9)
    assert np.abs(motions["equal", 0.0] - motions["equal", 5.0]).max() > 0.01  # m
