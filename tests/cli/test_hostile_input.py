"""Hostile input: files and options that request much memory or time, or contain unprintable text."""

import json
import os
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from pilotfish.cli.main import cli
from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import MAX_MESSAGE_LENGTH
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.io.skill_file import save_skill
from pilotfish.models import (
    Provenance,
    SemiMarkovChain,
    Skill,
)
from pilotfish.models.durations import Gamma, Gaussian

MAX_CPU_SECONDS = 8.0  # s of CPU time
HUGE = "0x1" + 5000 * "0"


@pytest.fixture
def skill(tmp_path: Path) -> Path:
    """Skill of two states in the frame of a cup."""
    return save_small_skill(tmp_path, Gaussian(np.array([5.0, 9.0]), np.array([1.0, 2.0])), 40)


def save_small_skill(folder: Path, durations: Any, datapoints: int) -> Path:
    place, speed = (
        Part("position", Quantity.POSITION, 3, "m"),
        Part("position", Quantity.POSITION, 3, "m/s", 1),
    )
    means = np.zeros((1, 2, 6))
    means[0, 1, :3] = 1.0
    skill = Skill(
        SemiMarkovChain(np.array([1.0, 0.0]), np.array([[0.0, 1.0], [0.0, 0.0]]), durations),
        means,
        (DenseCovariances(np.tile(0.01 * np.eye(6), (2, 1, 1))),),
        Layout((place, speed)),
        0.1,
        ("cup",),
        Provenance(("one",), datapoints, "", "full", -1.0, 1, True, "pilotfish"),
    )
    save_skill(skill, folder / "a.skill")
    return folder / "a.skill"


def run_command_line(*arguments: str | Path, stdin: bytes = b"") -> Result:
    """Run a command, and check that it takes little CPU time and raises nothing."""
    begin = process_time()
    result = CliRunner().invoke(cli, [str(argument) for argument in arguments], input=stdin)
    assert process_time() - begin < MAX_CPU_SECONDS
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def require_error(result: Result, code: int = 1) -> str:
    """Return the error message after checking that it is one bounded line."""
    assert result.exit_code == code, result.output
    line = result.stderr.rstrip("\n").split("\n")[-1]
    assert line.startswith("Error: ")
    assert line.isprintable()
    assert len(line) <= MAX_MESSAGE_LENGTH + 100  # with the option's name in front
    return line


FRAME = {"name": "cup", "position": [0, 0, 0], "quaternion": [1, 0, 0, 0]}


def test_frames_valid_file_is_accepted(skill: Path, tmp_path: Path) -> None:
    (tmp_path / "now.json").write_text(json.dumps([FRAME]))
    assert run_command_line("reproduce", skill, "--frames", tmp_path / "now.json").exit_code == 0


@pytest.mark.parametrize(
    "frames",
    [
        [{**FRAME, "position": [10**400, 0, 0]}],
        [{**FRAME, "quaternion": ["1", 0, 0, 0]}],
        [{**FRAME, "name": "\ud800"}],
        [{**FRAME, "name": "a\x1b[2J"}],
        [{**FRAME, "name": 10**400}],
        [10**400],
        [{f"k{n}": 0 for n in range(100_000)}],
        [FRAME] * 1001,
        ["\x1b" * 10**6],
    ],
    ids=range(9),
)
def test_frames_hostile_file_is_rejected(skill: Path, tmp_path: Path, frames: list[Any]) -> None:
    (tmp_path / "now.json").write_text(json.dumps(frames))
    assert "now.json" in require_error(
        run_command_line("reproduce", skill, "--frames", tmp_path / "now.json")
    )


@pytest.mark.parametrize("option", ["--frames", "--start"])
@pytest.mark.parametrize(
    "text",
    [
        f"frames = [{{name = 'cup', position = [{HUGE}, 0, 0], quaternion = [1, 0, 0, 0]}}]\nx = [{HUGE}]",
        f"frames = [{HUGE}]\nposition = {HUGE}",
        f"frames = [{{name = {HUGE}, A = {HUGE}, b = 1}}]",
    ],
    ids=range(3),
)
def test_toml_huge_integers_are_rejected(skill: Path, tmp_path: Path, option: str, text: str) -> None:
    (tmp_path / "now.toml").write_text(text)
    good = tmp_path / "good.json"
    good.write_text(json.dumps([FRAME]))
    more = [] if option == "--frames" else ["--frames", good]
    assert "now.toml" in require_error(
        run_command_line("reproduce", skill, option, tmp_path / "now.toml", *more)
    )


@pytest.mark.parametrize("kind", ["fifo", "zero", "long", "large"])
@pytest.mark.parametrize("option", ["--frames", "--start"])
def test_special_files_are_rejected_quickly(skill: Path, tmp_path: Path, option: str, kind: str) -> None:
    file = tmp_path / ("n" * 300 if kind == "long" else "file")
    if kind == "fifo":
        os.mkfifo(file)
    elif kind == "zero":
        file.symlink_to("/dev/zero")
    elif kind == "large":
        with file.open("wb") as sparse:
            sparse.truncate(2**40)
    good = tmp_path / "good.json"
    good.write_text(json.dumps([FRAME]))
    more = [] if option == "--frames" else ["--frames", good]
    require_error(run_command_line("reproduce", skill, option, file, *more))


@pytest.mark.parametrize(
    "arguments",
    [
        ("reproduce", "a.skill", "--via-point", "=" * 112_090),
        ("reproduce", "a.skill", "--via-point", "position=" + "1," * 50_000 + "1@4s+-.1"),
        ("reproduce", "a.skill", "--via-point", "position=1,1,\x1b[2J@4s+-.1"),
        ("reproduce", "a.skill", "--horizon", "1000000000"),
        ("reproduce", "a.skill", "--horizon", "9" * 100_000),
        ("reproduce", "a.skill", "--" + "x" * 100_000),
        ("x\x1b[2J" * 100_000,),
        ("learn", "folder", "--out", "o.skill", "--states", "1000000000"),
        ("learn", "folder", "--out", "o.skill", "--restarts", "1000000000"),
        ("learn", "folder", "--out", "o.skill", "--max-iterations", "10000000000"),
        ("learn", "folder", "--out", "o.skill", "--only", "x" * 100_000),
        ("learn", "folder", "--out", "o.skill", "--structure", "x" * 100_000),
        ("stream", "-", "--batch", "1000000000"),
        ("stream", "-", "--max-clusters", "1000000000"),
        ("stream", "-", "--extra-directions", "1000000000"),
        ("stream", "-", "--states", "1000000000"),
        ("perform", "a.skill", "carabiner", "--horizon", "1000000000"),
        ("record", "carabiner", "--demonstrations", "1000000000"),
    ],
    ids=range(18),
)
def test_options_out_of_bounds_are_usage_errors(arguments: tuple[str, ...]) -> None:
    require_error(run_command_line(*arguments), 2)


@pytest.mark.parametrize(
    "text", ["1:1000000", "3:99999", "x" * 100_000, ",".join(map(str, range(1, 20_000)))]
)
def test_select_state_counts_are_bounded(text: str) -> None:
    require_error(run_command_line("select", "folder", "--states", text))


LONG_ARGUMENTS = [
    Gaussian(np.array([1e5, 9.0]), np.array([1e5, 2.0])),
    Gaussian(np.array([1e6, 9.0]), np.array([1.0, 2.0])),
    Gamma(np.array([0.01, 1.0]), np.array([1e-6, 1.0])),
]


@pytest.mark.parametrize("durations", LONG_ARGUMENTS, ids=range(len(LONG_ARGUMENTS)))
def test_skill_with_long_durations_is_shown_and_reproduced_quickly(tmp_path: Path, durations: Any) -> None:
    file = save_small_skill(tmp_path, durations, 200)
    (tmp_path / "now.json").write_text(json.dumps([FRAME]))
    assert run_command_line("show", file).exit_code == 0
    assert run_command_line("reproduce", file, "--frames", tmp_path / "now.json").exit_code == 0


def test_skill_with_huge_mean_length_needs_horizon(tmp_path: Path) -> None:
    file = save_small_skill(tmp_path, LONG_ARGUMENTS[0], 10**15)
    (tmp_path / "now.json").write_text(json.dumps([FRAME]))
    assert "pass a horizon with --horizon" in require_error(
        run_command_line("reproduce", file, "--frames", tmp_path / "now.json")
    )
    assert (
        run_command_line("reproduce", file, "--frames", tmp_path / "now.json", "--horizon", "50").exit_code
        == 0
    )


@pytest.mark.parametrize(
    "line",
    [
        b",".join(b"name%d" % n for n in range(100_000)),
        b",".join([b"name"] * 100_000),
        b"a\x1b[2J,b",
        b"a\xff,\xed\xa0\x80",
        b"a," + b"n" * 201,
    ],
    ids=["many", "repeated", "control", "no text", "long"],
)
def test_stream_header_is_bounded(line: bytes) -> None:
    rows = line + b"\n" + b"1,2\n" * 3
    begin = process_time()
    result = CliRunner().invoke(
        cli, ["stream", "-", "--learner", "dp-gmm", "--cluster", "1", "--noise", "1"], input=rows
    )
    assert process_time() - begin < MAX_CPU_SECONDS
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert all(text.isprintable() for text in (result.stdout + result.stderr).split("\n"))
