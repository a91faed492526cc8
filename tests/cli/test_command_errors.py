"""Bad input, command by command: one line that names the value, the place and the fix; nothing is written."""

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
    """The folder with one cell of its first recording replaced, as someone would by hand."""
    manifest = json.loads((folder / "demonstrations.json").read_text())
    table = folder / manifest["demonstration"][0]["file"]
    rows = [row.split(",") for row in table.read_text().splitlines()]
    rows[line][column] = value
    table.write_text("\n".join(map(",".join, rows)))
    del manifest["sha256"], manifest["demonstration"][0]["sha256"]
    (folder / "demonstrations.json").write_text(json.dumps(manifest))
    return folder


@pytest.mark.parametrize("command", [["data", "check"], ["learn", "--out", "out"]])
@pytest.mark.parametrize(("name", "words"), [("none", "no folder"), ("empty", "demonstrations.toml")])
def test_a_folder_without_recordings(
    run_failing: RunFailing, tmp_path: Path, command: list[str], name: str, words: str
):
    """Missing or empty: named, with what was expected in it."""
    (tmp_path / "empty").mkdir()
    output = run_failing(*command, name)
    assert name in output
    assert words in output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", [["data", "check"], ["learn", "--out", "out"]])
@pytest.mark.parametrize("value", ["nan", "2,0", "high"])
def test_a_cell_that_is_no_number(run_failing: RunFailing, folder: Path, command: list[str], value: str):
    """File, line and column are named, in every command that reads it."""
    output = run_failing(*command, corrupt_cell(folder, line=5, column=1, value=value))
    assert re.search(r"1-reach-0\.csv, line 6(, column 'position y')?", output)


@pytest.mark.parametrize("only", ["7", "0-9", "0,0"])
def test_demonstrations_that_are_not_there(run_failing: RunFailing, folder: Path, tmp_path: Path, only: str):
    """--only is quoted back."""
    assert only in run_failing("learn", folder, f"--only={only}", "--out", "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("only", ["3-1", "a", "1-2-3", "-1", ",", "٣", "99999999"])
def test_no_list_of_demonstrations(run_command_line: RunCommand, folder: Path, tmp_path: Path, only: str):
    """Misuse, whatever lies in the folder."""
    result = run_command_line("learn", folder, f"--only={only}", "--out", "out")
    assert (result.exit_code, result.stdout) == (2, "")
    assert only in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("start", ["time-bins", "k-means"])
def test_more_states_than_data(run_failing: RunFailing, folder: Path, start: str):
    """Told with both numbers."""
    assert "500" in run_failing("learn", folder, "--states", "500", "--initialisation", start, "--out", "out")


def test_frames_that_differ_between_demonstrations(run_failing: RunFailing, folder: Path):
    """Which demonstration, and both lists of names."""
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
        ("--dynamics markov --durations gamma", "goes with --dynamics semi-markov"),
        ("--censoring both", "goes with --durations"),
        ("--structure ful", "did you mean 'full'"),
        ("--structure mfa", "expected mfa:FACTORS"),
        ("--structure semi-tied:1.5", "tying is 1.5"),
        ("--structure semi-tied:nan", "nan"),
        ("--regularisation -1", "-1.0 is not in the range"),
        ("--regularisation nan", "nan"),
        ("--regularisation inf", "inf"),
    ],
)
def test_options_that_do_not_fit(run_command_line: RunCommand, folder: Path, options: str, words: str):
    """Misuse; the value is quoted back."""
    result = run_command_line("learn", folder, *options.split(), "--out", "out")
    assert (result.exit_code, result.stdout) == (2, "")
    assert words in result.stderr.splitlines()[-1]


def test_a_covariance_that_collapses(run_failing: RunFailing, tmp_path: Path, folder: Path):
    """Without regularisation a constant column has no variance: the fix is named."""
    output = run_failing("learn", folder, "--regularisation", "0", "--states", "12", "--out", "out")
    assert "regularisation" in output


def test_misuse_has_exit_code_two(run_command_line: RunCommand, folder: Path):
    """A missing or unknown option, an impossible choice: click's words, not ours."""
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
def test_a_file_that_is_no_skill(run_failing: RunFailing, skill: Path, command: str, fault: str):
    """Each command that opens a skill names the file and what is wrong with it."""
    data = skill.read_bytes()
    words = {
        "none": "No such file",
        "folder": "not a regular file",
        "truncated": "no safetensors file",
        "text": "no safetensors file",
        "newer": "newer pilotfish (format 2",
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
        skill.write_bytes(data.replace(b'\\"version\\":1', b'\\"version\\":2'))
    output = run_failing(command, skill)
    assert "reach.skill" in output
    assert words in output


def test_names_of_data_sets_that_are_none(run_failing: RunFailing):
    """With the nearest that there is."""
    for command in (
        ["data", "info", "vlave"],
        ["data", "export", "vlave", "out"],
        ["learn", "dataset:vlave", "--out", "out"],
    ):
        output = run_failing(*command)
        assert "did you mean 'valve'" in output
        assert "synthetic valve" in output


@pytest.mark.parametrize("name", ["synthetic valv", "synthetic"])
def test_the_generated_data_set_is_a_near_name_too(run_failing: RunFailing, name: str):
    """It is learned from by name like the others."""
    assert "did you mean 'synthetic valve'" in run_failing("data", "info", name)


def test_an_export_never_replaces_what_is_no_recording(run_failing: RunFailing, tmp_path: Path):
    """Without --force nothing, with it only a folder of demonstrations."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    assert "mine exists" in run_failing("data", "export", "synthetic valve", "mine")
    output = run_failing("data", "export", "synthetic valve", "mine", "--force")
    assert "mine is not a folder of demonstrations and is not replaced" in output
    assert (tmp_path / "mine" / "letter.txt").read_text() == "dear"


CUP = {"name": "cup", "position": [0.5, 0.2, 0.1], "quaternion": [1, 0, 0, 0]}
HOME = {"name": "home", "position": [0, 0, 0], "quaternion": [1, 0, 0, 0]}
WRONG_FRAMES: dict[str, tuple[Any, str]] = {
    "a frame too few": ([CUP], "['cup'] were given"),
    "a wrong name": ([CUP, {**HOME, "name": "hoem"}], "hoem"),
    "a frame twice": ([CUP, CUP], "give each of these once"),
    "no list": (3, "list of frames"),
    "an empty list": ([], "list of frames"),
    "no quaternion": ([{"name": "cup", "position": [0, 0, 0]}], "expected name, position, quaternion"),
    "a long quaternion": ([{**CUP, "quaternion": [2, 0, 0, 0]}], "norm 2"),
    "two coordinates": ([{**CUP, "position": [0, 0]}], "frame 0"),
    "an infinite place": ([{**CUP, "position": [0, 0, 1e999]}], "finite"),
    "an endless number": ([{**CUP, "position": [0, 0, 10**400]}], "frame 0"),
    "text": ([{**CUP, "position": "here"}], "'here'"),
    "a number for a name": ([{**CUP, "name": 3}], "name of a frame is 3"),
    "a singular matrix": ([HOME, {"name": "cup", "A": [[0.0] * 7] * 7, "b": [0.0] * 7}], "singular"),
    "a narrow matrix": ([HOME, {"name": "cup", "A": [[1, 0], [0, 1]], "b": [0, 0]}], "2 columns"),
}


@pytest.mark.parametrize("what", WRONG_FRAMES)
def test_frames_that_cannot_be_used(run_failing: RunFailing, skill: Path, tmp_path: Path, what: str):
    """The file or the frame is named, with what was expected."""
    content, words = WRONG_FRAMES[what]
    (tmp_path / "frames.json").write_text(json.dumps(content))
    assert words in run_failing("reproduce", skill, "--frames", "frames.json", "--out", "out.csv")
    assert not (tmp_path / "out.csv").exists()


def test_no_frames_at_all(run_failing: RunFailing, skill: Path):
    """The skill's frames are named, and the option."""
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
    "a list": ("[1, 2]", "no table"),
    "broken": ("{", "no JSON that can be read"),
}


@pytest.mark.parametrize("what", WRONG_STARTS)
def test_starts_that_cannot_be_used(
    run_failing: RunFailing, skill: Path, frames: Path, tmp_path: Path, what: str
):
    """The file is named, with what was expected."""
    content, words = WRONG_STARTS[what]
    (tmp_path / "start.json").write_text(content)
    output = run_failing("reproduce", skill, "--frames", frames, "--start", "start.json")
    assert "start.json" in output
    assert words in output


@pytest.mark.parametrize("file", ["frames", "start"])
def test_files_of_a_situation_that_are_not_there(
    run_failing: RunFailing, skill: Path, frames: Path, file: str
):
    """Named, with what kind of file was expected."""
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
def test_replays_that_cannot_be(
    run_command_line: RunCommand, skill: Path, frames: Path, options: str, words: str
):
    """Misuse; the value is quoted back."""
    result = run_command_line("reproduce", skill, "--frames", frames, *options.split())
    assert (result.exit_code, result.stdout) == (2, "")
    assert words in result.stderr.splitlines()[-1]


def test_a_skill_without_speeds_cannot_be_replayed(
    run_command_line: RunCommand, run_failing: RunFailing, folder: Path, frames: Path
):
    """The fix is named: learn it with speeds."""
    run_command_line("learn", folder, "--no-velocities", "--states", "2", "--out", "still.skill")
    assert "--velocities" in run_failing("reproduce", "still.skill", "--frames", frames)


def test_a_mixture_cannot_be_replayed(
    run_command_line: RunCommand, run_failing: RunFailing, folder: Path, frames: Path
):
    """It has no order in time."""
    run_command_line("learn", folder, "--dynamics", "mixture", "--states", "2", "--out", "mixture.skill")
    assert "mixture" in run_failing("reproduce", "mixture.skill", "--frames", frames)


def test_pictures_without_matplotlib(
    run_failing: RunFailing, skill: Path, frames: Path, monkeypatch: pytest.MonkeyPatch
):
    """The extra that brings it is named, before any work."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for command in (
        ["show", skill, "--plots", "here"],
        ["reproduce", skill, "--frames", frames, "--plot", "motion.png"],
    ):
        assert "pilotfish[plots]" in run_failing(*command)


def test_pictures_that_are_there_are_not_replaced(
    run_command_line: RunCommand, run_failing: RunFailing, skill: Path, tmp_path: Path
):
    """None is drawn when one would be lost."""
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "states.png").write_text("mine")
    assert "states.png exists" in run_failing("show", skill, "--plots", "here")
    assert [file.name for file in (tmp_path / "here").iterdir()] == ["states.png"]
