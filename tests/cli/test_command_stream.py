"""pilotfish stream: the result equals that of the library on the same datapoints, bit for bit."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from stream_commands import PENALTIES, SOSC, expected, models_equal, text, walk

import pilotfish as pf
from pilotfish.cli.stream import lines as stream_lines
from pilotfish.cli.stream import outputs as session_outputs
from pilotfish.cli.stream import session as stream_session
from pilotfish.errors import InvalidInput
from pilotfish.models import online

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]


@pytest.fixture
def rows(tmp_path: Path) -> Path:
    (tmp_path / "rows.csv").write_text(text(walk(0, 60)))
    return tmp_path / "rows.csv"


def test_stream_file_equals_library(run_command_line: RunCommand, rows: Path, tmp_path: Path):
    result = run_command_line("stream", rows, *SOSC, "--out", "a.stream", "--skill", "a.skill")
    assert (result.exit_code, result.stderr) == (0, "")
    model = expected(walk(0, 60))
    assert models_equal(tmp_path / "a.stream", model)
    pf.save_skill(online.to_skill(model), tmp_path / "b.skill")
    assert (tmp_path / "a.skill").read_bytes() == (tmp_path / "b.skill").read_bytes()
    for words in ("60 datapoints", "0 lines", "a.stream", f"{model.clusters}, with ids"):
        assert words in result.stdout
    assert run_command_line("reproduce", "a.skill", "--horizon", "30", "--out", "motion.csv").exit_code == 0


@pytest.mark.parametrize("batch", [1, 7])
def test_stream_result_independent_of_format_and_chunks(
    run_command_line: RunCommand, rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int
):
    x = walk(0, 60)
    blanks = text(x).replace(",", " , ").replace("\n", "\r\n# nothing\r\n").removesuffix("\r\n# nothing\r\n")
    (tmp_path / "other.csv").write_text(blanks)
    learner = [*SOSC, "--batch", batch]
    assert run_command_line("stream", rows, *learner, "--out", "a.stream").exit_code == 0
    monkeypatch.setattr(stream_lines, "CHUNK_BYTES", 11)
    assert (
        run_command_line("stream", "other.csv", *learner, "--out", "b.stream", "--every", "9").exit_code == 0
    )
    model = expected(x, replace(PENALTIES, maintenance=online.Maintenance(batch=batch)))
    assert models_equal(tmp_path / "a.stream", model)
    assert models_equal(tmp_path / "b.stream", model)


def test_blank_line_begins_demonstration(run_command_line: RunCommand, tmp_path: Path):
    one, two = walk(0, 30), walk(1, 20)
    (tmp_path / "rows.csv").write_text(f"\n{text(one)}\n\n# and now\n\n{text(two, header=False)}\n")
    assert run_command_line("stream", "rows.csv", *SOSC, "--out", "a.stream").exit_code == 0
    model = online.begin_demonstration(expected(one))
    model, _ = online.observe_stream(model, two)
    assert models_equal(tmp_path / "a.stream", online.begin_demonstration(model))
    assert model.demonstrations == 2


def test_rejected_lines_are_reported_and_change_nothing(
    run_command_line: RunCommand, run_json: RunJson, rows: Path, tmp_path: Path
):
    good = rows.read_text().splitlines()
    bad = [f"{n},nan,0,0" for n in range(14)]
    (tmp_path / "bad.csv").write_text("\n".join([*good[:20], *bad, "1,2", *good[20:]]))
    result = run_command_line("stream", "bad.csv", *SOSC, "--out", "a.stream")
    assert result.exit_code == 0
    output = result.stderr.splitlines()
    assert len(output) == 10
    assert output[0].startswith("line 21 is rejected: column 2 is nan, expected a finite number")
    assert "further lines are only counted" in output[-1]
    assert "15 lines" in result.stdout
    assert models_equal(tmp_path / "a.stream", expected(walk(0, 60)))
    answer = run_json("stream", "bad.csv", *SOSC)
    assert (answer["rejected"], answer["observed"], len(answer["rejected_lines"])) == (15, 60, 10)
    assert answer["rejected_lines"][0]["line"] == 21


def test_strict_stops_at_rejected_line_and_saves(run_command_line: RunCommand, rows: Path, tmp_path: Path):
    good = rows.read_text().splitlines()
    (tmp_path / "bad.csv").write_text("\n".join([*good[:20], "x,1,2,3", "y", *good[20:]]))
    result = run_command_line("stream", "bad.csv", *SOSC, "--strict", "--out", "a.stream", "--batch", "4")
    assert result.exit_code == 1
    assert result.stderr.startswith("line 21 is rejected: column 1 is 'x'")
    assert result.stderr.count("\n") == 1
    assert "19 datapoints" in result.stdout
    assert models_equal(
        tmp_path / "a.stream",
        expected(walk(0, 60)[:19], replace(PENALTIES, maintenance=online.Maintenance(batch=4))),
    )


def test_resume_equals_one_run(run_command_line: RunCommand, rows: Path, tmp_path: Path):
    lines = rows.read_text().splitlines(keepends=True)
    (tmp_path / "one.csv").write_text("".join(lines[:26]))
    (tmp_path / "two.csv").write_text("".join([lines[0], *lines[26:]]))
    assert run_command_line("stream", "one.csv", *SOSC, "--out", "a.stream").exit_code == 0
    before = (tmp_path / "a.stream").read_bytes()
    refused = run_command_line("stream", "two.csv", "--resume", "a.stream", "--out", "a.stream")
    assert (refused.exit_code, (tmp_path / "a.stream").read_bytes()) == (1, before)
    assert "--force" in refused.stderr
    assert (
        run_command_line(
            "stream", "two.csv", "--resume", "a.stream", "--out", "a.stream", "--force"
        ).exit_code
        == 0
    )
    assert models_equal(tmp_path / "a.stream", expected(walk(0, 60)))


def test_resume_from_null_device_converts_to_skill(run_command_line: RunCommand, rows: Path, tmp_path: Path):
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream").exit_code == 0
    assert run_command_line("stream", os.devnull, "--resume", "a.stream", "--skill", "a.skill").exit_code == 0
    pf.save_skill(online.to_skill(pf.io.open_stream(tmp_path / "a.stream")), tmp_path / "b.skill")
    assert (tmp_path / "a.skill").read_bytes() == (tmp_path / "b.skill").read_bytes()


@pytest.mark.parametrize("content", ["", "\n\n", "# only this\n", "a,b,c,d\n"])
@pytest.mark.parametrize("more", [[], ["--resume", "a.stream"]])
def test_empty_stream_is_rejected_without_file(
    run_command_line: RunCommand,
    run_failing: RunFailing,
    rows: Path,
    tmp_path: Path,
    content: str,
    more: list[str],
):
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream").exit_code == 0
    (tmp_path / "empty.csv").write_text(content)
    output = run_failing("stream", "empty.csv", *(more or SOSC), "--out", "b.stream", "--skill", "b.skill")
    assert "has no datapoint" in output or "a, b, c, d" in output
    assert not list(tmp_path.glob("b.*"))


def test_stream_of_rejected_lines_is_rejected(run_command_line: RunCommand, tmp_path: Path):
    (tmp_path / "bad.csv").write_text("1,x\n2,y\n")
    result = run_command_line("stream", "bad.csv", *SOSC, "--out", "a.stream")
    assert result.exit_code == 1
    assert "all 2 lines were rejected; line 1: column 2 is 'x'" in result.stderr
    assert not (tmp_path / "a.stream").exists()


def test_resume_with_other_columns_is_rejected(
    run_command_line: RunCommand, run_failing: RunFailing, rows: Path, tmp_path: Path
):
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream").exit_code == 0
    (tmp_path / "other.csv").write_text("x,y,z,w\n1,2,3,4\n")
    output = run_failing("stream", "other.csv", "--resume", "a.stream", "--out", "b.stream")
    assert "x, y, z, w, expected those of the model: position x, position y" in output
    assert not (tmp_path / "b.stream").exists()


def test_rows_option_limits_datapoints(run_command_line: RunCommand, rows: Path, tmp_path: Path):
    assert run_command_line("stream", rows, *SOSC, "--rows", "23", "--out", "a.stream").exit_code == 0
    assert models_equal(tmp_path / "a.stream", expected(walk(0, 60)[:23]))


@pytest.mark.parametrize("batch", [1, 4])
def test_every_prints_progress_at_multiples(
    run_command_line: RunCommand, run_json: RunJson, rows: Path, batch: int
):
    learner = [*SOSC, "--every", "25", "--batch", batch]
    output = run_command_line("stream", rows, *learner).stdout.splitlines()
    counts = [25, 50] if batch == 1 else [28, 52]
    assert [line.split()[0] for line in output[:2]] == [str(count) for count in counts]
    assert "clusters, dimensions" in output[0]
    assert [mark["datapoints"] for mark in run_json("stream", rows, *learner)["history"]] == counts


def test_stream_json_describes_clusters(run_json: RunJson, rows: Path):
    answer, model = run_json("stream", rows, *SOSC), expected(walk(0, 60))
    assert [c["cluster_id"] for c in answer["clusters"]] == model.cluster_ids.tolist()
    assert sum(c["datapoints"] for c in answer["clusters"]) == answer["datapoints"] == 60
    assert [c["dimensions"]["world"] for c in answer["clusters"]] == model.dimensions[:, 0].tolist()
    for cluster in answer["clusters"]:
        assert not cluster["transitions"] or np.isclose(sum(cluster["transitions"].values()), 1.0)
        assert set(cluster["transitions"]) <= {str(cluster_id) for cluster_id in model.cluster_ids}
        assert cluster["duration"]["mean"] > 0.0
    assert answer["learner"] == "sosc"
    assert answer["datapoints_per_second"] > 0.0
    assert answer["files"] == {}


@pytest.mark.parametrize(
    ("options", "settings"),
    [
        ("--learner dp-gmm --cluster 1 --noise .1", online.DPGMM(1.0, 0.1)),
        (
            (
                "--learner dp-mppca --cluster 1 --dimension .1 --noise .1 --bandwidth 2 "
                "--discount .9 --forget-below .1 --extra-directions 2"
            ),
            online.DPMPPCA(
                1.0, 0.1, 0.1, 2.0, online.Maintenance(discount=0.9, forget_below=0.1, extra_directions=2)
            ),
        ),
        (
            (
                "--learner hdp-hsmm --cluster 1 --noise .1 --transition 0 --new-transition .2 "
                "--constant-weight 9 --merge-distance 0 --max-clusters 3"
            ),
            online.HDPHSMM(
                1.0,
                0.1,
                0.0,
                0.2,
                online.Maintenance(constant_weight=9.0, merge_distance=0.0, max_clusters=3),
            ),
        ),
    ],
)
def test_learner_options_equal_library_settings(
    run_command_line: RunCommand, rows: Path, tmp_path: Path, options: str, settings: online.OnlineSettings
):
    result = run_command_line("stream", rows, *options.split(), "--no-scale", "--out", "a.stream")
    assert result.exit_code == 0
    assert models_equal(tmp_path / "a.stream", expected(walk(0, 60), settings))


MISUSE = {
    "--scales 1,1,1,1 --no-scale": "--scales and --no-scale exclude each other",
    "--scales 1,0,1,1": "is not a list of positive numbers",
    "--scales 1,x": "is not a list of positive numbers",
    "--resume a.stream --no-scale": "--scale is stored in the file of --resume",
    "--resume a.stream --first-rows 9": "--first-rows is stored in the file of --resume",
    "--learner dp-gmm --cluster 1 --noise 1 --dimension 2": "is not an option of --learner dp-gmm",
    "--cluster 0": "0.0 is not in the range",
    "--cluster nan": "nan",
    "ALL --forget-below .1": "--forget-below needs --discount",
    "ALL --discount .9 --constant-weight 3": "exclude each other",
    "ALL --constant-weight 0": "0.0 is not in the range",
    "ALL --resume a.stream": "--cluster is stored in the file of --resume",
    "--resume a.stream --period 1": "--period",
    "ALL --from-batch 2": "--from-batch needs a folder of demonstrations",
    "ALL --only 1": "--only needs",
    "ALL --no-velocities": "--velocities needs",
    "ALL --seed 1": "--seed needs --from-batch",
    "ALL --save-every 1": "--save-every needs --out",
    "ALL --out a --skill a": "two outputs",
    "ALL --out rows.csv --force": "is an input of this command",
    "--resume a.stream --skill a.stream --force": "is an input of this command",
}


@pytest.mark.parametrize("options", MISUSE)
def test_stream_invalid_options_are_usage_errors(
    run_command_line: RunCommand, rows: Path, tmp_path: Path, options: str
):
    pf.io.save_stream(expected(walk(0, 9)), tmp_path / "a.stream")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    result = run_command_line("stream", rows, *options.replace("ALL", " ".join(SOSC)).split())
    assert (result.exit_code, result.stdout) == (2, "")
    assert MISUSE[options] in result.stderr.splitlines()[-1]
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_status_line_appears_only_on_terminal(
    run_command_line: RunCommand, rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    assert run_command_line("stream", rows, *SOSC).stderr == ""
    monkeypatch.setattr(stream_session, "is_interactive", lambda: True)
    monkeypatch.setattr(stream_session, "WAIT_INTERVAL", 0.0)
    monkeypatch.setattr(stream_lines, "CHUNK_BYTES", 800)
    (tmp_path / "rows.csv").write_text(rows.read_text() + "x\n")
    printed = run_command_line("stream", rows, *SOSC, "--out", "a.stream").stderr
    assert printed.count("datapoints, ") > 3
    assert "60 datapoints, " in printed
    assert "\rline 62 is rejected" in printed  # click leaves out what only a terminal understands
    assert printed.endswith("\r")


def test_save_every_saves_and_survives_failure(
    run_command_line: RunCommand, rows: Path, monkeypatch: pytest.MonkeyPatch
):
    saved: list[int] = []
    monkeypatch.setattr(stream_lines, "CHUNK_BYTES", 800)
    monkeypatch.setattr(session_outputs, "save_stream", lambda model, _, **__: saved.append(model.datapoints))
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream", "--save-every", "1e-9").exit_code == 0
    assert len(saved) > 3
    assert saved == sorted(saved)
    assert saved[-1] == 60

    def full(model: online.OnlineModel, path: Path, **_: bool) -> None:
        if model.datapoints < 60:
            raise InvalidInput(f"{path} cannot be written: no space")

    monkeypatch.setattr(session_outputs, "save_stream", full)
    result = run_command_line("stream", rows, *SOSC, "--out", "a.stream", "--save-every", "1e-9")
    assert result.exit_code == 0
    assert "not saved at" in result.stderr


@pytest.mark.parametrize("batch", [1, 7])
def test_failing_stream_saves_earlier_rows(
    run_command_line: RunCommand, rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int
):
    monkeypatch.setattr(stream_lines, "MAX_LINE_BYTES", 200)
    rows.write_text(rows.read_text() + "1" * 300)
    result = run_command_line("stream", rows, *SOSC, "--batch", batch, "--out", "a.stream")
    assert result.exit_code == 1
    assert "the stream failed: a line has more than 200 bytes" in result.stderr
    maintenance = online.Maintenance(batch=batch)
    assert models_equal(
        tmp_path / "a.stream", expected(walk(0, 60), replace(PENALTIES, maintenance=maintenance))
    )
