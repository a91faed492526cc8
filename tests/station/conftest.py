"""Small recordings, made by hand and in physics, skills learned from them, and commands without a process."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from annotations import annotations_checked
from click.testing import CliRunner, Result
from demonstrating import Demonstrated, demonstrate

from pilotfish.demonstrations import (
    Demonstration,
    demonstration,
    frame_from_pose,
    pose_layout,
    with_derivatives,
    write_folder,
)
from pilotfish.environments import TASKS, Scene, Task, Verdict, people, turn_between
from pilotfish.environments.tasks.screwdriver import above
from pilotfish.environments.tasks.valve import FACING, ValveSituation
from pilotfish.geometry import Pose, exp, multiply, pose, rotation_matrix
from pilotfish.models import Skill, learn
from pilotfish.station.command_line import cli
from pilotfish.station.recorder import SHOWN, Leader, Recording, record, situation
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


@dataclass(frozen=True)
class Leg:
    """Until a time [s] the hand is on its way to a goal, from where it was to be before; and the grip."""

    until: float
    goal: Callable[[Mapping[str, Pose]], Pose]
    grip: float = 0.0


def on_the_way(start: Pose, end: Pose, share: float) -> Pose:
    """Begun and ended at rest, turning the shorter way."""
    s = share**2 * (3.0 - 2.0 * share)
    turn = 0.5 * s * turn_between(start.quaternion, end.quaternion)
    return Pose(start.position + s * (end.position - start.position), multiply(exp(turn), start.quaternion))


def by_the_clock(*legs: Leg) -> Leader:
    """A leader who looks at nothing but the clock and where objects stand: quick, and always the same."""
    homes: list[Pose] = []

    def lead(time: float, seen: people.Seen) -> people.Wish:
        homes.append(seen.tool)
        n = next((n for n, leg in enumerate(legs) if time < leg.until), len(legs) - 1)
        begun, before = (legs[n - 1].until, legs[n - 1].goal(seen.frames)) if n else (0.0, homes[0])
        share = min((time - begun) / (legs[n].until - begun), 1.0)
        wish = on_the_way(before, legs[n].goal(seen.frames), share)
        return people.Wish(wish, legs[n].grip, n, time >= legs[-1].until)

    return lead


def before_the_handle(which: str, back: float) -> Callable[[Mapping[str, Pose]], Pose]:
    """The tool so far [m] before the handle, as it stands or is to stand."""
    return lambda seen: seen[which] @ Pose(np.array([-back, 0.0, 0.0]), FACING)


def valve_opener() -> Leader:
    """Opens any valve in five seconds."""
    return by_the_clock(
        Leg(1.0, before_the_handle("before", 0.13)),
        Leg(1.8, before_the_handle("before", 0.0)),
        Leg(2.3, before_the_handle("before", 0.0), grip=1.0),
        Leg(3.5, before_the_handle("after", 0.0), grip=1.0),
        Leg(3.8, before_the_handle("after", 0.0), grip=1.0),
        Leg(4.1, before_the_handle("after", 0.0)),
        Leg(4.9, before_the_handle("after", 0.15)),
    )


def _opening(number: int) -> Recording:
    task = TASKS["valve"]
    return record(task, situation(task, SHOWN, 0, number), valve_opener(), f"opening {number}")


@pytest.fixture(scope="session")
def openings() -> tuple[Recording, ...]:
    """Four valves opened in physics by the clock."""
    with annotations_checked(False):
        return tuple(_opening(number) for number in range(4))


@pytest.fixture(scope="session")
def valve_skill(openings: tuple[Recording, ...]) -> Skill:
    """What is learned from them."""
    shown = [with_derivatives(opening.demonstration) for opening in openings]
    return learn(shown, states=6, rng=np.random.default_rng(0)).skill


def _lined_up(scene: Scene, where: ValveSituation) -> Verdict:
    goal = before_the_handle("before", 0.13)(TASKS["valve"].see(scene.model, scene.data, where))
    error = float(np.linalg.norm(scene.tool.position - goal.position))
    return Verdict(error < 0.02, error, f"the tool is {error:.3f} m from its place" if error >= 0.02 else "")


LINING_UP: Task[ValveSituation] = replace(
    TASKS["valve"],
    name="lining up",
    about="come before a valve, and no more",
    unit="m",
    seconds=6.0,
    script=lambda where: TASKS["valve"].script(where)[:1],
    judge=_lined_up,
)


@pytest.fixture
def lining_up(monkeypatch: pytest.MonkeyPatch) -> Task[ValveSituation]:
    """A task that is done in two seconds, among those that commands know."""
    monkeypatch.setitem(TASKS, LINING_UP.name, LINING_UP)
    return LINING_UP


def screw_setter() -> Leader:
    """Sets a screwdriver into any recess, as it moves, in four seconds."""
    return by_the_clock(
        Leg(1.2, lambda seen: above(seen, 0.07)),
        Leg(2.0, lambda seen: above(seen, 0.03)),
        Leg(3.2, lambda seen: above(seen, -0.004)),
        Leg(4.0, lambda seen: above(seen, -0.004)),
    )


@pytest.fixture(scope="session")
def settings() -> tuple[Recording, ...]:
    """Four screwdrivers set in by the clock."""
    task = TASKS["screwdriver"]
    with annotations_checked(False):
        return tuple(
            record(task, situation(task, SHOWN, 0, m), screw_setter(), f"setting {m}") for m in range(4)
        )


@pytest.fixture(scope="session")
def lined_up(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A place with three showings of the short task in the folder "shown", and "skill", learned from them."""
    place = tmp_path_factory.mktemp("lined up")
    with pytest.MonkeyPatch.context() as patch, annotations_checked(False):
        patch.setitem(TASKS, LINING_UP.name, LINING_UP)
        patch.chdir(place)
        record_it = ["record", LINING_UP.name, "--demonstrations", "3", "--seed", "5", "--out", "shown"]
        for line in (record_it, ["learn", "shown", "--states", "2", "--out", "skill"]):
            CliRunner().invoke(cli, line, prog_name="pilotfish", catch_exceptions=False)
    return place


@pytest.fixture(scope="session")
def demonstrated(data_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Demonstrated:
    """The demonstration, run once on the real recording."""
    return demonstrate(tmp_path_factory.mktemp("demonstrated"), data_folder)
