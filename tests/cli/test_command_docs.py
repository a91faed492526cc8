"""docs/command-line.md tells what the commands tell, and what it shows works as shown."""

import re
import shlex
from collections.abc import Callable
from pathlib import Path

import click
import pytest
from click.testing import Result

DOCS = (Path(__file__).parents[2] / "docs" / "command-line.md").read_text(encoding="utf-8")


def section(path: str) -> str:
    """What the docs say about a command."""
    assert f"\n## `{path}`\n" in DOCS, f"docs/command-line.md has no section `{path}`"
    return DOCS.split(f"\n## `{path}`\n")[1].split("\n## ")[0]


def first_sentence(command: click.Command) -> str:
    """The command's own words."""
    return " ".join(str(command.help).split("\n\n")[0].split())


def example(command: click.Command) -> list[str]:
    return [line.strip() for line in str(command.epilog).splitlines()[2:]]


def test_the_docs_know_every_command_and_no_other(all_commands: dict[str, click.Command]):
    """A heading for each command there is."""
    assert set(re.findall(r"^## `(pilotfish [^`]+)`$", DOCS, re.MULTILINE)) == set(all_commands)


def test_help_and_docs_say_the_same(all_commands: dict[str, click.Command]):
    """The sentence and the example of every command stand in its section, and each of its options too."""
    for path, command in all_commands.items():
        text = section(path)
        assert first_sentence(command) in text, path
        for line in example(command):
            assert f"\n{line}\n" in text, line
        for parameter in command.params:
            names = {name for name in parameter.opts if name.startswith("--")} - {"--json"}
            assert all(f"`{name}" in text for name in names), (path, names)


# It records four carabiners, and hooks two, in physics: 15 CPU seconds.
@pytest.mark.slow
def test_every_line_of_the_docs_runs(
    data_folder: Path, run_command_line: Callable[..., Result], tmp_path: Path, unchecked: None
):
    """Typed in their order in an empty folder, they work; the demonstration runs in test_demo.py."""
    for name, text in re.findall(r"`(\S+\.(?:json|toml))`:\n\n```\w+\n(.*?)```", DOCS, re.DOTALL):
        (tmp_path / name).write_text(text)
    blocks = re.findall(r"```sh\n(.*?)```", DOCS, re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    assert len(lines) == 19
    for line in lines:
        program, *arguments = shlex.split(line)
        assert program == "pilotfish"
        if arguments[0] == "demo":
            assert arguments == ["demo", "--out", "build/demo"]
        else:
            result = run_command_line(*arguments)
            assert (result.exit_code, result.stderr) == (0, ""), line
    written = {
        "my-valve",
        "valve.skill",
        "valve.stream",
        "grown.skill",
        "grown.csv",
        "valve-pictures",
        "motion.csv",
        "gains.npz",
        "motion.png",
        "sizes.png",
        "via.png",
        "hooking",
        "hooking.skill",
        "hooking.webp",
    }
    assert written <= {path.name for path in tmp_path.iterdir()}
