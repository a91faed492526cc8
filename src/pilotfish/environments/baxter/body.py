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
from pilotfish.geometry import multiply

RED, DARK, GREY = (0.62, 0.09, 0.11, 1.0), (0.17, 0.18, 0.2, 1.0), (0.45, 0.46, 0.48, 1.0)
PALE = (0.62, 0.64, 0.66, 1.0)
ROBOT, OBJECT = 1, 2  # contact types: the robot collides with objects, objects with each other too
FLOOR = -0.93  # m, height in torso axes
SKY = (0.9, 0.92, 0.94, 1.0), (0.62, 0.71, 0.8, 1.0)  # at the horizon and above
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
    spec = mujoco.MjSpec()
    spec.modelname, spec.compiler.degree = "baxter", False
    spec.option.timestep = timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0  # less slip of gripped objects
    _add_light(spec)
    _add_fixed_geom(
        spec.worldbody, "floor", mujoco.mjtGeom.mjGEOM_PLANE, (0.0, 0.0, 0.1), (0.0, 0.0, FLOOR), PALE
    )
    spec.geom("floor").material = "dull"
    _add_torso(spec.worldbody)
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
        _set_inertial(parent, *INERTIALS[n])
        _add_cover(parent, f"{side}_{joint}_cover", (start, end), radius, RED if n in (0, 2, 4) else DARK)
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
    _set_inertial(hand, *HAND)
    return hand


def _add_light(spec: mujoco.MjSpec) -> None:
    """Add bright light and a pale sky, without shadows, so that images render fast."""
    spec.visual.quality.offsamples = 0
    spec.visual.map.znear, spec.visual.map.fogstart, spec.visual.map.fogend = 0.01, 3.0, 8.0
    spec.visual.rgba.fog = spec.visual.rgba.haze = SKY[0]
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.35] * 3, [0.35] * 3
    spec.visual.headlight.specular = [0.1] * 3
    size = getattr(spec.visual, "global")
    size.offwidth, size.offheight = 960, 720  # largest image
    for aim, strength in (((-0.5, 0.4, -1.0), 0.4), ((0.3, 0.8, -0.6), 0.25)):
        lamp = spec.worldbody.add_light(
            dir=aim, diffuse=[strength] * 3, specular=[0.15] * 3, castshadow=False
        )
        lamp.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    gradient = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    sky = spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=gradient)
    sky.rgb1, sky.rgb2, sky.width, sky.height = SKY[1][:3], SKY[0][:3], 32, 192
    spec.add_material(name="dull", specular=0.0, shininess=0.0)


def _add_torso(world: mujoco.MjsBody) -> None:
    for name, (kind, size, pos, rgba) in (STAND | UPPER_BODY).items():
        _add_fixed_geom(world, name, kind, size, pos, rgba)


def _add_fixed_geom(
    body: mujoco.MjsBody, name: str, kind: mujoco.mjtGeom, size: Triple, pos: Triple, rgba: tuple[float, ...]
) -> None:
    geom = body.add_geom(name=name, type=kind, size=size, pos=pos, rgba=rgba)
    geom.contype, geom.conaffinity = (OBJECT, ROBOT | OBJECT) if name == "floor" else (0, 0)


def _add_cover(
    body: mujoco.MjsBody, name: str, ends: tuple[Triple, Triple], radius: float, rgba: tuple[float, ...]
) -> None:
    geom = body.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*ends[0], *ends[1]], rgba=rgba
    )
    geom.size[0] = radius
    geom.contype, geom.conaffinity, geom.mass = ROBOT, OBJECT, 0.0


def _set_inertial(body: mujoco.MjsBody, mass: float, centre: Triple, inertia: tuple[float, ...]) -> None:
    body.mass, body.ipos, body.fullinertia = mass, centre, inertia
    body.explicitinertial = True
