"""Geoms, colours and rotations of which the objects of tasks are made."""

import mujoco
import numpy as np

from pilotfish.environments.world import FLOOR, OBJECT, ROBOT
from pilotfish.geometry import from_rotation_vector
from pilotfish.types import Array, Float

BOX, CYLINDER, CAPSULE, SPHERE = (
    mujoco.mjtGeom.mjGEOM_BOX,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_SPHERE,
)
WOOD, STEEL, YELLOW = (0.72, 0.58, 0.42, 1.0), (0.66, 0.68, 0.71, 1.0), (0.95, 0.77, 0.1, 1.0)
GREEN, BLUE, GLASS = (0.15, 0.62, 0.3, 1.0), (0.2, 0.4, 0.75, 1.0), (0.55, 0.8, 0.85, 0.75)
Triple = tuple[float, float, float]


def add_solid(
    body: mujoco.MjsBody,
    name: str,
    kind: mujoco.mjtGeom,
    size: Triple,
    pos: Triple,
    rgba: tuple[float, float, float, float],
) -> mujoco.MjsGeom:
    """Add a geom without mass that collides with the robot and with objects, and return it."""
    geom = body.add_geom(name=name, type=kind, size=size, pos=pos, rgba=rgba, mass=0.0)
    geom.contype, geom.conaffinity = OBJECT, ROBOT | OBJECT
    return geom


def axis_angle_quaternion(axis: Triple, angle: float) -> Float[Array, " 4"]:
    """Return the quaternion of a rotation about a unit axis [rad]."""
    return from_rotation_vector(angle * np.array(axis))


def add_post(spec: mujoco.MjSpec, name: str, top: Float[Array, " 3"], half: float = 0.03) -> mujoco.MjsGeom:
    """Add a square post from the floor to a point [m], and return it; half is half of its width [m]."""
    x, y, z = (float(value) for value in top)
    return add_solid(spec.worldbody, name, BOX, (half, half, (z - FLOOR) / 2), (x, y, (z + FLOOR) / 2), STEEL)
