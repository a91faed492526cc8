"""pilotfish stream: what has grown is what the library makes of the same datapoints, bit for bit."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

import pilotfish as pf
from pilotfish.cli.stream import lines as stream_lines
from pilotfish.cli.stream import session as growing
from pilotfish.demonstrations import position_layout
from pilotfish.errors import InvalidInput
from pilotfish.io.stream_file import encode_stream
from pilotfish.models import online

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]

SOSC = [
    "--cluster",
    "0.3",
    "--dimension",
    "0.02",
    "--noise",
    "0.01",
    "--bandwidth",
    "2",
    "--transition",
    "0.01",
]
PENALTIES = online.SOSC(0.3, 0.02, 0.01, 2.0, 0.01)
LAYOUT = position_layout(2).differentiate()


def walk(seed: int, n: int) -> np.ndarray:
    """A point that goes round and round, with its speed."""
    t = np.arange(n) / 7.0
    x = np.stack([np.cos(t), np.sin(t), -np.sin(t), np.cos(t)], axis=1)
    return x + 0.03 * np.random.default_rng(seed).normal(size=(n, 4))


def text(x: np.ndarray, header: bool = True) -> str:
    lines = [",".join(LAYOUT.names)] if header else []
    return "\n".join([*lines, *(",".join(map(repr, row)) for row in x.tolist())]) + "\n"


def expected(x: np.ndarray, penalties: online.OnlineSettings = PENALTIES) -> online.OnlineModel:
    return online.observe_stream(online.online_model(penalties, LAYOUT, 0.01), x)[0]


def models_equal(path: Path, model: online.OnlineModel) -> bool:
    return path.read_bytes() == encode_stream(model)


@pytest.fixture
def rows(tmp_path: Path) -> Path:
    (tmp_path / "rows.csv").write_text(text(walk(0, 60)))
    return tmp_path / "rows.csv"


def test_a_file_of_rows_gives_the_model_and_the_skill_that_the_library_gives(
    run_command_line: RunCommand, rows: Path, tmp_path: Path
):
    """Names of columns that are those of positions with speeds make a layout that can be replayed."""
    result = run_command_line("stream", rows, *SOSC, "--out", "a.stream", "--skill", "a.skill")
    assert (result.exit_code, result.stderr) == (0, "")
    model = expected(walk(0, 60))
    assert models_equal(tmp_path / "a.stream", model)
    pf.save_skill(online.to_skill(model), tmp_path / "b.skill")
    assert (tmp_path / "a.skill").read_bytes() == (tmp_path / "b.skill").read_bytes()
    for words in ("60 datapoints", "no line", "a.stream", f"{model.clusters}, born as"):
        assert words in result.stdout
    assert run_command_line("reproduce", "a.skill", "--horizon", "30", "--out", "motion.csv").exit_code == 0


@pytest.mark.parametrize("batch", [1, 7])
def test_it_makes_no_difference_how_rows_are_written_or_how_they_come(
    run_command_line: RunCommand, rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int
):
    """Blanks for commas, comments, no last line's end, chunks of a few bytes: the same file."""
    x = walk(0, 60)
    blanks = text(x).replace(",", " , ").replace("\n", "\r\n# nothing\r\n").removesuffix("\r\n# nothing\r\n")
    (tmp_path / "other.csv").write_text(blanks)
    learner = [*SOSC, "--batch", batch]
    assert run_command_line("stream", rows, *learner, "--out", "a.stream").exit_code == 0
    monkeypatch.setattr(stream_lines, "CHUNK", 11)
    assert (
        run_command_line("stream", "other.csv", *learner, "--out", "b.stream", "--every", "9").exit_code == 0
    )
    model = expected(x, replace(PENALTIES, maintenance=online.Maintenance(batch=batch)))
    assert models_equal(tmp_path / "a.stream", model)
    assert models_equal(tmp_path / "b.stream", model)


def test_a_blank_line_begins_a_demonstration(run_command_line: RunCommand, tmp_path: Path):
    """No transition leads over it, and many are one."""
    one, two = walk(0, 30), walk(1, 20)
    (tmp_path / "rows.csv").write_text(f"\n{text(one)}\n\n# and now\n\n{text(two, header=False)}\n")
    assert run_command_line("stream", "rows.csv", *SOSC, "--out", "a.stream").exit_code == 0
    model = online.begin_demonstration(expected(one))
    model, _ = online.observe_stream(model, two)
    assert models_equal(tmp_path / "a.stream", online.begin_demonstration(model))
    assert model.demonstrations == 2


def test_lines_that_are_no_datapoints_are_told_counted_and_leave_no_trace(
    run_command_line: RunCommand, run_json: RunJson, rows: Path, tmp_path: Path
):
    """The first ten on stderr, each with its line; all in the summary; the model is that of the others."""
    good = rows.read_text().splitlines()
    bad = [f"{n},nan,0,0" for n in range(14)]
    (tmp_path / "bad.csv").write_text("\n".join([*good[:20], *bad, "1,2", *good[20:]]))
    result = run_command_line("stream", "bad.csv", *SOSC, "--out", "a.stream")
    assert result.exit_code == 0
    output = result.stderr.splitlines()
    assert len(output) == 10
    assert output[0].startswith("line 21 is refused: column 2 is nan, expected a finite number")
    assert "more are counted" in output[-1]
    assert "15 lines" in result.stdout
    assert models_equal(tmp_path / "a.stream", expected(walk(0, 60)))
    answer = run_json("stream", "bad.csv", *SOSC)
    assert (answer["rejected"], answer["observed"], len(answer["rejected_lines"])) == (15, 60, 10)
    assert answer["rejected_lines"][0]["line"] == 21


def test_strict_stops_at_the_first_and_keeps_what_was_learned(
    run_command_line: RunCommand, rows: Path, tmp_path: Path
):
    """Exit code 1, the line on stderr, the summary and the file."""
    good = rows.read_text().splitlines()
    (tmp_path / "bad.csv").write_text("\n".join([*good[:20], "x,1,2,3", "y", *good[20:]]))
    result = run_command_line("stream", "bad.csv", *SOSC, "--strict", "--out", "a.stream", "--batch", "4")
    assert result.exit_code == 1
    assert result.stderr.startswith("line 21 is refused: column 1 is 'x'")
    assert result.stderr.count("\n") == 1
    assert "19 datapoints" in result.stdout
    assert models_equal(
        tmp_path / "a.stream",
        expected(walk(0, 60)[:19], replace(PENALTIES, maintenance=online.Maintenance(batch=4))),
    )


def test_two_runs_are_one_run(run_command_line: RunCommand, rows: Path, tmp_path: Path):
    """The second goes on from the file of the first, in place only by force."""
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


def test_nothing_reads_a_model_out(run_command_line: RunCommand, rows: Path, tmp_path: Path):
    """The null device, named as the source, is no stream that failed to come."""
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream").exit_code == 0
    assert run_command_line("stream", os.devnull, "--resume", "a.stream", "--skill", "a.skill").exit_code == 0
    pf.save_skill(online.to_skill(pf.open_stream(tmp_path / "a.stream")), tmp_path / "b.skill")
    assert (tmp_path / "a.skill").read_bytes() == (tmp_path / "b.skill").read_bytes()


@pytest.mark.parametrize("content", ["", "\n\n", "# only this\n", "a,b,c,d\n"])
@pytest.mark.parametrize("more", [[], ["--resume", "a.stream"]])
def test_an_empty_stream_is_refused_and_leaves_no_file(
    run_command_line: RunCommand,
    run_failing: RunFailing,
    rows: Path,
    tmp_path: Path,
    content: str,
    more: list[str],
):
    """Nothing came: said so."""
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream").exit_code == 0
    (tmp_path / "empty.csv").write_text(content)
    output = run_failing("stream", "empty.csv", *(more or SOSC), "--out", "b.stream", "--skill", "b.skill")
    assert "no datapoint came" in output or "a, b, c, d" in output
    assert not list(tmp_path.glob("b.*"))


def test_a_stream_of_nothing_but_bad_lines_is_refused(run_command_line: RunCommand, tmp_path: Path):
    """With the first of them, and no file."""
    (tmp_path / "bad.csv").write_text("1,x\n2,y\n")
    result = run_command_line("stream", "bad.csv", *SOSC, "--out", "a.stream")
    assert result.exit_code == 1
    assert "none of 2 lines is a datapoint: line 1: column 2 is 'x'" in result.stderr
    assert not (tmp_path / "a.stream").exists()


def test_rows_of_other_columns_than_the_model_are_refused(
    run_command_line: RunCommand, run_failing: RunFailing, rows: Path, tmp_path: Path
):
    """Told with the names of both; the model's file stays as it was."""
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream").exit_code == 0
    (tmp_path / "other.csv").write_text("x,y,z,w\n1,2,3,4\n")
    output = run_failing("stream", "other.csv", "--resume", "a.stream", "--out", "b.stream")
    assert "x, y, z, w, expected those of the model: position x, position y" in output
    assert not (tmp_path / "b.stream").exists()


def test_so_many_rows_are_learned_as_were_wanted(run_command_line: RunCommand, rows: Path, tmp_path: Path):
    """And no more is read."""
    assert run_command_line("stream", rows, *SOSC, "--rows", "23", "--out", "a.stream").exit_code == 0
    assert models_equal(tmp_path / "a.stream", expected(walk(0, 60)[:23]))


@pytest.mark.parametrize("batch", [1, 4])
def test_growth_is_told_each_so_many_datapoints(
    run_command_line: RunCommand, run_json: RunJson, rows: Path, batch: int
):
    """A line at every multiple, or at the end of the batch that holds it; a list for programs."""
    learner = [*SOSC, "--every", "25", "--batch", batch]
    output = run_command_line("stream", rows, *learner).stdout.splitlines()
    counts = [25, 50] if batch == 1 else [28, 52]
    assert [line.split()[0] for line in output[:2]] == [str(count) for count in counts]
    assert "clusters, dimensions" in output[0]
    assert [mark["datapoints"] for mark in run_json("stream", rows, *learner)["history"]] == counts


def test_the_answer_for_programs_tells_all_of_every_cluster(run_json: RunJson, rows: Path):
    """As the model and the skill have them, identities for indices."""
    answer, model = run_json("stream", rows, *SOSC), expected(walk(0, 60))
    assert [c["cluster_id"] for c in answer["clusters"]] == model.cluster_ids.tolist()
    assert sum(c["points"] for c in answer["clusters"]) == answer["datapoints"] == 60
    assert [c["dimensions"]["world"] for c in answer["clusters"]] == model.dimensions[:, 0].tolist()
    for cluster in answer["clusters"]:
        assert not cluster["next"] or np.isclose(sum(cluster["next"].values()), 1.0)
        assert set(cluster["next"]) <= {str(cluster_id) for cluster_id in model.cluster_ids}
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
                "--weighting trace --discount .9 --forget-below .1 --extra-directions 2"
            ),
            online.DPMPPCA(
                1.0, 0.1, 0.1, 2.0, online.Maintenance(discount=0.9, forget_below=0.1, extra_directions=2)
            ),
        ),
        (
            (
                "--learner hdp-hsmm --cluster 1 --noise .1 --transition 0 --new-transition .2 "
                "--weighting constant --weight 9 --merge-distance 0 --max-clusters 3"
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
def test_options_say_what_the_library_says(
    run_command_line: RunCommand, rows: Path, tmp_path: Path, options: str, settings: online.OnlineSettings
):
    """Every learner, weighting and kind of maintenance."""
    result = run_command_line("stream", rows, *options.split(), "--out", "a.stream")
    assert result.exit_code == 0
    assert models_equal(tmp_path / "a.stream", expected(walk(0, 60), settings))


MISUSE = {
    "--noise 1": "--cluster, --dimension, --bandwidth: --cluster is the squared distance",
    "--learner dp-gmm": "--from-batch M guesses them",
    "--learner hdp-hsmm --cluster 1 --noise 1": "--transition",
    "--learner dp-gmm --cluster 1 --noise 1 --dimension 2": "--dimension goes with another --learner",
    "--cluster 0": "0.0 is not in the range",
    "--cluster nan": "nan",
    "ALL --discount .9": "--discount goes with --weighting trace",
    "ALL --weighting trace --weight 3": "--weight goes with --weighting constant",
    "ALL --weighting constant": "needs --weight",
    "ALL --resume a.stream": "--cluster is as the file of --resume has it",
    "--resume a.stream --period 1": "--period",
    "ALL --from-batch 2": "--from-batch goes with a folder of recordings",
    "ALL --only 1": "--only goes with",
    "ALL --no-velocities": "--velocities goes with",
    "ALL --seed 1": "--seed goes with --from-batch",
    "ALL --save-every 1": "--save-every goes with --out",
    "ALL --out a --skill a": "two outputs",
    "ALL --out rows.csv --force": "what this command reads",
    "--resume a.stream --skill a.stream --force": "what this command reads",
}


@pytest.mark.parametrize("options", MISUSE)
def test_options_that_do_not_fit_are_misuse(
    run_command_line: RunCommand, rows: Path, tmp_path: Path, options: str
):
    """Exit code 2, and the words that say why; nothing is read, nothing written."""
    pf.save_stream(expected(walk(0, 9)), tmp_path / "a.stream")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    result = run_command_line("stream", rows, *options.replace("ALL", " ".join(SOSC)).split())
    assert (result.exit_code, result.stdout) == (2, "")
    assert MISUSE[options] in result.stderr.splitlines()[-1]
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_person_sees_the_growth_and_a_program_does_not(
    run_command_line: RunCommand, rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """One line on stderr, written over and taken away at the end."""
    assert run_command_line("stream", rows, *SOSC).stderr == ""
    monkeypatch.setattr(growing, "a_person_watches", lambda: True)
    monkeypatch.setattr(growing, "PATIENCE", 0.0)
    monkeypatch.setattr(stream_lines, "CHUNK", 800)
    (tmp_path / "rows.csv").write_text(rows.read_text() + "x\n")
    shown = run_command_line("stream", rows, *SOSC, "--out", "a.stream").stderr
    assert shown.count("datapoints, ") > 3
    assert "60 datapoints, " in shown
    assert "\rline 62 is refused" in shown  # click leaves out what only a terminal understands
    assert shown.endswith("\r")


def test_files_are_kept_meanwhile(run_command_line: RunCommand, rows: Path, monkeypatch: pytest.MonkeyPatch):
    """Every so many seconds, whole; a time when that fails is told, and the stream goes on."""
    kept: list[int] = []
    monkeypatch.setattr(stream_lines, "CHUNK", 800)
    monkeypatch.setattr(growing, "save_stream", lambda model, _, **__: kept.append(model.datapoints))
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream", "--save-every", "1e-9").exit_code == 0
    assert len(kept) > 3
    assert kept == sorted(kept)
    assert kept[-1] == 60

    def full(model: online.OnlineModel, path: Path, **_: bool) -> None:
        if model.datapoints < 60:
            raise InvalidInput(f"{path} cannot be written: no room")

    monkeypatch.setattr(growing, "save_stream", full)
    result = run_command_line("stream", rows, *SOSC, "--out", "a.stream", "--save-every", "1e-9")
    assert result.exit_code == 0
    assert "not saved at" in result.stderr


@pytest.mark.parametrize("batch", [1, 7])
def test_a_stream_that_breaks_keeps_what_came_before(
    run_command_line: RunCommand, rows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int
):
    """Exit code 1, the reason on stderr, the file and the summary all the same."""
    monkeypatch.setattr(stream_lines, "LONGEST", 200)
    rows.write_text(rows.read_text() + "1" * 300)
    result = run_command_line("stream", rows, *SOSC, "--batch", batch, "--out", "a.stream")
    assert result.exit_code == 1
    assert "the stream broke: a line has more than 200 bytes" in result.stderr
    maintenance = online.Maintenance(batch=batch)
    assert models_equal(
        tmp_path / "a.stream", expected(walk(0, 60), replace(PENALTIES, maintenance=maintenance))
    )
