"""Gaussians on paper: 1-sigma ellipses in a plane, crosses in space, triads of axes where frames stand."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped] # matplotlib types no 3-D axes

from pilotfish.demonstrations import Frame
from pilotfish.gaussians import Gaussian, ellipse, marginal
from pilotfish.plots.style import SMALL, halo, state_colour, state_dash
from pilotfish.types import Array, Float

CONTOUR_POINTS = 73  # one every five degrees


def draw_ellipses(
    axes: Axes,
    means: Float[Array, "K D"],
    covariances: Float[Array, "K D D"],
    plane: tuple[int, int],
    gid: str,
) -> None:
    """The 1-sigma contour of every state's marginal in the plane, its number where it lies outermost."""
    centre = means[:, plane].mean(axis=0)
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        g = marginal(Gaussian(mean, covariance), np.array(plane))
        contour, colour = ellipse(g, 1.0, CONTOUR_POINTS), state_colour(k)
        patch = Polygon(
            contour, facecolor=(colour, 0.2), edgecolor=colour, linestyle=state_dash(k), linewidth=1.4
        )
        patch.set(zorder=3, gid=f"{gid} state {k}")
        axes.add_patch(patch)
        x, y = contour[np.linalg.norm(contour - centre, axis=1).argmax()]
        label = axes.text(x, y, str(k), color=colour, fontweight="bold", zorder=5)
        halo(label).set(ha="center", va="center")
    axes.autoscale_view()


def draw_crosses(axes: Axes3D, means: Float[Array, "K 3"], covariances: Float[Array, "K 3 3"]) -> None:
    """The principal axes of every state's 1-sigma ellipsoid."""
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        values, vectors = np.linalg.eigh(covariance)
        for arm in (vectors * np.sqrt(np.maximum(values, 0.0))).T:
            axes.plot(*np.stack([mean - arm, mean + arm], axis=1), color=state_colour(k), linewidth=1.8)
        axes.plot(*mean[:, None], marker="o", markersize=5, color=state_colour(k))


def draw_triads(
    axes: Axes, frames: Sequence[Frame], space: Sequence[int], shown: Sequence[int], length: float
) -> None:
    """Where frames stand: their axes, as long as given, in the chosen columns of a plane or of space.

    space lists the columns of the whole position. An axis that points at the viewer has no letter.
    """
    places = [space.index(column) for column in shown]
    for frame in frames:
        origin = frame.b[list(space)][places]
        arms = length * frame.A[np.ix_(space, space)][places]  # a column an axis
        for name, arm in zip("xyz", arms.T, strict=False):
            axes.plot(*np.stack([origin, origin + arm], axis=1), color="0.25", linewidth=1.4, zorder=4)
            if np.linalg.norm(arm) > 0.3 * length:
                letter = axes.text(
                    *(origin + 1.18 * arm),
                    name,  # type: ignore[call-arg] # three in space
                    color="0.25",
                    fontsize=SMALL,
                    zorder=6,
                )
                halo(letter).set(ha="center", va="center")
        axes.plot(*origin[:, None], marker="s", markersize=4, color="0.25", zorder=4)


def name_triads(axes: Axes, frames: Sequence[Frame], plane: tuple[int, int]) -> None:
    """The names of frames beneath their origins: the lower a frame, the further beneath.

    So names of frames that stand together are at least a line apart.
    """
    right, up = plane
    for n, frame in enumerate(sorted(frames, key=lambda frame: -frame.b[up])):
        place, shift = (frame.b[right], frame.b[up]), (7, -13 - 12 * n)  # the shift in points
        text = axes.annotate(frame.name, place, shift, textcoords="offset points", fontsize=SMALL, zorder=6)
        halo(text)
