"""pilotfish drive: modes, link, summary and film."""

from collections.abc import Callable
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from drawing import needs_renderer
from PIL import Image

from pilotfish.assistance import assisted_skill, make_assistant
from pilotfish.environments import Task
from pilotfish.io import open_skill
from pilotfish.simulation import Link, situation_from_seed, teleoperate

pytestmark = pytest.mark.usefixtures("unchecked")

RunJson = Callable[..., dict[str, Any]]
RunCommand = Callable[..., Result]


@pytest.fixture
def drive(alignment_skill: Path, alignment_task: Task[Any]) -> list[str]:
    """Arguments of the command line without options."""
    return ["drive", str(alignment_skill / "skill"), "--task", alignment_task.name]


def test_drive_json_equals_teleoperation(
    drive: list[str], alignment_task: Task[Any], alignment_skill: Path, run_json: RunJson
):
    options = ("--view-off", "4", "--view-turn", "10", "--delay", "0.2")
    output = run_json(*drive, "--situation", "1", "--seed", "3", *options)
    assistant = make_assistant([assisted_skill(open_skill(alignment_skill / "skill"))])
    link = Link(delay=0.2, view_distance=0.04, view_angle=radians(10.0))
    situation, rng = situation_from_seed(alignment_task, "test", 3, 1), np.random.default_rng([3, 1, 1])
    result = teleoperate(assistant, alignment_task, situation, rng, link=link)
    assert output["mode"] == "shared"
    assert [fact["error"] for fact in output["situations"]] == [result.outcome.error]
    assert output["succeeded"] == result.outcome.success
    assert output["authority"] == pytest.approx(result.authority.mean())


def test_drive_autonomous_switches_after_time(drive: list[str], run_json: RunJson):
    options = ("--mode", "autonomous", "--switch-after", "0.6", "--situation", "0")
    output = run_json(*drive, *options)
    assert output["mode"] == "autonomous"
    assert output["succeeded"] == 1


def test_drive_fixture_guides_along_the_demonstrations(
    drive: list[str], alignment_skill: Path, run_json: RunJson
):
    folder = str(alignment_skill / "demonstrations")
    output = run_json(*drive, "--mode", "fixture", "--demonstrations", folder, "--situation", "0")
    assert output["mode"] == "fixture"
    assert output["succeeded"] == 1


def test_drive_fixture_without_its_folder_is_refused(drive: list[str], run_command_line: RunCommand):
    result = run_command_line(*drive, "--mode", "fixture", "--demonstrations", "nowhere")
    assert result.exit_code == 1
    assert "nowhere" in result.stderr


def test_drive_prints_correction(drive: list[str], run_command_line: RunCommand):
    result = run_command_line(*drive, "--situations", "1", "--view-off", "5")
    assert result.exit_code == 0
    corrected = float(result.stdout.split("correction, mean")[1].split("mm")[0])
    assert 20.0 < corrected < 60.0
    assert "1 of 1 succeeded" in result.stdout
    assert result.stderr == ""


@needs_renderer
def test_drive_film_shows_command_beside_tool(drive: list[str], run_json: RunJson, tmp_path: Path):
    """With a displaced view the orange copy of the tool differs from the tool."""
    masks = []
    for number, off in enumerate(("0", "8")):
        name = f"film{number}.webp"
        run_json(*drive, "--situation", "0", "--view-off", off, "--film", name)
        with Image.open(tmp_path / name) as film:
            assert film.size == (720, 540)
            film.seek(film.n_frames - 1)
            red, green, blue = (channel.astype(int) for channel in np.moveaxis(np.asarray(film), -1, 0)[:3])
        masks.append((red > green + 40) & (green > blue + 40))
    same, displaced = masks
    assert (displaced & ~same).sum() > 0.3 * same.sum()
    assert displaced.sum() > same.sum()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--situation", "1", "--situations", "2"), "--situation executes one situation; omit --situations"),
        (("--meshes",), "--meshes needs a film"),
        (("--mode", "shard"), "'shard' is not one of"),
        (("--delay", "-1"), "-1"),
        (("--switch-after", "1"), "--switch-after has no effect on --mode shared"),
        (("--demonstrations", "a"), "--demonstrations has no effect on --mode shared; give --mode fixture"),
        (("--mode", "fixture"), "--mode fixture needs the recordings of the task; give --demonstrations"),
        (("--view-off", "nan"), "--view-off"),
        (("--film", "film.txt"), "expected .webp or .gif"),
    ],
)
def test_drive_bad_options_are_refused(
    drive: list[str], run_command_line: RunCommand, options: tuple[str, ...], message: str
):
    result = run_command_line(*drive, *options)
    assert result.exit_code == 2
    assert message in result.stderr


def test_drive_autonomous_without_order_in_time_is_refused(
    alignment_skill: Path, alignment_task: Task[Any], run_command_line: RunCommand
):
    folder = alignment_skill / "demonstrations"
    options = ("--states", "2", "--dynamics", "mixture", "--out", "mixture.skill")
    assert run_command_line("learn", folder, *options).exit_code == 0
    task = ("--task", alignment_task.name, "--mode", "autonomous")
    result = run_command_line("drive", "mixture.skill", *task)
    assert result.exit_code == 2
    assert "learn it without --dynamics mixture" in result.stderr
