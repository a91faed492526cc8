"""pilotfish tasks lists what there is to do; pilotfish record writes showings that learn reads."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

from pilotfish.demonstrations import read_folder
from pilotfish.environments import TASKS, Task, Verdict
from pilotfish.station import recorder
from pilotfish.station.recorder import SHOWN, record, shown, simulated, situation
from pilotfish.store import open_skill

Runs = Callable[..., Result]
Facts = Callable[..., dict[str, Any]]
Refusal = Callable[..., str]


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_every_task_is_listed(facts: Facts, run: Runs):
    """Name, what it is and its frames, in a line of the text and as facts."""
    listed = facts("tasks")["tasks"]
    assert set(listed) == set(TASKS)
    lines = run("tasks").stdout.splitlines()[1:]
    for line, (name, task) in zip(lines, sorted(TASKS.items()), strict=True):
        assert listed[name] == {
            "about": task.about,
            "frames": list(task.frames),
            "unit": task.unit,
            "seconds": task.seconds,
        }
        assert line.startswith(f"{name} ")
        assert task.about in line
        assert line.endswith(", ".join(task.frames))


def test_showings_are_written_as_a_folder(lined_up: Path):
    """As many as were asked for, named and framed by the task, a row every tenth of a second."""
    demonstrations = read_folder(lined_up / "shown")
    assert [demo.name for demo in demonstrations] == [f"lining up {m}" for m in range(3)]
    for m, demo in enumerate(demonstrations):
        assert demo.period == 0.1
        assert [frame.name for frame in demo.frames] == ["before", "after"]
        where = situation(TASKS["valve"], SHOWN, 5, m)
        np.testing.assert_allclose(demo.frames[0].b[:3], where.valve.position, atol=1e-12)


def test_the_folder_is_what_check_and_learn_accept(lined_up: Path, facts: Facts):
    """Nothing in it is an error, and a skill was learned from it that knows where it comes from."""
    report = facts("data", "check", lined_up / "shown")
    assert len(report["demonstrations"]) == 3
    assert "error" not in {finding["severity"] for finding in report["findings"]}
    skill = open_skill(lined_up / "skill")
    assert skill.provenance.demonstrations == tuple(f"lining up {m}" for m in range(3))
    assert sorted(skill.frame_names) == ["after", "before"]


def test_the_same_seed_writes_the_same_files(
    lining_up: Task[Any], lined_up: Path, facts: Facts, tmp_path: Path, unchecked: None
):
    """Byte for byte; another seed writes others. The facts are of what is written."""
    ask = ["record", lining_up.name, "--demonstrations", "3"]
    told = facts(*ask, "--seed", "5", "--out", "again")
    assert contents(tmp_path / "again") == contents(lined_up / "shown")
    assert (told["folder"], told["task"], told["seed"]) == ("again", lining_up.name, 5)
    for fact, demo in zip(told["demonstrations"], read_folder(tmp_path / "again"), strict=True):
        assert (fact["name"], fact["rows"]) == (demo.name, len(demo.x))
        assert fact["seconds"] == pytest.approx((len(demo.x) - 1) * demo.period)
        assert 0.0 <= fact["error"] < 0.02
        assert fact["tries"] == 1
        assert fact["peaks"] == {"tool": 0.0}
    facts("record", lining_up.name, "--demonstrations", "1", "--seed", "6", "--out", "other")
    one, other = (read_folder(tmp_path / name)[0] for name in ("again", "other"))
    assert not np.array_equal(one.frames[0].b, other.frames[0].b)


def test_without_a_name_the_folder_is_named_after_the_task(
    lining_up: Task[Any], run: Runs, tmp_path: Path, unchecked: None
):
    """The answer says so, and a line a showing how it went; what is there is replaced by force alone."""
    ask = ["record", lining_up.name, "--demonstrations", "1"]
    result = run(*ask)
    assert (result.exit_code, result.stderr) == (0, "")
    head, line, _, last = result.stdout.splitlines()
    assert head.split() == ["name", "seconds", "rows", "error", "[m]", "largest", "force", "[N]", "tries"]
    assert line.split()[:3] == ["lining", "up", "0"]
    assert last == "written to lining up"
    first = contents(tmp_path / "lining up")
    assert run(*ask, "--seed", "1").exit_code == 1
    assert contents(tmp_path / "lining up") == first
    assert run(*ask, "--seed", "1", "--force").exit_code == 0
    assert contents(tmp_path / "lining up") != first


def test_a_showing_that_was_shown_again_says_so(
    lining_up: Task[Any], facts: Facts, monkeypatch: pytest.MonkeyPatch
):
    """tries counts them."""
    asked: list[None] = []

    def judge(*_: object) -> Verdict:
        asked.append(None)
        return Verdict(len(asked) == 3, 0.5)

    monkeypatch.setitem(TASKS, "tea", _short(lining_up, judge))
    told = facts("record", "tea", "--demonstrations", "1")
    assert [fact["tries"] for fact in told["demonstrations"]] == [3]


def _short(task: Task[Any], judge: Callable[..., Verdict]) -> Task[Any]:
    return replace(task, name="tea", seconds=0.3, judge=judge)


def test_a_showing_that_fails_always_leaves_no_folder(
    lining_up: Task[Any], refusal: Refusal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """One line says which, why and what to do."""
    monkeypatch.setitem(TASKS, "tea", _short(lining_up, lambda *_: Verdict(False, 0.5, "it is cold")))
    message = refusal("record", "tea", "--demonstrations", "2")
    assert "showing 0 of 'tea' failed 5 times, the last because it is cold" in message
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_is_refused_before_anything_is_shown(
    refusal: Refusal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A folder with something in it, a file, a place in a folder that is not there."""

    def nothing_is_shown(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr(recorder, "shown", nothing_is_shown)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter").write_text("dear")
    (tmp_path / "file").write_text("dear")
    assert "full exists; choose another name" in refusal("record", "valve", "--out", "full")
    assert "file exists; choose another name" in refusal("record", "valve", "--out", "file")
    assert "no/where cannot be written: no is no folder" in refusal("record", "valve", "--out", "no/where")


def test_a_task_that_is_none_is_told_those_that_are(refusal: Refusal):
    """Every name there is stands in the message."""
    message = refusal("record", "tea")
    assert f"there is no task 'tea', expected one of {', '.join(sorted(TASKS))}" in message


@pytest.mark.parametrize("option", [["--demonstrations", "0"], ["--seed", "-1"], ["--demonstrations", "two"]])
def test_numbers_that_mean_nothing_are_misuse(run: Runs, option: list[str]):
    """Exit code 2, and nothing is shown."""
    result = run("record", "valve", *option)
    assert result.exit_code == 2
    assert option[0] in result.stderr


@pytest.mark.parametrize(
    "line",
    [["tasks"], ["record", "valve"], ["perform", "any.skill", "--task", "valve"]],
    ids=lambda line: line[0],
)
def test_without_mujoco_the_extra_is_named(
    refusal: Refusal, monkeypatch: pytest.MonkeyPatch, line: list[str]
):
    """One line says what to install."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert refusal(*line) == "Error: simulation needs mujoco: pip install 'pilotfish[sim]'\n"


def test_the_command_records_what_the_function_does(lining_up: Task[Any], lined_up: Path, unchecked: None):
    """The folder holds the rows of shown, and those of its person recorded alone, to the last bit."""
    read = read_folder(lined_up / "shown")
    made = [recording.demonstration for recording, _ in shown(lining_up, 3, 5)]
    where = situation(lining_up, SHOWN, 5, 2)
    leader = simulated(lining_up, where, recorder.PERSON, np.random.default_rng([5, SHOWN, 2, 0]))
    for one, other in zip(
        [*read, read[2]], [*made, record(lining_up, where, leader, "x").demonstration], strict=True
    ):
        np.testing.assert_array_equal(one.x, other.x)
