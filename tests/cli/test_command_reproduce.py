"""pilotfish reproduce: horizon, start, output files and notes."""

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
from pilotfish.io.situations import read_frames
from pilotfish.io.skill_file import open_skill, save_skill
from pilotfish.models import EMSettings, adapt, learn

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]
PERIOD = 0.1


def save_learned_skill(path: Path, x: Sequence[np.ndarray], layout: Layout, states: int = 2) -> Path:
    """Learn a skill in the world frame from rows and save it."""
    demonstrations = [add_derivatives(demonstration(rows, PERIOD, layout)) for rows in x]
    settings = EMSettings(max_iterations=3)
    save_skill(
        learn(demonstrations, states=states, rng=np.random.default_rng(0), settings=settings).skill, path
    )
    return path


@pytest.fixture
def lines_skill(tmp_path: Path) -> Path:
    """Motion along one axis, which has no plane to plot."""
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
def test_reproduce_default_horizon_is_mean_length(
    run_json: RunJson, run_command_line: RunCommand, tmp_path: Path, lengths: tuple[int, ...]
):
    rng = np.random.default_rng(0)
    x = [np.linspace(0, 1, n)[:, None] + 0.01 * rng.normal(size=(n, 3)) for n in lengths]
    path = save_learned_skill(tmp_path / "skill", x, position_layout())
    steps = round(sum(lengths) / len(lengths))
    output = run_json("reproduce", path)
    assert (output["steps"], output["seconds"]) == (steps, pytest.approx(PERIOD * (steps - 1)))
    assert f"{steps}, {PERIOD * (steps - 1):g} s" in run_command_line("reproduce", path).stdout


def test_reproduce_any_horizon_reaches_final_state(
    run_json: RunJson, run_command_line: RunCommand, skill: Path, frames: Path
):
    reproduce = ["reproduce", skill, "--frames", frames]
    for horizon in ("4", "40"):
        output = run_json(*reproduce, "--horizon", horizon)
        assert output["final_state_reached"] is True
        assert not any("before the final state" in note for note in output["notes"])
        text = run_command_line(*reproduce, "--horizon", horizon).stdout
        notes = [line for line in text.splitlines() if line.startswith("note ")]
        assert any("the motion has 4 steps" in note for note in notes) is (horizon == "4")
        assert bool(notes) is (horizon == "4")


def test_reproduce_notes_name_options(run_json: RunJson, skill: Path, frames: Path, tmp_path: Path):
    """Frames in millimetres and a soft motion: each note has its remedy as an option."""
    soft = run_json("reproduce", skill, "--frames", frames, "--control-cost", "1e6")["notes"]
    assert any("was learned to" in note and "lower --control-cost or" in note for note in soft)
    content = json.loads(frames.read_text())
    for entry in content["frames"] if isinstance(content, dict) else content:
        entry["position"] = [1000.0 * value for value in entry["position"]]
    frames.write_text(json.dumps(content))
    notes = run_json("reproduce", skill, "--frames", frames)["notes"]
    assert any("frame 'cup' is" in note and "check --frames, and their unit" in note for note in notes)


def test_motion_file_quaternions_have_unit_norm(run_json: RunJson, skill: Path, frames: Path, tmp_path: Path):
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


def test_reproduce_distance_from_start_to_first_target(
    run_json: RunJson, run_command_line: RunCommand, skill: Path, frames: Path, tmp_path: Path
):
    reproduce = ["reproduce", skill, "--frames", frames]
    at_home = run_json(*reproduce, "--gains", "home.npz")["start_to_first_target"]
    begin = adapt(opened := open_skill(skill), read_frames(frames, opened)).endpoints.means[0, :3]
    with np.load(tmp_path / "home.npz") as controller:
        from_home = np.linalg.norm(controller["targets"][0, :3] - begin)
    assert at_home["position"] == pytest.approx(from_home)
    path = write_start(tmp_path, [0.0, -0.4, 0.5])
    moved = run_json(*reproduce, "--start", path, "--gains", "gains.npz")["start_to_first_target"]["position"]
    with np.load(tmp_path / "gains.npz") as controller:
        expected = np.linalg.norm(controller["targets"][0, :3] - [0.0, -0.4, 0.5])
    assert moved == pytest.approx(expected)
    assert f"start to first target  {moved:.4g} m" in run_command_line(*reproduce, "--start", path).stdout


@pytest.mark.parametrize(
    ("position", "turn", "far"),
    [
        ([0.1, -0.4, 0.3], [1, 0, 0, 0], []),
        ([0.1, -0.4, 0.3], [-1, 0, 0, 0], []),  # q and -q are one orientation
        ([0.0, -0.4, 9.0], [1, 0, 0, 0], ["position"]),
        ([0.1, -0.4, 0.3], [0, 0, 1, 0], ["orientation"]),
    ],
)
def test_reproduce_distant_start_has_note(
    run_json: RunJson,
    skill: Path,
    frames: Path,
    tmp_path: Path,
    position: list[float],
    turn: list[int],
    far: list,
):
    output = run_json(
        "reproduce", skill, "--frames", frames, "--start", write_start(tmp_path, position, turn)
    )
    notes = [note for note in output["notes"] if "extrapolation" in note]
    assert [part for part in ("position", "orientation") if any(part in note for note in notes)] == far


def test_failing_plot_leaves_no_other_file(run_failing: RunFailing, tmp_path: Path):
    pytest.importorskip("matplotlib")
    rng = np.random.default_rng(0)
    x = [np.linspace(0, 1, 90)[:, None] + 0.01 * rng.normal(size=(90, 2)) for _ in range(3)]
    path = save_learned_skill(tmp_path / "long.skill", x, position_layout(2), states=40)
    run_failing("reproduce", path, "--out", "x.csv", "--gains", "x.npz", "--plot", "x.png")
    assert [file.name for file in tmp_path.iterdir()] == ["long.skill"]


def test_plot_of_one_axis_is_over_time(run_json: RunJson, lines_skill: Path, tmp_path: Path):
    pytest.importorskip("matplotlib")
    run_json("reproduce", lines_skill, "--plot", "x.png")
    assert (tmp_path / "x.png").stat().st_size > 0


def test_show_too_many_states_gives_reason_per_plot(run_command_line: RunCommand, tmp_path: Path):
    pytest.importorskip("matplotlib")
    rng = np.random.default_rng(0)
    x = [np.linspace(0, 1, 90)[:, None] + 0.01 * rng.normal(size=(90, 2)) for _ in range(3)]
    path = save_learned_skill(tmp_path / "long.skill", x, position_layout(2), states=40)
    result = run_command_line("show", path, "--plots", "plots")
    failures = [line for line in result.stdout.splitlines() if line.startswith("not plotted: ")]
    plots = list((tmp_path / "plots").iterdir()) if (tmp_path / "plots").exists() else []
    assert len(failures) + len(plots) == 3
    assert failures
    assert all("32" in line and "40 states" in line for line in failures)
    assert (result.exit_code == 0) is bool(plots)
    assert (tmp_path / "plots").exists() is bool(plots)


def test_start_file_of_two_arms_uses_part_names(
    run_json: RunJson,
    run_failing: RunFailing,
    arms_skill: Path,
    tmp_path: Path,
    reach_demonstrations: tuple[Demonstration, ...],
):
    (tmp_path / "start.json").write_text(json.dumps({"position": [0, 0, 0]}))
    output = run_failing("reproduce", arms_skill, "--start", "start.json")
    assert "expected left hand, left turn, right hand, right turn" in output
    first, turn = reach_demonstrations[0].x[0, :3].tolist(), reach_demonstrations[0].x[0, 3:].tolist()
    arms = {"left hand": first, "left turn": turn, "right hand": first, "right turn": turn}
    (tmp_path / "start.json").write_text(json.dumps(arms))
    assert run_json("reproduce", arms_skill, "--start", "start.json")["notes"] == []


def test_plot_of_two_arms_has_note(run_json: RunJson, arms_skill: Path):
    pytest.importorskip("matplotlib")
    notes = run_json("reproduce", arms_skill, "--plot", "arms.png")["notes"]
    assert notes == ["the plot shows only left hand, not right hand"]


CONFLICTING_OUTPUTS = [
    "--out now.json",
    "--gains reach.skill",
    "--out a.csv --gains a.csv",
    "--out a.csv --gains ./a.csv",
]


@pytest.mark.parametrize(
    "files", [*CONFLICTING_OUTPUTS, "--gains a.png --plot a.png", "--out link.csv --gains a.csv"]
)
def test_same_file_twice_is_usage_error(
    run_command_line: RunCommand, skill: Path, frames: Path, tmp_path: Path, files: str
):
    (tmp_path / "link.csv").symlink_to("a.csv")
    before = {path: path.read_bytes() for path in (skill, frames)}
    result = run_command_line("reproduce", skill, "--frames", frames, "--force", *files.split())
    assert (result.exit_code, result.stdout) == (2, "")
    assert "choose another name" in result.stderr
    assert {path: path.read_bytes() for path in (skill, frames)} == before
    assert {path.name for path in tmp_path.iterdir()} == {"reach.skill", "now.json", "link.csv"}


def test_learn_never_replaces_demonstrations(run_command_line: RunCommand, folder: Path):
    before = {path: path.read_bytes() for path in folder.iterdir()}
    for path in before:
        assert run_command_line("learn", folder, "--out", path, "--force").exit_code == 2
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def read_motion(path: Path) -> np.ndarray:
    with path.open(encoding="utf-8", newline="") as file:
        return np.array(list(csv.reader(file))[1:], dtype=float)


def test_motion_period_interpolates_the_motion_that_is_written(
    run_json: RunJson, skill: Path, frames: Path, tmp_path: Path
):
    run_json("reproduce", skill, "--frames", frames, "--out", "own.csv")
    found = run_json("reproduce", skill, "--frames", frames, "--out", "fast.csv", "--motion-period", "0.004")
    own, fast = read_motion(tmp_path / "own.csv"), read_motion(tmp_path / "fast.csv")
    assert found["motion"] == {"rows": len(fast), "period": 0.004}
    np.testing.assert_allclose(fast[:, 0], 0.004 * np.arange(len(fast)), atol=1e-9)
    assert own[-1, 0] - 0.004 < fast[-1, 0] <= own[-1, 0] + 1e-9
    for column in range(1, 4):
        np.testing.assert_allclose(
            fast[:, column], np.interp(fast[:, 0], own[:, 0], own[:, column]), atol=1e-9
        )
    layout = open_skill(skill).layout
    for columns in layout.unit_quaternions:
        q = fast[:, 1 + columns.start : 1 + columns.stop]
        np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-9)
    rates = np.diff(fast[:, 1:4], axis=0) / 0.004
    start = 1 + layout.columns("position", 1).start
    np.testing.assert_allclose(fast[:-1, start : start + 3], rates, atol=1e-6)


def test_motion_period_without_file_or_beyond_the_motion_is_refused(
    run_command_line: RunCommand, run_failing: RunFailing, skill: Path, frames: Path, tmp_path: Path
):
    arguments = ("reproduce", skill, "--frames", frames, "--motion-period")
    assert "give --out FILE" in run_command_line(*arguments, "0.01").stderr
    assert "--motion-period: period is 99" in run_failing(*arguments, "99", "--out", "m.csv")
    assert not (tmp_path / "m.csv").exists()
