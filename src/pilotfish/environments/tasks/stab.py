"""Hot-stab task: push the plug of an underwater hydraulic coupling into a receptacle on a sloping panel.

The stab is 24 mm thick; the bore is 28 mm wide and 80 mm deep, behind a funnel of 53 mm. Simplifications:
no water and no current; the receptacle has twelve flat sides and does not move; nothing locks.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import degrees, pi, radians, tan

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
)
from pilotfish.environments.tasks.scene_objects import (
    BLUE,
    BOX,
    CAPSULE,
    CYLINDER,
    STEEL,
    YELLOW,
    add_post,
    add_solid,
    axis_angle_quaternion,
)
from pilotfish.environments.tasks.task import Task
from pilotfish.environments.tasks.task_state import Outcome, Scene
from pilotfish.environments.tasks.validation import validate_object_pose
from pilotfish.environments.world import FLOOR
from pilotfish.geometry import Pose, multiply, rotation_matrix
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

LENGTH = 0.2  # m, from the hand to the tip of the stab
RADIUS, BORE, MOUTH = 0.012, 0.014, 0.0265  # m: radii of stab, bore and mouth of the funnel
FUNNEL, BOTTOM = 0.0125, 0.08  # m, depth of the ends of funnel and bore below the mouth
SEATED, DEEP = 0.07, 0.06  # m, depth of the tip in a demonstration, and smallest depth for success
AXIS = radians(4.0)  # largest angle between stab and bore: slightly above the play at that depth
STILL = 0.01  # m/s, largest speed at the end
WALL, SIDES = 0.008, 12
# Tool z axis 60 degrees below the horizontal, ahead of the robot: into the bore.
SLOPE = axis_angle_quaternion((0.0, 1.0, 0.0), radians(150.0))


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class StabSituation:
    """Situation of the receptacle.

    Attributes:
        receptacle: Pose of the mouth; its z axis points into the bore.
    """

    receptacle: Pose

    def __post_init__(self) -> None:
        """Check the poses and ranges."""
        validate_object_pose(self.receptacle, "the receptacle", FLOOR + 0.2)


def _mount_tool(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str) -> Tool:
    """Mount a stab with a T handle and a round end; the tool point is its tip."""
    del spec
    held = add_tool_body(hand, side)
    add_tool_geom(
        held, f"{side}_handle", CAPSULE, (0.014, 0.045, 0.0), (0.0, 0.0, 0.03), YELLOW
    ).quat = axis_angle_quaternion((0.0, 1.0, 0.0), pi / 2)
    add_tool_geom(held, f"{side}_neck", CYLINDER, (0.02, 0.02, 0.0), (0.0, 0.0, 0.06), BLUE)
    half = (LENGTH - 0.06) / 2 - RADIUS
    stab = add_tool_geom(
        held, f"{side}_stab", CAPSULE, (RADIUS, half, 0.0), (0.0, 0.0, LENGTH - RADIUS - half), STEEL
    )
    stab.friction, stab.priority = (0.2, 0.005, 0.0001), 1  # wet steel
    stab.solref = (0.01, 1.0)
    return Tool(add_tool_point(held, LENGTH, side), LENGTH, (held.name,))


def _sample_situation(rng: np.random.Generator) -> StabSituation:
    position = np.array([0.86, -0.38, 0.02]) + rng.uniform(-1.0, 1.0, 3) * np.array([0.06, 0.1, 0.08])
    yaw, tilt = rng.uniform(-1.0, 1.0, 2) * np.radians([20.0, 10.0])
    rotation = multiply(
        axis_angle_quaternion((0.0, 0.0, 1.0), yaw),
        multiply(axis_angle_quaternion((0.0, 1.0, 0.0), tilt), SLOPE),
    )
    return StabSituation(Pose(position, rotation))


def _add_objects(spec: mujoco.MjSpec, situation: StabSituation) -> None:
    pose = situation.receptacle
    body = spec.worldbody.add_body(name="receptacle", pos=pose.position, quat=pose.quaternion)
    for n in range(SIDES):
        _add_bore_side(body, n)
        _add_funnel_side(body, n)
    add_solid(body, "bottom", CYLINDER, (BORE + WALL, 0.005, 0.0), (0.0, 0.0, BOTTOM + 0.005), STEEL)
    panel = add_solid(
        body, "panel", BOX, (0.1, 0.13, 0.006), (0.0, 0.0, BOTTOM + 0.014), (0.35, 0.42, 0.5, 1.0)
    )
    top = pose.position + rotation_matrix(pose.quaternion) @ panel.pos + [0.03, 0.0, -0.02]
    add_post(spec, "post", top)


def _add_bore_side(body: mujoco.MjsBody, n: int) -> None:
    angle, middle, half = 2 * pi * n / SIDES, BORE + WALL / 2, (BOTTOM - FUNNEL) / 2
    pos = middle * np.cos(angle), middle * np.sin(angle), FUNNEL + half
    half_width = (BORE + WALL) * tan(pi / SIDES)
    add_solid(body, f"wall_{n}", BOX, (WALL / 2, half_width, half), pos, BLUE).quat = axis_angle_quaternion(
        (0.0, 0.0, 1.0), angle
    )


def _add_funnel_side(body: mujoco.MjsBody, n: int) -> None:
    """Add a plate whose inner face leads from the edge of the mouth to the bore at 45 degrees."""
    angle, middle = 2 * pi * n / SIDES, (BORE + MOUTH + WALL / 2**0.5) / 2
    pos = middle * np.cos(angle), middle * np.sin(angle), (FUNNEL + WALL / 2**0.5) / 2
    half_length = FUNNEL / 2**0.5
    half_width = (MOUTH + WALL / 2) * tan(pi / SIDES)
    plate = add_solid(body, f"funnel_{n}", BOX, (WALL / 2, half_width, half_length), pos, YELLOW)
    plate.quat = multiply(
        axis_angle_quaternion((0.0, 0.0, 1.0), angle), axis_angle_quaternion((0.0, 1.0, 0.0), -pi / 4)
    )


def _observe_frames(model: mujoco.MjModel, data: mujoco.MjData, situation: StabSituation) -> dict[str, Pose]:
    del model, data
    return {"receptacle": situation.receptacle}


def insertion_depth(receptacle: Pose, tool: Pose) -> tuple[float, float, float]:
    """Return the depth of the tip, its distance from the bore axis [m], and the angle of the axes [rad]."""
    tip = rotation_matrix(receptacle.quaternion).T @ (tool.position - receptacle.position)
    axes = rotation_matrix(receptacle.quaternion)[:, 2] @ rotation_matrix(tool.quaternion)[:, 2]
    return float(tip[2]), float(np.hypot(tip[0], tip[1])), float(np.arccos(np.clip(axes, -1.0, 1.0)))


def _check_success(scene: Scene, situation: StabSituation) -> Outcome:
    depth, distance, angle = insertion_depth(situation.receptacle, scene.tool)
    error = float(np.hypot(max(0.0, DEEP - depth), max(0.0, distance - (BORE - RADIUS))))
    speed = float(np.linalg.norm(_tip_velocity(scene)))
    if distance > BORE:
        return Outcome(False, error, f"the tip is {distance:.3f} m from the axis of the bore, not in it")
    if depth < DEEP:
        return Outcome(False, error, f"the tip is {1e3 * depth:.0f} mm deep, expected {1e3 * DEEP:.0f}")
    if angle > AXIS:
        return Outcome(False, error, f"the stab is tilted by {degrees(angle):.1f} degrees in the bore")
    if speed > STILL:
        return Outcome(False, error, f"the stab still moves at {speed:.3f} m/s")
    return Outcome(True, error)


def _tip_velocity(scene: Scene) -> Float[Array, " 3"]:
    velocity = np.zeros(6)
    site = scene.model.site("right_tool").id
    mujoco.mj_objectVelocity(scene.model, scene.data, mujoco.mjtObj.mjOBJ_SITE, site, velocity, 0)
    return velocity[3:]


def _measure_progress(scene: Scene, situation: StabSituation) -> Measurements:
    """Return the depth of the tip, its distance from the bore axis, and the angle of the axes."""
    depth, distance, angle = insertion_depth(situation.receptacle, scene.tool)
    return {"depth": depth, "aside": distance, "angle": angle}


def _describe_progress(now: Measurements) -> str:
    if now["depth"] > 0.0 and now["aside"] < MOUTH:
        return f"{1000.0 * now['depth']:.0f} mm deep"
    return f"tip {1000.0 * float(np.hypot(now['depth'], now['aside'])):.0f} mm from the mouth"


def _explain_failure(history: History, outcome: Outcome) -> Failure:
    """Explain a failure by the first of: find the mouth, enter the bore, reach the depth, and align."""
    depth, aside, angle = history["depth"], history["aside"], float(history["angle"][-1])
    inside, at_mouth = (depth > 0.0) & (aside < MOUTH), first_true(depth > 0.0)
    deepest, passed = depth[aside < BORE].max(initial=0.0), aside[min(at_mouth, len(aside) - 1)]
    checks = (
        (
            not inside.any() and at_mouth == len(depth),
            Phase.APPROACH,
            "never reached the receptacle",
            f"the tip stopped {in_mm(-depth.max())} before the mouth",
        ),
        (
            not inside.any(),
            Phase.APPROACH,
            "missed the funnel",
            f"the tip passed {in_mm(passed)} beside the axis, the funnel's radius is {in_mm(MOUTH)}",
        ),
        (
            deepest < FUNNEL,
            Phase.MOTION,
            "stuck in the funnel",
            f"the tip came {in_mm(depth[inside].max(initial=0.0))} deep, the bore begins at {in_mm(FUNNEL)}",
        ),
        (
            depth[-1] < DEEP and deepest >= DEEP,
            Phase.GOAL,
            "pulled out again",
            f"the tip was {in_mm(deepest)} deep, and is {in_mm(depth[-1])} deep at the end",
        ),
        (
            depth[-1] < DEEP,
            Phase.GOAL,
            "not pushed in far enough",
            f"the tip is {in_mm(depth[-1])} deep, expected {in_mm(DEEP)}",
        ),
        (angle > AXIS, Phase.GOAL, "tilted in the bore", f"the stab is tilted by {in_degrees(angle)}"),
    )
    return first_failure(checks, outcome)


def _start_pose(situation: StabSituation) -> Pose:
    del situation
    return Pose(np.array([0.75, -0.4, 0.2]), SLOPE)


def _pose_at_depth(frames: Mapping[str, Pose], depth: float) -> Pose:
    """Return the pose with the tip on the bore axis at a depth below the mouth [m]."""
    return frames["receptacle"] @ Pose(np.array([0.0, 0.0, depth]), np.array([1.0, 0.0, 0.0, 0.0]))


def _demonstration_script(situation: StabSituation) -> tuple[Subtask, ...]:
    del situation
    near = partial(Subtask, position_tolerance=0.008, angle_tolerance=radians(3.0))
    exact = partial(Subtask, position_tolerance=0.005, angle_tolerance=radians(2.5))
    return (
        near("line up", lambda f: _pose_at_depth(f, -0.1), dwell=0.1),
        exact("approach", lambda f: _pose_at_depth(f, -0.015), speed_factor=0.5, dwell=0.1),
        exact("insert", lambda f: _pose_at_depth(f, SEATED), speed_factor=0.3, dwell=0.6),
    )


STAB: Task[StabSituation] = Task(
    name="stab",
    description="push a hot-stab into its receptacle",
    frames=("receptacle",),
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
    view=CameraView((0.66, -0.28, 0.07), 1.3, 65.0, -20.0),
    progress=Progress(_measure_progress, _describe_progress, _explain_failure),
)
