"""Franka Emika Panda, on a pedestal before the objects of the tasks.

Source: link transforms and limits from Franka's documentation of the Panda (Denavit-Hartenberg parameters,
Craig's convention); masses and inertias identified by Gaz et al. 2019, IEEE Robotics and Automation Letters
4(4). Chosen here: the shapes, joint friction, and the inertia of the rotors. The robot's own torque control
hides most of the rotors' inertia, so the value is smaller than that of the motors.
"""

import numpy as np

from pilotfish.control import arm_limits
from pilotfish.environments.robots.robot import IDENTITY, Robot
from pilotfish.environments.robots.serial_arm import SerialArm, chain_from_transforms, serial_arm_robot
from pilotfish.environments.robots.transforms import modified_dh, turn_about_z
from pilotfish.geometry import Pose

HALF_PI = 0.5 * np.pi
A = (0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088)  # m
D = (0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.0)  # m
ALPHA = (0.0, -HALF_PI, HALF_PI, HALF_PI, -HALF_PI, HALF_PI, HALF_PI)  # rad
FLANGE = 0.107  # m along z of the last joint
HAND_YAW = np.pi  # rad, of the tool about z of the flange: joint 7 is near the middle of its range
LOWER = (-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973)  # rad
UPPER = (2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973)  # rad
MAX_VELOCITIES = (2.175,) * 4 + (2.61,) * 3  # rad/s
MAX_TORQUES = (87.0,) * 4 + (12.0,) * 3  # N m
MASSES = (4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522)  # kg
CENTRES = (  # m
    (0.003875, 0.002081, -0.04762),
    (-0.003141, -0.02872, 0.003495),
    (0.027518, 0.039252, -0.066502),
    (-0.05317, 0.104419, 0.027454),
    (-0.011953, 0.041065, -0.038437),
    (0.060149, -0.014117, -0.010517),
    (0.010517, -0.004252, 0.061597),
)
INERTIAS = (  # xx, yy, zz, xy, xz, yz [kg m^2]
    (0.70337, 0.70661, 0.009117, -0.000139, 0.006772, 0.019169),
    (0.007962, 0.02811, 0.025995, -0.003925, 0.010254, 0.000704),
    (0.037242, 0.036155, 0.01083, -0.004761, -0.011396, -0.012805),
    (0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641),
    (0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229),
    (0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341),
    (0.012516, 0.010027, 0.004815, -0.000428, -0.001196, -0.000741),
)
ROTORS = (0.1,) * 4 + (0.05,) * 3  # kg m^2 at the joint; chosen
COVERS = (
    ((0.0, 0.0, -0.19), (0.0, 0.0, -0.05), 0.06),
    ((0.0, 0.0, -0.05), (0.0, 0.0, 0.05), 0.06),
    ((0.0, 0.0, -0.2), (0.0, 0.0, -0.07), 0.06),
    ((0.0, 0.0, -0.04), (0.0, 0.0, 0.04), 0.06),
    ((0.0, 0.0, -0.28), (0.0, 0.0, -0.07), 0.055),
    ((0.0, 0.0, -0.02), (0.06, 0.0, 0.0), 0.05),
    ((0.0, 0.0, 0.02), (0.0, 0.0, 0.06), 0.042),
)
BASE = Pose(np.array([0.32, -0.5, -0.46]), IDENTITY)  # low, so that a horizontal tool is in reach too
# Elbow up, tool ahead and down, between the postures of the tasks.
POSTURE = (0.0, 0.0, 0.0, -2.1, 0.0, 2.5, 0.0)  # rad


def panda(base: Pose = BASE) -> Robot:
    """Return a Panda whose base is at a pose in torso axes."""
    transforms = [modified_dh(*row) for row in zip(A, D, ALPHA, strict=True)]
    hand = Pose(np.array([0.0, 0.0, FLANGE]), turn_about_z(HAND_YAW))
    return serial_arm_robot(
        SerialArm(
            name="panda",
            joint_names=tuple(f"joint{n}" for n in range(1, 8)),
            chain=chain_from_transforms(base, transforms, hand),
            limits=arm_limits(LOWER, UPPER, MAX_VELOCITIES, MAX_TORQUES),
            posture=np.array(POSTURE),
            masses=np.array(MASSES),
            centres=np.array(CENTRES),
            inertias=np.array(INERTIAS),
            rotors=np.array(ROTORS),
            covers=COVERS,
        )
    )


PANDA = panda()
