"""Labels that cover neither each other nor the marks they stand by, and stay within their panel."""

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox, BboxBase

from pilotfish.plots.style import add_outline
from pilotfish.types import Array, Float

DIRECTIONS = [(1, -1), (1, 0), (1, 1), (0, -1), (0, 1), (-1, -1), (-1, 0), (-1, 1)]
DISTANCES = (3.0, 8.0, 15.0, 24.0, 36.0)  # points between a label and its place
MARKER_RADIUS = 4.5  # points from the middle of a mark to its rim


def add_label(
    axes: Axes, text: str, place: Float[Array, "2"], shift: tuple[float, float] = (0.0, 0.0)
) -> Annotation:
    """A text about a place of the panel, shifted by so many points until labels are settled."""
    annotation = axes.annotate(
        text,
        (place[0], place[1]),
        shift,
        textcoords="offset points",
        annotation_clip=False,
        zorder=8,
    )
    add_outline(annotation).set(ha="center", va="center")
    return annotation


def place_labels(axes: Axes, labels: Sequence[Annotation], marks: Float[Array, "N 2"]) -> None:
    """Each label in turn where it is if it is free there, otherwise where least is covered around its place.

    marks are places that nothing should cover. The figure has been laid out before.
    """
    radius = MARKER_RADIUS / 72 * axes.figure.dpi
    occupied: list[BboxBase] = [
        Bbox([place - radius, place + radius]) for place in axes.transData.transform(marks)
    ]
    for text in labels:
        places = list(_candidate_shifts(text, axes.figure.dpi / 72))
        costs = [_overlap_cost(_move_label(text, place), occupied, axes.bbox) for place in places]
        occupied.append(_move_label(text, places[int(np.argmin(costs))]))


def _candidate_shifts(text: Annotation, pixels: float) -> Iterator[tuple[float, float]]:
    """Shifts in points: the label's own, then around its place, further and further away."""
    x, y = text.xyann
    yield float(x), float(y)
    box = text.get_window_extent()
    for distance in DISTANCES:
        for right, up in DIRECTIONS:
            yield right * (box.width / pixels / 2 + distance), up * (box.height / pixels / 2 + distance)


def _move_label(text: Annotation, shift: tuple[float, float]) -> BboxBase:
    text.xyann = shift
    return text.get_window_extent()


def _overlap_cost(box: BboxBase, occupied: Sequence[BboxBase], panel: BboxBase) -> float:
    """How much is covered and how much lies outside, in square pixels; outside is worse."""
    covered = sum(_overlap_area(box, other) for other in occupied)
    return covered + 10.0 * (box.width * box.height - _overlap_area(box, panel))


def _overlap_area(one: BboxBase, two: BboxBase) -> float:
    width = min(one.x1, two.x1) - max(one.x0, two.x0)
    height = min(one.y1, two.y1) - max(one.y0, two.y0)
    return max(float(width), 0.0) * max(float(height), 0.0)
