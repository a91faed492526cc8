"""Fixtures: small demonstrations, skills learned from them, and commands that run in this process."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from annotations import check_annotations
from click.testing import CliRunner, Result
from demo_run import DemoRun, run_demo

from pilotfish.cli.main import cli
from pilotfish.demonstrations import (
    Demonstration,
    add_derivatives,
    demonstration,
    frame_from_pose,
    pose_layout,
)
from pilotfish.environments import TASKS, Outcome, Scene, Task
from pilotfish.environments.human import Observation
from pilotfish.environments.tasks.screwdriver import tool_above_recess
from pilotfish.environments.tasks.valve import FACING, ValveSituation
from pilotfish.geometry import Pose, multiply, pose, quaternion_exp, rotation_matrix, rotation_vector_in_world
from pilotfish.io.demonstration_folder import write_demonstrations
from pilotfish.io.skill_file import save_skill
from pilotfish.models import Skill, learn
from pilotfish.simulation import RecordedDemonstration, record, situation_from_seed
from pilotfish.simulation.recording import Leader

STEPS, PERIOD = 24, 0.1
RunCommand = Callable[..., Result]


@pytest.fixture
def run_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunCommand:
    """Run a command in an empty folder; an unexpected exception is raised."""
    monkeypatch.chdir(tmp_path)

    def run_command(*arguments: str | Path) -> Result:
        result = CliRunner().invoke(cli, [str(argument) for argument in arguments], prog_name="pilotfish")
        if result.exception and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result

    return run_command


@pytest.fixture
def run_json(run_command_line: RunCommand) -> Callable[..., dict[str, Any]]:
    """Run a command with --json and return its result; stderr must be empty."""

    def run_command(*arguments: str | Path) -> dict[str, Any]:
        result = run_command_line(*arguments, "--json")
        assert (result.exit_code, result.stderr) == (0, "")
        answer: dict[str, Any] = json.loads(result.stdout)
        return answer

    return run_command


@pytest.fixture
def run_failing(run_command_line: RunCommand) -> Callable[..., str]:
    """Run a command that must fail: exit code 1, one line on stderr, nothing on stdout."""

    def run_command(*arguments: str | Path) -> str:
        result = run_command_line(*arguments)
        assert (result.exit_code, result.stdout) == (1, "")
        assert result.stderr.startswith("Error: ")
        assert result.stderr.count("\n") == 1
        return str(result.stderr)

    return run_command


def reach_demonstration(rng: np.random.Generator, name: str) -> Demonstration:
    """Return a reach from a fixed start to a cup whose pose varies."""
    layout, s = pose_layout(), np.clip(np.linspace(0.0, 1.3, STEPS), 0.0, 1.0)
    share = (s**2 * (3.0 - 2.0 * s))[:, None]  # begins and ends at rest
    turn = quaternion_exp(np.array([0.0, 0.0, 0.3 * rng.normal()]))
    cup = pose(np.array([0.6, 0.0, 0.1]) + 0.1 * rng.normal(size=3), turn)
    home = np.array([0.0, -0.4, 0.3]) + 0.02 * rng.normal(size=3)
    grasp = cup.position + rotation_matrix(turn) @ np.array([0.0, 0.0, 0.05])
    x = (1.0 - share) * home + share * grasp + 0.003 * rng.normal(size=(STEPS, 3))
    turns = [multiply(turn, quaternion_exp(np.array([0.4 * (1.0 - a), 0.0, 0.0]))) for a in share[:, 0]]
    frames = [
        frame_from_pose("home", layout, pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))),
        frame_from_pose("cup", layout, cup),
    ]
    return demonstration(np.hstack([x, turns]), PERIOD, layout, frames, name)


@pytest.fixture(scope="session")
def reach_demonstrations() -> tuple[Demonstration, ...]:
    """Return five reaches for a cup, without velocities."""
    rng = np.random.default_rng(3)
    return tuple(reach_demonstration(rng, f"reach {m}") for m in range(5))


@pytest.fixture
def folder(tmp_path: Path, reach_demonstrations: tuple[Demonstration, ...]) -> Path:
    write_demonstrations(reach_demonstrations, tmp_path / "reaches")
    return tmp_path / "reaches"


@pytest.fixture(scope="session")
def learned_skill_bytes(
    tmp_path_factory: pytest.TempPathFactory, reach_demonstrations: tuple[Demonstration, ...]
) -> bytes:
    """Return the content of a skill file with three states."""
    demonstrations = [add_derivatives(demo) for demo in reach_demonstrations]
    path = tmp_path_factory.mktemp("learned") / "skill"
    save_skill(learn(demonstrations, states=3, rng=np.random.default_rng(0)).skill, path)
    return path.read_bytes()


@pytest.fixture
def skill(tmp_path: Path, learned_skill_bytes: bytes) -> Path:
    (tmp_path / "reach.skill").write_bytes(learned_skill_bytes)
    return tmp_path / "reach.skill"


CUP = {"name": "cup", "position": [0.5, 0.2, 0.1], "quaternion": [0.9659258, 0.0, 0.0, 0.2588190]}
HOME = {"name": "home", "position": [0.0, 0.0, 0.0], "quaternion": [1.0, 0.0, 0.0, 0.0]}


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    """Return a file with frames of a new situation."""
    (tmp_path / "now.json").write_text(json.dumps([HOME, CUP]))
    return tmp_path / "now.json"


def collect_commands(group: click.Group = cli, path: str = "pilotfish") -> dict[str, click.Command]:
    """Return every command by its path on the command line."""
    found: dict[str, click.Command] = {}
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            found |= collect_commands(command, f"{path} {name}")
        else:
            found[f"{path} {name}"] = command
    return found


@pytest.fixture
def all_commands() -> dict[str, click.Command]:
    return collect_commands()


@dataclass(frozen=True)
class TimedSegment:
    """Motion of the hand from the goal before to its goal, until a time [s], with a grip."""

    until: float
    goal: Callable[[Mapping[str, Pose]], Pose]
    grip: float = 0.0


def interpolate_pose(start: Pose, end: Pose, share: float) -> Pose:
    """Interpolate with zero velocity at both ends."""
    s = share**2 * (3.0 - 2.0 * share)
    turn = 0.5 * s * rotation_vector_in_world(start.quaternion, end.quaternion)
    return Pose(
        start.position + s * (end.position - start.position), multiply(quaternion_exp(turn), start.quaternion)
    )


def timed_leader(*segments: TimedSegment) -> Leader:
    """Return a leader that depends on time and object poses only."""
    tools: list[Pose] = []

    def lead(time: float, observation: Observation) -> tuple[Pose, float, bool]:
        tools.append(observation.tool)
        n = next((n for n, segment in enumerate(segments) if time < segment.until), len(segments) - 1)
        start, before = (
            (segments[n - 1].until, segments[n - 1].goal(observation.frames)) if n else (0.0, tools[0])
        )
        share = min((time - start) / (segments[n].until - start), 1.0)
        target = interpolate_pose(before, segments[n].goal(observation.frames), share)
        return target, segments[n].grip, time >= segments[-1].until

    return lead


def handle_approach(frame: str, distance: float) -> Callable[[Mapping[str, Pose]], Pose]:
    """Return the tool goal at a distance before the handle [m]."""
    return lambda frames: frames[frame] @ Pose(np.array([-distance, 0.0, 0.0]), FACING)


def valve_leader() -> Leader:
    """Return a leader that opens any valve in five seconds."""
    return timed_leader(
        TimedSegment(1.0, handle_approach("before", 0.13)),
        TimedSegment(1.8, handle_approach("before", 0.0)),
        TimedSegment(2.3, handle_approach("before", 0.0), grip=1.0),
        TimedSegment(3.5, handle_approach("after", 0.0), grip=1.0),
        TimedSegment(3.8, handle_approach("after", 0.0), grip=1.0),
        TimedSegment(4.1, handle_approach("after", 0.0)),
        TimedSegment(4.9, handle_approach("after", 0.15)),
    )


def _record_valve(number: int) -> RecordedDemonstration:
    task = TASKS["valve"]
    return record(
        task, situation_from_seed(task, "demonstration", 0, number), valve_leader(), f"opening {number}"
    )


@pytest.fixture(scope="session")
def valve_recordings() -> tuple[RecordedDemonstration, ...]:
    """Return four recordings of the valve task."""
    with check_annotations(False):
        return tuple(_record_valve(number) for number in range(4))


@pytest.fixture(scope="session")
def valve_skill(valve_recordings: tuple[RecordedDemonstration, ...]) -> Skill:
    """Return a skill learned from them."""
    demonstrations = [add_derivatives(opening.demonstration) for opening in valve_recordings]
    with check_annotations(False):
        return learn(demonstrations, states=6, rng=np.random.default_rng(0)).skill


def _check_alignment(scene: Scene, situation: ValveSituation) -> Outcome:
    goal = handle_approach("before", 0.13)(TASKS["valve"].observe_frames(scene.model, scene.data, situation))
    error = float(np.linalg.norm(scene.tool.position - goal.position))
    return Outcome(error < 0.02, error, f"the tool is {error:.3f} m from its goal" if error >= 0.02 else "")


ALIGNMENT_TASK: Task[ValveSituation] = replace(
    TASKS["valve"],
    name="lining up",
    description="bring the tool in front of a valve",
    unit="m",
    time_limit=6.0,
    demonstration_script=lambda situation: TASKS["valve"].demonstration_script(situation)[:1],
    check_success=_check_alignment,
    progress=None,
)


@pytest.fixture
def alignment_task(monkeypatch: pytest.MonkeyPatch) -> Task[ValveSituation]:
    """Register a task that is done in two seconds."""
    monkeypatch.setitem(TASKS, ALIGNMENT_TASK.name, ALIGNMENT_TASK)
    return ALIGNMENT_TASK


def screwdriver_leader() -> Leader:
    """Return a leader that inserts the screwdriver in four seconds."""
    return timed_leader(
        TimedSegment(1.2, lambda frames: tool_above_recess(frames, 0.07)),
        TimedSegment(2.0, lambda frames: tool_above_recess(frames, 0.03)),
        TimedSegment(3.2, lambda frames: tool_above_recess(frames, -0.004)),
        TimedSegment(4.0, lambda frames: tool_above_recess(frames, -0.004)),
    )


@pytest.fixture(scope="session")
def alignment_recordings() -> tuple[RecordedDemonstration, ...]:
    """Return four recordings of the screwdriver task."""
    task = TASKS["screwdriver"]
    with check_annotations(False):
        return tuple(
            record(
                task,
                situation_from_seed(task, "demonstration", 0, m),
                screwdriver_leader(),
                f"setting {m}",
            )
            for m in range(4)
        )


@pytest.fixture(scope="session")
def alignment_skill(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with three recordings of the short task, and the skill learned from them."""
    folder = tmp_path_factory.mktemp("lined up")
    with pytest.MonkeyPatch.context() as patch, check_annotations(False):
        patch.setitem(TASKS, ALIGNMENT_TASK.name, ALIGNMENT_TASK)
        patch.chdir(folder)
        record_command = [
            "record",
            ALIGNMENT_TASK.name,
            "--demonstrations",
            "3",
            "--seed",
            "5",
            "--out",
            "demonstrations",
        ]
        for line in (record_command, ["learn", "demonstrations", "--states", "2", "--out", "skill"]):
            CliRunner().invoke(cli, line, prog_name="pilotfish", catch_exceptions=False)
    return folder


@pytest.fixture(scope="session")
def demo_run(data_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> DemoRun:
    """Run the demo once on the real recording."""
    return run_demo(tmp_path_factory.mktemp("demonstrated"), data_folder)
