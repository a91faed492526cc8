"""Sheets of markers: true size in the PDF, ruler, pages."""

import re
import zlib
from pathlib import Path

import numpy as np
import pytest

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.vision import marker_bitmap, write_marker_sheet

POINT = 25.4 / 72.0  # mm
NUMBER = rb"(-?[0-9.]+)"


def page_streams(path: Path) -> list[bytes]:
    data = path.read_bytes()
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, re.DOTALL)
    texts = []
    for stream in streams:
        try:
            texts.append(zlib.decompress(stream))
        except zlib.error:
            continue
    return [text for text in texts if text.startswith(b"/DeviceRGB")]  # pages, not glyphs of fonts


def page_size(path: Path) -> list[float]:
    (box,) = set(re.findall(rb"/MediaBox \[ ([0-9. ]+) \]", path.read_bytes()))
    return [POINT * float(value) for value in box.split()]


def outlines(path: Path) -> np.ndarray:
    """Return x and y of the four corners of each filled polygon [mm]."""
    corner = NUMBER + rb" " + NUMBER
    pattern = corner + rb" m\s+" + rb"\s+".join([corner + rb" l"] * 3)
    found = [
        [float(value) for value in match]
        for stream in page_streams(path)
        for match in re.findall(pattern, stream)
    ]
    boxes = POINT * np.array(found).reshape(-1, 4, 2)
    return boxes[np.ptp(boxes[:, :, 0], axis=1) < 200.0]  # without the background of the page


@pytest.mark.parametrize(("paper", "size"), [("a4", (210.0, 297.0)), ("letter", (215.9, 279.4))])
def test_size_in_the_pdf_is_the_true_size(tmp_path, paper: str, size: tuple[float, float]):
    file = tmp_path / "markers.pdf"
    assert write_marker_sheet(file, [3], 0.05, paper=paper) == 1
    np.testing.assert_allclose(page_size(file), [0.0, 0.0, *size], atol=0.01)
    boxes = outlines(file)
    assert len(boxes) > 20
    spans = boxes.max(axis=(0, 1)) - boxes.min(axis=(0, 1))
    np.testing.assert_allclose(spans, [50.0, 50.0], atol=0.01)


def test_polygons_cover_the_black_cells_only(tmp_path):
    file = tmp_path / "markers.pdf"
    write_marker_sheet(file, [7], 0.04)
    grid = marker_bitmap("apriltag_36h11", 7, 1) < 128
    boxes, cell = outlines(file), 40.0 / len(grid)
    left, top = boxes[:, :, 0].min(), boxes[:, :, 1].max()
    covered = np.zeros(grid.shape, dtype=bool)
    for row in range(len(grid)):
        for column in range(len(grid)):
            x, y = left + (column + 0.5) * cell, top - (row + 0.5) * cell
            inside = (boxes.min(axis=1) < [x, y]).all(axis=1) & (boxes.max(axis=1) > [x, y]).all(axis=1)
            covered[row, column] = inside.any()
    np.testing.assert_array_equal(covered, grid)


def test_ruler_is_100_mm_long(tmp_path):
    file = tmp_path / "markers.pdf"
    write_marker_sheet(file, [0], 0.03)
    corner = NUMBER + rb" " + NUMBER
    lines = [
        POINT * np.array([float(value) for value in match])
        for stream in page_streams(file)
        for match in re.findall(corner + rb" m\s+" + corner + rb" l\s+S", stream)
    ]
    lengths = sorted(float(np.hypot(line[2] - line[0], line[3] - line[1])) for line in lines)
    assert lengths[-1] == pytest.approx(100.0, abs=0.01)
    assert len(lengths) == 12  # the line and its ticks


def test_many_markers_fill_pages_without_overlap(tmp_path):
    assert write_marker_sheet(tmp_path / "a.pdf", range(6), 0.05) == 1
    assert write_marker_sheet(tmp_path / "b.pdf", range(40), 0.05) > 1
    assert write_marker_sheet(tmp_path / "c.pdf", [1, 2], 0.14) == 2


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize(
    ("ids", "side", "options"),
    [
        ([], 0.05, {}), ([1, 1], 0.05, {}), ([600], 0.05, {}), ([-1], 0.05, {}), ([1.5], 0.05, {}),
        (None, 0.05, {}), ([1], 0.2, {}), ([1], 0.0, {}), ([1], np.nan, {}), ([1], 0.05, {"paper": "a3"}),
        ([1], 0.05, {"dictionary": "x"}), (range(500), 0.14, {}),
    ],
)  # fmt: skip
def test_unusable_arguments_are_invalid_input(tmp_path, ids, side, options):
    with pytest.raises(InvalidInput):
        write_marker_sheet(tmp_path / "a.pdf", ids, side, **options)
    assert not (tmp_path / "a.pdf").exists()


def test_existing_sheet_is_kept(tmp_path):
    (tmp_path / "a.pdf").write_text("mine")
    with pytest.raises(SkillError, match="exists"):
        write_marker_sheet(tmp_path / "a.pdf", [0], 0.05)
    assert (tmp_path / "a.pdf").read_text() == "mine"
