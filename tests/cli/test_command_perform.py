"""pilotfish perform carries a skill out in physics, tells how it went, and films it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from drawing import needs_renderer
from PIL import Image

from pilotfish import simulation
from pilotfish.environments import TASKS, Task
from pilotfish.io.skill_file import open_skill
from pilotfish.planning.reproduction import mean_demonstration_length
from pilotfish.simulation import situation_from_seed

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]


@pytest.fixture
def perform(alignment_skill: Path, alignment_task: Task[Any]) -> list[str]:
    """What one types."""
    return ["perform", str(alignment_skill / "skill"), "--task", alignment_task.name]


def test_facts_are_those_of_the_executions(
    perform: list[str], alignment_task: Task[Any], alignment_skill: Path, run_json: RunJson
):
    """Situation for situation, of the unseen ones of the seed: what perform finds is what is told."""
    output = run_json(*perform, "--situations", "2", "--seed", "3")
    skill = open_skill(alignment_skill / "skill")
    assert len(output["situations"]) == 2
    for n, fact in enumerate(output["situations"]):
        made = simulation.perform(skill, alignment_task, situation_from_seed(alignment_task, "test", 3, n))
        assert fact == {
            "success": made.outcome.success,
            "error": made.outcome.error,
            "reason": made.outcome.reason,
            "peak_forces": made.peak_forces,
            "seconds": made.duration,
        }
    assert output["succeeded"] == sum(fact["success"] for fact in output["situations"])
    assert (output["unit"], output["film"]) == ("m", None)


def test_people_are_told_how_many_succeeded(
    perform: list[str], run_command_line: RunCommand, unchecked: None
):
    """How many of how many, errors with their unit, forces and times; nothing on stderr. Exit code 0."""
    result = run_command_line(*perform, "--situations", "2")
    assert (result.exit_code, result.stderr) == (0, "")
    lines = [line.split("  ") for line in result.stdout.splitlines()]
    output = {line[0]: line[-1].strip() for line in lines}
    assert output["succeeded"] == "2 of 2"
    assert output["error, largest"].endswith(" m")
    assert output["largest force, median"] == "0.0 N"
    assert output["time, median"].endswith(" s")


def test_failures_are_named_with_their_reason(
    perform: list[str], run_command_line: RunCommand, run_json: RunJson, unchecked: None
):
    """A skill that is carried out too softly to arrive has exit code 0 all the same."""
    soft = [*perform, "--situations", "1", "--control-cost", "1e6"]
    result = run_command_line(*soft)
    assert result.exit_code == 0
    assert "0 of 1" in result.stdout
    (fact,) = run_json(*soft)["situations"]
    assert not fact["success"]
    assert fact["reason"]
    assert f"situation 0: {fact['why']}" in result.stdout.splitlines()


@needs_renderer
@pytest.mark.parametrize("ending", [".webp", ".gif"])
def test_a_film_shows_the_first_situation(
    perform: list[str], alignment_skill: Path, run_json: RunJson, tmp_path: Path, ending: str, unchecked: None
):
    """It opens, has a frame for each period, each shown as long as that took, and they differ."""
    name = f"film{ending}"
    output = run_json(*perform, "--situations", "2", "--film", name)
    skill = open_skill(alignment_skill / "skill")
    periods = mean_demonstration_length(skill) - 1 + 10
    assert output["film"] == name
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
    perform: list[str], run_failing: RunFailing, run_json: RunJson, tmp_path: Path, unchecked: None
):
    """What stands at the path stays, and nothing is carried out in vain."""
    (tmp_path / "film.webp").write_bytes(b"dear")
    ask = [*perform, "--situations", "1", "--film", "film.webp"]
    assert "film.webp exists; choose another name, or replace it with --force" in run_failing(*ask)
    assert (tmp_path / "film.webp").read_bytes() == b"dear"
    run_json(*ask, "--force")
    assert (tmp_path / "film.webp").read_bytes().startswith(b"RIFF")


@pytest.mark.parametrize(
    ("option", "told"),
    [
        (["--film", "film.mp4"], "ends in '.mp4', expected .webp or .gif"),
        (["--control-cost", "0"], "--control-cost"),
        (["--control-cost", "nan"], "finite"),
        (["--covariance-regularisation", "-1"], "--covariance-regularisation"),
        (["--situations", "0"], "--situations"),
        (["--seed", "-1"], "--seed"),
        (["--meshes"], "name one: --film FILE"),
    ],
)
def test_misuse_is_told_before_the_work(
    perform: list[str],
    run_command_line: RunCommand,
    monkeypatch: pytest.MonkeyPatch,
    option: list[str],
    output: str,
):
    """Exit code 2, the option is named, and nothing is carried out."""
    monkeypatch.setattr(simulation, "perform", None)
    result = run_command_line(*perform, *option)
    assert (result.exit_code, result.stdout) == (2, "")
    assert output in " ".join(result.stderr.split())


def test_a_film_is_not_written_over_the_skill(
    perform: list[str], run_command_line: RunCommand, alignment_skill: Path, tmp_path: Path
):
    """Force or not."""
    (tmp_path / "skill.webp").write_bytes((alignment_skill / "skill").read_bytes())
    result = run_command_line(
        "perform", "skill.webp", "--task", "lining up", "--film", "skill.webp", "--force"
    )
    assert result.exit_code == 2
    assert "is what this command reads" in result.stderr


def test_what_cannot_be_carried_out_is_refused(perform: list[str], skill: Path, run_failing: RunFailing):
    """No task, no skill, a skill of something else, a film in a folder that is not there: one line each."""
    names = ", ".join(sorted(TASKS))
    assert f"no task 'tea', expected one of {names}" in run_failing(*perform[:3], "tea")
    assert "nothing.skill" in run_failing("perform", "nothing.skill", "--task", "valve")
    assert "task 'valve' needs position x" in run_failing("perform", skill, "--task", "valve")
    assert "learn it from pilotfish record stab" in run_failing("perform", skill, "--task", "stab")
    assert "no/film.webp cannot be written: no is no folder" in run_failing(
        *perform, "--film", "no/film.webp"
    )
