"""pilotfish study: resumed after a kill, with the same tables; refusals; tables and figures."""

import fcntl
import json
import threading
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result
from matplotlib.figure import Figure

from pilotfish.cli.main import cli
from pilotfish.cli.output.figures import save_figure
from pilotfish.cli.stream.signals import StopRequested
from pilotfish.cli.study import execution
from pilotfish.cli.study.figures import study_figures
from pilotfish.cli.study.folder import RunLog, read_runs
from pilotfish.cli.study.results import Results
from pilotfish.cli.study.tables import requirement_table, study_tables, thesis_table, to_markdown
from pilotfish.simulation import StudyRun, study_runs

RunCommand = Callable[..., Result]
SPEED = {"direct": 1.0, "shared": 0.55, "autonomous": 0.5, "fixture": 1.0}


def invented_run(run: StudyRun, skill: bytes = b"", seed: int = 0) -> dict[str, Any]:
    """Return measures that depend on the run and the seed only."""
    assert skill == skill_bytes(run.condition.task, run.condition.arm == "wrong skill")
    rng = np.random.default_rng([seed, zlib.crc32(run.key.encode())])
    person = np.random.default_rng([seed, run.number]).uniform(15.0, 25.0)
    is_autonomous = run.condition.mode == "autonomous"
    return {
        "run": run.key,
        "success": bool(rng.random() < 0.9),
        "time": person * SPEED[run.condition.mode] * rng.uniform(0.9, 1.1),
        **{name: rng.uniform(0.5, 2.0) for name in ("path", "path_ratio", "peak_force")},
        "error": 0.001,
        "effort": 0.0 if is_autonomous else rng.uniform(0.2, 0.5),
        "disagreement": None if is_autonomous else 0.01,
        **{name: int(rng.integers(1, 9)) for name in ("submovements", "alignments", "stale", "limit_events")},
        **{name: int(rng.integers(10**5, 10**6)) for name in ("bytes_forward", "bytes_backward")},
        "failure": "",
        "cpu": 3.0,
    }


def skill_bytes(task: str, is_neighbour: bool) -> bytes:
    return f"{task}{'-neighbour' if is_neighbour else ''}".encode()


def invented_skills(task: str, seed: int = 0) -> dict[str, bytes]:
    return {f"{task}{end}": f"{task}{end}".encode() for end in ("", "-neighbour")}


def draw_one(results: Results) -> dict[str, tuple[Figure, str]]:
    return {"time": (Figure(figsize=(1.0, 1.0)), "A figure.")}


@pytest.fixture
def invented(monkeypatch: pytest.MonkeyPatch) -> None:
    """Invent runs and skills instead of simulating them, and draw one empty figure."""
    monkeypatch.setattr(execution, "perform_study_run", invented_run)
    monkeypatch.setattr(execution, "learn_study_skills", invented_skills)
    monkeypatch.setattr("pilotfish.cli.study.figures.study_figures", draw_one)


QUICK = ("study", "--quick", "--workers", "1", "--out", "out")


def full_results(seed: int = 0) -> Results:
    runs = study_runs()
    finished = {
        run.key: invented_run(run, skill_bytes(run.condition.task, run.condition.arm == "wrong skill"), seed)
        for run in runs
    }
    return Results(runs, finished, seed)


# -------------------------------------------------------------------------------------------------- folder


def test_study_writes_report_tables_figures_and_runs(
    invented: None, run_command_line: RunCommand, tmp_path: Path
):
    result = run_command_line(*QUICK)
    assert (result.exit_code, result.stderr) == (0, "")
    assert "Table 6.2" in result.stdout
    folder = tmp_path / "out"
    assert {path.name for path in folder.iterdir()} == {
        *("settings.json", "runs.jsonl", "skills", "study.md", "report.html", "time.png")
    }
    assert len((folder / "runs.jsonl").read_text().splitlines()) == 60
    assert sorted(path.stem for path in (folder / "skills").iterdir()) == [
        "stab",
        "stab-neighbour",
        "valve",
        "valve-neighbour",
    ]


@pytest.mark.parametrize("attempt", range(4))
def test_study_killed_at_any_byte_gives_the_same_table(
    invented: None, run_command_line: RunCommand, tmp_path: Path, rng: np.random.Generator, attempt: int
):
    whole = run_command_line(*QUICK, "--json")
    tables = (tmp_path / "out" / "study.md").read_bytes()
    file = tmp_path / "out" / "runs.jsonl"
    lines = file.read_bytes()
    file.write_bytes(lines[: rng.integers(len(lines))])  # what a kill leaves of a file that is appended to
    again = run_command_line(*QUICK, "--json")
    assert (again.exit_code, again.stdout) == (0, whole.stdout)
    assert (tmp_path / "out" / "study.md").read_bytes() == tables
    assert sorted(file.read_bytes().splitlines()) == sorted(lines.splitlines())


def test_study_continued_repeats_no_finished_run(
    invented: None, run_command_line: RunCommand, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    run_command_line(*QUICK)
    file = tmp_path / "out" / "runs.jsonl"
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:41]) + lines[41][:30])
    performed: list[str] = []

    def count(run: StudyRun, skill: bytes, seed: int) -> dict[str, Any]:
        performed.append(run.key)
        return invented_run(run, skill, seed)

    monkeypatch.setattr(execution, "perform_study_run", count)
    monkeypatch.setattr(execution, "learn_study_skills", None)  # they are kept
    assert run_command_line(*QUICK).exit_code == 0
    assert performed == [json.loads(line)["run"] for line in lines[41:]]


def test_study_stopped_keeps_runs_and_prints_how_to_continue(
    invented: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    performed: list[str] = []

    def stop(run: StudyRun, skill: bytes, seed: int) -> dict[str, Any]:
        if len(performed) == 7:
            raise StopRequested(2)
        performed.append(run.key)
        return invented_run(run, skill, seed)

    monkeypatch.setattr(execution, "perform_study_run", stop)
    monkeypatch.chdir(tmp_path)
    stopped: list[StopRequested] = []

    @click.command(context_settings={"ignore_unknown_options": True})
    @click.argument("arguments", nargs=-1)
    def main(arguments: tuple[str, ...]) -> None:
        try:
            cli.main(arguments, standalone_mode=False)
        except StopRequested as error:
            stopped.append(error)

    result = CliRunner().invoke(main, [*QUICK, "--seed", "3"])
    assert len(stopped) == 1
    line = "7 of 60 runs are finished and kept; continue with: pilotfish study --quick --out out --seed 3\n"
    assert result.stderr == line
    assert list(read_runs(tmp_path / "out")) == performed


def test_results_stopped_include_runs_under_way(
    invented: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """Two workers have begun two runs when the request to stop arrives."""
    release, begun = threading.Event(), threading.Semaphore(0)

    def wait(run: StudyRun, skill: bytes, seed: int) -> dict[str, Any]:
        begun.release()
        release.wait(10.0)
        return invented_run(run, skill, seed)

    def stop(futures: Any) -> Any:
        for _ in range(2):
            begun.acquire(timeout=10.0)
        threading.Timer(0.1, release.set).start()
        raise StopRequested(2)

    monkeypatch.setattr(execution, "perform_study_run", wait)
    monkeypatch.setattr(execution, "as_completed", stop)
    monkeypatch.setattr(execution, "print_note", print)
    runs = study_runs(quick=True)[:5]  # of the valve
    found: list[str] = []
    with ThreadPoolExecutor(2) as pool, pytest.raises(StopRequested):  # noqa: PT012 - results before it count
        for result in execution._results(pool, runs, invented_skills("valve"), 0):
            found.append(result["run"])
    assert found == [run.key for run in runs[:2]]
    assert "finishing the runs under way" in capsys.readouterr().out


def test_run_log_removes_torn_line_before_it_appends(tmp_path: Path):
    (tmp_path / "runs.jsonl").write_text('{"run": "a"}\n{"run": "b"')
    assert list(read_runs(tmp_path)) == ["a"]
    log = RunLog(tmp_path)
    log.append({"run": "c"})
    assert list(read_runs(tmp_path)) == ["a", "c"]  # flushed before it is closed
    log.close()


def test_read_runs_damaged_line_is_refused_by_number(
    invented: None, run_command_line: RunCommand, tmp_path: Path
):
    run_command_line(*QUICK)
    file = tmp_path / "out" / "runs.jsonl"
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join([*lines[:4], "[1]\n", *lines[5:]]))
    result = run_command_line(*QUICK)
    assert result.exit_code == 1
    assert "line 5 of out/runs.jsonl is not a run" in result.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--quick", "--seed", "1"), "out has a study with --seed 0"),
        ((), "out has a study with --quick"),
    ],
)
def test_study_other_settings_are_refused(
    invented: None, run_command_line: RunCommand, options: tuple[str, ...], message: str
):
    run_command_line(*QUICK)
    result = run_command_line("study", "--workers", "1", "--out", "out", *options)
    assert result.exit_code == 1
    assert message in result.stderr


def test_study_second_process_in_the_folder_is_refused(
    invented: None, run_command_line: RunCommand, tmp_path: Path
):
    run_command_line(*QUICK)
    with (tmp_path / "out" / "settings.json").open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        result = run_command_line(*QUICK)
    assert result.exit_code == 1
    assert "another process works in out" in result.stderr


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "pilotfish-study", "version": 2}'])
def test_study_foreign_settings_are_refused(run_command_line: RunCommand, tmp_path: Path, text: str):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "settings.json").write_text(text)
    result = run_command_line(*QUICK)
    assert result.exit_code == 1
    assert "has no settings of a study" in result.stderr


# -------------------------------------------------------------------------------------------------- tables


def test_study_tables_have_all_conditions_and_no_gain():
    tables = {
        table.caption.split(":")[0].split("[")[0].strip(): table for table in study_tables(full_results())
    }
    success = tables["Success, and by operator"]
    assert len(success.rows) == 30
    ratios = tables["Time relative to direct control"]
    fixture = [row[3] for row in ratios.rows]  # invented without gain
    assert sum("no gain" in cell for cell in fixture) >= 20
    assert not any("no gain" in row[2] for row in ratios.rows)


def test_results_ratio_takes_pairs_in_which_both_succeeded():
    results = full_results(5)
    condition = next(c for c in results.conditions if c.mode == "shared" and c.view_off)
    direct = next(c for c in results.conditions if c.name == condition.name and c.mode == "direct")
    pairs = [
        (shared["time"], other["time"])
        for shared, other in zip(results.runs(condition), results.runs(direct), strict=True)
        if shared["success"] and other["success"]
    ]
    ratio = results.ratio(condition)
    assert ratio.pairs == len(pairs) < 15
    assert ratio.value == pytest.approx(sum(x for x, _ in pairs) / sum(y for _, y in pairs))
    assert results.successes(condition) == sum(results.successes_by_operator(condition))


def test_thesis_table_has_printed_times_beside_ours():
    rows = {row[0]: row[1:] for row in thesis_table(full_results()).rows}
    assert rows["valve, printed"] == ("18.2", "13.6", "12.3", "13.1", "autonomous")
    assert rows["target, printed"] == ("7.2", "4.3", "5.1", "5.6", "shared")
    assert {"valve, 1 s", "valve, 1 s, view off", "stab, 1 s", "stab, 1 s, view off"} < set(rows)


def test_requirement_table_says_what_is_reached():
    rows = {row[0]: row for row in requirement_table(full_results()).rows}
    assert len(rows) == 14
    assert rows["valve, autonomous: time ratio"][3] == "yes"
    assert rows["stab, 1 s, wrong skill: upper bound"][3] == "yes"


def test_study_tables_without_success_have_no_numbers():
    runs = study_runs(quick=True)
    finished = {
        run.key: {
            **invented_run(run, skill_bytes(run.condition.task, run.condition.arm == "wrong skill")),
            "success": False,
        }
        for run in runs
    }
    results = Results(runs, finished, 0)
    text = to_markdown(study_tables(results))
    assert "nan" not in text.replace("no pairs", "")
    assert "no pairs" in text
    json.dumps(results.to_json(), allow_nan=False)


@pytest.mark.slow  # draws four figures with fifty intervals: 6 CPU seconds
def test_study_figures_are_drawn_with_captions(tmp_path: Path, unchecked: None):
    figures = study_figures(full_results())
    assert list(figures) == ["time", "ratios", "measures", "arms"]
    for name, (figure, caption) in figures.items():
        save_figure(figure, tmp_path / f"{name}.png", overwrite=False)
        assert caption.endswith(".")


@pytest.mark.slow  # records and learns two skills, and simulates sixty missions: 200 CPU seconds
def test_study_quick_runs_on_all_cores(run_command_line: RunCommand, tmp_path: Path, unchecked: None):
    result = run_command_line("study", "--quick", "--out", "out", "--json")
    assert result.exit_code == 0, result.output
    conditions = json.loads(result.stdout)["conditions"]
    assert all(each["successes"] >= 2 for each in conditions if "wrong" not in each["condition"])
