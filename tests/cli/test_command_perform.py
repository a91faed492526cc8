"""pilotfish perform: execution, summary and film."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from drawing import needs_renderer
from PIL import Image

from pilotfish import simulation
from pilotfish.cli.output.attempts import ADVICE
from pilotfish.cli.output.motion_notes import option_name
from pilotfish.environments import TASKS, Failure, Outcome, Phase, Task
from pilotfish.io.skill_file import open_skill
from pilotfish.planning import motion_notes
from pilotfish.planning.reproduction import mean_demonstration_length
from pilotfish.simulation import ExecutionResult, situation_from_seed

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]


@pytest.fixture
def perform(alignment_skill: Path, alignment_task: Task[Any]) -> list[str]:
    """Arguments of the command line without options."""
    return ["perform", str(alignment_skill / "skill"), "--task", alignment_task.name]


@pytest.mark.usefixtures("unchecked")
def test_perform_json_equals_executions(
    perform: list[str], alignment_task: Task[Any], alignment_skill: Path, run_json: RunJson
):
    output = run_json(*perform, "--situations", "2", "--seed", "3")
    skill = open_skill(alignment_skill / "skill")
    assert len(output["situations"]) == 2
    for n, fact in enumerate(output["situations"]):
        made = simulation.perform(skill, alignment_task, situation_from_seed(alignment_task, "test", 3, n))
        assert fact == {
            "seed": 3,
            "situation": n,
            "success": made.outcome.success,
            "error": made.outcome.error,
            "reason": made.outcome.reason,
            "failure": None,
            "peak_forces": made.peak_forces,
            "seconds": made.duration,
        }
    assert output["succeeded"] == sum(fact["success"] for fact in output["situations"])
    assert output["succeeded_by_seed"] == {"3": output["succeeded"]}
    assert (output["unit"], output["film"], output["advice"], output["failures"]) == ("m", None, None, [])
    motion, at = simulation.plan_in_situation(
        skill, alignment_task, situation_from_seed(alignment_task, "test", 3, 0)
    )
    assert output["notes"] == list(motion_notes(skill, motion, at, name_argument=option_name))


def test_perform_notes_of_a_short_horizon_name_the_option(
    perform: list[str], run_command_line: RunCommand, run_json: RunJson, unchecked: None
):
    arguments = [*perform, "--situations", "1", "--horizon", "5"]
    (note,) = [note for note in run_json(*arguments)["notes"] if "the motion has 5 steps" in note]
    assert "--horizon" in note
    assert f"note, situation 0: {note}" in run_command_line(*arguments).stderr


def test_perform_text_counts_successes(perform: list[str], run_command_line: RunCommand, unchecked: None):
    result = run_command_line(*perform, "--situations", "2")
    assert result.exit_code == 0
    assert all(line.startswith("note, situation 0: ") for line in result.stderr.splitlines())
    lines = [line.split("  ") for line in result.stdout.splitlines()]
    output = {line[0]: line[-1].strip() for line in lines}
    assert output["result"] == "2 of 2 succeeded"
    assert output["error, maximum"].endswith(" m")
    assert output["peak force, median"] == "0.0 N"
    assert output["duration, median"].endswith(" s")


def test_perform_failures_have_reasons_and_exit_code_0(
    perform: list[str], run_command_line: RunCommand, run_json: RunJson, unchecked: None
):
    soft = [*perform, "--situations", "1", "--control-cost", "1e6"]
    result = run_command_line(*soft)
    assert result.exit_code == 0
    assert "0 of 1 succeeded" in result.stdout
    assert "try: learn again with more --states" in result.stdout
    (fact,) = run_json(*soft)["situations"]
    assert not fact["success"]
    assert fact["reason"]
    assert f"situation 0: {fact['reason']}" in result.stdout.splitlines()


def outcomes(monkeypatch: pytest.MonkeyPatch, failures: dict[tuple[int, int], Failure]) -> None:
    """Replace the executions by failures in some situations, given by seed and number, else successes."""

    def execute(skill: object, task: object, situation: tuple[int, int], **_: object) -> ExecutionResult:
        failure = failures.get(situation)
        outcome = Outcome(failure is None, 0.01, failure.detail if failure else "")
        rows = np.zeros((3, 7))
        return ExecutionResult(outcome, rows, rows, rows[:, 0], {"tool": 1.0}, 2.0, {}, {}, failure)

    monkeypatch.setattr(simulation, "perform", execute)
    sample, plan = simulation.situation_from_seed, simulation.plan_in_situation
    monkeypatch.setattr(
        simulation,
        "plan_in_situation",
        lambda skill, task, key, **options: plan(skill, task, sample(task, "test", *key), **options),
    )
    monkeypatch.setattr(simulation, "situation_from_seed", lambda task, kind, *key: key)


def test_perform_seeds_print_spread(
    perform: list[str], run_command_line: RunCommand, run_json: RunJson, monkeypatch: pytest.MonkeyPatch
):
    drop = Failure(Phase.MOTION, "dropped on the way", "it fell")
    aside = Failure(Phase.GOAL, "put down aside", "it lies 34 mm aside")
    outcomes(monkeypatch, {(5, 0): drop, (5, 2): drop, (7, 1): aside})
    command = [*perform, "--situations", "3", "--seeds", "3", "--seed", "5"]
    lines = run_command_line(*command).stdout.splitlines()
    rows = [line.split(maxsplit=1) for line in lines]
    assert ["result", "6 of 9 succeeded"] in rows
    assert "each seed           1, 3, 2 of 3 succeeded" in lines
    assert "over seeds          1 to 3, median 2 of 3" in lines
    assert ["2", "dropped on the way  motion"] in rows
    assert ["1", "put down aside      goal"] in rows
    assert "seed 5, situation 2: dropped on the way: it fell" in lines
    assert "seed 7, situation 1: put down aside: it lies 34 mm aside" in lines
    assert [line for line in lines if line.startswith("try: ")] == [f"try: {ADVICE['motion']}"]
    output = run_json(*command)
    assert output["succeeded_by_seed"] == {"5": 1, "6": 3, "7": 2}
    assert output["failures"][0] == {"phase": "motion", "summary": "dropped on the way", "count": 2}
    assert [(fact["seed"], fact["situation"]) for fact in output["situations"][2:4]] == [(5, 2), (6, 0)]


def test_advice_covers_every_phase():
    assert ADVICE.keys() == {phase.value for phase in Phase}


def test_perform_situation_executes_only_this_one(
    perform: list[str], run_json: RunJson, alignment_task: Task[Any], alignment_skill: Path, unchecked: None
):
    (fact,) = run_json(*perform, "--situation", "2", "--seed", "4")["situations"]
    skill = open_skill(alignment_skill / "skill")
    made = simulation.perform(skill, alignment_task, situation_from_seed(alignment_task, "test", 4, 2))
    assert (fact["seed"], fact["situation"], fact["error"]) == (4, 2, made.outcome.error)


@needs_renderer
@pytest.mark.parametrize("ending", [".webp", ".gif"])
def test_film_has_one_frame_per_period(
    perform: list[str], alignment_skill: Path, run_json: RunJson, tmp_path: Path, ending: str, unchecked: None
):
    name = f"film{ending}"
    output = run_json(*perform, "--situations", "2", "--film", name)
    skill = open_skill(alignment_skill / "skill")
    periods = mean_demonstration_length(skill) - 1 + 10
    assert output["film"] == name
    with Image.open(tmp_path / name) as film:
        assert film.n_frames == periods
        assert film.size == (720, 540)
        film.seek(0)
        first = np.asarray(film.convert("RGB"))
        assert film.info["duration"] == 100
        film.seek(periods // 2)
        assert not np.array_equal(first, np.asarray(film.convert("RGB")))


@needs_renderer
def test_film_shows_chosen_situation_and_outcome(
    perform: list[str], run_json: RunJson, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unchecked: None
):
    captions: list[dict[str, Any]] = []
    draw = simulation.caption_images

    def record_caption(*arguments: Any, **caption: Any) -> Any:
        captions.append(caption)
        return draw(*arguments, **caption)

    monkeypatch.setattr(simulation, "caption_images", record_caption)
    run_json(*perform, "--situation", "3", "--seed", "1", "--film", "film.webp", "--control-cost", "1e6")
    title = "lining up, situation 3, seed 1"
    assert captions == [{"title": title, "outcome": "failed: not done", "success": False}]
    assert (tmp_path / "film.webp").stat().st_size > 1000


@needs_renderer
def test_film_existing_is_replaced_only_with_force(
    perform: list[str], run_failing: RunFailing, run_json: RunJson, tmp_path: Path, unchecked: None
):
    (tmp_path / "film.webp").write_bytes(b"existing")
    command = [*perform, "--situations", "1", "--film", "film.webp"]
    assert "film.webp exists; choose another name, or replace it with --force" in run_failing(*command)
    assert (tmp_path / "film.webp").read_bytes() == b"existing"
    run_json(*command, "--force")
    assert (tmp_path / "film.webp").read_bytes().startswith(b"RIFF")


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--film", "film.mp4"], "ends in '.mp4', expected .webp or .gif"),
        (["--control-cost", "0"], "--control-cost"),
        (["--control-cost", "nan"], "finite"),
        (["--covariance-regularisation", "-1"], "--covariance-regularisation"),
        (["--situations", "0"], "--situations"),
        (["--seed", "-1"], "--seed"),
        (["--seeds", "0"], "--seeds"),
        (["--situation", "-1"], "--situation"),
        (["--situation", "1", "--seeds", "2"], "omit --seeds"),
        (["--situation", "1", "--situations", "2"], "omit --situations"),
        (["--meshes"], "give --film FILE"),
    ],
)
def test_perform_usage_error_executes_nothing(
    perform: list[str],
    run_command_line: RunCommand,
    monkeypatch: pytest.MonkeyPatch,
    option: list[str],
    message: str,
):
    monkeypatch.setattr(simulation, "perform", None)
    result = run_command_line(*perform, *option)
    assert (result.exit_code, result.stdout) == (2, "")
    assert message in " ".join(result.stderr.split())


def test_film_never_replaces_skill(
    perform: list[str], run_command_line: RunCommand, alignment_skill: Path, tmp_path: Path
):
    (tmp_path / "skill.webp").write_bytes((alignment_skill / "skill").read_bytes())
    result = run_command_line(
        "perform", "skill.webp", "--task", "lining up", "--film", "skill.webp", "--force"
    )
    assert result.exit_code == 2
    assert "is an input of this command" in result.stderr


def test_perform_invalid_input_is_rejected(perform: list[str], skill: Path, run_failing: RunFailing):
    names = ", ".join(sorted(TASKS))
    assert f"task 'tea' is unknown, expected one of {names}" in run_failing(*perform[:3], "tea")
    assert "nothing.skill" in run_failing("perform", "nothing.skill", "--task", "valve")
    assert "task 'valve' needs position x" in run_failing("perform", skill, "--task", "valve")
    assert "learn it from pilotfish record stab" in run_failing("perform", skill, "--task", "stab")
    assert "no/film.webp cannot be written: no is not a folder" in run_failing(
        *perform, "--film", "no/film.webp"
    )
