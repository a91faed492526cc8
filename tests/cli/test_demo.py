"""The demo learns, reproduces, plots and saves, and announces synthetic data."""

import json
import sys
from pathlib import Path
from typing import Any, NoReturn

import pytest
from annotations import check_annotations
from click.testing import CliRunner
from demo_run import DemoRun

from pilotfish.cli.demo import run as demo_module
from pilotfish.cli.demo.run import run_demo
from pilotfish.cli.main import cli
from pilotfish.cli.output.tables import Table
from pilotfish.environments.scene_renderer import rendering_error
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io import datasets
from pilotfish.io.skill_file import open_skill

SLOW = pytest.mark.slow  # 2 fits, 32 reproductions, 13 figures and 8 simulations: 27 s


def raise_no_network() -> NoReturn:
    raise SkillError("the network is down")


@pytest.fixture(scope="module")
def synthetic_demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], list[str]]:
    """Run the demo without recorded data; return its result and the printed lines."""
    printed: list[str] = []
    with pytest.MonkeyPatch.context() as patch, check_annotations(False):
        patch.setattr(datasets, "valve", raise_no_network)
        return run_demo(
            tmp_path_factory.mktemp("demo") / "deep" / "inside", print_line=printed.append
        ), printed


@SLOW
def test_demo_synthetic_data_is_announced(synthetic_demo: tuple[dict[str, Any], list[str]]):
    result, printed = synthetic_demo
    assert result["synthetic"]
    for text in (printed[0], Path(result["report"]).read_text(encoding="utf-8").partition("<table>")[0]):
        assert "SYNTHETIC DATA" in text
        assert "the network is down" in text
    assert printed[0].startswith("*** SYNTHETIC DATA")
    assert printed[-1].startswith("\n*** SYNTHETIC DATA")  # what scrolled away is printed again


@SLOW
def test_demo_synthetic_data_has_no_published_errors(synthetic_demo: tuple[dict[str, Any], list[str]]):
    result, _ = synthetic_demo
    assert "published" not in " ".join(cell for table in result["tables"] for cell in table["header"])


@SLOW
def test_demo_saved_skill_is_semi_tied(synthetic_demo: tuple[dict[str, Any], list[str]]):
    result, _ = synthetic_demo
    skill = open_skill(result["skill"])
    assert skill.provenance.structure == "semi-tied(1)"
    assert len(skill.provenance.demonstrations) == 4
    assert "synthetic" in skill.provenance.demonstrations[0]
    assert skill.states == 7


@SLOW
def test_demo_tables_have_one_row_per_reproduction(synthetic_demo: tuple[dict[str, Any], list[str]]):
    result, _ = synthetic_demo
    grasp, *numbers, summary, physics = (table["rows"] for table in result["tables"])
    assert [row[0] for row in grasp] == ["grasp"] * 4 + ["release"] * 4
    assert [len(rows) for rows in numbers] == [10] * 4
    assert [row[1] for row in numbers[0]] == ["yes"] * 4 + ["no"] * 4 + ["yes", "no"]
    assert [row[1] for row in summary] == ["1470", "1470", "588", "588"]  # covariance parameters
    assert [row[1] for row in physics] == ["yes"] * 4 + ["no"] * 4
    assert 0.0 < result["seconds"] < 600.0


@SLOW
def test_demo_report_has_figures_of_new_situations(synthetic_demo: tuple[dict[str, Any], list[str]]):
    result, _ = synthetic_demo
    text = Path(result["report"]).read_text(encoding="utf-8")
    films = text.count("data:image/webp;base64,")
    assert films == int(rendering_error() == "")
    assert text.count("data:image/png;base64,") == 13 + films
    for degrees in ("157.5", "112.5", "67.5", "22.5"):
        assert f"synthetic valve {degrees} deg, a new situation" in text


@SLOW
def test_demo_without_mujoco_writes_report_and_skill(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(datasets, "valve", raise_no_network)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    printed: list[str] = []
    result = run_demo(tmp_path, print_line=printed.append)
    report = Path(result["report"]).read_text(encoding="utf-8")
    for text in (report.replace("&#39;", "'"), "\n".join(printed)):
        assert "not executed" in text
        assert "simulation needs mujoco: pip install '.[sim]' in the clone" in text
    assert "image/webp" not in report
    assert len(result["tables"]) == 6
    assert open_skill(result["skill"]).states == 7


def test_demo_invalid_data_folder_is_rejected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PILOTFISH_DATA", str(tmp_path / "nowhere"))
    with pytest.raises(InvalidInput, match="PILOTFISH_DATA"):
        run_demo(tmp_path / "out", print_line=lambda _: None)


def test_demo_file_in_place_of_folder_is_rejected(tmp_path: Path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(InvalidInput, match="choose another folder"):
        run_demo(tmp_path / "taken" / "demo", print_line=lambda _: None)


@SLOW
def test_demo_command_writes_files_and_json(demo_run: DemoRun):
    assert demo_run.result.exit_code == 0
    output = json.loads(demo_run.result.stdout)
    assert not output["synthetic"]
    for name, file in (("report", "report.html"), ("skill", "valve.skill")):
        assert Path(output[name]) == Path("build/demo", file)
        assert (demo_run.folder / "build" / "demo" / file).is_file()
    rows = {tuple(row[:1] + row[3:4]): row[4:] for row in output["tables"][-2]["rows"]}
    assert rows["full", "first state"][2:] == [".0021", ".0146"]  # as published
    assert float(rows["semi-tied(1)", "first state"][1]) < float(rows["full", "first state"][1])


def test_demo_error_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(demo_module, "load_valve", lambda _: raise_no_network())
    result = CliRunner().invoke(cli, ["demo", "--out", str(tmp_path)])
    assert result.exit_code == 1
    assert result.stderr.strip() == "Error: the network is down"


def test_table_text_is_aligned():
    caption, *lines = (
        Table(("a", "long header"), (("word", "1"), ("w", "22")), "caption", right_aligned=True)
        .to_text()
        .split("\n")
    )
    assert caption == "caption"
    assert lines == ["a     long header", "word            1", "w              22"]
