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
    demonstration,
    frame_from_pose,
    position_layout,
    with_derivatives,
    write_folder,
)
from pilotfish.geometry import exp, pose
from pilotfish.models import relevance
from pilotfish.store import open_skill

Runs = Callable[..., Result]
Facts = Callable[..., dict[str, Any]]
Refusal = Callable[..., str]
STEPS = 24


def fetch(rng: np.random.Generator, name: str) -> Demonstration:
    """A hand goes from a box to a cup; a clock stands about, at random, and is in the recording too."""
    layout, s = position_layout(), np.linspace(0.0, 1.0, STEPS)
    share = (s**2 * (3.0 - 2.0 * s))[:, None]
    places = [0.3 * rng.normal(size=3) + [1.0 * n, 0.0, 0.0] for n in range(3)]
    turns = [exp(np.array([0.0, 0.0, rng.uniform(-1.5, 1.5)])) for _ in range(3)]
    x = (1.0 - share) * places[0] + share * places[1] + 0.004 * rng.normal(size=(STEPS, 3))
    frames = [
        frame_from_pose(name, layout, pose(place, turn))
        for name, place, turn in zip(("box", "cup", "clock"), places, turns, strict=True)
    ]
    return demonstration(x, 0.1, layout, frames, name)


@pytest.fixture(scope="session")
def fetched() -> tuple[Demonstration, ...]:
    rng = np.random.default_rng(4)
    return tuple(fetch(rng, f"fetch {m}") for m in range(8))


@pytest.fixture
def fetches(tmp_path: Path, fetched: tuple[Demonstration, ...]) -> Path:
    write_folder(fetched, tmp_path / "fetches")
    return tmp_path / "fetches"


def test_a_distractor_is_named_and_left_out(facts: Facts, run: Runs, fetches: Path):
    """The clock matters at no state; learned without it, a skill has the frames of box and cup alone."""
    facts("learn", fetches, "--states", "3", "--out", "all.skill")
    told = facts("show", "all.skill", "--relevance", fetches)
    assert told["distractors"] == ["clock"]
    assert set(told["relevance"]["clock"]) == {0.0}
    assert "of relevance 0 at every state: clock" in run("show", "all.skill", "--relevance", fetches).stdout
    anew = facts("learn", fetches, "--states", "3", "--out", "few.skill", "--drop-distractors")
    assert (anew["frames"], anew["frames_left_out"]) == (["box", "cup"], ["clock"])
    assert anew["note"] == "frames left out, they matter at no state: clock"
    again = facts("show", "few.skill", "--relevance", fetches)
    assert (set(again["relevance"]), again["distractors"]) == ({"box", "cup"}, [])


def test_where_every_frame_matters_none_is_left_out(facts: Facts, run: Runs, folder: Path):
    """The skill is then that of learning once."""
    once = facts("learn", folder, "--states", "3", "--out", "once.skill")
    twice = facts("learn", folder, "--states", "3", "--out", "twice.skill", "--drop-distractors")
    assert twice["frames_left_out"] == []
    assert twice["content"] == once["content"]


def test_relevance_is_that_of_the_demonstrations_learned_from(
    facts: Facts, fetches: Path, fetched: tuple[Demonstration, ...], tmp_path: Path
):
    """Of the folder those are taken that the skill names, in its columns."""
    facts("learn", fetches, "--states", "2", "--only", "1-5", "--out", "few.skill")
    told = facts("show", "few.skill", "--relevance", fetches)
    shown = [with_derivatives(demo) for demo in fetched[1:6]]
    expected = relevance(open_skill(tmp_path / "few.skill"), shown)
    for p, name in enumerate(expected.frame_names):
        np.testing.assert_allclose(told["relevance"][name], expected.values[p], atol=1e-6)
        np.testing.assert_allclose(told["relevance_costs"][name], expected.costs[p], atol=1e-6)


def test_relevance_on_the_sphere(facts: Facts, folder: Path):
    """A skill with orientations on S^3 is asked in the same words."""
    facts("learn", folder, "--states", "3", "--sphere", "--out", "s.skill")
    told = facts("show", "s.skill", "--relevance", folder)
    assert set(told["relevance"]) == {"home", "cup"}
    assert np.max([told["relevance"][name] for name in ("home", "cup")], axis=0).tolist() == [1.0] * 3


def test_relevance_is_drawn(facts: Facts, folder: Path):
    """One picture more."""
    pytest.importorskip("matplotlib")
    facts("learn", folder, "--states", "3", "--out", "r.skill")
    told = facts("show", "r.skill", "--relevance", folder, "--pictures", "drawn")
    assert any(path.endswith("relevance.png") for path in told["pictures"])


def test_relevance_that_cannot_be_told_is_refused(
    facts: Facts, refusal: Refusal, folder: Path, fetches: Path, fetched: tuple[Demonstration, ...]
):
    """Other recordings, or one frame alone."""
    facts("learn", folder, "--states", "2", "--out", "reach.skill")
    assert "name the folder that it was learned from" in refusal(
        "show", "reach.skill", "--relevance", fetches
    )
    write_folder([replace(demo, frames=demo.frames[:1]) for demo in fetched], fetches, overwrite=True)
    facts("learn", fetches, "--states", "2", "--out", "one.skill")
    assert "expected several" in refusal("show", "one.skill", "--relevance", fetches)
    assert (
        facts("learn", fetches, "--states", "2", "--out", "o.skill", "--drop-distractors")["frames_left_out"]
        == []
    )


@pytest.mark.parametrize(
    ("durations", "named"),
    [
        ("counted", "normal"),
        *(
            (law,) * 2
            for law in ("normal", "log-normal", "gamma", "poisson", "negative-binomial", "histogram")
        ),
    ],
)
def test_the_law_of_durations_is_named(facts: Facts, run: Runs, folder: Path, durations: str, named: str):
    """In the answer of learn and of show, for people and for programs."""
    learned = facts("learn", folder, "--states", "2", "--durations", durations, "--out", "d.skill")
    assert learned["durations"] == named
    assert facts("show", "d.skill")["durations"] == named
    assert f"semi-markov, {named} durations" in run("show", "d.skill").stdout


def test_models_without_durations_name_none(facts: Facts, folder: Path):
    """A Markov model has no law of its own."""
    assert facts("learn", folder, "--states", "2", "--dynamics", "markov", "--out", "m")["durations"] is None
