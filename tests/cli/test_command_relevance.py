"""Frames that matter: told by `show --relevance`, left out by `learn --drop-distractors`."""

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
    """A hand goes from a box to a cup; a clock stands about, at random, and is in the recording too."""
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


def test_a_distractor_is_named_and_left_out(
    run_json: RunJson, run_command_line: RunCommand, distractor_folder: Path
):
    """The clock matters at no state; learned without it, a skill has the frames of box and cup alone."""
    run_json("learn", distractor_folder, "--states", "3", "--out", "all.skill")
    output = run_json("show", "all.skill", "--relevance", distractor_folder)
    assert output["distractors"] == ["clock"]
    assert set(output["relevance"]["clock"]) == {0.0}
    assert (
        "of relevance 0 at every state: clock"
        in run_command_line("show", "all.skill", "--relevance", distractor_folder).stdout
    )
    anew = run_json("learn", distractor_folder, "--states", "3", "--out", "few.skill", "--drop-distractors")
    assert (anew["frames"], anew["dropped_frames"]) == (["box", "cup"], ["clock"])
    assert anew["note"] == "dropped frames, they matter at no state: clock"
    again = run_json("show", "few.skill", "--relevance", distractor_folder)
    assert (set(again["relevance"]), again["distractors"]) == ({"box", "cup"}, [])


def test_where_every_frame_matters_none_is_left_out(
    run_json: RunJson, run_command_line: RunCommand, folder: Path
):
    """The skill is then that of learning once."""
    once = run_json("learn", folder, "--states", "3", "--out", "once.skill")
    twice = run_json("learn", folder, "--states", "3", "--out", "twice.skill", "--drop-distractors")
    assert twice["dropped_frames"] == []
    assert twice["content_hash"] == once["content_hash"]


def test_relevance_is_that_of_the_demonstrations_learned_from(
    run_json: RunJson,
    distractor_folder: Path,
    distractor_demonstrations: tuple[Demonstration, ...],
    tmp_path: Path,
):
    """Of the folder those are taken that the skill names, in its columns."""
    run_json("learn", distractor_folder, "--states", "2", "--only", "1-5", "--out", "few.skill")
    output = run_json("show", "few.skill", "--relevance", distractor_folder)
    shown = [add_derivatives(demo) for demo in distractor_demonstrations[1:6]]
    expected = relevance(open_skill(tmp_path / "few.skill"), shown)
    for p, name in enumerate(expected.frame_names):
        np.testing.assert_allclose(output["relevance"][name], expected.values[p], atol=1e-6)
        np.testing.assert_allclose(output["relevance_costs"][name], expected.costs[p], atol=1e-6)


def test_relevance_on_the_sphere(run_json: RunJson, folder: Path):
    """A skill with orientations on S^3 is asked in the same words."""
    run_json("learn", folder, "--states", "3", "--riemannian", "--out", "s.skill")
    output = run_json("show", "s.skill", "--relevance", folder)
    assert set(output["relevance"]) == {"home", "cup"}
    assert np.max([output["relevance"][name] for name in ("home", "cup")], axis=0).tolist() == [1.0] * 3


def test_relevance_is_drawn(run_json: RunJson, folder: Path):
    """One picture more."""
    pytest.importorskip("matplotlib")
    run_json("learn", folder, "--states", "3", "--out", "r.skill")
    output = run_json("show", "r.skill", "--relevance", folder, "--plots", "drawn")
    assert any(path.endswith("relevance.png") for path in output["plots"])


def test_relevance_that_cannot_be_told_is_refused(
    run_json: RunJson,
    run_failing: RunFailing,
    folder: Path,
    distractor_folder: Path,
    distractor_demonstrations: tuple[Demonstration, ...],
):
    """Other recordings, or one frame alone."""
    run_json("learn", folder, "--states", "2", "--out", "reach.skill")
    assert "name the folder that it was learned from" in run_failing(
        "show", "reach.skill", "--relevance", distractor_folder
    )
    write_demonstrations(
        [replace(demo, frames=demo.frames[:1]) for demo in distractor_demonstrations],
        distractor_folder,
        overwrite=True,
    )
    run_json("learn", distractor_folder, "--states", "2", "--out", "one.skill")
    assert "expected several" in run_failing("show", "one.skill", "--relevance", distractor_folder)
    assert (
        run_json("learn", distractor_folder, "--states", "2", "--out", "o.skill", "--drop-distractors")[
            "dropped_frames"
        ]
        == []
    )


@pytest.mark.parametrize(
    ("durations", "named"),
    [
        ("counted", "gaussian"),
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
def test_the_law_of_durations_is_named(
    run_json: RunJson, run_command_line: RunCommand, folder: Path, durations: str, named: str
):
    """In the answer of learn and of show, for people and for programs."""
    learned = run_json("learn", folder, "--states", "2", "--durations", durations, "--out", "d.skill")
    assert learned["durations"] == named
    assert run_json("show", "d.skill")["durations"] == named
    assert f"semi-markov, {named} durations" in run_command_line("show", "d.skill").stdout


def test_models_without_durations_name_none(run_json: RunJson, folder: Path):
    """A Markov model has no law of its own."""
    assert (
        run_json("learn", folder, "--states", "2", "--dynamics", "markov", "--out", "m")["durations"] is None
    )
