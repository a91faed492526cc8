"""Screwdriver task: insert a screwdriver into the recess of a moving screw and keep it there.

The tip is 7 mm thick; the recess is an eight-sided funnel of 25 mm that narrows to a bore of 11 mm.
Simplifications: the tool is fixed to the hand; blade and slot are visible and checked but do not collide;
nothing is screwed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import acos, degrees, pi, radians

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
    first_true,
    in_degrees,
    in_mm,
    smallest,
)
from pilotfish.environments.tasks.scene_objects import (
    BLUE,
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
from pilotfish.environments.tasks.validation import MAX_ANGLE, validate_object_pose
from pilotfish.environments.world import FLOOR
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, multiply, rotation_matrix
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_number, shorten_repr

TIP, REACH = 0.0035, 0.2  # m: radius of the tip, and its distance from the hand
BORE, MOUTH, DEEP, HIGH = (
    0.0055,
    0.0125,
    0.01,
    0.017,
)  # m: radii of bore and funnel mouth, their heights above the bottom
BLOCK = 0.03  # m, half of the side of the block
NEAR, STRAIGHT, SLOT = (
    0.003,
    radians(5.0),
    radians(10.0),
)  # m, rad, rad: largest errors of tip, axis and blade
# Tool z axis down, recess z axis up.
DOWN = axis_angle_quaternion((0.0, 1.0, 0.0), pi)
SIDES = 8
MAX_AMPLITUDE, MAX_FREQUENCY = 1.0, 100.0  # m, rad/s


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ScrewdriverSituation:
    """Situation of a screw that oscillates: middle + amplitude sin(frequency t + phase) direction.

    Attributes:
        middle: Pose of the screw in the middle of its path; z points out of the recess, x along the slot.
        direction: Horizontal unit vector.
        amplitude: Amplitude [m].
        frequency: Angular frequency [rad/s].
        phase: Phase at time 0 [rad].
    """

    middle: Pose
    direction: Float[Array, " 3"]
    amplitude: float
    frequency: float
    phase: float

    def __post_init__(self) -> None:
        """Check the poses and ranges."""
        validate_object_pose(self.middle, "the middle of the screw's path", FLOOR + 0.1)
        direction = finite_array(self.direction, "the direction of the motion", (3,))
        if not abs(float(direction @ direction) - 1.0) < 1e-3:
            raise InvalidInput(
                f"the direction of the motion is {direction.tolist()}, expected a unit vector; "
                "divide by its norm"
            )
        require_number(self.amplitude, "the amplitude", 0.0, MAX_AMPLITUDE)
        require_number(self.frequency, "the frequency", 0.0, MAX_FREQUENCY)
        require_number(self.phase, "the phase", -MAX_ANGLE, MAX_ANGLE)


def _mount_tool(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str) -> Tool:
    """Mount a screwdriver; the tool point is the end of its blade, which lies along x."""
    del spec
    held = add_tool_body(hand, side)
    add_tool_geom(
        held, f"{side}_palm", CYLINDER, (0.03, 0.03, 0.0), (0.0, 0.0, 0.03), (0.17, 0.18, 0.2, 1.0)
    ).mass = 0.3
    add_tool_geom(held, f"{side}_grip", CYLINDER, (0.014, 0.03, 0.0), (0.0, 0.0, 0.08), YELLOW)
    shaft = add_tool_geom(
        held, f"{side}_shaft", CAPSULE, (TIP, 0.05 - TIP, 0.0), (0.0, 0.0, REACH - 0.05), STEEL
    )
    shaft.friction, shaft.priority = (0.3, 0.005, 0.0001), 1
    blade = add_tool_geom(held, f"{side}_blade", BOX, (0.005, 0.001, 0.006), (0.0, 0.0, REACH - 0.007), STEEL)
    blade.mass, blade.contype, blade.conaffinity = 0.0, 0, 0
    return Tool(add_tool_point(held, REACH, side), REACH, (held.name,))


def _sample_situation(rng: np.random.Generator) -> ScrewdriverSituation:
    position = np.array([0.66, -0.32, -0.05]) + rng.uniform(-1.0, 1.0, 3) * np.array([0.08, 0.08, 0.04])
    yaw = axis_angle_quaternion((0.0, 0.0, 1.0), radians(20.0) * rng.uniform(-1.0, 1.0))
    tilt_direction, heading, phase = rng.uniform(-pi, pi, 3)
    tilt = axis_angle_quaternion(
        (np.cos(tilt_direction), np.sin(tilt_direction), 0.0), radians(8.0) * rng.uniform()
    )
    frequency = 2.0 * pi / rng.uniform(10.0, 18.0)
    amplitude = rng.uniform(0.005, 0.02) / frequency  # m; peak speed 5 to 20 mm/s
    direction = np.array([np.cos(heading), np.sin(heading), 0.0])
    return ScrewdriverSituation(Pose(position, multiply(tilt, yaw)), direction, amplitude, frequency, phase)


def screw_pose(situation: ScrewdriverSituation, time: float) -> Pose:
    """Return the commanded pose of the screw at a time [s]."""
    offset = situation.amplitude * np.sin(situation.frequency * time + situation.phase)
    return Pose(situation.middle.position + offset * situation.direction, situation.middle.quaternion)


def _add_objects(spec: mujoco.MjSpec, situation: ScrewdriverSituation) -> None:
    start = screw_pose(situation, 0.0)
    x, y, z = situation.middle.position
    top = z - 0.045
    add_solid(spec.worldbody, "bench", BOX, (0.16, 0.16, 0.01), (x, y, top - 0.01), WOOD)
    add_solid(
        spec.worldbody, "leg", BOX, (0.04, 0.04, (top - FLOOR) / 2), (x, y, (top + FLOOR) / 2 - 0.01), STEEL
    )
    carriage = spec.worldbody.add_body(name="carriage", pos=start.position)
    for name, axis in (("ahead", [1, 0, 0]), ("aside", [0, 1, 0])):
        slide = carriage.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        slide.damping[0] = 5.0
        motor = spec.add_actuator(name=name, target=name)
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.set_to_position(kp=20000.0, kv=400.0)
        motor.forcerange, motor.ctrlrange = (-150.0, 150.0), (-1.0, 1.0)
    target = carriage.add_body(name="target", quat=start.quaternion)
    add_solid(target, "bottom", BOX, (BLOCK, BLOCK, 0.008), (0.0, 0.0, -0.008), BLUE).mass = 1.0
    for name, sign in (("mark", 1.0), ("other_mark", -1.0)):  # marks of the slot, beside the funnel
        mark = add_solid(target, name, BOX, (0.007, 0.001, 0.0005), (sign * 0.021, 0.0, HIGH), YELLOW)
        mark.contype = mark.conaffinity = 0
    _add_recess_walls(target)


def _add_recess_walls(target: mujoco.MjsBody) -> None:
    """Add the recess: a ring of vertical boxes, a ring of slanted boxes above it, a plate around them."""
    half = 0.003  # m, half of the thickness of each wall
    slant, edge = (MOUTH - BORE) / 2, half / 2**0.5
    for n in range(SIDES):
        rotation = axis_angle_quaternion((0.0, 0.0, 1.0), 2.0 * pi * n / SIDES)
        rings = (
            ("bore", BORE + half, DEEP / 2, (half, 0.004, DEEP / 2), 0.0),
            ("funnel", BORE + slant + edge, HIGH - slant - edge, (half, 0.0055, slant * 2**0.5), pi / 4),
            ("plate", (MOUTH + BLOCK) / 2, HIGH - half, ((BLOCK - MOUTH) / 2, 0.012, half), 0.0),
        )  # fmt: skip
        for name, radius, height, size, angle in rings:
            wall = add_solid(target, f"{name}_{n}", BOX, size, (0.0, 0.0, 0.0), BLUE)
            wall.pos = rotation_matrix(rotation) @ np.array([radius, 0.0, height])
            wall.quat = multiply(rotation, axis_angle_quaternion((0.0, 1.0, 0.0), angle))


def _actuate_scene(
    model: mujoco.MjModel, data: mujoco.MjData, situation: ScrewdriverSituation, time: float
) -> None:
    """Command the displacement of the carriage since the start to its motors."""
    displacement = screw_pose(situation, time).position - screw_pose(situation, 0.0).position
    data.ctrl[model.actuator("ahead").id], data.ctrl[model.actuator("aside").id] = displacement[:2]


def _observe_frames(
    model: mujoco.MjModel, data: mujoco.MjData, situation: ScrewdriverSituation
) -> dict[str, Pose]:
    del model, situation
    target = data.body("target")
    return {"target": Pose(target.xpos.copy(), target.xquat.copy())}


def _check_success(scene: Scene, situation: ScrewdriverSituation) -> Outcome:
    tool = _observe_frames(scene.model, scene.data, situation)["target"].inverse() @ scene.tool
    error = float(np.linalg.norm(tool.position))
    blade, _, axis = rotation_matrix(tool.quaternion).T
    tilt, twist = acos(np.clip(-axis[2], -1.0, 1.0)), acos(min(abs(blade[0]), 1.0))
    if error > NEAR:
        return Outcome(False, error, f"the tip is {1000 * error:.1f} mm from the bottom of the recess")
    if tilt > STRAIGHT:
        return Outcome(False, error, f"the screwdriver is tilted by {degrees(tilt):.1f} degrees")
    if twist > SLOT:
        return Outcome(
            False, error, f"the blade is {degrees(twist):.1f} degrees from the direction of the slot"
        )
    return Outcome(True, error)


def _measure_progress(scene: Scene, situation: ScrewdriverSituation) -> Measurements:
    """Return the position of the tip in the recess, and the angles of axis and blade."""
    tool = _observe_frames(scene.model, scene.data, situation)["target"].inverse() @ scene.tool
    blade, _, axis = rotation_matrix(tool.quaternion).T
    return {
        "aside": float(np.hypot(*tool.position[:2])),
        "height": float(tool.position[2]),
        "distance": float(np.linalg.norm(tool.position)),
        "tilt": acos(np.clip(-axis[2], -1.0, 1.0)),
        "twist": acos(min(abs(blade[0]), 1.0)),
    }


def _describe_progress(now: Measurements) -> str:
    if now["distance"] <= NEAR:
        return "on the bottom of the recess"
    if now["height"] < HIGH and now["aside"] < MOUTH:
        return "in the recess"
    return f"tip {1000.0 * now['distance']:.0f} mm away"


def _explain_failure(history: History, outcome: Outcome) -> Failure:
    """Explain a failure by the first of: find the mouth, reach the bottom, stay there, and align."""
    aside, height, distance = history["aside"], history["height"], history["distance"]
    inside = (height < HIGH) & (aside < MOUTH)
    low = first_true(height < HIGH + NEAR)
    at_mouth = aside[min(low, len(aside) - 1)]
    tilt, twist = float(history["tilt"][-1]), float(history["twist"][-1])
    checks = (
        (
            not inside.any() and low == len(height),
            Phase.APPROACH,
            "stopped above the recess",
            f"the tip came down to {in_mm(smallest(height))} above the bottom, the mouth is at {in_mm(HIGH)}",
        ),
        (
            not inside.any(),
            Phase.APPROACH,
            "missed the recess",
            f"the tip came down {in_mm(at_mouth)} beside the middle, the mouth's radius is {in_mm(MOUTH)}",
        ),
        (
            distance[-1] > NEAR and distance.min() <= NEAR,
            Phase.GOAL,
            "left the recess again",
            f"the tip was on the bottom, and is {in_mm(distance[-1])} away at the end",
        ),
        (
            distance[-1] > NEAR,
            Phase.GOAL,
            "not inserted to the bottom",
            f"the tip is {in_mm(distance[-1])} from the bottom, expected {in_mm(NEAR)}",
        ),
        (tilt > STRAIGHT, Phase.GOAL, "inserted tilted", f"the screwdriver is tilted by {in_degrees(tilt)}"),
        (twist > SLOT, Phase.GOAL, "blade turned", f"the blade is {in_degrees(twist)} from the slot"),
    )
    return first_failure(checks, outcome)


def _start_pose(situation: ScrewdriverSituation) -> Pose:
    del situation
    return Pose(np.array([0.6, -0.35, 0.15]), DOWN)


def tool_above_recess(frames: Mapping[str, Pose], height: float) -> Pose:
    """Return the aligned tool pose with its tip at a height above the bottom of the recess [m]."""
    return frames["target"] @ Pose(np.array([0.0, 0.0, height]), DOWN)


def _demonstration_script(situation: ScrewdriverSituation) -> tuple[Subtask, ...]:
    del situation
    near = partial(Subtask, position_tolerance=0.010, angle_tolerance=radians(4.0), tracking=True)
    exact = partial(Subtask, position_tolerance=0.0045, angle_tolerance=radians(2.5), tracking=True)
    return (
        near("line up", lambda f: tool_above_recess(f, 0.07)),
        exact("aim", lambda f: tool_above_recess(f, HIGH + 0.01), speed_factor=0.6),
        exact("set in", lambda f: tool_above_recess(f, -0.002), speed_factor=0.3, dwell=2.5),
    )


SCREWDRIVER: Task[ScrewdriverSituation] = Task(
    name="screwdriver",
    description="insert a screwdriver into the recess of a moving screw and keep it there",
    frames=("target",),
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
    view=CameraView((0.66, -0.3, 0.07), 1.05, 80.0, -22.0),
    actuate_scene=_actuate_scene,
    progress=Progress(_measure_progress, _describe_progress, _explain_failure),
)
