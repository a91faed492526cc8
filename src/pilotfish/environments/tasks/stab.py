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

from pilotfish.environments.baxter import FLOOR, Tool, held_body, mount_point, part
from pilotfish.environments.people import Act
from pilotfish.environments.tasks.furniture import (
    BLUE,
    BOX,
    CAPSULE,
    CYLINDER,
    STEEL,
    YELLOW,
    post_under,
    thing,
    turned,
)
from pilotfish.environments.tasks.situation_checks import require_pose
from pilotfish.environments.tasks.task import Scene, Task, Verdict
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
SLOPE = turned((0.0, 1.0, 0.0), radians(150.0))


@dataclass(frozen=True, slots=True, eq=False)
class StabSituation:
    """Where the mouth of the receptacle is, its z axis pointing into the bore."""

    receptacle: Pose

    def __post_init__(self) -> None:
        require_pose(self.receptacle, "the receptacle", FLOOR + 0.2)


def mount_stab(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str) -> Tool:
    """A stab held by its T handle, 12 mm in radius, with a round end; the point is its tip."""
    del spec
    held = held_body(hand, side)
    part(held, f"{side}_handle", CAPSULE, (0.014, 0.045, 0.0), (0.0, 0.0, 0.03), YELLOW).quat = turned(
        (0.0, 1.0, 0.0), pi / 2
    )
    part(held, f"{side}_neck", CYLINDER, (0.02, 0.02, 0.0), (0.0, 0.0, 0.06), BLUE)
    half = (LENGTH - 0.06) / 2 - RADIUS
    stab = part(held, f"{side}_stab", CAPSULE, (RADIUS, half, 0.0), (0.0, 0.0, LENGTH - RADIUS - half), STEEL)
    stab.friction, stab.priority = (0.2, 0.005, 0.0001), 1  # wet steel
    stab.solref = (0.01, 1.0)
    return Tool(mount_point(held, LENGTH, side), LENGTH, (held.name,))


def _draw(rng: np.random.Generator) -> StabSituation:
    place = np.array([0.86, -0.38, 0.02]) + rng.uniform(-1.0, 1.0, 3) * np.array([0.06, 0.1, 0.08])
    yaw, tilt = rng.uniform(-1.0, 1.0, 2) * np.radians([20.0, 10.0])
    turn = multiply(turned((0.0, 0.0, 1.0), yaw), multiply(turned((0.0, 1.0, 0.0), tilt), SLOPE))
    return StabSituation(Pose(place, turn))


def _furnish(spec: mujoco.MjSpec, situation: StabSituation) -> None:
    at = situation.receptacle
    body = spec.worldbody.add_body(name="receptacle", pos=at.position, quat=at.quaternion)
    for n in range(SIDES):
        _wall(body, n)
        _funnel(body, n)
    thing(body, "bottom", CYLINDER, (BORE + WALL, 0.005, 0.0), (0.0, 0.0, BOTTOM + 0.005), STEEL)
    panel = thing(body, "panel", BOX, (0.1, 0.13, 0.006), (0.0, 0.0, BOTTOM + 0.014), (0.35, 0.42, 0.5, 1.0))
    post_under(spec, "post", at.position + rotation_matrix(at.quaternion) @ panel.pos + [0.03, 0.0, -0.02])


def _wall(body: mujoco.MjsBody, n: int) -> None:
    angle, middle, half = 2 * pi * n / SIDES, BORE + WALL / 2, (BOTTOM - FUNNEL) / 2
    pos = middle * np.cos(angle), middle * np.sin(angle), FUNNEL + half
    wide = (BORE + WALL) * tan(pi / SIDES)
    thing(body, f"wall_{n}", BOX, (WALL / 2, wide, half), pos, BLUE).quat = turned((0.0, 0.0, 1.0), angle)


def _funnel(body: mujoco.MjsBody, n: int) -> None:
    """One side of the funnel: its inner face leads from the mouth's edge to the bore's, at 45 degrees."""
    angle, middle = 2 * pi * n / SIDES, (BORE + MOUTH + WALL / 2**0.5) / 2
    pos = middle * np.cos(angle), middle * np.sin(angle), (FUNNEL + WALL / 2**0.5) / 2
    long = FUNNEL / 2**0.5
    wide = (MOUTH + WALL / 2) * tan(pi / SIDES)
    plate = thing(body, f"funnel_{n}", BOX, (WALL / 2, wide, long), pos, YELLOW)
    plate.quat = multiply(turned((0.0, 0.0, 1.0), angle), turned((0.0, 1.0, 0.0), -pi / 4))


def _see(model: mujoco.MjModel, data: mujoco.MjData, situation: StabSituation) -> dict[str, Pose]:
    del model, data
    return {"receptacle": situation.receptacle}


def tip_in(receptacle: Pose, tool: Pose) -> tuple[float, float, float]:
    """How deep the tip is in and how far from the axis [m], and the angle between axes [rad]."""
    tip = rotation_matrix(receptacle.quaternion).T @ (tool.position - receptacle.position)
    axes = rotation_matrix(receptacle.quaternion)[:, 2] @ rotation_matrix(tool.quaternion)[:, 2]
    return float(tip[2]), float(np.hypot(tip[0], tip[1])), float(np.arccos(np.clip(axes, -1.0, 1.0)))


def _judge(scene: Scene, situation: StabSituation) -> Verdict:
    depth, beside, angle = tip_in(situation.receptacle, scene.tool)
    error = float(np.hypot(max(0.0, DEEP - depth), max(0.0, beside - (BORE - RADIUS))))
    speed = float(np.linalg.norm(_tip_velocity(scene)))
    if beside > BORE:
        return Verdict(False, error, f"the tip is {beside:.3f} m beside the bore's axis: not in it")
    if depth < DEEP:
        return Verdict(False, error, f"the tip is {1e3 * depth:.0f} mm deep, expected {1e3 * DEEP:.0f}")
    if angle > AXIS:
        return Verdict(False, error, f"the stab leans {degrees(angle):.1f} degrees in its bore")
    if speed > STILL:
        return Verdict(False, error, f"the stab still moves, at {speed:.3f} m/s")
    return Verdict(True, error)


def _tip_velocity(scene: Scene) -> Float[Array, " 3"]:
    velocity = np.zeros(6)
    site = scene.model.site("right_tool").id
    mujoco.mj_objectVelocity(scene.model, scene.data, mujoco.mjtObj.mjOBJ_SITE, site, velocity, 0)
    return velocity[3:]


def _home(situation: StabSituation) -> Pose:
    del situation
    return Pose(np.array([0.75, -0.4, 0.2]), SLOPE)


def _along(frames: Mapping[str, Pose], depth: float) -> Pose:
    """The tip on the bore's axis, so deep beyond the mouth."""
    return frames["receptacle"] @ Pose(np.array([0.0, 0.0, depth]), np.array([1.0, 0.0, 0.0, 0.0]))


def _script(situation: StabSituation) -> tuple[Act, ...]:
    del situation
    near = partial(Act, position_tolerance=0.008, angle_tolerance=radians(3.0))
    exact = partial(Act, position_tolerance=0.005, angle_tolerance=radians(2.5))
    return (
        near("line up", lambda f: _along(f, -0.1), dwell=0.1),
        exact("approach", lambda f: _along(f, -0.015), speed=0.5, dwell=0.1),
        exact("insert", lambda f: _along(f, SEATED), speed=0.3, dwell=0.6),
    )


STAB: Task[StabSituation] = Task(
    name="stab",
    about="push a hot-stab into its receptacle",
    frames=("receptacle",),
    grips=False,
    unit="m",
    seconds=30.0,
    fragile=(),
    mount=mount_stab,
    draw=_draw,
    furnish=_furnish,
    home=_home,
    see=_see,
    judge=_judge,
    script=_script,
)
