"""Output paths that cannot be used: one line before the work, and no file is lost."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from pilotfish.cli.stream import outputs as session_outputs
from pilotfish.io.stream_file import open_stream

RunFailing = Callable[..., str]
ROWS = "".join(f"{0.1 * n} {0.01 * n * n}\n" for n in range(60))
DP_GMM = ["--learner", "dp-gmm", "--cluster", "0.1", "--noise", "1e-3"]


def writing_commands(skill: Path, folder: Path) -> dict[str, list[str]]:
    """Return command lines that write, without the output path, which is the last argument."""
    return {
        "learn": ["learn", str(folder), "--out"],
        "stream": ["stream", "rows", *DP_GMM, "--skill"],
        "select": ["select", str(folder), "--states", "2", "--structures", "full", "--out"],
        "reproduce": ["reproduce", str(skill), "--gains"],
        "export": ["data", "export", "synthetic valve"],
        "record": ["record", "valve", "--out"],
    }


# Imports first: Python itself may lie where another user cannot read it.
OTHER_USER_PROGRAM = """
import os, sys
from click.testing import CliRunner
from pilotfish.cli import main
from pilotfish.cli.main import cli
assert CliRunner().invoke(cli, sys.argv[1:]).exit_code == 1
os.setuid(65534)
main()
"""
NAMES = ["learn", "stream", "select", "reproduce", "export", "record"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("place", ["x" * 300 + ".png", "loop.png", "loop/out.png", "file/out.png"])
@pytest.mark.parametrize("force", [False, True])
def test_unusable_output_path_is_rejected(
    run_failing: RunFailing, skill: Path, folder: Path, tmp_path: Path, name: str, place: str, force: bool
):
    (tmp_path / "rows").write_text(ROWS)
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "loop.png").symlink_to("loop.png")
    (tmp_path / "file").touch()
    output = run_failing(*writing_commands(skill, folder)[name], place, *(["--force"] if force else []))
    assert place[:4] in output


@pytest.mark.parametrize("name", NAMES)
def test_broken_link_is_not_replaced_without_force(
    run_failing: RunFailing, skill: Path, folder: Path, tmp_path: Path, name: str
):
    (tmp_path / "rows").write_text(ROWS)
    (tmp_path / "out.png").symlink_to("nowhere")
    assert "out.png exists" in run_failing(*writing_commands(skill, folder)[name], "out.png")
    assert (tmp_path / "out.png").is_symlink()
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.parametrize("command", [["show", "x"], ["learn", "x", "--out", "y"], ["data", "check", "x"]])
@pytest.mark.parametrize("name", ["x" * 300, "loop", "loop/below"])
def test_unusable_input_path_is_one_line(
    run_failing: RunFailing, tmp_path: Path, command: list[str], name: str
):
    (tmp_path / "loop").symlink_to("loop")
    run_failing(*[name if word == "x" else word for word in command])


@pytest.mark.skipif(os.geteuid() != 0, reason="another user is needed")
@pytest.mark.parametrize("line", [["show", "closed/a"], ["learn", "closed", "--out", "a"]])
def test_folder_without_permission_is_one_line(tmp_path: Path, line: list[str]):
    (tmp_path / "closed").mkdir(mode=0o700)
    tmp_path.chmod(0o755)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2] / "src")}
    result = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", OTHER_USER_PROGRAM, *line],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (result.returncode, result.stderr.count("\n")) == (1, 1), result.stderr
    assert "ermission" in result.stderr


def test_stream_writes_skill_if_model_fails(
    run_command_line: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "rows").write_text(ROWS)
    real = session_outputs.save_stream

    def taken(model: Any, path: Path, **options: bool) -> None:
        path.write_text("another")
        real(model, path, **options)

    monkeypatch.setattr(session_outputs, "save_stream", taken)
    result = run_command_line("stream", "rows", *DP_GMM, "--out", "m.stream", "--skill", "s.skill")
    assert result.exit_code == 1
    assert (tmp_path / "s.skill").exists()


def test_stream_output_created_by_other_process_is_kept(
    run_command_line: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "rows").write_text(ROWS)
    real, calls = session_outputs.save_stream, []

    def save(model: Any, path: Path, *, overwrite: bool, use_free_name: bool) -> None:
        calls.append((path.name, overwrite))
        if len(calls) == 1:
            path.write_text("another")
        real(model, path, overwrite=overwrite, use_free_name=use_free_name)

    monkeypatch.setattr(session_outputs, "save_stream", save)
    result = run_command_line("stream", "rows", *DP_GMM, "--out", "m.stream", "--save-every", "1e-9")
    assert result.exit_code == 1
    assert calls[0] == ("m.stream", False)
    assert set(calls[1:]) == {("m-1.stream", True)}
    assert (tmp_path / "m.stream").read_text() == "another"
    assert open_stream(tmp_path / "m-1.stream").datapoints == 60
