"""pilotfish view: what it loads and refuses; tests/live/test_panel_in_browser.py opens the page."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from pilotfish import panel
from pilotfish.cli.main import cli
from pilotfish.panel import ViewContent

RunCommand = Callable[..., Result]


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> list[tuple[ViewContent, dict[str, Any]]]:
    """Return the contents that would be served; the server is stopped by Ctrl-C at once."""
    contents: list[tuple[ViewContent, dict[str, Any]]] = []

    def serve(content: ViewContent, should_stop: Any, *, on_start: Any, **options: Any) -> None:
        contents.append((content, options))
        on_start(f"http://{options['host']}:{options['port']}")
        raise SystemExit(0)  # in place of a signal, which the runner does not catch

    monkeypatch.setattr(panel, "serve", serve)
    return contents


def view(*arguments: str | Path) -> Result:
    """Run the command until it is stopped."""
    result = CliRunner().invoke(cli, ["view", *map(str, arguments)], prog_name="pilotfish")
    assert result.exit_code == 0, result.stderr
    return result


def test_folder_shows_demonstrations_on_loopback(folder: Path, served: list[Any]):
    result = view(folder, "--json")
    assert json.loads(result.stdout) == {
        "address": "http://127.0.0.1:8080",
        "demonstrations": 5,
        "states": 0,
        "situations": 5,
    }
    (content, options) = served[0]
    assert (content.skill, options) == (None, {"host": "127.0.0.1", "port": 8080})


def test_folder_and_skill_have_common_columns(folder: Path, skill: Path, served: list[Any]):
    result = view(folder, "--skill", skill, "--only", "1,3", "--port", "0")
    content, options = served[0]
    assert [demo.name for demo in content.demonstrations] == ["reach 1", "reach 3"]
    assert content.demonstrations[0].layout == content.skill.layout
    assert options["port"] == 0
    assert result.stdout.startswith("page ")
    assert "Ctrl-C" in result.stdout


def test_skill_alone_with_frames(skill: Path, frames: Path, served: list[Any]):
    view(skill, "--frames", frames)
    view(skill)
    assert [each.name for each in served[0][0].situations] == ["given frames"]
    assert [each.name for each in served[1][0].situations] == ["middle of the demonstrations"]


def test_open_address_of_the_network_is_noted(
    folder: Path, served: list[Any], monkeypatch: pytest.MonkeyPatch
):
    opened: list[str] = []
    monkeypatch.setattr("click.launch", opened.append)
    result = view(folder, "--host", "0.0.0.0", "--open")
    assert result.stderr == "note: whoever can reach 0.0.0.0 can read and change the page\n"
    assert opened == ["http://0.0.0.0:8080"]
    assert view(folder).stderr == ""
    assert len(opened) == 1


def test_options_without_effect_are_usage_errors(
    run_command_line: RunCommand, folder: Path, skill: Path, frames: Path
):
    for arguments in ((skill, "--skill", skill), (skill, "--only", "0"), (folder, "--frames", frames)):
        result = run_command_line("view", *arguments)
        assert result.exit_code == 2
        assert "has no effect" in result.stderr


def test_bad_files_are_refused(run_failing: Callable[..., str], folder: Path, skill: Path, tmp_path: Path):
    assert "absent" in run_failing("view", "absent")
    (tmp_path / "broken.skill").write_bytes(b"no skill")
    assert "broken.skill" in run_failing("view", "broken.skill")
    assert "broken.skill" in run_failing("view", folder, "--skill", "broken.skill")
    assert "zshape" in run_failing("view", "dataset:zshapes")
