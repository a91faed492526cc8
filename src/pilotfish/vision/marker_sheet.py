"""Sheets of markers to print at true size, as PDF with a ruler that reveals a scaled print."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.io import atomic_file
from pilotfish.types import Array, Bool
from pilotfish.validation import (
    first_duplicate,
    require_count,
    require_number,
    require_type,
    short_list,
)
from pilotfish.vision.detection import marker_bitmap
from pilotfish.vision.marker_setup import DEFAULT_DICTIONARY, MAX_SIDE, MIN_SIDE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAPERS = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}  # mm
MM_PER_INCH = 25.4
PAGE_MARGIN, GAP, LABEL = 12.0, 6.0, 5.0  # mm; LABEL is the height of the text below a marker
RULER, RULER_HEIGHT = 100.0, 18.0  # mm
MAX_PAGES = 200


def write_marker_sheet(
    path: Path,
    ids: Sequence[int],
    side: float,
    *,
    dictionary: str = DEFAULT_DICTIONARY,
    paper: str = "a4",
    overwrite: bool = False,
) -> int:
    """Write a PDF with markers of a true size.

    Args:
        path: File to write.
        ids: Ids of the markers.
        side: Side of the black square of each [m].
        dictionary: Name from `DICTIONARIES`.
        paper: "a4" or "letter".
        overwrite: Whether to replace an existing file.

    Returns:
        The number of pages.

    Raises:
        InvalidInput: If an argument cannot be used, a marker does not fit the paper, or the file cannot be
            written.
    """
    _require_matplotlib()
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure

    numbers = _validate_ids(ids)
    width, height = _paper_size(paper)
    grids = [marker_bitmap(dictionary, number, 1) < 128 for number in numbers]
    places = _places(len(numbers), 1e3 * require_number(side, "side", MIN_SIDE, MAX_SIDE), grids[0], paper)
    with atomic_file(path, overwrite=overwrite) as temporary, PdfPages(temporary) as pages:
        for page in range(places[-1][0] + 1):
            figure = Figure(figsize=(width / MM_PER_INCH, height / MM_PER_INCH))
            axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
            axes.set(xlim=(0.0, width), ylim=(0.0, height))
            axes.set_axis_off()
            _draw_ruler(axes)
            for number, grid, (on, x, y) in zip(numbers, grids, places, strict=True):
                if on == page:
                    _draw_marker(axes, grid, (x, y), 1e3 * side)
                    text = f"{dictionary}  id {number}  side {1e3 * side:g} mm"
                    axes.text(x, y - LABEL, text, fontsize=6, va="bottom", color="0.3")
            pages.savefig(figure)
    return places[-1][0] + 1


def _require_matplotlib() -> None:
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise InvalidInput(
            "sheets of markers need matplotlib: pip install '.[plots]' in the clone"
        ) from error


def _validate_ids(ids: object) -> list[int]:
    require_type(ids, "ids", (list, tuple, range), "give a list of whole numbers")
    assert isinstance(ids, list | tuple | range)
    if not 1 <= len(ids) <= 2000:
        raise InvalidInput(f"ids has {len(ids)} entries, expected 1 to 2000")
    numbers = [require_count(number, "an id", 2**16) for number in ids]
    if (duplicate := first_duplicate(numbers)) is not None:
        raise InvalidInput(f"id {duplicate} is given twice, expected different ids")
    return numbers


def _paper_size(paper: object) -> tuple[float, float]:
    if not isinstance(paper, str) or paper not in PAPERS:
        raise InvalidInput(f"paper is {paper!r}, expected one of {short_list(list(PAPERS))}")
    return PAPERS[paper]


def _places(n: int, side: float, grid: Bool[Array, "S S"], paper: str) -> list[tuple[int, float, float]]:
    """Return page, left and lower edge of each marker [mm], row by row from the top."""
    width, height = PAPERS[paper]
    margin = side / len(grid)  # the white margin of one cell that detection needs
    block = side + 2 * margin + GAP
    across = int((width - 2 * PAGE_MARGIN + GAP) // block)
    down = int((height - 2 * PAGE_MARGIN - RULER_HEIGHT + GAP) // (block + LABEL))
    if across < 1 or down < 1:
        largest = (width - 2 * PAGE_MARGIN) / (1 + 2 / len(grid))
        raise InvalidInput(
            f"a marker of {side:g} mm does not fit on paper {paper}, expected at most {int(largest)} mm; "
            "print it on larger paper by other means"
        )
    if -(-n // (across * down)) > MAX_PAGES:
        raise InvalidInput(f"{n} markers need more than {MAX_PAGES} pages; give fewer ids")
    places = []
    for index in range(n):
        page, rest = divmod(index, across * down)
        row, column = divmod(rest, across)
        x = PAGE_MARGIN + margin + column * block
        y = height - PAGE_MARGIN - margin - side - row * (block + LABEL)
        places.append((page, x, y))
    return places


def _draw_marker(axes: "Axes", grid: Bool[Array, "S S"], corner: tuple[float, float], side: float) -> None:
    """Draw black cells as rows and again as columns, so that no white lines remain between them."""
    from matplotlib.collections import PolyCollection

    cell, top = side / len(grid), corner[1] + side
    boxes: list[tuple[float, float, float, float]] = []
    for n, (row, column) in enumerate(zip(grid, grid.T, strict=True)):
        near, far = n * cell, (n + 1) * cell
        boxes += [(first * cell, near, last * cell, far) for first, last in _runs(row)]
        boxes += [(near, first * cell, far, last * cell) for first, last in _runs(column)]
    outlines = [
        [(corner[0] + x, top - y) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
        for x0, y0, x1, y1 in boxes
    ]
    axes.add_collection(PolyCollection(outlines, facecolors="black", linewidths=0.0), autolim=False)


def _runs(cells: Bool[Array, " S"]) -> list[tuple[int, int]]:
    """Return the first index of each run of black cells, and the index after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], cells, [False]]).astype(int)))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def _draw_ruler(axes: "Axes") -> None:
    """Draw a line of 100 mm with a tick every 10 mm."""
    y, style = PAGE_MARGIN, {"color": "black", "linewidth": 0.5, "solid_capstyle": "butt"}
    line: Any = axes.plot
    line([PAGE_MARGIN, PAGE_MARGIN + RULER], [y, y], **style)
    for n in range(int(RULER) // 10 + 1):
        x = PAGE_MARGIN + 10.0 * n
        line([x, x], [y, y + (4.0 if n % 5 == 0 else 2.5)], **style)
    text = "this line is 100 mm long if the page is printed at 100 %; measure it"
    axes.text(PAGE_MARGIN, y + 5.5, text, fontsize=7, va="bottom")
