"""Invalid input of each command: one line with value, place and fix; nothing is written."""

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

RunFailing = Callable[..., str]
RunCommand = Callable[..., Result]


def corrupt_cell(folder: Path, line: int, column: int, value: str) -> Path:
    """Replace one cell of the first demonstration of a folder, as if edited by hand."""
    manifest = json.loads((folder / "demonstrations.json").read_text())
    table = folder / manifest["demonstration"][0]["file"]
    rows = [row.split(",") for row in table.read_text().splitlines()]
    rows[line][column] = value
    table.write_text("\n".join(map(",".join, rows)))
    del manifest["sha256"], manifest["demonstration"][0]["sha256"]
    (folder / "demonstrations.json").write_text(json.dumps(manifest))
    return folder


@pytest.mark.parametrize("command", [["data", "check"], ["learn", "--out", "out"]])
@pytest.mark.parametrize(("name", "words"), [("none", "not a folder"), ("empty", "demonstrations.toml")])
def test_folder_without_demonstrations_is_named(
    run_failing: RunFailing, tmp_path: Path, command: list[str], name: str, words: str
):
    (tmp_path / "empty").mkdir()
    output = run_failing(*command, name)
    assert name in output
    assert words in output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", [["data", "check"], ["learn", "--out", "out"]])
@pytest.mark.parametrize("value", ["nan", "2,0", "high"])
def test_cell_not_a_number_names_file_and_line(
    run_failing: RunFailing, folder: Path, command: list[str], value: str
):
    output = run_failing(*command, corrupt_cell(folder, line=5, column=1, value=value))
    assert re.search(r"1-reach-0\.csv, line 6(, column 'position y')?", output)


@pytest.mark.parametrize("only", ["7", "0-9", "0,0"])
def test_only_out_of_range_is_rejected(run_failing: RunFailing, folder: Path, tmp_path: Path, only: str):
    assert only in run_failing("learn", folder, f"--only={only}", "--out", "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("only", ["3-1", "a", "1-2-3", "-1", ",", "٣", "99999999"])
def test_only_wrong_syntax_is_usage_error(
    run_command_line: RunCommand, folder: Path, tmp_path: Path, only: str
):
    result = run_command_line("learn", folder, f"--only={only}", "--out", "out")
    assert (result.exit_code, result.stdout) == (2, "")
    assert only in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("start", ["time-bins", "k-means"])
def test_learn_more_states_than_datapoints_is_rejected(run_failing: RunFailing, folder: Path, start: str):
    assert "500" in run_failing("learn", folder, "--states", "500", "--initialisation", start, "--out", "out")


def test_learn_different_frames_names_demonstration(run_failing: RunFailing, folder: Path):
    manifest = json.loads((folder / "demonstrations.json").read_text())
    manifest["demonstration"][1]["frames"][1]["name"] = "mug"
    del manifest["sha256"]
    (folder / "demonstrations.json").write_text(json.dumps(manifest))
    output = run_failing("learn", folder, "--out", "out")
    assert "demonstration 1" in output
    assert "mug" in output


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--structure full:3", "expected full"),
        ("--dynamics markov --durations gamma", "needs --dynamics semi-markov"),
        ("--censoring both", "needs --durations"),
        ("--structure ful", "did you mean 'full'"),
        ("--structure mfa", "expected mfa:FACTORS"),
        ("--structure semi-tied:1.5", "tying is 1.5"),
        ("--structure semi-tied:nan", "nan"),
        ("--regularisation -1", "-1.0 is not in the range"),
        ("--regularisation nan", "nan"),
        ("--regularisation inf", "inf"),
    ],
)
def test_learn_invalid_options_are_usage_errors(
    run_command_line: RunCommand, folder: Path, options: str, words: str
):
    result = run_command_line("learn", folder, *options.split(), "--out", "out")
    assert (result.exit_code, result.stdout) == (2, "")
    assert words in result.stderr.splitlines()[-1]


def test_learn_singular_covariance_suggests_regularisation(
    run_failing: RunFailing, tmp_path: Path, folder: Path
):
    output = run_failing("learn", folder, "--regularisation", "0", "--states", "12", "--out", "out")
    assert "regularisation" in output


def test_usage_error_has_exit_code_2(run_command_line: RunCommand, folder: Path):
    for options in (
        [],
        ["--out", "o", "--states", "0"],
        ["--out", "o", "--initialisation", "dice"],
        ["--nonsense"],
    ):
        result = run_command_line("learn", folder, *options)
        assert (result.exit_code, result.stdout) == (2, "")
        assert "Usage: pilotfish learn" in result.stderr


@pytest.mark.parametrize("command", ["show", "reproduce"])
@pytest.mark.parametrize("fault", ["none", "folder", "truncated", "text", "newer"])
def test_invalid_skill_file_is_named_with_reason(
    run_failing: RunFailing, skill: Path, command: str, fault: str
):
    data = skill.read_bytes()
    words = {
        "none": "No such file",
        "folder": "not a regular file",
        "truncated": "not a complete safetensors file",
        "text": "not a complete safetensors file",
        "newer": "newer version (format 9",
    }[fault]
    if fault in ("none", "folder"):
        skill.unlink()
    if fault == "folder":
        skill.mkdir()
    if fault == "truncated":
        skill.write_bytes(data[:-100])
    if fault == "text":
        skill.write_text("not a skill\n")
    if fault == "newer":
        skill.write_bytes(re.sub(rb"(version[^:]*:)[0-9]+", rb"\g<1>9", data, count=1))
    output = run_failing(command, skill)
    assert "reach.skill" in output
    assert words in output


def test_unknown_data_set_suggests_nearest(run_failing: RunFailing):
    for command in (
        ["data", "info", "vlave"],
        ["data", "export", "vlave", "out"],
        ["learn", "dataset:vlave", "--out", "out"],
    ):
        output = run_failing(*command)
        assert "did you mean 'valve'" in output
        assert "synthetic valve" in output


@pytest.mark.parametrize("name", ["synthetic valv", "synthetic"])
def test_unknown_data_set_suggests_synthetic_valve(run_failing: RunFailing, name: str):
    assert "did you mean 'synthetic valve'" in run_failing("data", "info", name)


def test_export_replaces_only_demonstrations_with_force(run_failing: RunFailing, tmp_path: Path):
    (tmp_path / "existing").mkdir()
    (tmp_path / "existing" / "letter.txt").write_text("existing")
    assert "existing exists" in run_failing("data", "export", "synthetic valve", "existing")
    output = run_failing("data", "export", "synthetic valve", "existing", "--force")
    assert "existing is not a folder of demonstrations and is not replaced" in output
    assert (tmp_path / "existing" / "letter.txt").read_text() == "existing"


CUP = {"name": "cup", "position": [0.5, 0.2, 0.1], "quaternion": [1, 0, 0, 0]}
HOME = {"name": "home", "position": [0, 0, 0], "quaternion": [1, 0, 0, 0]}
WRONG_FRAMES: dict[str, tuple[Any, str]] = {
    "a frame too few": ([CUP], "frames are ['cup'], expected each of"),
    "a wrong name": ([CUP, {**HOME, "name": "hoem"}], "hoem"),
    "a frame twice": ([CUP, CUP], "frames are ['cup', 'cup'], expected each of"),
    "no list": (3, "list of frames"),
    "an empty list": ([], "list of frames"),
    "no quaternion": (
        [{"name": "cup", "position": [0, 0, 0]}],
        "is missing; expected name with position",
    ),
    "a long quaternion": ([{**CUP, "quaternion": [2, 0, 0, 0]}], "norm 2"),
    "two coordinates": ([{**CUP, "position": [0, 0]}], "frame 0"),
    "an infinite place": ([{**CUP, "position": [0, 0, 1e999]}], "finite"),
    "an endless number": ([{**CUP, "position": [0, 0, 10**400]}], "frame 0"),
    "text": ([{**CUP, "position": "text"}], "'text'"),
    "a number for a name": ([{**CUP, "name": 3}], "name of a frame is 3"),
    "a singular matrix": ([HOME, {"name": "cup", "A": [[0.0] * 7] * 7, "b": [0.0] * 7}], "singular"),
    "a narrow matrix": ([HOME, {"name": "cup", "A": [[1, 0], [0, 1]], "b": [0, 0]}], "2 columns"),
}


@pytest.mark.parametrize("what", WRONG_FRAMES)
def test_reproduce_invalid_frames_are_rejected(
    run_failing: RunFailing, skill: Path, tmp_path: Path, what: str
):
    content, words = WRONG_FRAMES[what]
    (tmp_path / "frames.json").write_text(json.dumps(content))
    assert words in run_failing("reproduce", skill, "--frames", "frames.json", "--out", "out.csv")
    assert not (tmp_path / "out.csv").exists()


def test_reproduce_without_frames_names_option(run_failing: RunFailing, skill: Path):
    output = run_failing("reproduce", skill)
    assert "['home', 'cup']" in output
    assert "--frames" in output


WRONG_STARTS: dict[str, tuple[str, str]] = {
    "half a state": ('{"x": [0, 0, 0, 1, 0, 0, 0]}', "expected (14,)"),
    "no state": ('{"x": 3}', "expected (14,)"),
    "a place alone": ('{"position": [0, 0, 0]}', "expected position, quaternion"),
    "a flat place": ('{"position": [0, 0], "quaternion": [1, 0, 0, 0]}', "expected (3,)"),
    "no turn": ('{"position": [0, 0, 0], "quaternion": [0, 0, 0, 0]}', "norm 0"),
    "not finite": ('{"position": [0, 0, NaN], "quaternion": [1, 0, 0, 0]}', "finite"),
    "a list": ("[1, 2]", "expected a table"),
    "broken": ("{", "is not JSON that can be read"),
}


@pytest.mark.parametrize("what", WRONG_STARTS)
def test_reproduce_invalid_start_is_rejected(
    run_failing: RunFailing, skill: Path, frames: Path, tmp_path: Path, what: str
):
    content, words = WRONG_STARTS[what]
    (tmp_path / "start.json").write_text(content)
    output = run_failing("reproduce", skill, "--frames", frames, "--start", "start.json")
    assert "start.json" in output
    assert words in output


@pytest.mark.parametrize("file", ["frames", "start"])
def test_reproduce_missing_situation_file_is_named(
    run_failing: RunFailing, skill: Path, frames: Path, file: str
):
    assert "none.toml cannot be read" in run_failing(
        "reproduce", skill, "--frames", frames, f"--{file}", "none.toml"
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--control-cost 0", "0.0 is not in the range"),
        ("--control-cost -1", "-1.0 is not in the range"),
        ("--control-cost nan", "nan"),
        ("--control-cost inf", "inf"),
        ("--covariance-regularisation -1", "-1.0 is not in the range"),
        ("--horizon 0", "0 is not in the range"),
        ("--plot motion.bmp", "'.bmp'"),
    ],
)
def test_reproduce_invalid_options_are_usage_errors(
    run_command_line: RunCommand, skill: Path, frames: Path, options: str, words: str
):
    result = run_command_line("reproduce", skill, "--frames", frames, *options.split())
    assert (result.exit_code, result.stdout) == (2, "")
    assert words in result.stderr.splitlines()[-1]


def test_reproduce_without_velocities_suggests_option(
    run_command_line: RunCommand, run_failing: RunFailing, folder: Path, frames: Path
):
    run_command_line("learn", folder, "--no-velocities", "--states", "2", "--out", "still.skill")
    assert "--velocities" in run_failing("reproduce", "still.skill", "--frames", frames)


def test_reproduce_mixture_is_rejected(
    run_command_line: RunCommand, run_failing: RunFailing, folder: Path, frames: Path
):
    run_command_line("learn", folder, "--dynamics", "mixture", "--states", "2", "--out", "mixture.skill")
    assert "mixture" in run_failing("reproduce", "mixture.skill", "--frames", frames)


def test_plots_without_matplotlib_name_the_extra(
    run_failing: RunFailing, skill: Path, frames: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for command in (
        ["show", skill, "--plots", "plots"],
        ["reproduce", skill, "--frames", frames, "--plot", "motion.png"],
    ):
        assert "'.[plots]'" in run_failing(*command)


def test_show_existing_plot_is_kept(
    run_command_line: RunCommand, run_failing: RunFailing, skill: Path, tmp_path: Path
):
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / "states.png").write_text("existing")
    assert "states.png exists" in run_failing("show", skill, "--plots", "plots")
    assert [file.name for file in (tmp_path / "plots").iterdir()] == ["states.png"]
