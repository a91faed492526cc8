"""MuJoCo model of Baxter: joints, inertias and torque limits of the robot, with simple shapes."""

import mujoco

from pilotfish.environments.baxter.chain import quaternion_from_rpy
from pilotfish.environments.baxter.parameters import (
    COVER_RADIUS,
    HAND,
    HAND_FROM_WRIST,
    INERTIALS,
    JOINT_NAMES,
    JOINT_ORIGINS,
    JOINT_ROTATIONS,
    LOWER_LIMITS,
    MAX_TORQUES,
    MOUNT,
    MOUNT_YAW,
    SPRING,
    SPRING_JOINT,
    SPRING_REST,
    UPPER_LIMITS,
    Triple,
)
from pilotfish.environments.world import (
    FLOOR,
    add_cover,
    add_fixed_geom,
    empty_scene,
    set_inertial,
)
from pilotfish.environments.world import (
    OBJECT as OBJECT,
)
from pilotfish.environments.world import (
    ROBOT as ROBOT,
)
from pilotfish.geometry import multiply

RED, DARK, GREY = (0.62, 0.09, 0.11, 1.0), (0.17, 0.18, 0.2, 1.0), (0.45, 0.46, 0.48, 1.0)
ROTOR = (0.08, 0.08, 0.06, 0.06, 0.02, 0.02, 0.02)  # kg m^2 at the joint; chosen, none is published
FRICTION = 0.7  # N m s/rad, of each joint, as published

# Capsules along the links: ends and radius [m], in the frame of the joint that moves them.
COVERS = (
    ((0.0, 0.0, 0.08), (0.0, 0.0, 0.24), 0.075),
    ((0.0, 0.0, 0.0), (0.102, 0.0, 0.0), 0.075),
    ((0.0, 0.0, -0.02), (0.0, 0.0, 0.22), COVER_RADIUS),
    ((0.0, 0.0, 0.0), (0.10359, 0.0, 0.0), COVER_RADIUS),
    ((0.0, 0.0, -0.02), (0.0, 0.0, 0.23), 0.055),
    ((0.0, 0.0, 0.0), (0.115975, 0.0, 0.0), 0.05),
    ((0.0, 0.0, -0.03), (0.0, 0.0, 0.06), 0.042),
)

BOX, CYLINDER = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
# Fixed shapes without contacts: type, size, position [m] and colour.
Shape = tuple[mujoco.mjtGeom, Triple, Triple, tuple[float, ...]]
STAND: dict[str, Shape] = {
    "pedestal": (CYLINDER, (0.1, 0.25, 0.0), (-0.06, 0.0, -0.35), GREY),
    "foot": (CYLINDER, (0.38, 0.03, 0.0), (-0.06, 0.0, FLOOR + 0.03), DARK),
    "column": (CYLINDER, (0.13, 0.13, 0.0), (-0.06, 0.0, -0.72), GREY),
}
UPPER_BODY: dict[str, Shape] = {
    "torso": (BOX, (0.1, 0.15, 0.26), (-0.03, 0.0, 0.18), RED),
    "shoulders": (BOX, (0.08, 0.26, 0.08), (0.0, 0.0, 0.12), DARK),
    "neck": (CYLINDER, (0.06, 0.12, 0.0), (0.03, 0.0, 0.53), GREY),
    "screen": (BOX, (0.015, 0.15, 0.1), (0.14, 0.0, 0.69), DARK),
}


def joint_names(side: str) -> tuple[str, ...]:
    """Return the names of an arm's joints, which are also those of its motors, in order.

    Args:
        side: "left" or "right".
    """
    return tuple(f"{side}_{name}" for name in JOINT_NAMES)


def empty_world(timestep: float) -> mujoco.MjSpec:
    """Return a model of floor, light and torso, without arms; the world axes are the torso axes.

    Args:
        timestep: Timestep of the physics [s].
    """
    spec = empty_scene("baxter", timestep)
    add_torso(spec)
    return spec


def add_arm(spec: mujoco.MjSpec, side: str, *, posture: tuple[float, ...] | None = None) -> mujoco.MjsBody:
    """Add an arm with torque motors, or a rigid one in a fixed posture, and return its hand.

    Args:
        spec: Model that is extended.
        side: "left" or "right".
        posture: Joint positions of a rigid arm [rad]; None adds joints and motors.
    """
    sign = 1.0 if side == "left" else -1.0
    x, y, z = MOUNT
    parent = spec.worldbody.add_body(
        name=f"{side}_mount", pos=[x, sign * y, z], quat=quaternion_from_rpy((0.0, 0.0, sign * MOUNT_YAW))
    )
    for n, (joint, (start, end, radius)) in enumerate(zip(JOINT_NAMES, COVERS, strict=True)):
        rotation = quaternion_from_rpy(JOINT_ROTATIONS[n])
        parent = parent.add_body(name=f"{side}_{joint}_link", pos=JOINT_ORIGINS[n], quat=rotation)
        set_inertial(parent, *INERTIALS[n])
        add_cover(parent, f"{side}_{joint}_cover", (start, end), radius, RED if n in (0, 2, 4) else DARK)
        if posture is not None:
            parent.quat = multiply(rotation, quaternion_from_rpy((0.0, 0.0, posture[n])))
            continue
        hinge = parent.add_joint(name=f"{side}_{joint}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
        hinge.range, hinge.armature = (LOWER_LIMITS[n], UPPER_LIMITS[n]), ROTOR[n]
        hinge.damping[0] = FRICTION  # the linear term
        if joint == SPRING_JOINT:
            hinge.stiffness[0], hinge.springref = SPRING, SPRING_REST
        motor = spec.add_actuator(name=f"{side}_{joint}", target=hinge.name)
        motor.trntype, motor.ctrlrange = mujoco.mjtTrn.mjTRN_JOINT, (-MAX_TORQUES[n], MAX_TORQUES[n])
    hand = parent.add_body(name=f"{side}_hand", pos=[0.0, 0.0, HAND_FROM_WRIST])
    set_inertial(hand, *HAND)
    return hand


def add_torso(spec: mujoco.MjSpec) -> None:
    """Add torso, screen and stand, which are visible only."""
    for name, (kind, size, pos, rgba) in (STAND | UPPER_BODY).items():
        add_fixed_geom(spec.worldbody, name, kind, size, pos, rgba)
