"""pilotfish tasks lists what there is to do; pilotfish record writes showings that learn reads."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

from pilotfish.environments import TASKS, Outcome, Task
from pilotfish.io.demonstration_folder import read_demonstrations
from pilotfish.io.skill_file import open_skill
from pilotfish.simulation import recording as recorder
from pilotfish.simulation.recording import (
    record,
    shown,
    simulated_leader,
    situation_from_seed,
)

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]


def file_contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_every_task_is_listed(run_json: RunJson, run_command_line: RunCommand):
    """Name, what it is and its frames, in a line of the text and as facts."""
    listed = run_json("tasks")["tasks"]
    assert set(listed) == set(TASKS)
    lines = run_command_line("tasks").stdout.splitlines()[1:]
    for line, (name, task) in zip(lines, sorted(TASKS.items()), strict=True):
        assert listed[name] == {
            "about": task.description,
            "frames": list(task.frames),
            "unit": task.unit,
            "seconds": task.time_limit,
        }
        assert line.startswith(f"{name} ")
        assert task.description in line
        assert line.endswith(", ".join(task.frames))


def test_showings_are_written_as_a_folder(alignment_skill: Path):
    """As many as were asked for, named and framed by the task, a row every tenth of a second."""
    demonstrations = read_demonstrations(alignment_skill / "shown")
    assert [demo.name for demo in demonstrations] == [f"lining up {m}" for m in range(3)]
    for m, demo in enumerate(demonstrations):
        assert demo.period == 0.1
        assert [frame.name for frame in demo.frames] == ["before", "after"]
        where = situation_from_seed(TASKS["valve"], "demonstration", 5, m)
        np.testing.assert_allclose(demo.frames[0].b[:3], where.valve.position, atol=1e-12)


def test_the_folder_is_what_check_and_learn_accept(alignment_skill: Path, run_json: RunJson):
    """Nothing in it is an error, and a skill was learned from it that knows where it comes from."""
    report = run_json("data", "check", alignment_skill / "shown")
    assert len(report["demonstrations"]) == 3
    assert "error" not in {finding["severity"] for finding in report["diagnostics"]}
    skill = open_skill(alignment_skill / "skill")
    assert skill.provenance.demonstrations == tuple(f"lining up {m}" for m in range(3))
    assert sorted(skill.frame_names) == ["after", "before"]


def test_the_same_seed_writes_the_same_files(
    alignment_task: Task[Any], alignment_skill: Path, run_json: RunJson, tmp_path: Path, unchecked: None
):
    """Byte for byte; another seed writes others. The facts are of what is written."""
    ask = ["record", alignment_task.name, "--demonstrations", "3"]
    output = run_json(*ask, "--seed", "5", "--out", "again")
    assert file_contents(tmp_path / "again") == file_contents(alignment_skill / "shown")
    assert (output["folder"], output["task"], output["seed"]) == ("again", alignment_task.name, 5)
    for fact, demo in zip(output["demonstrations"], read_demonstrations(tmp_path / "again"), strict=True):
        assert (fact["name"], fact["steps"]) == (demo.name, len(demo.x))
        assert fact["seconds"] == pytest.approx((len(demo.x) - 1) * demo.period)
        assert 0.0 <= fact["error"] < 0.02
        assert fact["attempts"] == 1
        assert fact["peak_forces"] == {"tool": 0.0}
    run_json("record", alignment_task.name, "--demonstrations", "1", "--seed", "6", "--out", "other")
    one, other = (read_demonstrations(tmp_path / name)[0] for name in ("again", "other"))
    assert not np.array_equal(one.frames[0].b, other.frames[0].b)


def test_without_a_name_the_folder_is_named_after_the_task(
    alignment_task: Task[Any], run_command_line: RunCommand, tmp_path: Path, unchecked: None
):
    """The answer says so, and a line a showing how it went; what is there is replaced by force alone."""
    ask = ["record", alignment_task.name, "--demonstrations", "1"]
    result = run_command_line(*ask)
    assert (result.exit_code, result.stderr) == (0, "")
    head, line, _, last = result.stdout.splitlines()
    assert head.split() == ["name", "seconds", "steps", "error", "[m]", "largest", "force", "[N]", "attempts"]
    assert line.split()[:3] == ["lining", "up", "0"]
    assert last == "written to lining up"
    first = file_contents(tmp_path / "lining up")
    assert run_command_line(*ask, "--seed", "1").exit_code == 1
    assert file_contents(tmp_path / "lining up") == first
    assert run_command_line(*ask, "--seed", "1", "--force").exit_code == 0
    assert file_contents(tmp_path / "lining up") != first


def test_a_showing_that_was_shown_again_says_so(
    alignment_task: Task[Any], run_json: RunJson, monkeypatch: pytest.MonkeyPatch
):
    """Tries counts them."""
    asked: list[None] = []

    def check_success(*_: object) -> Outcome:
        asked.append(None)
        return Outcome(len(asked) == 3, 0.5)

    monkeypatch.setitem(TASKS, "tea", _short(alignment_task, check_success))
    output = run_json("record", "tea", "--demonstrations", "1")
    assert [fact["attempts"] for fact in output["demonstrations"]] == [3]


def _short(task: Task[Any], check_success: Callable[..., Outcome]) -> Task[Any]:
    return replace(task, name="tea", time_limit=0.3, check_success=check_success)


def test_a_showing_that_fails_always_leaves_no_folder(
    alignment_task: Task[Any], run_failing: RunFailing, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """One line says which, why and what to do."""
    monkeypatch.setitem(TASKS, "tea", _short(alignment_task, lambda *_: Outcome(False, 0.5, "it is cold")))
    message = run_failing("record", "tea", "--demonstrations", "2")
    assert "showing 0 of 'tea' failed 5 times, the last because it is cold" in message
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_is_refused_before_anything_is_shown(
    run_failing: RunFailing, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A folder with something in it, a file, a place in a folder that is not there."""

    def nothing_is_shown(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr(recorder, "record_demonstrations", nothing_is_shown)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter").write_text("dear")
    (tmp_path / "file").write_text("dear")
    assert "full exists; choose another name" in run_failing("record", "valve", "--out", "full")
    assert "file exists; choose another name" in run_failing("record", "valve", "--out", "file")
    assert "no/where cannot be written: no is no folder" in run_failing(
        "record", "valve", "--out", "no/where"
    )


def test_a_task_that_is_none_is_told_those_that_are(run_failing: RunFailing):
    """Every name there is stands in the message."""
    message = run_failing("record", "tea")
    assert f"there is no task 'tea', expected one of {', '.join(sorted(TASKS))}" in message


@pytest.mark.parametrize("option", [["--demonstrations", "0"], ["--seed", "-1"], ["--demonstrations", "two"]])
def test_numbers_that_mean_nothing_are_misuse(run_command_line: RunCommand, option: list[str]):
    """Exit code 2, and nothing is shown."""
    result = run_command_line("record", "valve", *option)
    assert result.exit_code == 2
    assert option[0] in result.stderr


@pytest.mark.parametrize(
    "line",
    [["tasks"], ["record", "valve"], ["perform", "any.skill", "--task", "valve"]],
    ids=lambda line: line[0],
)
def test_without_mujoco_the_extra_is_named(
    run_failing: RunFailing, monkeypatch: pytest.MonkeyPatch, line: list[str]
):
    """One line says what to install."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert run_failing(*line) == "Error: simulation needs mujoco: pip install 'pilotfish[sim]'\n"


def test_the_command_records_what_the_function_does(
    alignment_task: Task[Any], alignment_skill: Path, unchecked: None
):
    """The folder holds the rows of shown, and those of its person recorded alone, to the last bit."""
    read = read_demonstrations(alignment_skill / "shown")
    made = [recording.demonstration for recording, _ in shown(alignment_task, 3, 5)]
    where = situation_from_seed(alignment_task, "demonstration", 5, 2)
    leader = simulated_leader(
        alignment_task,
        where,
        recorder.DEFAULT_HUMAN,
        np.random.default_rng([5, recorder.SPLITS["demonstration"], 2, 0]),
    )
    for one, other in zip(
        [*read, read[2]], [*made, record(alignment_task, where, leader, "x").demonstration], strict=True
    ):
        np.testing.assert_array_equal(one.x, other.x)
