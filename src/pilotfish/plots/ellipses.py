"""Gaussians on paper: 1-sigma ellipses in a plane, crosses in space, triads of axes where frames stand."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from matplotlib.text import Annotation
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped] # matplotlib types no 3-D axes

from pilotfish.demonstrations import Frame
from pilotfish.gaussians import Gaussian, ellipse, marginal
from pilotfish.plots.labels import label
from pilotfish.plots.style import SMALL, halo, state_colour, state_dash
from pilotfish.types import Array, Float

CONTOUR_POINTS = 73  # one every five degrees


@dataclass(frozen=True, slots=True)
class Triad:
    """A frame's name, and its origin and axes in D columns, the axes side by side."""

    name: str
    origin: Float[Array, " D"]
    arms: Float[Array, "D 3"]


def draw_ellipses(
    axes: Axes,
    means: Float[Array, "K D"],
    covariances: Float[Array, "K D D"],
    plane: tuple[int, int],
    gid: str,
) -> list[Annotation]:
    """The 1-sigma contour of every state's marginal in the plane, its number where it lies outermost.

    The numbers are returned: they are to be settled when all is drawn.
    """
    labels = []
    centre = means[:, plane].mean(axis=0)
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        g = marginal(Gaussian(mean, covariance), np.array(plane))
        contour, colour = ellipse(g, 1.0, CONTOUR_POINTS), state_colour(k)
        patch = Polygon(
            contour, facecolor=(colour, 0.2), edgecolor=colour, linestyle=state_dash(k), linewidth=1.4
        )
        patch.set(zorder=3, gid=f"{gid} state {k}")
        axes.add_patch(patch)
        outermost = contour[np.linalg.norm(contour - centre, axis=1).argmax()]
        labels.append(label(axes, str(k), outermost))
        labels[-1].set(color=colour, fontweight="bold")
    axes.autoscale_view()
    return labels


def draw_crosses(axes: Axes3D, means: Float[Array, "K 3"], covariances: Float[Array, "K 3 3"]) -> None:
    """The principal axes of every state's 1-sigma ellipsoid."""
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        values, vectors = np.linalg.eigh(covariance)
        for arm in (vectors * np.sqrt(np.maximum(values, 0.0))).T:
            axes.plot(*np.stack([mean - arm, mean + arm], axis=1), color=state_colour(k), linewidth=1.8)
        axes.plot(*mean[:, None], marker="o", markersize=5, color=state_colour(k))


def draw_triads(axes: Axes, triads: Sequence[Triad]) -> None:
    """Where frames stand: their axes, in a plane or in space."""
    for triad in triads:
        for arm in triad.arms.T:
            axes.plot(
                *np.stack([triad.origin, triad.origin + arm], axis=1), color="0.25", linewidth=1.4, zorder=4
            )
        axes.plot(*triad.origin[:, None], color="0.25", marker="s", markersize=4, zorder=4)


def triads_of(
    frames: Sequence[Frame], space: Sequence[int], shown: Sequence[int], length: float
) -> list[Triad]:
    """The axes of frames, so long, in the columns shown; space lists those of the whole position."""
    places = [space.index(column) for column in shown]
    return [
        Triad(frame.name, frame.b[list(space)][places], length * frame.A[np.ix_(space, space)][places])
        for frame in frames
    ]


def letter_in_space(axes: Axes3D, triads: Sequence[Triad]) -> None:
    for triad in triads:
        for name, arm in zip("xyz", triad.arms.T, strict=False):
            letter = axes.text(*(triad.origin + 1.18 * arm), name, color="0.25", fontsize=SMALL, zorder=6)
            halo(letter).set(ha="center", va="center")


def label_triads(axes: Axes, triads: Sequence[Triad], length: float) -> list[Annotation]:
    """A letter beyond each axis, but for those that point at the viewer, and names beneath the origins."""
    names = [label(axes, triad.name, triad.origin, (0.0, -14.0)) for triad in triads]
    letters = [
        label(axes, letter, triad.origin + arm, _beyond(arm))
        for triad in triads
        for letter, arm in zip("xyz", triad.arms.T, strict=False)
        if np.linalg.norm(arm) > 0.3 * length
    ]
    for text in letters:
        text.set_color("0.25")
    for text in (*names, *letters):
        text.set_fontsize(SMALL)
    return [*names, *letters]


def _beyond(arm: Float[Array, "2"]) -> tuple[float, float]:
    """Seven points further."""
    right, up = 7.0 * arm / np.linalg.norm(arm)
    return float(right), float(up)
