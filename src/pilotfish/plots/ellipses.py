"""Gaussians on paper: 1-sigma ellipses in a plane, crosses in space, triads of axes where frames stand."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from mpl_toolkits.mplot3d.axes3d import Axes3D

from pilotfish.demonstrations import Frame
from pilotfish.gaussians import Gaussian, ellipse, marginal
from pilotfish.plots.style import AXIS_COLOURS, SMALL, halo, state_colour, state_dash
from pilotfish.types import Array, Float

CONTOUR_POINTS = 73  # one every five degrees


def draw_ellipses(
    axes: Axes, means: Float[Array, "K D"], covariances: Float[Array, "K D D"], plane: tuple[int, int], gid: str
) -> None:
    """The 1-sigma contour of every state's marginal in the plane, with the state's number at its mean."""
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        g = marginal(Gaussian(mean, covariance), np.array(plane))
        contour, colour = ellipse(g, 1.0, CONTOUR_POINTS), state_colour(k)
        style = {"linestyle": state_dash(k), "linewidth": 1.4, "zorder": 3}
        patch = Polygon(contour, facecolor=(colour, 0.22), edgecolor=colour, gid=f"{gid} state {k}", **style)
        axes.add_patch(patch)
        label = axes.text(*g.mean, str(k), color=colour, fontweight="bold", ha="center", va="center", zorder=5)
        halo(label).set_clip_on(True)
    axes.autoscale_view()


def draw_crosses(
    axes: Axes3D, means: Float[Array, "K 3"], covariances: Float[Array, "K 3 3"]
) -> None:
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

    space lists the columns of the whole position; x, y and z have a colour each.
    """
    places = [space.index(column) for column in shown]
    for frame in frames:
        turn = frame.A[np.ix_(space, space)]
        origin = frame.b[list(space)][places]
        for name, arm in zip("xyz", turn.T, strict=False):
            tip = origin + length * arm[places]
            axes.plot(*np.stack([origin, tip], axis=1), color=AXIS_COLOURS[name], linewidth=2.2, zorder=4)
        axes.plot(*origin[:, None], marker="s", markersize=4, color="black", zorder=4)


def name_triads(axes: Axes, frames: Sequence[Frame], shown: Sequence[int]) -> None:
    """The names of frames beside their origins, in a plane."""
    for frame in frames:
        x, y = frame.b[list(shown)]
        text = axes.annotate(frame.name, (x, y), (5, -11), textcoords="offset points", fontsize=SMALL, zorder=6)
        halo(text)
