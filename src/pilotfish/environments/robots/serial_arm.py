"""A robot from numbers: kinematics, masses and limits of a serial arm, with capsules as its shape."""

from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np

from pilotfish.control import SerialChain, impedance
from pilotfish.environments.robots.robot import SIDE, Robot
from pilotfish.environments.world import FLOOR, Triple, add_cover, add_fixed_geom, set_inertial
from pilotfish.geometry import Pose
from pilotfish.kernels import ArmLimits
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

WHITE, DARK, GREY = (0.9, 0.9, 0.91, 1.0), (0.3, 0.32, 0.35, 1.0), (0.45, 0.46, 0.48, 1.0)
FRICTION = 1.0  # N m s/rad, of each joint; chosen
HAND_MASS, HAND_INERTIA = 0.05, 5e-5  # kg, kg m^2: the screws and plate between flange and tool
# Position control is 4 Hz at the weakest and 2 Hz at the strongest joint: stiffness = torque limit * this.
POSITION_STIFFNESS, POSITION_DAMPING = 6.0, 0.6  # 1/rad, s/rad
Capsule = tuple[Triple, Triple, float]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class SerialArm:
    """Mechanics of an arm of n joints; what belongs to a link is in the frame of the joint that moves it.

    Attributes:
        name: Name of the robot.
        joint_names: Names of the joints, in order.
        chain: Kinematics from the world to the hand.
        limits: Limits of the joints.
        posture: Nominal joint positions [rad].
        masses: Mass of each link [kg].
        centres: Centre of mass of each link [m].
        inertias: Inertia xx, yy, zz, xy, xz, yz of each link about its centre of mass [kg m^2].
        rotors: Inertia of each motor at the joint [kg m^2].
        covers: Capsule of each link: two ends and the radius [m]; None for a link without shape.
    """

    name: str
    joint_names: tuple[str, ...]
    chain: SerialChain
    limits: ArmLimits
    posture: Float[Array, " n"]
    masses: Float[Array, " n"]
    centres: Float[Array, "n 3"]
    inertias: Float[Array, "n 6"]
    rotors: Float[Array, " n"]
    covers: tuple[Capsule | None, ...]


def serial_arm_robot(arm: SerialArm) -> Robot:
    """Return the robot of an arm, on a pedestal, with torque motors and the default impedance.

    Args:
        arm: Mechanics of the arm.
    """
    torque = arm.limits.torque
    return Robot(
        name=arm.name,
        joint_names=arm.joint_names,
        chain=arm.chain,
        limits=arm.limits,
        posture=arm.posture,
        add_body=partial(_add_pedestal, arm),
        add_arm=partial(_add_arm, arm),
        position_stiffness=POSITION_STIFFNESS * torque,
        position_damping=POSITION_DAMPING * torque,
        impedance=impedance,
    )


def chain_from_transforms(
    base: Pose, transforms: list[Pose], last_from_hand: Pose, axis: Triple = (0.0, 0.0, 1.0)
) -> SerialChain:
    """Return a chain from the transform between successive joint frames, whose axes are the same.

    Args:
        base: Pose of the base in the world.
        transforms: Frame of each joint at q = 0 in the frame of the joint before, the first in the base.
        last_from_hand: Pose of the hand in the frame of the last joint.
        axis: Axis of every joint in its own frame.
    """
    return SerialChain(
        base,
        np.stack([transform.position for transform in transforms]),
        np.stack([transform.quaternion for transform in transforms]),
        np.tile(axis, (len(transforms), 1)),
        last_from_hand,
    )


def _add_pedestal(arm: SerialArm, spec: mujoco.MjSpec) -> None:
    """Add a column from the floor to the base, without contacts."""
    x, y, z = (float(value) for value in arm.chain.world_from_base.position)
    half = 0.5 * (z - FLOOR)
    if half > 0.0:
        column = mujoco.mjtGeom.mjGEOM_CYLINDER
        add_fixed_geom(spec.worldbody, "pedestal", column, (0.08, half, 0.0), (x, y, FLOOR + half), GREY)


def _add_arm(arm: SerialArm, spec: mujoco.MjSpec) -> mujoco.MjsBody:
    chain = arm.chain
    base = chain.world_from_base
    parent = spec.worldbody.add_body(name=f"{SIDE}_mount", pos=base.position, quat=base.quaternion)
    for n, name in enumerate(f"{SIDE}_{joint}" for joint in arm.joint_names):
        parent = parent.add_body(name=f"{name}_link", pos=chain.positions[n], quat=chain.quaternions[n])
        set_inertial(parent, arm.masses[n], arm.centres[n], arm.inertias[n])
        if cover := arm.covers[n]:
            add_cover(parent, f"{name}_cover", cover[:2], cover[2], WHITE if n % 2 == 0 else DARK)
        _add_joint(arm, n, spec, parent)
    tool = chain.last_from_tool
    hand = parent.add_body(name=f"{SIDE}_hand", pos=tool.position, quat=tool.quaternion)
    set_inertial(hand, HAND_MASS, (0.0, 0.0, 0.0), (HAND_INERTIA,) * 3 + (0.0,) * 3)
    return hand


def _add_joint(arm: SerialArm, n: int, spec: mujoco.MjSpec, link: mujoco.MjsBody) -> None:
    """Add joint n to its link, with a torque motor."""
    name, limits = f"{SIDE}_{arm.joint_names[n]}", arm.limits
    hinge = link.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=arm.chain.axes[n])
    hinge.range, hinge.armature = (limits.lower[n], limits.upper[n]), arm.rotors[n]
    hinge.damping[0] = FRICTION
    motor = spec.add_actuator(name=name, target=name)
    motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
    motor.ctrlrange = (-limits.torque[n], limits.torque[n])
