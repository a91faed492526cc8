"""pilotfish perform carries a skill out in physics, tells how it went, and films it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from drawing import needs_renderer
from PIL import Image

from pilotfish.environments import TASKS, Task
from pilotfish.station import execution
from pilotfish.station.execution import execute
from pilotfish.station.following import steps_shown
from pilotfish.station.recorder import UNSEEN, situation
from pilotfish.store import open_skill

Runs = Callable[..., Result]
Facts = Callable[..., dict[str, Any]]
Refusal = Callable[..., str]


@pytest.fixture
def perform(lined_up: Path, lining_up: Task[Any]) -> list[str]:
    """What one types."""
    return ["perform", str(lined_up / "skill"), "--task", lining_up.name]


def test_facts_are_those_of_the_executions(
    perform: list[str], lining_up: Task[Any], lined_up: Path, facts: Facts
):
    """Situation for situation, of the unseen ones of the seed: what execute finds is what is told."""
    told = facts(*perform, "--situations", "2", "--seed", "3")
    skill = open_skill(lined_up / "skill")
    assert len(told["situations"]) == 2
    for n, fact in enumerate(told["situations"]):
        made = execute(skill, lining_up, situation(lining_up, UNSEEN, 3, n))
        assert fact == {
            "success": made.verdict.success,
            "error": made.verdict.error,
            "why": made.verdict.why,
            "peaks": made.peaks,
            "seconds": made.seconds,
        }
    assert told["succeeded"] == sum(fact["success"] for fact in told["situations"])
    assert (told["unit"], told["film"]) == ("m", None)


def test_people_are_told_how_many_succeeded(perform: list[str], run: Runs, unchecked: None):
    """How many of how many, errors with their unit, forces and times; nothing on stderr. Exit code 0."""
    result = run(*perform, "--situations", "2")
    assert (result.exit_code, result.stderr) == (0, "")
    lines = [line.split("  ") for line in result.stdout.splitlines()]
    told = {line[0]: line[-1].strip() for line in lines}
    assert told["succeeded"] == "2 of 2"
    assert told["error, largest"].endswith(" m")
    assert told["largest force, median"] == "0.0 N"
    assert told["time, median"].endswith(" s")


def test_failures_are_named_with_their_reason(perform: list[str], run: Runs, facts: Facts, unchecked: None):
    """A skill that is carried out too softly to arrive has exit code 0 all the same."""
    soft = [*perform, "--situations", "1", "--effort", "1e6"]
    result = run(*soft)
    assert result.exit_code == 0
    assert "0 of 1" in result.stdout
    (fact,) = facts(*soft)["situations"]
    assert not fact["success"]
    assert fact["why"]
    assert f"situation 0: {fact['why']}" in result.stdout.splitlines()


@needs_renderer
@pytest.mark.parametrize("ending", [".webp", ".gif"])
def test_a_film_shows_the_first_situation(
    perform: list[str], lined_up: Path, facts: Facts, tmp_path: Path, ending: str, unchecked: None
):
    """It opens, has a frame for each period, each shown as long as that took, and they differ."""
    name = f"film{ending}"
    told = facts(*perform, "--situations", "2", "--film", name)
    skill = open_skill(lined_up / "skill")
    periods = steps_shown(skill) - 1 + 10
    assert told["film"] == name
    with Image.open(tmp_path / name) as film:
        assert film.n_frames == periods
        assert film.size == (480, 360)
        film.seek(0)
        first = np.asarray(film.convert("RGB"))
        assert film.info["duration"] == 100
        film.seek(periods // 2)
        assert not np.array_equal(first, np.asarray(film.convert("RGB")))


@needs_renderer
def test_a_film_is_replaced_by_force_alone(
    perform: list[str], refusal: Refusal, facts: Facts, tmp_path: Path, unchecked: None
):
    """What stands at the path stays, and nothing is carried out in vain."""
    (tmp_path / "film.webp").write_bytes(b"dear")
    ask = [*perform, "--situations", "1", "--film", "film.webp"]
    assert "film.webp exists; choose another name, or replace it with --force" in refusal(*ask)
    assert (tmp_path / "film.webp").read_bytes() == b"dear"
    facts(*ask, "--force")
    assert (tmp_path / "film.webp").read_bytes().startswith(b"RIFF")


@pytest.mark.parametrize(
    ("option", "told"),
    [
        (["--film", "film.mp4"], "ends in '.mp4', expected .webp or .gif"),
        (["--effort", "0"], "--effort"),
        (["--effort", "nan"], "finite"),
        (["--slack", "-1"], "--slack"),
        (["--situations", "0"], "--situations"),
        (["--seed", "-1"], "--seed"),
        (["--dressed"], "name one: --film FILE"),
    ],
)
def test_misuse_is_told_before_the_work(
    perform: list[str], run: Runs, monkeypatch: pytest.MonkeyPatch, option: list[str], told: str
):
    """Exit code 2, the option is named, and nothing is carried out."""
    monkeypatch.setattr(execution, "execute", None)
    result = run(*perform, *option)
    assert (result.exit_code, result.stdout) == (2, "")
    assert told in " ".join(result.stderr.split())


def test_a_film_is_not_written_over_the_skill(perform: list[str], run: Runs, lined_up: Path, tmp_path: Path):
    """Force or not."""
    (tmp_path / "skill.webp").write_bytes((lined_up / "skill").read_bytes())
    result = run("perform", "skill.webp", "--task", "lining up", "--film", "skill.webp", "--force")
    assert result.exit_code == 2
    assert "is what this command reads" in result.stderr


def test_what_cannot_be_carried_out_is_refused(perform: list[str], skill: Path, refusal: Refusal):
    """No task, no skill, a skill of something else, a film in a folder that is not there: one line each."""
    names = ", ".join(sorted(TASKS))
    assert f"no task 'tea', expected one of {names}" in refusal(*perform[:3], "tea")
    assert "nothing.skill" in refusal("perform", "nothing.skill", "--task", "valve")
    assert "task 'valve' needs position x" in refusal("perform", skill, "--task", "valve")
    assert "learn it from pilotfish record stab" in refusal("perform", skill, "--task", "stab")
    assert "no/film.webp cannot be written: no is no folder" in refusal(*perform, "--film", "no/film.webp")
