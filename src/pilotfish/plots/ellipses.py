"""Gaussians as 1-sigma ellipses in a plane or principal axes in space, and axes of frames."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from matplotlib.text import Annotation, Text
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped] # matplotlib types no 3-D axes

from pilotfish.demonstrations import Frame
from pilotfish.gaussians import Gaussian, marginal
from pilotfish.plots.labels import add_label
from pilotfish.plots.style import SMALL_FONT, add_outline, state_colour, state_dash
from pilotfish.types import Array, Float

CONTOUR_POINTS = 73  # every five degrees
# Name, origin, and axes x, y and z side by side, of a frame in the drawn columns.
FrameAxes = tuple[str, Float[Array, " D"], Float[Array, "D _"]]


def draw_ellipses(
    axes: Axes,
    means: Float[Array, "K D"],
    covariances: Float[Array, "K D D"],
    plane: tuple[int, int],
    gid: str,
) -> list[Annotation]:
    """Draw the 1-sigma contour of each state's marginal, and its number at the outermost point.

    Args:
        axes: Axes to draw into.
        means: Mean of each state.
        covariances: Covariance of each state.
        plane: Indices of the two columns.
        gid: Prefix of the identifiers of the contours.

    Returns:
        The labels, to be placed at the end.
    """
    labels = []
    centre = means[:, plane].mean(axis=0)
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        g = marginal(Gaussian(mean, covariance), np.array(plane))
        contour, colour = g.ellipse(1.0, CONTOUR_POINTS), state_colour(k)
        patch = Polygon(
            contour, facecolor=(colour, 0.2), edgecolor=colour, linestyle=state_dash(k), linewidth=1.4
        )
        patch.set(zorder=3, gid=f"{gid} state {k}")
        axes.add_patch(patch)
        outermost = contour[np.linalg.norm(contour - centre, axis=1).argmax()]
        labels.append(add_label(axes, str(k), outermost))
        _style_state_number(labels[-1], k)
    axes.autoscale_view()
    return labels


def draw_principal_axes(axes: Axes3D, means: Float[Array, "K 3"], covariances: Float[Array, "K 3 3"]) -> None:
    """Draw the principal axes of every state's 1-sigma ellipsoid, and its number above."""
    rise = np.array([0.0, 0.0, 0.06 * float(np.ptp(means, axis=0).max())])
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        values, vectors = np.linalg.eigh(covariance)
        for axis in (vectors * np.sqrt(np.maximum(values, 0.0))).T:
            axes.plot(*np.stack([mean - axis, mean + axis], axis=1), color=state_colour(k), linewidth=1.8)
        axes.plot(*mean[:, None], marker="o", markersize=5, color=state_colour(k))
        number = axes.text(*(mean + rise), str(k), ha="center", va="bottom", zorder=10)
        _style_state_number(number, k)


def _style_state_number(number: Text, state: int) -> None:
    """Write a state's number in black in a box with the state's colour: light colours are hard to read."""
    number.set(color="black", fontweight="bold", fontsize=SMALL_FONT, path_effects=[])
    box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": state_colour(state)}
    number.set_bbox({**box, "linewidth": 1.4, "linestyle": state_dash(state)})


def draw_frame_axes(axes: Axes, frame_axes: Sequence[FrameAxes]) -> None:
    """Draw the axes of frames, in a plane or in space."""
    for _, origin, directions in frame_axes:
        for axis in directions.T:
            axes.plot(*np.stack([origin, origin + axis], axis=1), color="0.25", linewidth=1.4, zorder=4)
        axes.plot(*origin[:, None], color="0.25", marker="s", markersize=4, zorder=4)


def frame_axes_in(
    frames: Sequence[Frame], position: Sequence[int], columns: Sequence[int], length: float
) -> list[FrameAxes]:
    """Return the axes of frames, of a given length, in the drawn columns of the position."""
    rows = [position.index(column) for column in columns]
    return [
        (frame.name, frame.b[list(position)][rows], length * frame.A[np.ix_(position, position)][rows])
        for frame in frames
    ]


def label_frame_axes_3d(axes: Axes3D, frame_axes: Sequence[FrameAxes]) -> None:
    """Label the axes of frames in space by letters."""
    for _, origin, directions in frame_axes:
        for name, axis in zip("xyz", directions.T, strict=False):
            letter = axes.text(*(origin + 1.18 * axis), name, color="0.25", fontsize=SMALL_FONT, zorder=6)
            add_outline(letter).set(ha="center", va="center")


def label_frame_axes(axes: Axes, frame_axes: Sequence[FrameAxes], length: float) -> list[Annotation]:
    """Label axes by letters, except those that point at the viewer, and origins by names."""
    names = [add_label(axes, name, origin, (0.0, -14.0)) for name, origin, _ in frame_axes]
    letters = [
        add_label(axes, letter, origin + axis, _label_offset(axis))
        for _, origin, directions in frame_axes
        for letter, axis in zip("xyz", directions.T, strict=False)
        if np.linalg.norm(axis) > 0.3 * length
    ]
    for text in letters:
        text.set_color("0.25")
    for text in (*names, *letters):
        text.set_fontsize(SMALL_FONT)
    return [*names, *letters]


def _label_offset(axis: Float[Array, "2"]) -> tuple[float, float]:
    """Return an offset of seven points along the axis."""
    right, up = 7.0 * axis / np.linalg.norm(axis)
    return float(right), float(up)
