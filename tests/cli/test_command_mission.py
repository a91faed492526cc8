"""pilotfish mission and replay-session: options that contradict each other, outputs, and their content."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from drawing import needs_renderer
from PIL import Image

from pilotfish.environments import Task
from pilotfish.io import read_session

pytestmark = pytest.mark.usefixtures("unchecked")

RunJson = Callable[..., dict[str, Any]]
RunCommand = Callable[..., Result]


@pytest.fixture
def mission(alignment_skill: Path, alignment_task: Task[Any]) -> list[str]:
    """Arguments of a mission that takes a few seconds of simulated time."""
    return ["mission", alignment_task.name, "--skill", str(alignment_skill / "skill"), "--rtt", "0.1"]


def usage_error(run_command_line: RunCommand, *arguments: str) -> str:
    result = run_command_line(*arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    return str(result.stderr)


def test_mission_recording_is_replayed_identically(
    mission: list[str], run_json: RunJson, run_command_line: RunCommand, tmp_path: Path
):
    output = run_json(*mission, "--loss", "2", "--out", "a.mcap")
    (situation,) = output["situations"]
    assert (output["succeeded"], output["out"]) == (1, "a.mcap")
    assert situation["completed"]
    assert situation["holds"] == []
    assert situation["bytes_forward"] > 10_000
    assert json.loads(read_session(tmp_path / "a.mcap").metadata["mission"])["loss"] == 2.0
    replay = run_command_line("replay-session", "a.mcap")
    assert replay.exit_code == 0
    assert "messages: identical" in replay.stdout
    whole = run_json("replay-session", "a.mcap")
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:-100_000])
    cut = run_json("replay-session", "cut.mcap")
    assert (whole["identical"], whole["complete"], whole["difference"]) == (True, True, None)
    assert (cut["identical"], cut["complete"]) == (True, False)
    assert 0 < cut["steps"] < whole["steps"]
    assert "was cut short" in run_command_line("replay-session", "cut.mcap").stdout


def test_mission_summary_states_holds_bytes_and_late_outage(mission: list[str], run_command_line: RunCommand):
    result = run_command_line(*mission, "--outage", "3.6:1", "--outage", "500:1")
    assert result.exit_code == 0
    for text in ("link lost at 3.", "% of 256 kbit/s", "% of 768 kbit/s", "agreed budget 0.25 s"):
        assert text in result.stdout
    assert "note: the outage at 500 s had no effect" in result.stdout


def test_mission_envelope_continues_through_the_outage(mission: list[str], run_json: RunJson):
    options = ("--outage", "3.6:2", "--allow-after-outage", "10")
    (situation,) = run_json(*mission, *options)["situations"]
    assert [hold["reason"] for hold in situation["holds"]] in ([], ["plan ended"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--mode", "direct", "--rtt", "1"), "--mode shared, or --allow-direct 1.2"),
        (("--rtt", "9"), "up to 5 s, and it is 9.15 s here; use --mode autonomous"),
        (("--continue-from", "shared"), "give --allow-after-outage"),
        (("--allow-direct", "2"), "no effect on --mode shared"),
        (("--outage", "20"), "START:DURATION"),
        (("--outage", "20:10:sideways"), "20:10:forward"),
        (("--outage", "nan:1"), "START:DURATION"),
        (("--outage", "5:10", "--outage", "8:1"), "--outage [1] starts at 8 s"),
        (("--rate", "fast"), "FORWARD:BACKWARD"),
        (("--rate", "1:2:3"), "FORWARD:BACKWARD"),
        (("--loss", "50", "--burst", "1.5"), "--burst is 1.5"),
        (("--allow-after-outage", "5", "--continue-from", "sideways"), "not one of direct"),
        (("--mode", "fixture"), "omit --skill"),
        (("--situation", "1", "--situations", "2"), "omit --situations"),
    ],
)
def test_mission_contradicting_options_are_refused(
    mission: list[str], run_command_line: RunCommand, options: tuple[str, ...], message: str
):
    assert message in " ".join(usage_error(run_command_line, *mission, *options).split())


def test_mission_existing_recording_is_kept_without_force(
    mission: list[str], run_failing: Callable[..., str], tmp_path: Path
):
    (tmp_path / "a.mcap").write_bytes(b"old")
    assert "--force" in run_failing(*mission, "--out", "a.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == b"old"
    (tmp_path / "b.mcap.part").write_bytes(b"rest")
    assert "cut short" in run_failing(*mission, "--out", "b.mcap")


def test_mission_unknown_task_is_refused(run_failing: Callable[..., str]):
    assert "valve" in run_failing("mission", "juggling")


def test_replay_session_difference_has_exit_code_one(
    mission: list[str], run_command_line: RunCommand, run_json: RunJson, tmp_path: Path
):
    from pilotfish.io import SessionWriter

    run_json(*mission, "--out", "a.mcap")
    session = read_session(tmp_path / "a.mcap")
    with SessionWriter(tmp_path / "b.mcap") as writer:
        writer.describe(session.metadata)
        for n, (channel, time, data) in enumerate(session.records()):
            changed = data[:-1] + bytes([data[-1] ^ 1]) if channel == "robot/target" and n > 100 else data
            writer.write(channel, time, changed)
    result = run_command_line("replay-session", "b.mcap")
    assert result.exit_code == 1
    assert "target grip: recorded" in result.stdout


def test_replay_session_other_files_are_refused(run_failing: Callable[..., str], tmp_path: Path):
    (tmp_path / "a.mcap").write_bytes(b"no recording")
    assert "not a session" in run_failing("replay-session", "a.mcap")
    assert "cannot be read" in run_failing("replay-session", "missing.mcap")


@pytest.mark.slow  # it records six demonstrations
def test_mission_learns_and_keeps_a_skill(
    alignment_task: Task[Any], run_json: RunJson, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    first = run_json("mission", alignment_task.name, "--rtt", "0.1")
    again = run_json("mission", alignment_task.name, "--rtt", "0.1")
    assert "learned from 6 simulated demonstrations in" in first["skill"]
    assert " in " not in again["skill"].split("kept in")[0].replace("learned from", "")
    assert first["situations"] == again["situations"]
    assert first["succeeded"] == 1


@needs_renderer
@pytest.mark.slow  # it renders a film
def test_mission_film_has_an_image_per_period_of_motion(
    mission: list[str], run_json: RunJson, tmp_path: Path
):
    output = run_json(*mission, "--film", "a.webp")
    (situation,) = output["situations"]
    with Image.open(tmp_path / "a.webp") as film:
        moving = situation["session_seconds"] - situation["began"]
        assert film.n_frames == pytest.approx(moving / 0.1, abs=2)
