"""Tools for Baxter's hands: gripper, suction cup and handle.

The tool point lies on the z axis of the hand, and its axes are parallel to those of the hand.
"""

from dataclasses import dataclass
from math import cos, pi, sin

import mujoco

from pilotfish.environments.baxter.body import DARK, GREY
from pilotfish.environments.world import OBJECT, ROBOT

TOOL_POINT = "tool"
BOX, CYLINDER, SPHERE = (
    mujoco.mjtGeom.mjGEOM_BOX,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_SPHERE,
)
STEEL, ORANGE, RUBBER = (0.7, 0.72, 0.75, 1.0), (0.93, 0.45, 0.1, 1.0), (0.12, 0.12, 0.12, 1.0)
FINGERS_OPEN, FINGERS_SHUT = 0.034, 0.001  # m from the middle to the face of each finger
SQUEEZE = 60.0  # N, largest force of each finger
SUCTION, LIP = 30.0, 8  # largest force [N]; number of spheres of the lip
# Joints of the bellows of a suction cup: axis, stiffness [N/m, N m/rad], damping, range [m, rad].
BELLOWS = (
    ("press", (0.0, 0.0, -1.0), 600.0, 12.0, (0.0, 0.01)),
    ("lean_x", (1.0, 0.0, 0.0), 2.0, 0.06, (-0.2, 0.2)),
    ("lean_y", (0.0, 1.0, 0.0), 2.0, 0.06, (-0.2, 0.2)),
)


@dataclass(frozen=True, slots=True)
class Tool:
    """Tool mounted on a hand.

    Attributes:
        point: Name of the site at the tool point.
        length: Distance of the tool point from the hand [m].
        bodies: Names of the tool's bodies.
        motor: Name of the actuator of the grip; empty for a tool that does not grip.
        open: Command at grip 0.
        shut: Command at grip 1.
    """

    point: str
    length: float
    bodies: tuple[str, ...]
    motor: str = ""
    open: float = 0.0
    shut: float = 0.0


def add_tool_body(hand: mujoco.MjsBody, side: str) -> mujoco.MjsBody:
    """Add a body that is fixed to the hand, and return it."""
    return hand.add_body(name=f"{side}_held")


def add_tool_point(held: mujoco.MjsBody, length: float, side: str) -> str:
    """Add the site of the tool point at a distance from the hand [m], and return its name."""
    name = f"{side}_{TOOL_POINT}"
    held.add_site(name=name, pos=[0.0, 0.0, length], size=[0.004, 0.004, 0.004], rgba=[0.1, 0.8, 0.2, 1.0])
    return name


def mount_gripper(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str, length: float = 0.15) -> Tool:
    """Mount two parallel fingers that close along y, with the tool point between their tips."""
    held, palm = add_tool_body(hand, side), 0.5 * (length - 0.07)
    add_tool_geom(held, f"{side}_palm", CYLINDER, (0.03, palm, 0.0), (0.0, 0.0, palm), DARK).mass = 0.3
    point = add_tool_point(held, length, side)
    fingers = [
        _add_finger(held, f"{side}_left", 1.0, 2 * palm),
        _add_finger(held, f"{side}_right", -1.0, 2 * palm),
    ]
    # One motor moves both fingers by the same distance.
    spec.add_equality(
        name=f"{side}_fingers",
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=f"{side}_left_slide",
        name2=f"{side}_right_slide",
        data=[0, 1, *[0] * 10],
    )
    motor = spec.add_actuator(name=f"{side}_grip", target=f"{side}_left_slide")
    motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
    motor.set_to_position(kp=4000.0, kv=80.0)
    motor.forcerange, motor.ctrlrange = (-2 * SQUEEZE, 2 * SQUEEZE), (0.0, FINGERS_OPEN)
    return Tool(point, length, (held.name, *fingers), motor.name, open=FINGERS_OPEN, shut=0.0)


def _add_finger(held: mujoco.MjsBody, name: str, sign: float, height: float) -> str:
    """Add a finger that slides along y, outward in the direction of sign, and return its name."""
    body = held.add_body(name=f"{name}_finger", pos=[0.0, 0.0, height])
    slide = body.add_joint(name=f"{name}_slide", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, sign, 0])
    slide.range, slide.armature = (FINGERS_SHUT, FINGERS_OPEN + 0.002), 0.1
    slide.damping[0] = 20.0
    pad = add_tool_geom(body, f"{name}_pad", BOX, (0.02, 0.006, 0.045), (0.0, sign * 0.006, 0.04), GREY)
    pad.mass, pad.friction, pad.condim, pad.priority = 0.05, (1.2, 0.02, 0.001), 4, 1
    return str(body.name)


def mount_suction(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str) -> Tool:
    """Mount a suction cup on bellows; it sucks at a grip above 0.5.

    The tool point is the middle of the lip when it is pressed in by 4 mm. The bellows yield by 10 mm and tilt
    by 12 degrees. Suction is MuJoCo's adhesion: up to 30 N between the lip and every geom within 4 mm.
    """
    cylinder, held = mujoco.mjtGeom.mjGEOM_CYLINDER, add_tool_body(hand, side)
    add_tool_geom(held, f"{side}_palm", cylinder, (0.03, 0.03, 0.0), (0.0, 0.0, 0.03), DARK)
    add_tool_geom(held, f"{side}_tube", cylinder, (0.01, 0.033, 0.0), (0.0, 0.0, 0.093), STEEL)
    cup = _add_cup(held, side)
    motor = spec.add_actuator(name=f"{side}_suction", target=cup.name)
    motor.trntype, motor.ctrlrange = mujoco.mjtTrn.mjTRN_BODY, (0.0, 1.0)
    motor.set_to_adhesion(gain=SUCTION)
    return Tool(
        add_tool_point(held, 0.15, side), 0.15, (held.name, cup.name), motor.name, open=-1.0, shut=1.0
    )


def _add_cup(held: mujoco.MjsBody, side: str) -> mujoco.MjsBody:
    """Add bellows that yield along z and tilt about x and y, with a lip of small spheres."""
    cup = held.add_body(name=f"{side}_cup", pos=[0.0, 0.0, 0.154])
    for name, axis, stiffness, damping, limits in BELLOWS:
        joint = cup.add_joint(name=f"{side}_{name}", axis=axis)
        joint.type = mujoco.mjtJoint.mjJNT_SLIDE if name == "press" else mujoco.mjtJoint.mjJNT_HINGE
        joint.range, joint.stiffness[0], joint.damping[0] = limits, stiffness, damping
        joint.armature = 0.01 if name == "press" else 1e-4
    bellows = add_tool_geom(
        cup, f"{side}_bellows", mujoco.mjtGeom.mjGEOM_CYLINDER, (0.02, 0.01, 0.0), (0.0, 0.0, -0.013), RUBBER
    )
    bellows.mass, bellows.contype, bellows.conaffinity = 0.02, 0, 0
    for n in range(LIP):
        angle = 2 * pi * n / LIP
        pos = 0.02 * cos(angle), 0.02 * sin(angle), -0.005
        ball = add_tool_geom(
            cup, f"{side}_lip_{n}", mujoco.mjtGeom.mjGEOM_SPHERE, (0.005, 0.0, 0.0), pos, RUBBER
        )
        ball.mass, ball.friction, ball.condim, ball.priority = 0.002, (0.7, 0.02, 0.001), 4, 1
        ball.margin = ball.gap = 0.004
        ball.solref = (0.01, 1.0)
    return cup


def mount_handle(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str) -> Tool:
    """Mount a spherical handle by which a person guides the arm; the tool point is its centre."""
    del spec
    held = add_tool_body(hand, side)
    add_tool_geom(
        held, f"{side}_knob", mujoco.mjtGeom.mjGEOM_SPHERE, (0.03, 0.0, 0.0), (0.0, 0.0, 0.06), ORANGE
    )
    return Tool(add_tool_point(held, 0.06, side), 0.06, (held.name,))


def add_tool_geom(
    body: mujoco.MjsBody,
    name: str,
    kind: mujoco.mjtGeom,
    size: tuple[float, float, float],
    pos: tuple[float, float, float],
    rgba: tuple[float, float, float, float],
) -> mujoco.MjsGeom:
    """Add a solid geom of 100 g to a tool, which collides with objects, and return it."""
    geom = body.add_geom(name=name, type=kind, size=size, pos=pos, rgba=rgba, mass=0.1)
    geom.contype, geom.conaffinity = ROBOT, OBJECT
    return geom
