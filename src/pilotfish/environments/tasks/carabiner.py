"""Hooking a carabiner on a rod: its gate, pushed against the rod, lets it in and springs shut behind it.

The ring is about 60 by 46 mm inside, of 9 mm wire in straight pieces; the rod is 14 mm thick. What is
simpler than in life: the carabiner is fixed to the hand, its gate has no hook at the nose and never meets
the ring's own wire, and the rod stands still.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import degrees, pi, radians, sqrt

import mujoco
import numpy as np

from pilotfish.environments.baxter import FLOOR, Tool, add_tool_body, add_tool_geom, add_tool_point
from pilotfish.environments.human import Subtask
from pilotfish.environments.tasks.furniture import (
    BOX,
    CAPSULE,
    CYLINDER,
    STEEL,
    WOOD,
    YELLOW,
    add_solid,
    axis_angle_quaternion,
)
from pilotfish.environments.tasks.situation_checks import validate_object_pose
from pilotfish.environments.tasks.task import Outcome, Scene, Task
from pilotfish.geometry import Pose, multiply, rotation_matrix
from pilotfish.types import Array, Float
from pilotfish.validation import require_number

ROD, HALF = 0.007, 0.15  # m: radius of the rod, and half of its length
SEAT, GATE_LINE = 0.12, 0.172  # m from the hand: where the rod comes to rest inside, and where the gate is
WIRE, LATCH, GATE_RADIUS = 0.0045, 0.04, 0.004  # m: radius of the ring's wire, length and radius of the gate
HINGE = -0.03  # m: how far the gate's hinge is aside of where the rod goes in
SHUT = radians(5.0)
# The middle of the ring's wire, x and z in the axes of the hand [m], from the hinge by the spine to the nose.
RING = np.array(
    [
        [-0.034, 0.172],
        [-0.038, 0.162],
        [-0.038, 0.112],
        [-0.028, 0.102],
        [0.009, 0.102],
        [0.019, 0.112],
        [0.019, 0.172],
    ]
)
# The tool looks down and the ring stands across the rod: its y axis, normal to the ring, lies along the rod.
ACROSS = axis_angle_quaternion((sqrt(0.5), sqrt(0.5), 0.0), pi)
LEVEL = axis_angle_quaternion((0.0, 1.0, 0.0), pi / 2)  # what is made along z lies along x


@dataclass(frozen=True, slots=True, eq=False)
class CarabinerSituation:
    """Where the rod is, x along it and z up, and the place along it [m] that a person chooses to hook at."""

    rod: Pose
    place: float

    def __post_init__(self) -> None:
        validate_object_pose(self.rod, "the rod", FLOOR + 0.15)
        require_number(self.place, "the place along the rod", -HALF, HALF)


def _mount_tool(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str) -> Tool:
    """A carabiner held at its spine; the point is where the rod is to be inside it."""
    del spec
    held = add_tool_body(hand, side)
    add_tool_geom(
        held, f"{side}_palm", CYLINDER, (0.03, 0.03, 0.0), (0.0, 0.0, 0.03), (0.17, 0.18, 0.2, 1.0)
    ).mass = 0.3
    add_tool_geom(held, f"{side}_stalk", CYLINDER, (0.009, 0.022, 0.0), (0.0, 0.0, 0.078), STEEL)
    for n, (a, b) in enumerate(pairwise(RING)):
        wire = add_tool_geom(held, f"{side}_wire_{n}", CAPSULE, (WIRE, 0.0, 0.0), (0.0, 0.0, 0.0), YELLOW)
        wire.fromto = a[0], 0.0, a[1], b[0], 0.0, b[1]
        wire.mass, wire.friction, wire.priority = 0.01, (0.3, 0.005, 0.0001), 1
    gate = _hang_gate(held, side)
    return Tool(add_tool_point(held, SEAT, side), SEAT, (held.name, gate.name))


def _hang_gate(held: mujoco.MjsBody, side: str) -> mujoco.MjsBody:
    """The gate: a spring of .15 N m/rad, bent by 20 degrees when shut, holds it against the nose.

    The nose, which lets it open inwards only, is the hard end of the hinge's range.
    """
    gate = held.add_body(name=f"{side}_gate", pos=[HINGE, 0.0, GATE_LINE])
    hinge = gate.add_joint(name=f"{side}_gate", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    hinge.range, hinge.armature = (0.0, radians(80.0)), 1e-4
    hinge.stiffness[0], hinge.springref, hinge.damping[0] = 0.15, radians(-20.0), 0.008
    hinge.solref_limit, hinge.solimp_limit = (0.004, 1.0), (0.95, 0.995, 0.01, 0.5, 2.0)
    bar = add_tool_geom(gate, f"{side}_gate_bar", CAPSULE, (GATE_RADIUS, 0.0, 0.0), (0.0, 0.0, 0.0), STEEL)
    bar.fromto = 0.0, 0.0, 0.0, LATCH, 0.0, 0.0
    bar.mass, bar.friction, bar.priority = 0.02, (0.2, 0.005, 0.0001), 1
    return gate


def _sample_situation(rng: np.random.Generator) -> CarabinerSituation:
    at = np.array([0.68, -0.3, 0.0]) + rng.uniform(-0.06, 0.06, 3)
    turn = axis_angle_quaternion((0.0, 0.0, 1.0), pi / 2 + radians(25.0) * rng.uniform(-1.0, 1.0))
    return CarabinerSituation(Pose(at, turn), rng.uniform(-0.07, 0.07))


def _add_objects(spec: mujoco.MjSpec, situation: CarabinerSituation) -> None:
    at = situation.rod.position
    rail = spec.worldbody.add_body(name="rail", pos=at, quat=situation.rod.quaternion)
    add_solid(rail, "rod", CYLINDER, (ROD, HALF, 0.0), (0.0, 0.0, 0.0), STEEL).quat = LEVEL
    for name, sign in (("post", 1.0), ("other_post", -1.0)):
        add_solid(rail, name, BOX, (0.008, 0.008, 0.06), (sign * (HALF - 0.008), 0.0, -0.06), STEEL)
    add_solid(rail, "base", BOX, (HALF + 0.02, 0.05, 0.01), (0.0, 0.0, -0.13), WOOD)
    column = -0.14 - (FLOOR - at[2])
    add_solid(rail, "pillar", CYLINDER, (0.03, column / 2, 0.0), (0.0, 0.0, -0.14 - column / 2), STEEL)


def _observe_frames(
    model: mujoco.MjModel, data: mujoco.MjData, situation: CarabinerSituation
) -> dict[str, Pose]:
    del model, situation
    rail = data.body("rail")
    return {"rod": Pose(rail.xpos.copy(), rail.xquat.copy())}


def rod_in_ring_plane(rod: Pose, tool: Pose) -> Float[Array, " 3"]:
    """Where the rod's axis passes the ring's plane, seen from the tool; nan if not between the rod's ends."""
    seen = tool.inverse() @ rod
    along = rotation_matrix(seen.quaternion)[:, 0]
    way = -seen.position[1] / along[1] if along[1] else np.inf
    return seen.position + way * along if abs(way) <= HALF else np.full(3, np.nan)


def point_inside_ring(x: float, z: float) -> bool:
    """Whether a point of the ring's plane, seen from the tool [m], lies within its wire and the shut gate."""
    corners = RING - np.array([0.0, SEAT])
    edges = np.roll(corners, -1, axis=0) - corners
    ways = np.array([x, z]) - corners
    return bool((edges[:, 0] * ways[:, 1] - edges[:, 1] * ways[:, 0] > 0.0).all())


def _error(rod: Pose, tool: Pose) -> float:
    """The distance [m] from where the rod is to be in the ring to the nearest point of the rod's axis."""
    x, y, z = (rod.inverse() @ tool).position
    return float(np.linalg.norm([max(abs(x) - HALF, 0.0), y, z]))


def _check_success(scene: Scene, situation: CarabinerSituation) -> Outcome:
    rod = _observe_frames(scene.model, scene.data, situation)["rod"]
    error = _error(rod, scene.tool)
    x, _, z = rod_in_ring_plane(rod, scene.tool)
    gate = abs(float(scene.data.joint("right_gate").qpos[0]))
    if not point_inside_ring(x, z):
        return Outcome(
            False, error, f"the rod is not in the carabiner but {error:.3f} m from its place there"
        )
    if gate > SHUT:
        return Outcome(False, error, f"the gate stands open by {degrees(gate):.0f} degrees")
    return Outcome(True, error)


def _start_pose(situation: CarabinerSituation) -> Pose:
    del situation
    return Pose(
        np.array([0.6, -0.35, 0.18]), multiply(axis_angle_quaternion((0.0, 0.0, 1.0), pi / 2), ACROSS)
    )


def tool_above_rod(frames: Mapping[str, Pose], place: float, above: float) -> Pose:
    """The tool across the rod at a place along it [m], so far above where the rod is to be inside."""
    return frames["rod"] @ Pose(np.array([place, 0.0, above]), ACROSS)


def _demonstration_script(situation: CarabinerSituation) -> tuple[Subtask, ...]:
    place = situation.place
    far = GATE_LINE - SEAT
    near = partial(Subtask, position_tolerance=0.010, angle_tolerance=radians(4.0))
    exact = partial(Subtask, position_tolerance=0.004, angle_tolerance=radians(2.5))
    return (
        near("line up", lambda f: tool_above_rod(f, place, far + 0.06)),
        exact("aim", lambda f: tool_above_rod(f, place, far + 0.02), speed=0.6),
        exact("push", lambda f: tool_above_rod(f, place, 0.0), speed=0.4, dwell=1.0),
    )


CARABINER: Task[CarabinerSituation] = Task(
    name="carabiner",
    description="hook a carabiner on a rod, anywhere along it, so that the gate springs shut behind the rod",
    frames=("rod",),
    has_gripper=False,
    unit="m",
    time_limit=30.0,
    contact_limits=(),
    mount_tool=_mount_tool,
    sample_situation=_sample_situation,
    add_objects=_add_objects,
    start_pose=_start_pose,
    observe_frames=_observe_frames,
    check_success=_check_success,
    demonstration_script=_demonstration_script,
)
