"""Hot-stab: push a plug, as robots under water couple hoses with, into a receptacle on a sloping panel.

The stab is 24 mm thick, the bore 28 mm wide and 80 mm deep behind a funnel of 53 mm. What is simpler than in
life: there is no water and no current, the receptacle has twelve flat sides and stands still, and nothing
locks.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import degrees, pi, radians, tan

import mujoco
import numpy as np

from pilotfish.environments.baxter import FLOOR, Tool, add_tool_body, add_tool_geom, add_tool_point
from pilotfish.environments.human import Subtask
from pilotfish.environments.tasks.furniture import (
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
from pilotfish.environments.tasks.situation_checks import validate_object_pose
from pilotfish.environments.tasks.task import Outcome, Scene, Task
from pilotfish.geometry import Pose, multiply, rotation_matrix
from pilotfish.types import Array, Float

LENGTH = 0.2  # m, from the hand to the tip of the stab
RADIUS, BORE, MOUTH = 0.012, 0.014, 0.0265  # m: of the stab, of the bore, and where its funnel begins
FUNNEL, BOTTOM = 0.0125, 0.08  # m, from the mouth: where the funnel ends, and the bore
SEATED, DEEP = 0.07, 0.06  # m, from the mouth to the tip: where a person takes it, and what is enough
AXIS = radians(4.0)  # between stab and bore: what the play allows at that depth, and a little
STILL = 0.01  # m/s
WALL, SIDES = 0.008, 12
# Looking down and a little ahead, 60 degrees below the horizon; the tool's z axis points into the bore.
SLOPE = axis_angle_quaternion((0.0, 1.0, 0.0), radians(150.0))


@dataclass(frozen=True, slots=True, eq=False)
class StabSituation:
    """Where the mouth of the receptacle is, its z axis pointing into the bore."""

    receptacle: Pose

    def __post_init__(self) -> None:
        validate_object_pose(self.receptacle, "the receptacle", FLOOR + 0.2)


def mount_stab(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str) -> Tool:
    """A stab held by its T handle, 12 mm in radius, with a round end; the point is its tip."""
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
    place = np.array([0.86, -0.38, 0.02]) + rng.uniform(-1.0, 1.0, 3) * np.array([0.06, 0.1, 0.08])
    yaw, tilt = rng.uniform(-1.0, 1.0, 2) * np.radians([20.0, 10.0])
    turn = multiply(
        axis_angle_quaternion((0.0, 0.0, 1.0), yaw),
        multiply(axis_angle_quaternion((0.0, 1.0, 0.0), tilt), SLOPE),
    )
    return StabSituation(Pose(place, turn))


def _add_objects(spec: mujoco.MjSpec, situation: StabSituation) -> None:
    at = situation.receptacle
    body = spec.worldbody.add_body(name="receptacle", pos=at.position, quat=at.quaternion)
    for n in range(SIDES):
        _wall(body, n)
        _funnel(body, n)
    add_solid(body, "bottom", CYLINDER, (BORE + WALL, 0.005, 0.0), (0.0, 0.0, BOTTOM + 0.005), STEEL)
    panel = add_solid(
        body, "panel", BOX, (0.1, 0.13, 0.006), (0.0, 0.0, BOTTOM + 0.014), (0.35, 0.42, 0.5, 1.0)
    )
    add_post(spec, "post", at.position + rotation_matrix(at.quaternion) @ panel.pos + [0.03, 0.0, -0.02])


def _wall(body: mujoco.MjsBody, n: int) -> None:
    angle, middle, half = 2 * pi * n / SIDES, BORE + WALL / 2, (BOTTOM - FUNNEL) / 2
    pos = middle * np.cos(angle), middle * np.sin(angle), FUNNEL + half
    wide = (BORE + WALL) * tan(pi / SIDES)
    add_solid(body, f"wall_{n}", BOX, (WALL / 2, wide, half), pos, BLUE).quat = axis_angle_quaternion(
        (0.0, 0.0, 1.0), angle
    )


def _funnel(body: mujoco.MjsBody, n: int) -> None:
    """One side of the funnel: its inner face leads from the mouth's edge to the bore's, at 45 degrees."""
    angle, middle = 2 * pi * n / SIDES, (BORE + MOUTH + WALL / 2**0.5) / 2
    pos = middle * np.cos(angle), middle * np.sin(angle), (FUNNEL + WALL / 2**0.5) / 2
    long = FUNNEL / 2**0.5
    wide = (MOUTH + WALL / 2) * tan(pi / SIDES)
    plate = add_solid(body, f"funnel_{n}", BOX, (WALL / 2, wide, long), pos, YELLOW)
    plate.quat = multiply(
        axis_angle_quaternion((0.0, 0.0, 1.0), angle), axis_angle_quaternion((0.0, 1.0, 0.0), -pi / 4)
    )


def _observe_frames(model: mujoco.MjModel, data: mujoco.MjData, situation: StabSituation) -> dict[str, Pose]:
    del model, data
    return {"receptacle": situation.receptacle}


def insertion_depth(receptacle: Pose, tool: Pose) -> tuple[float, float, float]:
    """How deep the tip is in and how far from the axis [m], and the angle between axes [rad]."""
    tip = rotation_matrix(receptacle.quaternion).T @ (tool.position - receptacle.position)
    axes = rotation_matrix(receptacle.quaternion)[:, 2] @ rotation_matrix(tool.quaternion)[:, 2]
    return float(tip[2]), float(np.hypot(tip[0], tip[1])), float(np.arccos(np.clip(axes, -1.0, 1.0)))


def _check_success(scene: Scene, situation: StabSituation) -> Outcome:
    depth, beside, angle = insertion_depth(situation.receptacle, scene.tool)
    error = float(np.hypot(max(0.0, DEEP - depth), max(0.0, beside - (BORE - RADIUS))))
    speed = float(np.linalg.norm(_tip_velocity(scene)))
    if beside > BORE:
        return Outcome(False, error, f"the tip is {beside:.3f} m beside the bore's axis: not in it")
    if depth < DEEP:
        return Outcome(False, error, f"the tip is {1e3 * depth:.0f} mm deep, expected {1e3 * DEEP:.0f}")
    if angle > AXIS:
        return Outcome(False, error, f"the stab leans {degrees(angle):.1f} degrees in its bore")
    if speed > STILL:
        return Outcome(False, error, f"the stab still moves, at {speed:.3f} m/s")
    return Outcome(True, error)


def _tip_velocity(scene: Scene) -> Float[Array, " 3"]:
    velocity = np.zeros(6)
    site = scene.model.site("right_tool").id
    mujoco.mj_objectVelocity(scene.model, scene.data, mujoco.mjtObj.mjOBJ_SITE, site, velocity, 0)
    return velocity[3:]


def _start_pose(situation: StabSituation) -> Pose:
    del situation
    return Pose(np.array([0.75, -0.4, 0.2]), SLOPE)


def _along(frames: Mapping[str, Pose], depth: float) -> Pose:
    """The tip on the bore's axis, so deep beyond the mouth."""
    return frames["receptacle"] @ Pose(np.array([0.0, 0.0, depth]), np.array([1.0, 0.0, 0.0, 0.0]))


def _demonstration_script(situation: StabSituation) -> tuple[Subtask, ...]:
    del situation
    near = partial(Subtask, position_tolerance=0.008, angle_tolerance=radians(3.0))
    exact = partial(Subtask, position_tolerance=0.005, angle_tolerance=radians(2.5))
    return (
        near("line up", lambda f: _along(f, -0.1), dwell=0.1),
        exact("approach", lambda f: _along(f, -0.015), speed=0.5, dwell=0.1),
        exact("insert", lambda f: _along(f, SEATED), speed=0.3, dwell=0.6),
    )


STAB: Task[StabSituation] = Task(
    name="stab",
    description="push a hot-stab into its receptacle",
    frames=("receptacle",),
    has_gripper=False,
    unit="m",
    time_limit=30.0,
    contact_limits=(),
    mount_tool=mount_stab,
    sample_situation=_sample_situation,
    add_objects=_add_objects,
    start_pose=_start_pose,
    observe_frames=_observe_frames,
    check_success=_check_success,
    demonstration_script=_demonstration_script,
)
