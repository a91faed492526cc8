"""Universal Robots UR5e, on a pedestal before the objects of the tasks.

Source: Denavit-Hartenberg parameters, masses and centres of mass from Universal Robots' article "DH
parameters for calculations of kinematics and dynamics"; limits from the UR5e's documentation. The maker
publishes no inertias of this robot: each link is a solid cylinder of its mass about its centre of mass.
Chosen here: the shapes, joint friction, and the inertia of the rotors.
"""

import numpy as np

from pilotfish.control import arm_limits
from pilotfish.environments.robots.robot import IDENTITY, Robot
from pilotfish.environments.robots.serial_arm import (
    Capsule,
    SerialArm,
    chain_from_transforms,
    serial_arm_robot,
)
from pilotfish.environments.robots.transforms import standard_dh, turn_about_z
from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.types import Array, Float

HALF_PI = 0.5 * np.pi
A = (0.0, -0.425, -0.3922, 0.0, 0.0, 0.0)  # m
D = (0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996)  # m
ALPHA = (HALF_PI, 0.0, 0.0, HALF_PI, -HALF_PI, 0.0)  # rad
JOINT_NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
MAX_ANGLE = 2.0 * np.pi  # rad, of every joint
MAX_VELOCITY = np.pi  # rad/s
MAX_TORQUES = (150.0, 150.0, 150.0, 28.0, 28.0, 28.0)  # N m
MASSES = (3.761, 8.058, 2.846, 1.37, 1.3, 0.365)  # kg
CENTRES = (  # m, in link frame i of Denavit and Hartenberg, which follows the link
    (0.0, -0.02561, 0.00193),
    (0.2125, 0.0, 0.11336),
    (0.15, 0.0, 0.0265),
    (0.0, -0.0018, 0.01634),
    (0.0, 0.0018, 0.01634),
    (0.0, 0.0, -0.001159),
)
ROTORS = (0.1,) * 3 + (0.05,) * 3  # kg m^2 at the joint; chosen
COVERS: tuple[Capsule, ...] = (  # in the frame of the joint
    ((0.0, 0.0, 0.1), (0.0, 0.0, 0.19), 0.06),
    ((0.0, 0.0, 0.13), (-0.425, 0.0, 0.13), 0.06),
    ((0.0, 0.0, 0.015), (-0.3922, 0.0, 0.015), 0.05),
    ((0.0, 0.0, 0.06), (0.0, 0.0, 0.14), 0.045),
    ((0.0, 0.0, 0.03), (0.0, 0.0, 0.1), 0.045),
    ((0.0, 0.0, 0.03), (0.0, 0.0, 0.06), 0.04),
)
BASE = Pose(np.array([0.05, -0.3, 0.0]), turn_about_z(np.pi))
POSTURE = (0.0, -1.8, 2.0, -1.8, -HALF_PI, 0.0)  # rad: elbow up, tool down


def ur5e(base: Pose = BASE) -> Robot:
    """Return a UR5e whose base is at a pose in torso axes."""
    links = [standard_dh(*row) for row in zip(A, D, ALPHA, strict=True)]
    start = Pose(np.zeros(3), IDENTITY)
    n = len(links)
    return serial_arm_robot(
        SerialArm(
            name="ur5e",
            joint_names=JOINT_NAMES,
            chain=chain_from_transforms(base, [start, *links[:-1]], links[-1]),
            limits=arm_limits([-MAX_ANGLE] * n, [MAX_ANGLE] * n, [MAX_VELOCITY] * n, MAX_TORQUES),
            posture=np.array(POSTURE),
            masses=np.array(MASSES),
            centres=np.stack([_in_joint_frame(*pair) for pair in zip(links, CENTRES, strict=True)]),
            inertias=np.stack([_cylinder_inertia(*pair) for pair in zip(MASSES, COVERS, strict=True)]),
            rotors=np.array(ROTORS),
            covers=COVERS,
        )
    )


def _in_joint_frame(link: Pose, point: tuple[float, float, float]) -> Float[Array, " 3"]:
    return np.asarray(link.position + rotation_matrix(link.quaternion) @ np.array(point))


def _cylinder_inertia(mass: float, cover: Capsule) -> Float[Array, " 6"]:
    """Return the inertia of a solid cylinder as long as the capsule with one of its ends, along x or z."""
    start, end, radius = np.array(cover[0]), np.array(cover[1]), cover[2]
    axis = np.argmax(abs(end - start))
    length = float(abs(end - start).max()) + 2.0 * radius
    inertia = np.full(3, mass * (3.0 * radius**2 + length**2) / 12.0)
    inertia[axis] = 0.5 * mass * radius**2
    return np.concatenate([inertia, np.zeros(3)])


UR5E = ur5e()
