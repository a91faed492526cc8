"""Common behaviour of all commands: help, JSON, errors, start-up and output files."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import click
import numpy as np
import pytest
from click.testing import Result

from pilotfish import models
from pilotfish.cli.output import terminal

SLOW_MODULES = {"scipy", "matplotlib", "safetensors", "pooch", "tqdm", "rich", "jinja2"}
RunCommand = Callable[..., Result]


def run_process(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the command line in a new process, as from a shell."""
    command = [sys.executable, "-W", "ignore", "-m", "pilotfish", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, env=environment())


def environment() -> dict[str, str]:
    top = Path(__file__).parents[2]
    return {**os.environ, "PYTHONPATH": str(top / "src")}


def test_module_process_exit_codes_and_streams(tmp_path: Path):
    output = run_process("--help", cwd=tmp_path)
    assert (output.returncode, output.stderr) == (0, "")
    assert "Learn manipulation skills" in output.stdout
    failed = run_process("show", "none.skill", cwd=tmp_path)
    assert (failed.returncode, failed.stdout) == (1, "")
    assert failed.stderr.splitlines() == [failed.stderr.strip()]
    assert "none.skill" in failed.stderr
    assert run_process("learn", cwd=tmp_path).returncode == 2


def test_cli_import_loads_no_slow_module(tmp_path: Path):
    program = "import sys, pilotfish.cli; print(*sys.modules)"
    command = [sys.executable, "-W", "ignore", "-c", program]
    result = subprocess.run(command, check=True, capture_output=True, text=True, env=environment())
    assert not set(result.stdout.split()) & SLOW_MODULES


def test_every_command_has_json_help_and_example(
    run_command_line: RunCommand, all_commands: dict[str, click.Command]
):
    assert len(all_commands) > 6
    for path, command in all_commands.items():
        assert "as_json" in {parameter.name for parameter in command.params}, path
        output = run_command_line(*path.split()[1:], "--help")
        assert output.exit_code == 0
        assert "Example:" in output.stdout
        assert f"\n    {path}" in output.stdout, path


def test_unexpected_exception_is_not_caught(
    run_command_line: RunCommand, folder: Path, monkeypatch: pytest.MonkeyPatch
):

    def broken(*_: object, **__: object) -> NoReturn:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(models, "learn", broken)
    with pytest.raises(ZeroDivisionError, match="a bug"):
        run_command_line("learn", folder, "--out", "skill")


def test_keyboard_interrupt_leaves_no_file(
    run_command_line: RunCommand, folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):

    def interrupted(*_: object, **__: object) -> NoReturn:
        raise KeyboardInterrupt

    monkeypatch.setattr(models, "learn", interrupted)
    before = sorted(tmp_path.iterdir())
    result = run_command_line("learn", folder, "--out", "skill")
    assert result.exit_code == 1
    assert "Aborted" in result.stderr
    assert sorted(tmp_path.iterdir()) == before


def outputs(skill: Path, folder: Path, frames: Path) -> dict[str, tuple[list[str | Path], str]]:
    reproduce = ["reproduce", skill, "--frames", frames, "--horizon", "5"]
    return {
        "learn": (["learn", folder, "--states", "2", "--out", "out"], "out"),
        "motion": ([*reproduce, "--out", "out.csv"], "out.csv"),
        "gains": ([*reproduce, "--gains", "out.npz"], "out.npz"),
        "plot": ([*reproduce, "--plot", "out.png"], "out.png"),
    }


@pytest.mark.parametrize("what", ["learn", "motion", "gains", "plot"])
def test_existing_output_is_replaced_only_with_force(
    run_command_line: RunCommand,
    run_failing: Callable[..., str],
    skill: Path,
    folder: Path,
    frames: Path,
    tmp_path: Path,
    what: str,
):
    command, name = outputs(skill, folder, frames)[what]
    (tmp_path / name).write_text("existing")
    assert f"{name} exists" in run_failing(*command)
    assert (tmp_path / name).read_text() == "existing"
    assert run_command_line(*command, "--force").exit_code == 0
    assert (tmp_path / name).read_bytes() != b"existing"


@pytest.mark.parametrize("what", ["learn", "motion", "gains", "plot"])
@pytest.mark.parametrize("place", ["missing/file.png", "folder.png"])
def test_unwritable_output_is_rejected_before_work(
    run_failing: Callable[..., str],
    skill: Path,
    folder: Path,
    frames: Path,
    tmp_path: Path,
    what: str,
    place: str,
):
    (tmp_path / "folder.png").mkdir()
    command, _ = outputs(skill, folder, frames)[what]
    assert place.split("/")[0] in run_failing(*command[:-1], place)


def test_learn_twice_writes_same_bytes(run_command_line: RunCommand, folder: Path, tmp_path: Path):
    for name in ("one", "two"):
        run_command_line(
            "learn", folder, "--states", "3", "--initialisation", "k-means", "--restarts", "2", "--out", name
        )
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_progress_bar_appears_only_on_terminal(
    run_command_line: RunCommand, folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    command = ["learn", folder, "--states", "2", "--force", "--out", "skill"]
    assert run_command_line(*command).stderr == ""
    monkeypatch.setattr(terminal, "is_interactive", lambda: True)
    result = run_command_line(*command)
    assert result.exit_code == 0
    assert "learning" in result.stderr
    assert "log-likelihood" in result.stderr


def test_json_output_has_no_nan_or_infinity(run_command_line: RunCommand, skill: Path):
    text = run_command_line("show", skill, "--json").stdout
    json.loads(text, parse_constant=lambda constant: pytest.fail(constant))
    assert text.count("\n") == 1


def test_show_transitions_sum_to_one(run_json: Callable[..., dict[str, Any]], skill: Path):
    for state in run_json("show", skill)["states"]:
        assert not state["transitions"] or np.isclose(sum(state["transitions"].values()), 1.0)
