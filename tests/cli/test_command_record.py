"""pilotfish tasks and pilotfish record: simulated demonstrations."""

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
from pilotfish.simulation import recording
from pilotfish.simulation.recording import (
    record,
    record_demonstrations,
    simulated_leader,
    situation_from_seed,
)

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]


def file_contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_tasks_lists_every_task(run_json: RunJson, run_command_line: RunCommand):
    listed = run_json("tasks")["tasks"]
    assert set(listed) == set(TASKS)
    lines = run_command_line("tasks").stdout.splitlines()[1:]
    for line, (name, task) in zip(lines, sorted(TASKS.items()), strict=True):
        assert listed[name] == {
            "description": task.description,
            "frames": list(task.frames),
            "unit": task.unit,
            "time_limit": task.time_limit,
        }
        assert line.startswith(f"{name} ")
        assert task.description in line
        assert line.endswith(", ".join(task.frames))


def test_record_writes_named_and_framed_demonstrations(alignment_skill: Path):
    demonstrations = read_demonstrations(alignment_skill / "demonstrations")
    assert [demo.name for demo in demonstrations] == [f"lining up {m}" for m in range(3)]
    for m, demo in enumerate(demonstrations):
        assert demo.period == 0.1
        assert [frame.name for frame in demo.frames] == ["before", "after"]
        where = situation_from_seed(TASKS["valve"], "demonstration", 5, m)
        np.testing.assert_allclose(demo.frames[0].b[:3], where.valve.position, atol=1e-12)


def test_recorded_folder_passes_check_and_learn(alignment_skill: Path, run_json: RunJson):
    report = run_json("data", "check", alignment_skill / "demonstrations")
    assert len(report["demonstrations"]) == 3
    assert "error" not in {finding["severity"] for finding in report["diagnostics"]}
    skill = open_skill(alignment_skill / "skill")
    assert skill.provenance.demonstrations == tuple(f"lining up {m}" for m in range(3))
    assert sorted(skill.frame_names) == ["after", "before"]


def test_record_same_seed_writes_same_files(
    alignment_task: Task[Any], alignment_skill: Path, run_json: RunJson, tmp_path: Path, unchecked: None
):
    command = ["record", alignment_task.name, "--demonstrations", "3"]
    output = run_json(*command, "--seed", "5", "--out", "again")
    assert file_contents(tmp_path / "again") == file_contents(alignment_skill / "demonstrations")
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


def test_record_default_folder_is_task_name(
    alignment_task: Task[Any], run_command_line: RunCommand, tmp_path: Path, unchecked: None
):
    command = ["record", alignment_task.name, "--demonstrations", "1"]
    result = run_command_line(*command)
    assert (result.exit_code, result.stderr) == (0, "")
    head, line, _, last = result.stdout.splitlines()
    assert head.split() == [
        "name",
        "duration",
        "[s]",
        "steps",
        "error",
        "[m]",
        "peak",
        "force",
        "[N]",
        "attempts",
    ]
    assert line.split()[:3] == ["lining", "up", "0"]
    assert last == "written to lining up"
    first = file_contents(tmp_path / "lining up")
    assert run_command_line(*command, "--seed", "1").exit_code == 1
    assert file_contents(tmp_path / "lining up") == first
    assert run_command_line(*command, "--seed", "1", "--force").exit_code == 0
    assert file_contents(tmp_path / "lining up") != first


def test_record_repeated_demonstration_counts_attempts(
    alignment_task: Task[Any], run_json: RunJson, monkeypatch: pytest.MonkeyPatch
):
    asked: list[None] = []

    def check_success(*_: object) -> Outcome:
        asked.append(None)
        return Outcome(len(asked) == 3, 0.5)

    monkeypatch.setitem(TASKS, "tea", _short(alignment_task, check_success))
    output = run_json("record", "tea", "--demonstrations", "1")
    assert [fact["attempts"] for fact in output["demonstrations"]] == [3]


def _short(task: Task[Any], check_success: Callable[..., Outcome]) -> Task[Any]:
    return replace(task, name="tea", time_limit=0.3, check_success=check_success)


def test_record_repeated_failure_leaves_no_folder(
    alignment_task: Task[Any], run_failing: RunFailing, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(TASKS, "tea", _short(alignment_task, lambda *_: Outcome(False, 0.5, "it is cold")))
    message = run_failing("record", "tea", "--demonstrations", "2")
    assert "demonstration 0 of 'tea' failed 5 times, the last time because it is cold" in message
    assert list(tmp_path.iterdir()) == []


def test_record_unwritable_folder_is_rejected_before_work(
    run_failing: RunFailing, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):

    def raise_assertion(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr(recording, "record_demonstrations", raise_assertion)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter").write_text("existing")
    (tmp_path / "file").write_text("existing")
    assert "full exists; choose another name" in run_failing("record", "valve", "--out", "full")
    assert "file exists; choose another name" in run_failing("record", "valve", "--out", "file")
    assert "no/where cannot be written: no is not a folder" in run_failing(
        "record", "valve", "--out", "no/where"
    )


def test_record_unknown_task_lists_tasks(run_failing: RunFailing):
    message = run_failing("record", "tea")
    assert f"task 'tea' is unknown, expected one of {', '.join(sorted(TASKS))}" in message


@pytest.mark.parametrize("option", [["--demonstrations", "0"], ["--seed", "-1"], ["--demonstrations", "two"]])
def test_record_invalid_numbers_are_usage_errors(run_command_line: RunCommand, option: list[str]):
    result = run_command_line("record", "valve", *option)
    assert result.exit_code == 2
    assert option[0] in result.stderr


@pytest.mark.parametrize(
    "line",
    [
        ["tasks"],
        ["record", "valve"],
        ["perform", "any.skill", "--task", "valve"],
        ["drive", "any.skill", "--task", "valve"],
    ],
    ids=lambda line: line[0],
)
def test_without_mujoco_extra_is_named(
    run_failing: RunFailing, monkeypatch: pytest.MonkeyPatch, line: list[str]
):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert run_failing(*line) == "Error: simulation needs mujoco: pip install '.[sim]' in the clone\n"


def test_record_command_equals_function(alignment_task: Task[Any], alignment_skill: Path, unchecked: None):
    from_command = read_demonstrations(alignment_skill / "demonstrations")
    from_function = [recorded.demonstration for recorded, _ in record_demonstrations(alignment_task, 3, 5)]
    situation = situation_from_seed(alignment_task, "demonstration", 5, 2)
    rng = np.random.default_rng([5, recording.SPLITS["demonstration"], 2, 0])
    leader = simulated_leader(alignment_task, situation, recording.DEFAULT_HUMAN, rng)
    single = record(alignment_task, situation, leader, "x").demonstration
    for actual, expected in zip([*from_command, single], [*from_function, from_function[2]], strict=True):
        np.testing.assert_array_equal(actual.x, expected.x)
