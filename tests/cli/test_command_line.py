"""What every command has in common: help, one JSON object, refusals in one line, quick help, whole files."""

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

from pilotfish.cli.commands import learn as commands_learn

RunCommand = Callable[..., Result]


def run_process(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """A real one, as from a shell."""
    command = [sys.executable, "-W", "ignore", "-m", "pilotfish", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, env=environment())


def environment() -> dict[str, str]:
    top = Path(__file__).parents[2]
    return {**os.environ, "PYTHONPATH": str(top / "src")}


def test_help_and_a_refusal_in_a_real_process(tmp_path: Path):
    """`python -m pilotfish`: help on stdout; a refusal is one line on stderr and exit code 1; misuse is 2."""
    output = run_process("--help", cwd=tmp_path)
    assert (output.returncode, output.stderr) == (0, "")
    assert "Learn manipulation skills" in output.stdout
    refused = run_process("show", "none.skill", cwd=tmp_path)
    assert (refused.returncode, refused.stdout) == (1, "")
    assert refused.stderr.splitlines() == [refused.stderr.strip()]
    assert "none.skill" in refused.stderr
    assert run_process("learn", cwd=tmp_path).returncode == 2


def test_help_imports_nothing_slow(tmp_path: Path):
    """A person who types --help does not wait for SciPy, matplotlib or safetensors."""
    program = "import sys, pilotfish.cli; print(*sys.modules)"
    command = [sys.executable, "-W", "ignore", "-c", program]
    result = subprocess.run(command, check=True, capture_output=True, text=True, env=environment())
    assert not set(result.stdout.split()) & {"scipy", "matplotlib", "safetensors", "pooch", "tqdm"}


def test_every_command_answers_programs_and_helps_people(
    run_command_line: RunCommand, all_commands: dict[str, click.Command]
):
    """--json everywhere; help with a first sentence and an example that begins with the command itself."""
    assert len(all_commands) > 6
    for path, command in all_commands.items():
        assert "as_json" in {parameter.name for parameter in command.params}, path
        output = run_command_line(*path.split()[1:], "--help")
        assert output.exit_code == 0
        assert "Example:" in output.stdout
        assert f"\n    {path}" in output.stdout, path


def test_a_bug_keeps_its_traceback(
    run_command_line: RunCommand, folder: Path, monkeypatch: pytest.MonkeyPatch
):
    """Only refusals of ours become one line; anything else must be seen whole."""

    def broken(*_: object, **__: object) -> NoReturn:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(commands_learn, "semi_markov_learner", lambda *_: broken)
    with pytest.raises(ZeroDivisionError, match="a bug"):
        run_command_line("learn", folder, "--out", "skill")


def test_an_interrupt_leaves_no_file(
    run_command_line: RunCommand, folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    """Ctrl-C while learning: a word on stderr, exit code 1, nothing written."""

    def interrupted(*_: object, **__: object) -> NoReturn:
        raise KeyboardInterrupt

    monkeypatch.setattr(commands_learn, "semi_markov_learner", lambda *_: interrupted)
    before = sorted(tmp_path.iterdir())
    result = run_command_line("learn", folder, "--out", "skill")
    assert result.exit_code == 1
    assert "Aborted" in result.stderr
    assert sorted(tmp_path.iterdir()) == before


def outputs(skill: Path, folder: Path, frames: Path) -> dict[str, tuple[list[str | Path], str]]:
    replay = ["reproduce", skill, "--frames", frames, "--horizon", "5"]
    return {
        "learn": (["learn", folder, "--states", "2", "--out", "out"], "out"),
        "motion": ([*replay, "--out", "out.csv"], "out.csv"),
        "gains": ([*replay, "--gains", "out.npz"], "out.npz"),
        "picture": ([*replay, "--plot", "out.png"], "out.png"),
    }


@pytest.mark.parametrize("what", ["learn", "motion", "gains", "picture"])
def test_outputs_are_replaced_only_by_force(
    run_command_line: RunCommand,
    run_failing: Callable[..., str],
    skill: Path,
    folder: Path,
    frames: Path,
    tmp_path: Path,
    what: str,
):
    """A file that is there stays as it is, unless --force; and it is refused before the work begins."""
    command, name = outputs(skill, folder, frames)[what]
    (tmp_path / name).write_text("mine")
    assert f"{name} exists" in run_failing(*command)
    assert (tmp_path / name).read_text() == "mine"
    assert run_command_line(*command, "--force").exit_code == 0
    assert (tmp_path / name).read_bytes() != b"mine"


@pytest.mark.parametrize("what", ["learn", "motion", "gains", "picture"])
@pytest.mark.parametrize("place", ["missing/file.png", "here.png"])
def test_outputs_that_cannot_be_written_are_refused_at_once(
    run_failing: Callable[..., str],
    skill: Path,
    folder: Path,
    frames: Path,
    tmp_path: Path,
    what: str,
    place: str,
):
    """No folder, or a folder where a file should be: named, with what to do."""
    (tmp_path / "here.png").mkdir()
    command, _ = outputs(skill, folder, frames)[what]
    assert place.split("/")[0] in run_failing(*command[:-1], place)


def test_the_same_command_writes_the_same_bytes(run_command_line: RunCommand, folder: Path, tmp_path: Path):
    """Learning is repeatable: the same seed, the same file."""
    for name in ("one", "two"):
        run_command_line(
            "learn", folder, "--states", "3", "--initialisation", "k-means", "--restarts", "2", "--out", name
        )
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_a_progress_bar_is_drawn_only_for_a_person(
    run_command_line: RunCommand, folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    """On a terminal it follows the iterations; in a pipe or with --json there is not a sign of it."""
    command = ["learn", folder, "--states", "2", "--force", "--out", "skill"]
    assert run_command_line(*command).stderr == ""
    calls: list[int] = []
    monkeypatch.setattr(commands_learn, "a_person_watches", lambda: True)
    monkeypatch.setattr(click, "progressbar", _bar(calls))
    assert run_command_line(*command).exit_code == 0
    assert calls


def _bar(calls: list[int]) -> Any:
    real = click.progressbar

    def progressbar(**options: Any) -> Any:
        bar = real(**options)
        update = bar.update
        bar.update = lambda n, shown: (calls.append(n), update(n, shown))
        return bar

    return progressbar


def test_json_is_json_for_anyone(run_command_line: RunCommand, skill: Path):
    """No NaN and no Infinity, which other languages do not read."""
    text = run_command_line("show", skill, "--json").stdout
    json.loads(text, parse_constant=lambda constant: pytest.fail(constant))
    assert text.count("\n") == 1


def test_numbers_in_the_answer_are_those_of_the_file(run_json: Callable[..., dict[str, Any]], skill: Path):
    """Probabilities of what comes next sum to one, or the state is final."""
    for state in run_json("show", skill)["states"]:
        assert not state["next"] or np.isclose(sum(state["next"].values()), 1.0)
