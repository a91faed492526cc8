"""The demonstration learns, replays, draws and saves, and says plainly when its data is generated."""

import json
import sys
from pathlib import Path
from typing import NoReturn

import pytest
from annotations import check_annotations
from click.testing import CliRunner
from demo_run import DemoRun

from pilotfish.cli.demo import demo as room
from pilotfish.cli.demo.demo import DemoRun, demo, format_report_table
from pilotfish.cli.main import cli
from pilotfish.cli.output.report import Table
from pilotfish.environments.scene_renderer import rendering_error
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io import datasets
from pilotfish.io.skill_file import open_skill

SLOW = pytest.mark.slow  # it learns twice, replays 32 times and draws thirteen pictures, in physics too: 27 s


def raise_no_network() -> NoReturn:
    raise SkillError("the network is down")


@pytest.fixture(scope="module")
def synthetic_demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[DemoRun, list[str]]:
    """The demonstration where no recording can be had, and all that it said meanwhile."""
    said: list[str] = []
    with pytest.MonkeyPatch.context() as patch, check_annotations(False):
        patch.setattr(datasets, "valve", raise_no_network)
        return demo(tmp_path_factory.mktemp("demo") / "deep" / "inside", print_line=said.append), said


@SLOW
def test_generated_data_is_called_so_first_of_all(synthetic_demo: tuple[DemoRun, list[str]]):
    """Terminal and report begin by saying that the data is synthetic, and why."""
    result, said = synthetic_demo
    assert result.synthetic
    for text in (said[0], result.report.read_text(encoding="utf-8").partition("<table>")[0]):
        assert "SYNTHETIC DATA" in text
        assert "the network is down" in text
    assert said[0].startswith("*** SYNTHETIC DATA")
    assert said[-1].startswith("\n*** SYNTHETIC DATA")  # what scrolled away is said again


@SLOW
def test_published_numbers_stand_beside_the_recording_alone(synthetic_demo: tuple[DemoRun, list[str]]):
    """Nothing measured on generated data is put beside a published number."""
    result, _ = synthetic_demo
    assert "published" not in " ".join(cell for table in result.tables for cell in table.header)


@SLOW
def test_the_skill_that_is_saved_can_be_opened(synthetic_demo: tuple[DemoRun, list[str]]):
    """It is the semi-tied one, learned from the first four demonstrations."""
    result, _ = synthetic_demo
    skill = open_skill(result.skill)
    assert skill.provenance.structure == "semi-tied(1)"
    assert len(skill.provenance.demonstrations) == 4
    assert "synthetic" in skill.provenance.demonstrations[0]
    assert skill.states == 7


@SLOW
def test_every_replay_has_a_row(synthetic_demo: tuple[DemoRun, list[str]]):
    """Two structures and two beginnings, each with eight situations and two means; a summary; the physics."""
    result, _ = synthetic_demo
    *numbers, summary, physics = result.tables
    assert [len(table.rows) for table in numbers] == [10] * 4
    assert [row[1] for row in numbers[0].rows] == ["yes"] * 4 + ["no"] * 4 + ["yes", "no"]
    assert [row[1] for row in summary.rows] == ["1470", "1470", "588", "588"]  # covariance parameters
    assert [row[1] for row in physics.rows] == ["yes"] * 4 + ["no"] * 4
    assert 0.0 < result.seconds < 600.0


@SLOW
def test_the_report_shows_every_new_situation(synthetic_demo: tuple[DemoRun, list[str]]):
    """Thirteen pictures are inside, one for each of the four new situations among them; and where physics can
    be drawn, a film of it and its moments.
    """
    result, _ = synthetic_demo
    text = result.report.read_text(encoding="utf-8")
    films = text.count("data:image/webp;base64,")
    assert films == int(rendering_error() == "")
    assert text.count("data:image/png;base64,") == 13 + films
    for degrees in ("157.5", "112.5", "67.5", "22.5"):
        assert f"synthetic valve {degrees} deg, new to the skill" in text


@SLOW
def test_without_mujoco_the_rest_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Report and skill are there, and say what is missing; no replay in physics has a row."""
    monkeypatch.setattr(datasets, "valve", raise_no_network)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    said: list[str] = []
    result = demo(tmp_path, print_line=said.append)
    report = result.report.read_text(encoding="utf-8")
    for text in (report.replace("&#x27;", "'"), "\n".join(said)):
        assert "not carried out" in text
        assert "simulation needs mujoco: pip install 'pilotfish[sim]'" in text
    assert "image/webp" not in report
    assert len(result.tables) == 5
    assert open_skill(result.skill).states == 7


def test_a_wrong_recording_is_not_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """PILOTFISH_DATA that names no folder is an error of its own, not a reason to generate data."""
    monkeypatch.setenv("PILOTFISH_DATA", str(tmp_path / "nowhere"))
    with pytest.raises(InvalidInput, match="PILOTFISH_DATA"):
        demo(tmp_path / "out", print_line=lambda _: None)


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path):
    """A file stands where the folder should be."""
    (tmp_path / "taken").write_text("")
    with pytest.raises(InvalidInput, match="choose another folder"):
        demo(tmp_path / "taken" / "demo", print_line=lambda _: None)


@SLOW
def test_the_command_tells_people_and_programs(demo_run: DemoRun):
    """The line of the docs leaves a report and a skill; --json prints one object and nothing else; the
    recording is not called generated.
    """
    assert demo_run.answer.exit_code == 0
    run_json = json.loads(demo_run.answer.stdout)
    assert not run_json["synthetic"]
    for name, file in (("report", "report.html"), ("skill", "valve.skill")):
        assert Path(run_json[name]) == Path("build/demo", file)
        assert (demo_run.folder / "build" / "demo" / file).is_file()
    rows = {tuple(row[:1] + row[3:4]): row[4:] for row in run_json["tables"][-2]["rows"]}
    assert rows["full", "first mean"][2:] == [".0021", ".0146"]  # as published
    assert float(rows["semi-tied(1)", "first mean"][1]) < float(rows["full", "first mean"][1])


def test_a_refusal_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What the demonstration refuses ends the command with exit code 1 and no traceback."""
    monkeypatch.setattr(room, "_demonstrations", lambda _: raise_no_network())
    answer = CliRunner().invoke(cli, ["demo", "--out", str(tmp_path)])
    assert answer.exit_code == 1
    assert answer.stderr.strip() == "Error: the network is down"


def test_columns_are_aligned():
    """Every line of a table is equally long; the first column stands to the left."""
    caption, *lines = format_report_table(
        Table("caption", ("a", "long head"), (("word", "1"), ("w", "22")))
    ).split("\n")
    assert caption == "caption"
    assert lines == ["a     long head", "word          1", "w            22"]
