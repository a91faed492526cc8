"""Drawings in the image of a simulated scene: coordinate axes, a path, ellipsoids and copies of a tool."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np

from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

AXIS, AXIS_RADIUS, PATH_RADIUS = 0.06, 0.003, 0.003  # m
MAX_PATH_SEGMENTS = 400  # more segments look the same
AXES = np.array(
    [[0.85, 0.1, 0.1, 1.0], [0.1, 0.65, 0.15, 1.0], [0.15, 0.3, 0.9, 1.0]]
)  # x red, y green, z blue
ORANGE, BLUE = np.array([0.95, 0.5, 0.05, 1.0]), np.array([0.2, 0.45, 0.95, 0.3])
COPY_COLOUR = np.array([0.95, 0.5, 0.05, 0.45])
MIN_RADIUS = 1e-4  # m: a thinner ellipsoid is drawn with this radius


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Ellipsoid:
    """Points at one Mahalanobis distance from the mean of a Gaussian.

    Attributes:
        mean: Centre, in torso axes [m].
        covariance: Covariance of the positions [m^2].
        deviations: Mahalanobis distance of its points.
    """

    mean: Float[Array, " 3"]
    covariance: Float[Array, "3 3"]
    deviations: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class ToolCopy:
    """Copy of a tool at another pose.

    Attributes:
        point: Name of the site at the tool point.
        pose: Pose of that point, in torso axes.
    """

    point: str
    pose: Pose


def draw_ellipsoids(scene: mujoco.MjvScene, ellipsoids: Sequence[Ellipsoid]) -> None:
    """Draw translucent blue ellipsoids."""
    for ellipsoid in ellipsoids:
        variances, axes = np.linalg.eigh(ellipsoid.covariance)
        if np.linalg.det(axes) < 0.0:
            axes[:, 0] *= -1.0
        radii = np.maximum(ellipsoid.deviations * np.sqrt(np.maximum(variances, 0.0)), MIN_RADIUS)
        _add_geom(scene, int(mujoco.mjtGeom.mjGEOM_ELLIPSOID), radii, ellipsoid.mean, axes, BLUE)


def draw_tool_copies(
    model: mujoco.MjModel, data: mujoco.MjData, scene: mujoco.MjvScene, copies: Sequence[ToolCopy]
) -> None:
    """Draw the geoms of a tool again, translucent and orange, at other poses."""
    drawn = [scene.geoms[n] for n in range(scene.ngeom)] if copies else []
    for copy in copies:
        site = model.site(copy.point).id
        body = int(model.site_bodyid[site])
        tool = Pose(data.site_xpos[site], data.xquat[body])
        rotation = rotation_matrix(copy.pose.quaternion) @ rotation_matrix(tool.quaternion).T
        bodies = {b for b in range(model.nbody) if body in _ancestors(model, b)}
        for geom in drawn:
            if geom.objtype != mujoco.mjtObj.mjOBJ_GEOM or model.geom_bodyid[geom.objid] not in bodies:
                continue
            position = copy.pose.position + rotation @ (geom.pos - tool.position)
            added = _add_geom(scene, int(geom.type), geom.size, position, rotation @ geom.mat, COPY_COLOUR)
            if added is not None:
                added.size[:], added.dataid = geom.size, geom.dataid


def _ancestors(model: mujoco.MjModel, body: int) -> list[int]:
    """Return a body and those that carry it."""
    chain = [body]
    while chain[-1]:
        chain.append(int(model.body_parentid[chain[-1]]))
    return chain


def _add_geom(
    scene: mujoco.MjvScene,
    kind: int,
    size: Float[Array, " 3"],
    position: Float[Array, " 3"],
    rotation: Float[Array, "3 3"],
    colour: Float[Array, " 4"],
) -> mujoco.MjvGeom | None:
    """Draw a geom and return it, unless the scene is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(
        geom,
        kind,
        np.asarray(size, dtype=np.float64),
        np.asarray(position, dtype=np.float64),
        np.asarray(rotation, dtype=np.float64).ravel(),
        colour.astype(np.float32),
    )
    geom.category, geom.emission = mujoco.mjtCatBit.mjCAT_DECOR, 0.4
    scene.ngeom += 1
    return geom


def draw_frames(scene: mujoco.MjvScene, frames: Mapping[str, Pose]) -> None:
    """Draw poses as red, green and blue axes."""
    for pose in frames.values():
        ends = pose.position + AXIS * rotation_matrix(pose.quaternion).T
        for end, colour in zip(ends, AXES, strict=True):
            _add_capsule(scene, (pose.position, end), AXIS_RADIUS, colour)


def draw_path(scene: mujoco.MjvScene, path: Float[Array, "T 3"]) -> None:
    """Draw a path in orange."""
    for ends in pairwise(_subsample_path(path)):
        _add_capsule(scene, ends, PATH_RADIUS, ORANGE)


def _subsample_path(path: Float[Array, "T 3"]) -> Float[Array, "L 3"]:
    """Return points of the path from first to last, for at most MAX_PATH_SEGMENTS segments."""
    kept = np.linspace(0, len(path) - 1, min(len(path), MAX_PATH_SEGMENTS + 1)).round().astype(int)
    return np.asarray(path[kept])


def _add_capsule(
    scene: mujoco.MjvScene,
    ends: tuple[Float[Array, " 3"], Float[Array, " 3"]],
    radius: float,
    colour: Float[Array, " 4"],
) -> None:
    """Draw a capsule between two points, unless the scene is full."""
    kind = int(mujoco.mjtGeom.mjGEOM_CAPSULE)
    geom = _add_geom(scene, kind, np.zeros(3), np.zeros(3), np.eye(3), colour)
    if geom is not None:
        mujoco.mjv_connector(geom, kind, radius, *ends)
