"""What replay promises about its length, its start, its files and what it leaves out."""

import csv
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    add_derivatives,
    demonstration,
    position_layout,
)
from pilotfish.io.skill_file import save_skill
from pilotfish.models import EMSettings, learn

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]
PERIOD = 0.1


def save_learned_skill(path: Path, x: Sequence[np.ndarray], layout: Layout, states: int = 2) -> Path:
    """A skill of the world's frame alone, from these rows."""
    shown = [add_derivatives(demonstration(rows, PERIOD, layout)) for rows in x]
    settings = EMSettings(max_iterations=3)
    save_skill(learn(shown, states=states, rng=np.random.default_rng(0), settings=settings).skill, path)
    return path


@pytest.fixture
def lines_skill(tmp_path: Path) -> Path:
    """A movement along one line: nothing to draw a plane of."""
    rng = np.random.default_rng(1)
    x = [np.linspace(0, 1, 20)[:, None] + 0.01 * rng.normal(size=(20, 1)) for _ in range(3)]
    return save_learned_skill(tmp_path / "line.skill", x, position_layout(1))


@pytest.fixture
def arms_skill(tmp_path: Path, reach_demonstrations: tuple[Demonstration, ...]) -> Path:
    """Two arms, each with a position and an orientation."""
    parts = [
        part
        for arm in ("left", "right")
        for part in (
            Part(f"{arm} hand", Quantity.POSITION, 3, "m"),
            Part(f"{arm} turn", Quantity.QUATERNION, 4, "1"),
        )
    ]
    x = [np.hstack([demo.x, demo.x]) for demo in reach_demonstrations]
    return save_learned_skill(tmp_path / "arms.skill", x, Layout(tuple(parts)))


@pytest.mark.parametrize("lengths", [(20, 20, 20), (20, 31, 40)])
def test_without_a_horizon_a_replay_is_as_long_as_the_demonstrations(
    run_json: RunJson, run_command_line: RunCommand, tmp_path: Path, lengths: tuple[int, ...]
):
    """The mean number of rows, rounded; the answer tells steps and seconds."""
    rng = np.random.default_rng(0)
    x = [np.linspace(0, 1, n)[:, None] + 0.01 * rng.normal(size=(n, 3)) for n in lengths]
    path = save_learned_skill(tmp_path / "skill", x, position_layout())
    steps = round(sum(lengths) / len(lengths))
    output = run_json("reproduce", path)
    assert (output["steps"], output["seconds"]) == (steps, pytest.approx(PERIOD * (steps - 1)))
    assert f"{steps}, {PERIOD * (steps - 1):g} s" in run_command_line("reproduce", path).stdout


def test_a_horizon_that_ends_too_early_is_remarked(
    run_json: RunJson, run_command_line: RunCommand, skill: Path, frames: Path
):
    """The last state has nothing after it; a motion that never comes there says so."""
    replay = ["reproduce", skill, "--frames", frames]
    for horizon, reached in (("4", False), ("40", True)):
        output = run_json(*replay, "--horizon", horizon)
        assert output["final_state_reached"] is reached
        assert any("before the final state" in note for note in output["notes"]) is not reached
        text = run_command_line(*replay, "--horizon", horizon).stdout
        assert any(line.startswith("note ") for line in text.splitlines()) is not reached


def test_orientations_in_the_file_have_unit_length(
    run_json: RunJson, skill: Path, frames: Path, tmp_path: Path
):
    """The motion of a linear system leaves the sphere; what is written lies on it again."""
    run_json("reproduce", skill, "--frames", frames, "--out", "motion.csv")
    with (tmp_path / "motion.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    first = header.index("orientation w [1]")
    x = np.array(rows, dtype=float)[:, first : first + 4]
    np.testing.assert_allclose(np.linalg.norm(x, axis=1), 1.0, rtol=1e-12)


def write_start(tmp_path: Path, position: Sequence[float], turn: Sequence[float] = (1, 0, 0, 0)) -> Path:
    path = tmp_path / "start.json"
    path.write_text(json.dumps({"position": list(position), "quaternion": list(turn)}))
    return path


def test_the_distance_from_the_start_to_the_first_target_is_told(
    run_json: RunJson, run_command_line: RunCommand, skill: Path, frames: Path, tmp_path: Path
):
    """In the unit of each part; where the skill begins there is none."""
    replay = ["reproduce", skill, "--frames", frames]
    at_home = run_json(*replay)["start_to_first_target"]
    assert at_home["position"] == pytest.approx(0.0, abs=1e-12)
    path = write_start(tmp_path, [0.0, -0.4, 0.5])
    moved = run_json(*replay, "--start", path, "--gains", "gains.npz")["start_to_first_target"]["position"]
    with np.load(tmp_path / "gains.npz") as controller:
        expected = np.linalg.norm(controller["targets"][0, :3] - [0.0, -0.4, 0.5])
    assert moved == pytest.approx(expected)
    assert f"start to first target  {moved:.4g} m" in run_command_line(*replay, "--start", path).stdout


@pytest.mark.parametrize(
    ("position", "turn", "far"),
    [
        ([0.1, -0.4, 0.3], [1, 0, 0, 0], []),
        ([0.1, -0.4, 0.3], [-1, 0, 0, 0], []),  # q and -q are one orientation
        ([0.0, -0.4, 9.0], [1, 0, 0, 0], ["position"]),
        ([0.1, -0.4, 0.3], [0, 0, 1, 0], ["orientation"]),
    ],
)
def test_a_start_far_from_every_state_is_remarked(
    run_json: RunJson,
    skill: Path,
    frames: Path,
    tmp_path: Path,
    position: list[float],
    turn: list[int],
    far: list,
):
    """Where nothing was shown the motion is extrapolation; the part that is far away is named."""
    output = run_json(
        "reproduce", skill, "--frames", frames, "--start", write_start(tmp_path, position, turn)
    )
    notes = [note for note in output["notes"] if "extrapolation" in note]
    assert [part for part in ("position", "orientation") if any(part in note for note in notes)] == far


def test_a_picture_that_cannot_be_drawn_leaves_no_other_file(run_failing: RunFailing, tmp_path: Path):
    """Pictures are made before anything is written."""
    pytest.importorskip("matplotlib")
    rng = np.random.default_rng(0)
    x = [np.linspace(0, 1, 90)[:, None] + 0.01 * rng.normal(size=(90, 2)) for _ in range(3)]
    path = save_learned_skill(tmp_path / "long.skill", x, position_layout(2), states=30)
    run_failing("reproduce", path, "--out", "x.csv", "--gains", "x.npz", "--plot", "x.png")
    assert [file.name for file in tmp_path.iterdir()] == ["long.skill"]


def test_a_motion_without_a_plane_is_drawn_over_time(run_json: RunJson, lines_skill: Path, tmp_path: Path):
    """A movement along one line, or of joints, has no path to look at from above."""
    pytest.importorskip("matplotlib")
    run_json("reproduce", lines_skill, "--plot", "x.png")
    assert (tmp_path / "x.png").stat().st_size > 0


def test_a_skill_of_too_many_states_is_not_drawn(run_command_line: RunCommand, tmp_path: Path):
    """Each picture is named with the reason; if none is left, that is exit code 1 and no folder."""
    pytest.importorskip("matplotlib")
    rng = np.random.default_rng(0)
    x = [np.linspace(0, 1, 90)[:, None] + 0.01 * rng.normal(size=(90, 2)) for _ in range(3)]
    path = save_learned_skill(tmp_path / "long.skill", x, position_layout(2), states=30)
    result = run_command_line("show", path, "--plots", "drawn")
    left_out = [line for line in result.stdout.splitlines() if line.startswith("not drawn: ")]
    drawn = list((tmp_path / "drawn").iterdir()) if (tmp_path / "drawn").exists() else []
    assert len(left_out) + len(drawn) == 3
    assert left_out
    assert all("24" in line and "30 states" in line for line in left_out)
    assert (result.exit_code == 0) is bool(drawn)
    assert (tmp_path / "drawn").exists() is bool(drawn)


def test_two_arms_start_by_their_own_names(
    run_json: RunJson,
    run_failing: RunFailing,
    arms_skill: Path,
    tmp_path: Path,
    reach_demonstrations: tuple[Demonstration, ...],
):
    """Of two positions neither is `position`."""
    (tmp_path / "start.json").write_text(json.dumps({"position": [0, 0, 0]}))
    output = run_failing("reproduce", arms_skill, "--start", "start.json")
    assert "expected left hand, left turn, right hand, right turn" in output
    first, turn = reach_demonstrations[0].x[0, :3].tolist(), reach_demonstrations[0].x[0, 3:].tolist()
    arms = {"left hand": first, "left turn": turn, "right hand": first, "right turn": turn}
    (tmp_path / "start.json").write_text(json.dumps(arms))
    assert run_json("reproduce", arms_skill, "--start", "start.json")["notes"] == []


def test_a_picture_of_one_of_two_arms_says_so(run_json: RunJson, arms_skill: Path):
    """What is left out is named."""
    pytest.importorskip("matplotlib")
    notes = run_json("reproduce", arms_skill, "--plot", "arms.png")["notes"]
    assert notes == ["the picture shows left hand alone, not right hand"]


CONFLICTING_OUTPUTS = [
    "--out now.json",
    "--gains reach.skill",
    "--out a.csv --gains a.csv",
    "--out a.csv --gains ./a.csv",
]


@pytest.mark.parametrize(
    "files", [*CONFLICTING_OUTPUTS, "--gains a.png --plot a.png", "--out link.csv --gains a.csv"]
)
def test_a_file_is_not_two_things(
    run_command_line: RunCommand, skill: Path, frames: Path, tmp_path: Path, files: str
):
    """Neither two outputs nor an input and an output, by whatever path: misuse, and nothing is written."""
    (tmp_path / "link.csv").symlink_to("a.csv")
    before = {path: path.read_bytes() for path in (skill, frames)}
    result = run_command_line("reproduce", skill, "--frames", frames, "--force", *files.split())
    assert (result.exit_code, result.stdout) == (2, "")
    assert "choose another name" in result.stderr
    assert {path: path.read_bytes() for path in (skill, frames)} == before
    assert {path.name for path in tmp_path.iterdir()} == {"reach.skill", "now.json", "link.csv"}


def test_a_skill_does_not_replace_what_it_is_learned_from(run_command_line: RunCommand, folder: Path):
    """--force is no leave to write over a recording."""
    before = {path: path.read_bytes() for path in folder.iterdir()}
    for path in before:
        assert run_command_line("learn", folder, "--out", path, "--force").exit_code == 2
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
