"""Placement of labels that overlap neither each other nor marks, and stay in their panel.

Each label is moved to the candidate position that covers least; the result is deterministic and needs no
pyplot.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox, BboxBase

from pilotfish.plots.style import add_outline
from pilotfish.types import Array, Float

DIRECTIONS = [(1, -1), (1, 0), (1, 1), (0, -1), (0, 1), (-1, -1), (-1, 0), (-1, 1)]
DISTANCES = (3.0, 8.0, 15.0, 24.0, 36.0)  # points between a label and its point
MARKER_RADIUS = 4.5  # points


def add_label(
    axes: Axes, text: str, point: Float[Array, "2"], offset: tuple[float, float] = (0.0, 0.0)
) -> Annotation:
    """Annotate a point, with an offset in points until labels are placed."""
    annotation = axes.annotate(
        text,
        (point[0], point[1]),
        offset,
        textcoords="offset points",
        annotation_clip=False,
        zorder=8,
    )
    add_outline(annotation).set(ha="center", va="center")
    return annotation


def place_labels(axes: Axes, labels: Sequence[Annotation], marks: Float[Array, "N 2"]) -> None:
    """Keep each label where it is free, otherwise move it where it covers least.

    marks are points that should stay visible. The figure must have been laid out before.
    """
    radius = MARKER_RADIUS / 72 * axes.figure.dpi
    occupied: list[BboxBase] = [
        Bbox([point - radius, point + radius]) for point in axes.transData.transform(marks)
    ]
    for text in labels:
        candidates = list(_candidate_shifts(text, axes.figure.dpi / 72))
        costs = [_overlap_cost(_move_label(text, offset), occupied, axes.bbox) for offset in candidates]
        occupied.append(_move_label(text, candidates[int(np.argmin(costs))]))


def _candidate_shifts(text: Annotation, pixels: float) -> Iterator[tuple[float, float]]:
    """Yield offsets in points: the present one, then around the point at growing distances."""
    x, y = text.xyann
    yield float(x), float(y)
    box = text.get_window_extent()
    for distance in DISTANCES:
        for right, up in DIRECTIONS:
            yield right * (box.width / pixels / 2 + distance), up * (box.height / pixels / 2 + distance)


def _move_label(text: Annotation, offset: tuple[float, float]) -> BboxBase:
    text.xyann = offset
    return text.get_window_extent()


def _overlap_cost(box: BboxBase, occupied: Sequence[BboxBase], panel: BboxBase) -> float:
    """Return the covered area, plus ten times the area outside the panel, in square pixels."""
    covered = sum(_overlap_area(box, other) for other in occupied)
    return covered + 10.0 * (box.width * box.height - _overlap_area(box, panel))


def _overlap_area(a: BboxBase, b: BboxBase) -> float:
    width = min(a.x1, b.x1) - max(a.x0, b.x0)
    height = min(a.y1, b.y1) - max(a.y0, b.y0)
    return max(float(width), 0.0) * max(float(height), 0.0)
