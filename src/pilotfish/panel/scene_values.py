"""What the page draws, as arrays: paths, ellipsoids, poses at a time, the grid and the first camera.

Nothing here knows a browser. Lengths are in the unit of the position.
"""

from dataclasses import dataclass
from math import ceil, floor, log10

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.geometry import Pose, quaternion_from_rotation_matrix
from pilotfish.models import AdaptedSkill
from pilotfish.panel.colours import state_colours
from pilotfish.panel.content import ViewContent, is_fixed
from pilotfish.panel.frame_motions import frame_pose
from pilotfish.panel.spatial_columns import (
    SPACE,
    covariances_in_space,
    orientations_in_space,
    points_in_space,
    position_part,
)
from pilotfish.types import Array, Float, Int, UInt8

MAX_PATH_POINTS = 1000  # of one line
MIN_THICKNESS = 0.002  # semi-axis of an ellipsoid, relative to the extent: a plane one is a disc
FIELD_OF_VIEW = np.radians(75.0)  # vertical, that of viser
VIEW_FROM = np.array([0.55, -0.75, 0.5])  # direction from the data to the first camera; z is up
VIEW_FROM_ABOVE = np.array([0.0, -1e-3, 1.0])  # for data in a plane: x to the right, y up
VIEW_SHARE = 0.85  # of the image, that the data fill at most
VIEW_ASPECT = 1.05  # width to height of the narrowest image that has all data in it


@dataclass(frozen=True, slots=True, eq=False)
class Ellipsoids:
    """Ellipsoid of each state.

    Attributes:
        centres: Mean of each state.
        quaternions: Orientation w x y z of the principal axes.
        semi_axes: Lengths of the principal semi-axes.
        colours: Red, green and blue.
    """

    centres: Float[Array, "K 3"]
    quaternions: Float[Array, "K 4"]
    semi_axes: Float[Array, "K 3"]
    colours: UInt8[Array, "K 3"]


@dataclass(frozen=True, slots=True, eq=False)
class Extent:
    """Box around demonstrations, frames and states.

    Attributes:
        lowest: Smallest coordinates.
        highest: Largest coordinates.
        is_flat: Whether the position has fewer than three axes.
    """

    lowest: Float[Array, " 3"]
    highest: Float[Array, " 3"]
    is_flat: bool

    @property
    def centre(self) -> Float[Array, " 3"]:
        """Middle of the box."""
        return np.asarray(0.5 * (self.lowest + self.highest))

    @property
    def size(self) -> float:
        """Diagonal of the box."""
        return float(np.linalg.norm(self.highest - self.lowest))


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """First view of the page.

    Attributes:
        position: Position of the camera.
        look_at: Point in the middle of the image.
        up: Direction that is up in the image.
    """

    position: Float[Array, " 3"]
    look_at: Float[Array, " 3"]
    up: Float[Array, " 3"]


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Horizontal grid under the data.

    Attributes:
        centre: Middle of the grid.
        width: Length in x.
        height: Length in y.
        cell: Distance of two lines.
    """

    centre: Float[Array, " 3"]
    width: float
    height: float
    cell: float


def path_segments(layout: Layout, x: Float[Array, "T D"]) -> Float[Array, "S 2 3"]:
    """Return the line through the rows of a motion as segments; a long one is thinned out."""
    points = points_in_space(layout, x)
    steps = np.unique(np.linspace(0, len(points) - 1, min(len(points), MAX_PATH_POINTS)).round().astype(int))
    points = points[steps]
    return np.stack([points[:-1], points[1:]], axis=1)


def state_ellipsoids(adapted: AdaptedSkill, deviations: float, min_semi_axis: float) -> Ellipsoids:
    """Return the ellipsoids of the positions of all states.

    Args:
        adapted: Adapted skill.
        deviations: Semi-axes in standard deviations.
        min_semi_axis: Smallest semi-axis that is drawn.
    """
    values, axes = np.linalg.eigh(covariances_in_space(adapted.layout, adapted.covariances))
    axes[np.linalg.det(axes) < 0.0, :, 0] *= -1.0  # principal axes that are a rotation
    semi_axes = np.maximum(deviations * np.sqrt(np.maximum(values, 0.0)), min_semi_axis)
    return Ellipsoids(
        points_in_space(adapted.layout, adapted.means),
        np.array([quaternion_from_rotation_matrix(each) for each in axes]),
        semi_axes,
        state_colours(adapted.states),
    )


def step_at(time: float, period: float, steps: int) -> int:
    """Return the step of a motion that is nearest to a time; the last one after its end."""
    return int(np.clip(round(time / period), 0, steps - 1))


def tool_pose(layout: Layout, x: Float[Array, "T D"], step: int) -> Pose:
    """Return the pose of the tool at a step; without an orientation, its axes are those of the world."""
    row = x[step : step + 1]
    quaternions = orientations_in_space(layout, row)
    q = np.array([1.0, 0.0, 0.0, 0.0]) if quaternions is None else quaternions[0]
    return Pose(points_in_space(layout, row)[0], q)


def extent_of(content: ViewContent, adapted: AdaptedSkill | None) -> Extent:
    """Return the box around all that the page draws at first."""
    layout = content.layout
    points = [points_in_space(layout, demo.x) for demo in content.demonstrations]
    points += [
        frame_pose(frame, layout).position[None]
        for each in content.situations
        for frame in each.frames
        if not is_fixed(frame)  # the world's may be far from a drawing
    ]
    if adapted is not None:
        points.append(points_in_space(layout, adapted.means))
    every = np.vstack(points or [np.zeros((1, SPACE))])
    lowest, highest = every.min(axis=0), every.max(axis=0)
    if not float(np.ptp(every, axis=0).max()) > 0.0:  # a single point
        lowest, highest = lowest - 0.5, highest + 0.5
    return Extent(lowest, highest, position_part(layout)[0].size < SPACE)


def first_camera(extent: Extent) -> Camera:
    """Return a view of the whole box: from above if it is flat, else from the front right, z up.

    A corner at height h above the line of sight, and depth d in front of the middle of the box, is in the
    image if h <= (D - d) tan(field of view / 2), where D is the distance of the camera. Width is alike.
    """
    backward = VIEW_FROM_ABOVE if extent.is_flat else VIEW_FROM
    backward = backward / np.linalg.norm(backward)
    up = np.array([0.0, 0.0, 1.0])
    right = np.cross(up, backward) / np.linalg.norm(np.cross(up, backward))
    offsets = _corners(extent) - extent.centre
    tangent = VIEW_SHARE * np.tan(0.5 * FIELD_OF_VIEW)
    heights = np.abs(offsets @ np.cross(backward, right)) / tangent
    widths = np.abs(offsets @ right) / (VIEW_ASPECT * tangent)
    distance = float((np.maximum(heights, widths) + offsets @ backward).max())
    return Camera(extent.centre + distance * backward, extent.centre, up)


def _corners(extent: Extent) -> Float[Array, "8 3"]:
    """Return the corners of the box."""
    choices = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(SPACE, -1).T
    return np.where(choices == 1, extent.highest, extent.lowest)


def grid_under(extent: Extent) -> Grid:
    """Return a grid at the lowest point, in cells of 1, 2 or 5 times a power of ten."""
    sides = (extent.highest - extent.lowest)[:2]
    cell = round_length(0.1 * max(float(sides.max()), 0.5 * extent.size))
    lines = [max(ceil((side + 2.0 * cell) / cell), 4) for side in sides.tolist()]
    centre = np.array([*np.round(extent.centre[:2] / cell) * cell, extent.lowest[2]])
    return Grid(centre, lines[0] * cell, lines[1] * cell, cell)


def round_length(length: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above a positive length."""
    power = 10.0 ** floor(log10(length))
    return float(power * max(factor for factor in (1, 2, 5) if factor <= 1.0000001 * length / power))


def sphere_mesh(meridians: int = 20, parallels: int = 12) -> tuple[Float[Array, "V 3"], Int[Array, "F 3"]]:
    """Return vertices and triangles of a sphere of radius one."""
    polar = np.linspace(0.0, np.pi, parallels + 1)[:, None]
    around = np.linspace(0.0, 2.0 * np.pi, meridians, endpoint=False)[None]
    vertices = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar) + 0.0 * around],
        axis=-1,
    ).reshape(-1, SPACE)
    row, column = np.divmod(np.arange(parallels * meridians), meridians)
    corners = [(row + i) * meridians + (column + j) % meridians for i in (0, 1) for j in (0, 1)]
    upper_left, upper_right, lower_left, lower_right = corners
    faces = np.vstack(
        [
            np.stack([upper_left, lower_left, lower_right], axis=1),
            np.stack([upper_left, lower_right, upper_right], axis=1),
        ]
    )
    return vertices, faces
