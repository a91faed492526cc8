"""docs/command-line.md agrees with the commands, and its command lines run."""

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from click.testing import Result

DOCS = (Path(__file__).parents[2] / "docs" / "command-line.md").read_text(encoding="utf-8")


def section(path: str) -> str:
    """Return the section of the docs on a command."""
    assert f"\n## `{path}`\n" in DOCS, f"docs/command-line.md has no section `{path}`"
    return DOCS.split(f"\n## `{path}`\n")[1].split("\n## ")[0]


def first_sentence(command: click.Command) -> str:
    """Return the first paragraph of a help text."""
    return " ".join(str(command.help).split("\n\n")[0].split())


def example(command: click.Command) -> list[str]:
    return [line.strip() for line in str(command.epilog).splitlines()[2:]]


def test_docs_have_one_section_per_command(all_commands: dict[str, click.Command]):
    assert set(re.findall(r"^## `(pilotfish [^`]+)`$", DOCS, re.MULTILINE)) == set(all_commands)


def test_docs_contain_help_sentence_example_and_options(all_commands: dict[str, click.Command]):
    for path, command in all_commands.items():
        text = section(path)
        assert first_sentence(command) in text, path
        for line in example(command):
            assert f"\n{line}\n" in text, line
        for parameter in command.params:
            names = {name for name in parameter.opts if name.startswith("--")} - {"--json"}
            assert all(f"`{name}" in text for name in names), (path, names)


def test_docs_option_tables_list_existing_options(all_commands: dict[str, click.Command]):
    for path, command in all_commands.items():
        options = {name for p in command.params for name in (*p.opts, *p.secondary_opts)}
        rows = re.findall(r"^\| (`--[^|]*) \|", section(path), re.MULTILINE)
        assert set(re.findall(r"`(--[a-z-]+)`", " ".join(rows))) <= options, path


# It records four carabiners, and hooks two, in physics: 15 CPU seconds.
@pytest.mark.slow
def test_docs_command_lines_run(
    data_folder: Path, run_command_line: Callable[..., Result], tmp_path: Path, unchecked: None
):
    for name, text in re.findall(r"`(\S+\.(?:json|toml|csv))`:\n\n```\w+\n(.*?)```", DOCS, re.DOTALL):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    blocks = re.findall(r"```sh\n(.*?)```", DOCS, re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    assert len(lines) == 39
    for line in lines:
        program, *arguments = shlex.split(line)
        assert program == "pilotfish"
        if arguments[0] == "demo":
            assert arguments == ["demo", "--out", "build/demo"]
        elif arguments[0] == "view":  # until it is stopped: tests/live/test_panel_in_browser.py runs it
            assert arguments[1] in ("dataset:valve", "valve.skill")
        elif arguments[0] == "study":  # minutes: tests/cli/test_study.py runs it
            assert arguments[-2] == "--out"
        else:
            result = run_command_line(*arguments)
            assert (result.exit_code, result.stderr) == (0, ""), line
    written = {
        "my-valve",
        "valve.skill",
        "valve.stream",
        "online.skill",
        "online.csv",
        "valve-plots",
        "motion.csv",
        "gains.npz",
        "motion.png",
        "scores.png",
        "via.png",
        "hooking",
        "hooking.skill",
        "hooking.webp",
        "session.mcap",
    }
    assert written <= {path.name for path in tmp_path.iterdir()}
