"""Measures of held-out motions equal brute force, and every method is given the same information."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motion_measures import (
    extent,
    mean_angle,
    mean_distance,
    mean_with_offsets,
    relative_size,
)
from peer_recordings import load_recordings, select_names, split
from peer_tables import BEGIN, END, markdown_tables, replace_tables

import pilotfish as pf
from pilotfish.geometry import multiply, normalise
from pilotfish.planning import time_warped_distance

FOLDER = Path(__file__).parents[2] / "reproductions"
METHODS = ("pilotfish", "ProMP", "DMP", "GMR", "mean + offsets")


def test_mean_with_offsets_starts_and_ends_exactly(rng: np.random.Generator):
    demonstrations, start, end = rng.normal(size=(4, 9, 3)), rng.normal(size=3), rng.normal(size=3)
    x = mean_with_offsets(demonstrations, start, end)
    np.testing.assert_allclose(x[[0, -1]], [start, end], rtol=0, atol=1e-15)
    mean = demonstrations.mean(axis=0)
    np.testing.assert_allclose(x[4], mean[4] + (start - mean[0]) / 2 + (end - mean[-1]) / 2, atol=1e-15)


def test_mean_with_offsets_own_ends_is_mean(rng: np.random.Generator):
    demonstrations = rng.normal(size=(4, 9, 3))
    mean = demonstrations.mean(axis=0)
    np.testing.assert_allclose(mean_with_offsets(demonstrations, mean[0], mean[-1]), mean, atol=1e-15)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 39.37])
def test_measures_relative_to_size_do_not_depend_on_unit_or_origin(rng: np.random.Generator, unit: float):
    x, y = rng.normal(size=(2, 20, 2))
    shift = rng.normal(size=2)
    scaled = [unit * z + shift for z in (x, y)]
    assert relative_size(*scaled) == pytest.approx(relative_size(x, y), rel=1e-9)
    for distance in (mean_distance, time_warped_distance):
        expected = distance(x, y) / extent(y)
        assert distance(*scaled) / extent(scaled[1]) == pytest.approx(expected, rel=1e-9)


def test_relative_size_of_shrunk_motion_is_its_factor(rng: np.random.Generator):
    y = rng.normal(size=(20, 3))
    assert relative_size(0.4 * y + 3.0, y) == pytest.approx(0.4, rel=1e-12)


def test_mean_angle_of_rotated_orientations_is_the_angle(rng: np.random.Generator):
    q = normalise(rng.normal(size=(10, 4)))
    half = np.radians(15.0)
    turned = multiply(q, np.tile([np.cos(half), 0.0, np.sin(half), 0.0], (10, 1)))
    signs = np.where(np.arange(10) % 2, 1.0, -1.0)[:, None]
    assert mean_angle(q, signs * turned) == pytest.approx(30.0, rel=1e-9)


def test_select_names_unknown_recording_is_refused():
    assert select_names(["valve", "letters a"]) == ["letters a", "valve"]
    assert len(select_names([])) == 15
    with pytest.raises(pf.InvalidInput, match="no recording is named 'letter a', expected one of robotasks"):
        select_names(["letter a"])


@pytest.mark.parametrize("name", ["letters a", "helloworld e", "robotasks openbox"])
def test_split_gives_frames_and_peers_the_same_ends(data_folder, name: str):
    recording = load_recordings([name])[0]
    part = split(recording, 2)
    assert all(d is not part.test for d in part.training)
    assert len(part.training) == len(recording.demonstrations) - 1
    position = slice(0, recording.position)
    for frame, end, row in zip(part.test.frames, part.local_ends, (0, -1), strict=True):
        np.testing.assert_array_equal(frame.b[position], part.test.x[row, position])
        np.testing.assert_allclose(end[position], part.test.x[row, position], atol=1e-12)


def test_split_of_valve_gives_peers_start_and_frame_but_no_end(data_folder):
    recording = load_recordings(["valve"])[0]
    part = split(recording, 1)
    world = part.to_world(part.local_ends)
    np.testing.assert_allclose(world[0, :3], part.x[0, :3], atol=1e-12)
    changed = part.test.x.copy()
    changed[1:, :3] += 0.1  # the rest of the held-out demonstration
    moved = pf.demonstration(changed, part.test.period, part.test.layout, part.test.frames, part.test.name)
    others = (*recording.demonstrations[:1], moved, *recording.demonstrations[2:])
    again = split(type(recording)(recording.name, others, 3, is_pose=True, frame=recording.frame), 1)
    np.testing.assert_array_equal(again.local_ends, part.local_ends)
    np.testing.assert_array_equal(again.local_training, part.local_training)


def test_start_state_does_not_depend_on_later_rows(data_folder, peers):
    recording = load_recordings(["helloworld l"])[0]
    part = split(recording, 3)
    demonstration = part.test
    bent = demonstration.x.copy()
    bent[0, 2:] += 1.0  # the difference to the second row
    changed = pf.demonstration(bent, demonstration.period, demonstration.layout, demonstration.frames)
    np.testing.assert_array_equal(peers.start_state(replace(part, test=changed)), peers.start_state(part))
    np.testing.assert_array_equal(peers.start_state(part)[:2], part.x[0])


@pytest.mark.parametrize("name", ["letters m", "valve", "robotasks pouring"])
def test_to_world_inverts_coordinates_of_peers(data_folder, name: str):
    recording = load_recordings([name])[0]
    part = split(recording, 0)
    again = split(recording, 1)  # the first demonstration is a training demonstration here
    lengths = {len(d.x) for d in recording.demonstrations}
    world = part.to_world(again.local_training[0])
    assert mean_distance(world[:, : recording.position], part.x[:, : recording.position]) < 1e-3
    if len(lengths) == 1:
        np.testing.assert_allclose(world[:, : recording.position], part.x[:, : recording.position], atol=1e-9)


def test_missing_environment_is_a_note_without_traceback(data_folder, peers, monkeypatch):
    parts = [split(load_recordings(["letters c"])[0], 0)]
    monkeypatch.setattr(peers, "peer_environment", lambda *_: (Path("no/such/python"), {"gmr": "no network"}))
    answers, notes, _ = peers.compare(parts)
    assert list(answers[parts[0].name]) == ["pilotfish", "mean + offsets"]
    missing = [note for note in notes if "is left out" in note]
    assert [note.split()[0] for note in missing] == ["ProMP", "DMP", "GMR"]
    assert all("no such file" in note.lower() and "no network" in note for note in missing)


def test_missing_package_is_a_note_without_traceback(data_folder, peers, monkeypatch):
    parts = [split(load_recordings(["letters c"])[0], 0)]
    python = Path(sys.executable)  # of the project, which does not have the peers
    monkeypatch.setattr(peers, "peer_environment", lambda *_: (python, {"gmr": "no network"}))
    answers, notes, _ = peers.compare(parts)
    assert list(answers[parts[0].name]) == ["pilotfish", "mean + offsets"]
    assert any("GMR is left out: gmr cannot be imported" in note and "no network" in note for note in notes)


@pytest.mark.slow  # installs the peers
def test_peers_write_table_and_json(data_folder, tmp_path: Path):
    report = tmp_path / "rows.json"
    command = [sys.executable, FOLDER / "peers.py", "--only", "letters c", "robotasks openbox"]
    done = subprocess.run(
        [*command, "--json", report, "--out", tmp_path / "pictures"],
        check=True,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert "left out" not in done.stdout
    rows = {(row["recording"], row["method"]): row for row in json.loads(report.read_text())["rows"]}
    assert set(rows) == {(name, m) for name in ("robotasks openbox", "letters c") for m in METHODS}
    for method in ("ProMP", "GMR", "mean + offsets"):  # these are given start and end
        for name in ("robotasks openbox", "letters c"):
            assert rows[name, method]["end"] < 1e-6
            assert 90.0 < rows[name, method]["size"] < 110.0
    assert 3.0 < rows["letters c", "mean + offsets"]["mean"] < 8.0  # mean of demonstrations: 4-8 %
    assert rows["robotasks openbox", "DMP"]["end"] < 2.0
    assert len(list((tmp_path / "pictures").glob("*.png"))) == 2


def table_row(recording: str, method: str, mean: float, degrees: float | None) -> dict[str, object]:
    numbers = {"mean": mean, "warped": 1.0 + mean, "end": 0.5, "size": 99.6, "seconds": 0.0123}
    kind = {"unit": "%" if degrees is None else "mm", "degrees": degrees, "force": None}
    return {"recording": recording, "method": method} | numbers | kind


def test_markdown_tables_mark_smallest_distance(tmp_path: Path):
    rows = [
        table_row("letters a", "DMP", 2.0, None),
        table_row("letters a", "GMR", 3.0, None),
        table_row("valve", "DMP", 5.0, 7.0),
        table_row("valve", "GMR", 4.0, 8.0),
    ]
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    replace_tables(page, markdown_tables(rows))
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text
    assert "| letters a [%] | **2.00** / **3.00** | 3.00 / 4.00 |" in text
    assert "| valve [mm] | 5.00 / 6.00 | **4.00** / **5.00** |" in text
    assert "| valve [deg] | 7.00 | 8.00 |" in text
    assert "| valve [CPU ms] | 12.3 | 12.3 |" in text


def test_replace_tables_without_marks_is_refused(tmp_path: Path):
    page = tmp_path / "page.md"
    page.write_text("text\n")
    with pytest.raises(pf.InvalidInput, match="has no tables to replace"):
        replace_tables(page, "")
    assert page.read_text() == "text\n"
