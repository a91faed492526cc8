"""Carabiner task: push the gate of a carabiner against a rod, so that it lets the rod in and springs shut.

The ring is about 60 by 46 mm inside, of 9 mm wire in straight pieces; the rod is 14 mm thick.
Simplifications: the carabiner is fixed to the hand; its gate has no hook at the nose and does not collide
with the ring; the rod does not move.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import degrees, pi, radians, sqrt

import mujoco
import numpy as np

from pilotfish.environments.baxter.tools import Tool, add_tool_body, add_tool_geom, add_tool_point
from pilotfish.environments.human import Subtask
from pilotfish.environments.scene_renderer import CameraView
from pilotfish.environments.tasks.progress import (
    Failure,
    History,
    Measurements,
    Phase,
    Progress,
    first_failure,
    in_degrees,
    in_mm,
    smallest,
)
from pilotfish.environments.tasks.scene_objects import (
    BOX,
    CAPSULE,
    CYLINDER,
    STEEL,
    WOOD,
    YELLOW,
    add_solid,
    axis_angle_quaternion,
)
from pilotfish.environments.tasks.task import Task
from pilotfish.environments.tasks.task_state import Outcome, Scene
from pilotfish.environments.tasks.validation import validate_object_pose
from pilotfish.environments.world import FLOOR
from pilotfish.geometry import Pose, multiply, rotation_matrix
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, shorten_repr

ROD, HALF = 0.007, 0.15  # m: radius and half length of the rod
SEAT, GATE_LINE = 0.12, 0.172  # m from the hand: goal of the rod, and position of the gate
WIRE, LATCH, GATE_RADIUS = 0.0045, 0.04, 0.004  # m: radius of the ring's wire, length and radius of the gate
HINGE = -0.03  # m, lateral position of the gate's hinge
SHUT = radians(5.0)  # largest angle of a closed gate
NEAR_GATE = 0.015  # m, distance of rod and gate at which they may touch
# Centre line of the ring, x and z in hand axes [m], from the hinge along the spine to the nose.
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
# Tool z axis down, tool y axis (the normal of the ring) along the rod.
ACROSS = axis_angle_quaternion((sqrt(0.5), sqrt(0.5), 0.0), pi)
LEVEL = axis_angle_quaternion((0.0, 1.0, 0.0), pi / 2)  # rotates z to x


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class CarabinerSituation:
    """Situation of the rod.

    Attributes:
        rod: Pose of the rod, with x along it and z up.
        hook_position: Position along the rod where a person hooks the carabiner [m].
    """

    rod: Pose
    hook_position: float

    def __post_init__(self) -> None:
        """Check the poses and ranges."""
        validate_object_pose(self.rod, "the rod", FLOOR + 0.15)
        require_number(self.hook_position, "the hook_position", -HALF, HALF)


def _mount_tool(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str) -> Tool:
    """Mount a carabiner; the tool point is the goal of the rod inside it."""
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
    gate = _add_gate(held, side)
    return Tool(add_tool_point(held, SEAT, side), SEAT, (held.name, gate.name))


def _add_gate(held: mujoco.MjsBody, side: str) -> mujoco.MjsBody:
    """Add the gate; a spring of .15 N m/rad, 20 degrees from its rest when closed, presses it to the nose.

    The nose, which lets the gate open inwards only, is the lower limit of the hinge.
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
    position = np.array([0.68, -0.3, 0.0]) + rng.uniform(-0.06, 0.06, 3)
    rotation = axis_angle_quaternion((0.0, 0.0, 1.0), pi / 2 + radians(25.0) * rng.uniform(-1.0, 1.0))
    return CarabinerSituation(Pose(position, rotation), rng.uniform(-0.07, 0.07))


def _add_objects(spec: mujoco.MjSpec, situation: CarabinerSituation) -> None:
    position = situation.rod.position
    rail = spec.worldbody.add_body(name="rail", pos=position, quat=situation.rod.quaternion)
    add_solid(rail, "rod", CYLINDER, (ROD, HALF, 0.0), (0.0, 0.0, 0.0), STEEL).quat = LEVEL
    for name, sign in (("post", 1.0), ("other_post", -1.0)):
        add_solid(rail, name, BOX, (0.008, 0.008, 0.06), (sign * (HALF - 0.008), 0.0, -0.06), STEEL)
    add_solid(rail, "base", BOX, (HALF + 0.02, 0.05, 0.01), (0.0, 0.0, -0.13), WOOD)
    column = -0.14 - (FLOOR - position[2])
    add_solid(rail, "pillar", CYLINDER, (0.03, column / 2, 0.0), (0.0, 0.0, -0.14 - column / 2), STEEL)


def _observe_frames(
    model: mujoco.MjModel, data: mujoco.MjData, situation: CarabinerSituation
) -> dict[str, Pose]:
    del model, situation
    rail = data.body("rail")
    return {"rod": Pose(rail.xpos.copy(), rail.xquat.copy())}


def rod_in_ring_plane(rod: Pose, tool: Pose) -> Float[Array, " 3"]:
    """Return where the rod axis crosses the plane of the ring, in tool axes; nan beyond the rod's ends."""
    tool_from_rod = tool.inverse() @ rod
    axis = rotation_matrix(tool_from_rod.quaternion)[:, 0]
    distance = -tool_from_rod.position[1] / axis[1] if axis[1] else np.inf
    return tool_from_rod.position + distance * axis if abs(distance) <= HALF else np.full(3, np.nan)


def point_inside_ring(x: float, z: float) -> bool:
    """Return whether a point of the ring plane, in tool axes [m], is within the ring and the closed gate."""
    corners = RING - np.array([0.0, SEAT])
    edges = np.roll(corners, -1, axis=0) - corners
    offsets = np.array([x, z]) - corners
    return bool((edges[:, 0] * offsets[:, 1] - edges[:, 1] * offsets[:, 0] > 0.0).all())


def _distance_to_rod(rod: Pose, tool: Pose) -> float:
    """Return the distance of the tool point from the rod [m]."""
    x, y, z = (rod.inverse() @ tool).position
    return float(np.linalg.norm([max(abs(x) - HALF, 0.0), y, z]))


def _check_success(scene: Scene, situation: CarabinerSituation) -> Outcome:
    rod = _observe_frames(scene.model, scene.data, situation)["rod"]
    error = _distance_to_rod(rod, scene.tool)
    x, _, z = rod_in_ring_plane(rod, scene.tool)
    gate = abs(float(scene.data.joint("right_gate").qpos[0]))
    if not point_inside_ring(x, z):
        return Outcome(False, error, f"the rod is not in the carabiner, but {error:.3f} m from its goal")
    if gate > SHUT:
        return Outcome(False, error, f"the gate is open by {degrees(gate):.0f} degrees")
    return Outcome(True, error)


def _measure_progress(scene: Scene, situation: CarabinerSituation) -> Measurements:
    """Return the distance of rod and goal, whether the rod is inside the ring, and the angle of the gate."""
    rod = _observe_frames(scene.model, scene.data, situation)["rod"]
    x, _, z = rod_in_ring_plane(rod, scene.tool)
    return {
        "distance": _distance_to_rod(rod, scene.tool),
        "inside": float(point_inside_ring(x, z)),
        "gate": abs(float(scene.data.joint("right_gate").qpos[0])),
    }


def _describe_progress(now: Measurements) -> str:
    if now["inside"]:
        return "hooked" if now["gate"] <= SHUT else "rod inside, gate open"
    return (
        "gate pushed open" if now["gate"] > SHUT else f"rod {1000.0 * now['distance']:.0f} mm from its goal"
    )


def _explain_failure(history: History, outcome: Outcome) -> Failure:
    """Explain a failure by the first of: reach the rod, push it in, keep it, and close the gate."""
    distance, gate, inside = history["distance"], history["gate"], history["inside"] > 0.0
    short = smallest(distance) - (GATE_LINE - SEAT)
    checks = (
        (
            not inside.any() and short > NEAR_GATE and gate.max() <= SHUT,
            Phase.APPROACH,
            "never reached the rod",
            f"the gate stayed {in_mm(short)} away from the rod",
        ),
        (
            not inside.any() and gate.max() <= SHUT,
            Phase.GRASP,
            "pushed beside the gate",
            f"the gate opened by only {in_degrees(gate.max())}",
        ),
        (
            not inside.any(),
            Phase.MOTION,
            "rod not pushed in",
            f"the gate opened, but the rod stayed {in_mm(smallest(distance))} from its goal",
        ),
        (
            not inside[-1],
            Phase.GOAL,
            "rod slipped out",
            f"the rod was inside, and is {in_mm(distance[-1])} from its goal at the end",
        ),
        (
            gate[-1] > SHUT,
            Phase.GOAL,
            "gate not closed",
            f"the rod is inside, but holds the gate open by {in_degrees(gate[-1])}",
        ),
    )
    return first_failure(checks, outcome)


def _start_pose(situation: CarabinerSituation) -> Pose:
    del situation
    return Pose(
        np.array([0.6, -0.35, 0.18]), multiply(axis_angle_quaternion((0.0, 0.0, 1.0), pi / 2), ACROSS)
    )


def tool_above_rod(frames: Mapping[str, Pose], position: float, height: float) -> Pose:
    """Return the tool pose across the rod at a position along it and a height above the goal [m]."""
    return frames["rod"] @ Pose(np.array([position, 0.0, height]), ACROSS)


def _demonstration_script(situation: CarabinerSituation) -> tuple[Subtask, ...]:
    position = situation.hook_position
    gate_height = GATE_LINE - SEAT
    near = partial(Subtask, position_tolerance=0.010, angle_tolerance=radians(4.0))
    exact = partial(Subtask, position_tolerance=0.004, angle_tolerance=radians(2.5))
    return (
        near("line up", lambda f: tool_above_rod(f, position, gate_height + 0.06)),
        exact("aim", lambda f: tool_above_rod(f, position, gate_height + 0.02), speed_factor=0.6),
        exact("push", lambda f: tool_above_rod(f, position, 0.0), speed_factor=0.4, dwell=1.0),
    )


CARABINER: Task[CarabinerSituation] = Task(
    name="carabiner",
    description="hook a carabiner on a rod, anywhere along it, so that the gate closes behind the rod",
    frames=("rod",),
    has_gripper=False,
    unit="m",
    time_limit=30.0,
    mount_tool=_mount_tool,
    sample_situation=_sample_situation,
    add_objects=_add_objects,
    start_pose=_start_pose,
    observe_frames=_observe_frames,
    check_success=_check_success,
    demonstration_script=_demonstration_script,
    view=CameraView((0.66, -0.3, 0.1), 1.05, 95.0, -18.0),
    progress=Progress(_measure_progress, _describe_progress, _explain_failure),
)
