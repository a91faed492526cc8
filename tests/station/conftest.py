"""A small folder of recordings, a skill learned from it, and the command line without a process."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result

from pilotfish.demonstrations import (
    Demonstration,
    demonstration,
    frame_from_pose,
    pose_layout,
    with_derivatives,
    write_folder,
)
from pilotfish.geometry import exp, multiply, pose, rotation_matrix
from pilotfish.models import learn
from pilotfish.station.command_line import cli
from pilotfish.store import save_skill

STEPS, PERIOD = 24, 0.1
Runs = Callable[..., Result]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Runs:
    """Runs a command in an empty folder. A bug is raised, not printed."""
    monkeypatch.chdir(tmp_path)

    def run_command(*arguments: str | Path) -> Result:
        result = CliRunner().invoke(cli, [str(argument) for argument in arguments], prog_name="pilotfish")
        if result.exception and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result

    return run_command


@pytest.fixture
def facts(run: Runs) -> Callable[..., dict[str, Any]]:
    """Runs a command with --json and reads its answer; nothing else may stand on stdout or stderr."""

    def run_command(*arguments: str | Path) -> dict[str, Any]:
        result = run(*arguments, "--json")
        assert (result.exit_code, result.stderr) == (0, "")
        answer: dict[str, Any] = json.loads(result.stdout)
        return answer

    return run_command


@pytest.fixture
def refusal(run: Runs) -> Callable[..., str]:
    """Runs a command that must be refused: exit code 1, one line on stderr, nothing on stdout."""

    def run_command(*arguments: str | Path) -> str:
        result = run(*arguments)
        assert (result.exit_code, result.stdout) == (1, "")
        assert result.stderr.startswith("Error: ")
        assert result.stderr.count("\n") == 1
        return str(result.stderr)

    return run_command


def reach(rng: np.random.Generator, name: str) -> Demonstration:
    """A hand moves from a place in the world to a cup that stands elsewhere each time, and turns with it."""
    layout, s = pose_layout(), np.clip(np.linspace(0.0, 1.3, STEPS), 0.0, 1.0)
    share = (s**2 * (3.0 - 2.0 * s))[:, None]  # begins and ends at rest
    turn = exp(np.array([0.0, 0.0, 0.3 * rng.normal()]))
    cup = pose(np.array([0.6, 0.0, 0.1]) + 0.1 * rng.normal(size=3), turn)
    home = np.array([0.0, -0.4, 0.3]) + 0.02 * rng.normal(size=3)
    grasp = cup.position + rotation_matrix(turn) @ np.array([0.0, 0.0, 0.05])
    x = (1.0 - share) * home + share * grasp + 0.003 * rng.normal(size=(STEPS, 3))
    turns = [multiply(turn, exp(np.array([0.4 * (1.0 - a), 0.0, 0.0]))) for a in share[:, 0]]
    frames = [
        frame_from_pose("home", layout, pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))),
        frame_from_pose("cup", layout, cup),
    ]
    return demonstration(np.hstack([x, turns]), PERIOD, layout, frames, name)


@pytest.fixture(scope="session")
def reaches() -> tuple[Demonstration, ...]:
    """Five reaches for a cup, without speeds."""
    rng = np.random.default_rng(3)
    return tuple(reach(rng, f"reach {m}") for m in range(5))


@pytest.fixture
def folder(tmp_path: Path, reaches: tuple[Demonstration, ...]) -> Path:
    write_folder(reaches, tmp_path / "reaches")
    return tmp_path / "reaches"


@pytest.fixture(scope="session")
def learned(tmp_path_factory: pytest.TempPathFactory, reaches: tuple[Demonstration, ...]) -> bytes:
    """The bytes of a skill file of three states."""
    shown = [with_derivatives(demo) for demo in reaches]
    path = tmp_path_factory.mktemp("learned") / "skill"
    save_skill(learn(shown, states=3, rng=np.random.default_rng(0)).skill, path)
    return path.read_bytes()


@pytest.fixture
def skill(tmp_path: Path, learned: bytes) -> Path:
    (tmp_path / "reach.skill").write_bytes(learned)
    return tmp_path / "reach.skill"


CUP = {"name": "cup", "position": [0.5, 0.2, 0.1], "quaternion": [0.9659258, 0.0, 0.0, 0.2588190]}
HOME = {"name": "home", "position": [0.0, 0.0, 0.0], "quaternion": [1.0, 0.0, 0.0, 0.0]}


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    """A situation never shown."""
    (tmp_path / "now.json").write_text(json.dumps([HOME, CUP]))
    return tmp_path / "now.json"


def commands(group: click.Group = cli, path: str = "pilotfish") -> dict[str, click.Command]:
    """Every command that does something, by what one types."""
    found: dict[str, click.Command] = {}
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            found |= commands(command, f"{path} {name}")
        else:
            found[f"{path} {name}"] = command
    return found


@pytest.fixture
def every_command() -> dict[str, click.Command]:
    return commands()
