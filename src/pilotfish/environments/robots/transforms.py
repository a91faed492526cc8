"""Transforms between joint frames by Denavit and Hartenberg's parameters."""

import numpy as np

from pilotfish.geometry import Pose, from_rotation_vector
from pilotfish.types import Array, Float


def turn_about_z(angle: float) -> Float[Array, " 4"]:
    """Return the quaternion of a rotation about z [rad]."""
    return from_rotation_vector(np.array([0.0, 0.0, angle]))


def turn_about_x(angle: float) -> Float[Array, " 4"]:
    """Return the quaternion of a rotation about x [rad]."""
    return from_rotation_vector(np.array([angle, 0.0, 0.0]))


def modified_dh(a: float, d: float, alpha: float) -> Pose:
    """Return joint frame i in joint frame i - 1 at q = 0: turn and move along x, then move along z.

    Args:
        a: Distance along x of frame i - 1 [m].
        d: Distance along z of frame i [m].
        alpha: Angle about x of frame i - 1 [rad].

    Source:
        Craig 2005, Introduction to Robotics, eq. 3.6.
    """
    along_x = Pose(np.array([a, 0.0, 0.0]), turn_about_x(alpha))
    return along_x @ Pose(np.array([0.0, 0.0, d]), np.array([1.0, 0.0, 0.0, 0.0]))


def standard_dh(a: float, d: float, alpha: float) -> Pose:
    """Return link frame i in the frame of the joint that moves it: move along z and x, then turn about x.

    Args:
        a: Distance along x [m].
        d: Distance along z [m].
        alpha: Angle about x [rad].

    Source:
        Siciliano et al. 2009, Robotics: Modelling, Planning and Control, section 2.8.2.
    """
    return Pose(np.array([a, 0.0, d]), turn_about_x(alpha))
