"""pilotfish stream with scales and penalties from the first rows."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from stream_commands import LAYOUT, SOSC, expected, models_equal, text, walk

import pilotfish as pf
from pilotfish.cli.stream import lines as stream_lines
from pilotfish.demonstrations import Layout, Quantity
from pilotfish.models import online

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]


@pytest.fixture
def rows(tmp_path: Path) -> Path:
    (tmp_path / "rows.csv").write_text(text(walk(0, 60)))
    return tmp_path / "rows.csv"


def first_settings(x: np.ndarray, **options: Any) -> online.SOSC:
    """Return the settings that the command estimates from first rows."""
    layout = Layout(tuple(replace(part, quantity=Quantity.SCALAR) for part in LAYOUT.parts))
    first = pf.demonstration(x, 0.01, layout)
    return online.estimate_settings([first], states=7, rng=np.random.default_rng(0), **options)


@pytest.mark.parametrize("chunk", [11, 2**16])
def test_stream_without_penalties_equals_library(
    run_command_line: RunCommand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chunk: int
):
    """Scales and penalties are those of the first rows, also if rows arrive byte by byte."""
    x = walk(0, 300) * [1.0, 1.0, 50.0, 50.0]
    (tmp_path / "rows.csv").write_text(text(x))
    monkeypatch.setattr(stream_lines, "CHUNK_BYTES", chunk)
    result = run_command_line("stream", "rows.csv", "--first-rows", "120", "--out", "a.stream")
    assert result.exit_code == 0
    model = expected(x, first_settings(x[:120]))
    assert models_equal(tmp_path / "a.stream", model)
    assert "from the first 120 rows: scales position " in result.stderr
    assert "scales      position " in result.stdout


@pytest.mark.parametrize(
    ("content", "count"),
    [("ONE\n\nTWO", 40), ("\n\nONE\nbad line\nTWO", 200), ("ONE\nTWO", 200)],
    ids=["blank line", "rejected line", "200 rows"],
)
def test_first_rows_end_with_first_demonstration(run_json: RunJson, tmp_path: Path, content: str, count: int):
    """Rejected lines do not count; the rows are learned, too."""
    x = walk(0, 300)
    parts = {"ONE": text(x[:40], header=False).strip(), "TWO": text(x[40:], header=False).strip()}
    for name, rows in parts.items():
        content = content.replace(name, rows)
    (tmp_path / "rows.csv").write_text(",".join(LAYOUT.names) + "\n" + content)
    answer = run_json("stream", "rows.csv")
    assert answer["observed"] == 300
    settings = first_settings(x[:count])
    assert answer["scales"] == list(settings.scales or ())
    assert answer["penalties"]["cluster"] == settings.cluster


def test_given_penalties_and_scales_take_precedence(run_json: RunJson, rows: Path):
    """With every penalty given only scales are estimated; with scales only penalties."""
    x = walk(0, 60)
    answer = run_json("stream", rows, *SOSC[:-1])
    assert answer["penalties"]["cluster"] == 0.3
    assert answer["scales"] == list(first_settings(x).scales or ())
    answer = run_json("stream", rows, "--scales", "2,2,4,4", "--noise", "0.125")
    settings = first_settings(x, scales=(2.0, 2.0, 4.0, 4.0))
    assert answer["scales"] == [2.0, 2.0, 4.0, 4.0]
    assert answer["penalties"]["noise"] == 0.125
    assert answer["penalties"]["cluster"] == settings.cluster
    assert run_json("stream", rows, "--no-scale")["scales"] is None


def test_resume_of_scaled_stream_equals_one_run(run_command_line: RunCommand, rows: Path, tmp_path: Path):
    """Scales are those of the file, not of the rows that follow."""
    lines = rows.read_text().splitlines(keepends=True)
    (tmp_path / "one.csv").write_text("".join(lines[:41]))
    (tmp_path / "two.csv").write_text("".join([lines[0], *lines[41:]]))
    assert run_command_line("stream", "one.csv", "--out", "a.stream").exit_code == 0
    assert run_command_line("stream", "two.csv", "--resume", "a.stream", "--out", "b.stream").exit_code == 0
    assert models_equal(tmp_path / "b.stream", expected(walk(0, 60), first_settings(walk(0, 60)[:40])))


def test_constant_first_rows_name_the_fix(run_failing: RunFailing, tmp_path: Path):
    (tmp_path / "rows.csv").write_text("1,2\n" * 30)
    assert "give the penalties" in run_failing("stream", "rows.csv", "--out", "a.stream")
    assert not (tmp_path / "a.stream").exists()
