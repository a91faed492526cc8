"""Pick-and-place task: carry a glass plate over an obstacle of varying height to a cross on the table.

The plate is 14 by 10 cm and 8 mm thick. Simplifications: glass does not break; suction is a force that needs
no seal; the obstacle is fixed, and the force on it is measured instead.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import degrees, pi, radians

import mujoco
import numpy as np

from pilotfish.environments.baxter.tools import mount_suction
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
    BOX,
    CYLINDER,
    GLASS,
    GREEN,
    STEEL,
    WOOD,
    YELLOW,
    Triple,
    add_post,
    add_solid,
    axis_angle_quaternion,
)
from pilotfish.environments.tasks.task import Task
from pilotfish.environments.tasks.task_state import Outcome, Scene
from pilotfish.environments.tasks.validation import validate_object_pose
from pilotfish.geometry import Pose, multiply, relative_rotation_vector, rotation_matrix
from pilotfish.validation import require_count, shorten_repr

LEVELS, STEP, LOWEST = 8, 0.02, 0.09  # heights of the obstacle: number, step [m], lowest [m]
POSSIBLE = (-3, 20)  # levels: from just above the table to the reach of the arm with a plate
TABLE = -0.12  # m, height of its surface
HALF: Triple = (0.07, 0.05, 0.004)  # m, half of its size
WEIGHT = 0.28  # kg, of glass of this size
BAR: Triple = (0.16, 0.02, 0.015)  # m, half of the size of the obstacle
BAR_POSITION = (0.68, -0.3)  # m, x and y of its centre
CROSS_POSITION = (0.66, -0.1)  # m
NEAR, STRAIGHT, FLAT = 0.02, radians(10.0), radians(3.0)  # m, rad, rad: largest errors
PASS = 0.1  # m, height of the cup above the centre of the bar
CLEAR, STILL, TOUCH = 0.03, 0.02, 1.0  # m from plate to cup; m/s; N on the obstacle
LIFTED, DROPPED, PARTED, SUCKING = 0.01, 0.015, 0.02, 0.5  # m; grip at which suction begins
FRAGILE_GEOMS = ("obstacle", "rod_0", "rod_1")
# Tool z axis down, hand x axis to the robot; z of a frame on the table points up.
DOWN = axis_angle_quaternion((0.0, 1.0, 0.0), pi)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class PlateSituation:
    """Situation of plate and obstacle.

    Attributes:
        plate: Initial pose of the centre of the plate's upper face, z up.
        level: Height of the obstacle in steps of 2 cm. Levels 0 to 7 are sampled; -3 to 20 are accepted, for
            situations outside the demonstrations.
    """

    plate: Pose
    level: int

    def __post_init__(self) -> None:
        """Check the poses and ranges."""
        validate_object_pose(self.plate, "the plate", TABLE)
        require_count(self.level, "the level of the obstacle", POSSIBLE[1], POSSIBLE[0])


def situation_for_level(level: int, rng: np.random.Generator) -> PlateSituation:
    """Return a situation with a given obstacle and a sampled pose of the plate.

    Args:
        level: Level of the obstacle.
        rng: Generator of the pose.
    """
    x, y = np.array([0.66, -0.52]) + rng.uniform(-1.0, 1.0, 2) * np.array([0.08, 0.06])
    yaw = rng.uniform(-1.0, 1.0) * radians(25.0)
    position = np.array([x, y, TABLE + 2 * HALF[2]])
    return PlateSituation(Pose(position, axis_angle_quaternion((0.0, 0.0, 1.0), yaw)), level)


def _sample_situation(rng: np.random.Generator) -> PlateSituation:
    return situation_for_level(int(rng.integers(LEVELS)), rng)


def obstacle_pose(level: int) -> Pose:
    """Return the pose of the centre of the obstacle.

    Args:
        level: Level of the obstacle.
    """
    position = np.array([*BAR_POSITION, TABLE + LOWEST + level * STEP])
    return Pose(position, np.array([1.0, 0.0, 0.0, 0.0]))


def goal_pose() -> Pose:
    """Return the goal of the plate, at the centre of its upper face."""
    return Pose(np.array([*CROSS_POSITION, TABLE + 2 * HALF[2]]), np.array([1.0, 0.0, 0.0, 0.0]))


def _add_objects(spec: mujoco.MjSpec, situation: PlateSituation) -> None:
    table = add_solid(spec.worldbody, "table", BOX, (0.24, 0.4, 0.015), (0.67, -0.3, TABLE - 0.015), WOOD)
    # Rubber mat: the cup slips on the glass before the glass slips on the table.
    table.friction = (1.2, 0.005, 0.0001)
    add_post(spec, "leg", np.array([0.67, -0.3, TABLE - 0.03]))
    for name, size in (("along", (0.05, 0.006, 0.0004)), ("across", (0.006, 0.05, 0.0004))):
        arm = add_solid(spec.worldbody, f"cross_{name}", BOX, size, (*CROSS_POSITION, TABLE + 0.0002), GREEN)
        arm.contype = arm.conaffinity = 0  # paint
    _add_obstacle(spec, obstacle_pose(situation.level).position[2])
    _add_plate(spec, situation.plate)


def _add_obstacle(spec: mujoco.MjSpec, height: float) -> None:
    """Add a bar along x on two rods."""
    x, y = BAR_POSITION
    add_solid(spec.worldbody, "obstacle", BOX, BAR, (x, y, height), YELLOW)
    for n, sign in enumerate((-1.0, 1.0)):
        half = (height - TABLE) / 2
        pos = x + sign * (BAR[0] - 0.01), y, TABLE + half
        add_solid(spec.worldbody, f"rod_{n}", CYLINDER, (0.008, half, 0.0), pos, STEEL)


def _add_plate(spec: mujoco.MjSpec, pose: Pose) -> None:
    body = spec.worldbody.add_body(name="plate", pos=pose.position, quat=pose.quaternion)
    body.add_freejoint(name="plate")
    glass = add_solid(body, "plate", BOX, HALF, (0.0, 0.0, -HALF[2]), GLASS)
    glass.mass, glass.friction = WEIGHT, (0.6, 0.005, 0.0001)


def _observe_frames(model: mujoco.MjModel, data: mujoco.MjData, situation: PlateSituation) -> dict[str, Pose]:
    """Return the initial pose of the plate, which the robot observes before it moves."""
    del model, data
    return {"plate": situation.plate, "obstacle": obstacle_pose(situation.level)}


def plate_pose(data: mujoco.MjData) -> Pose:
    """Return the pose of the centre of the plate's upper face."""
    body = data.body("plate")
    return Pose(np.array(body.xpos), np.array(body.xquat))


def _check_success(scene: Scene, situation: PlateSituation) -> Outcome:
    del situation
    plate, goal = plate_pose(scene.data), goal_pose()
    error = float(np.linalg.norm(plate.position - goal.position))
    rotation = float(np.linalg.norm(relative_rotation_vector(goal.quaternion, plate.quaternion)))
    tilt = float(np.arccos(np.clip(rotation_matrix(plate.quaternion)[2, 2], -1.0, 1.0)))
    distance = float(np.linalg.norm(scene.tool.position - plate.position))
    speed = float(np.linalg.norm(scene.data.joint("plate").qvel[:3]))
    force = max(scene.forces.get(name, 0.0) for name in FRAGILE_GEOMS)
    for failed, reason in (
        (error > NEAR, f"the plate is {error:.3f} m from the cross"),
        (tilt > FLAT, f"the plate is tilted by {degrees(tilt):.1f} degrees"),
        (rotation > STRAIGHT, f"the plate is rotated by {degrees(rotation):.1f} degrees"),
        (distance < CLEAR, f"the cup is still {distance:.3f} m from the plate"),
        (speed > STILL, f"the plate still moves at {speed:.3f} m/s"),
        (force > TOUCH, f"the obstacle was pushed by {force:.1f} N"),
    ):
        if failed:
            return Outcome(False, error, reason)
    return Outcome(True, error)


def _measure_progress(scene: Scene, situation: PlateSituation) -> Measurements:
    """Return the plate's pose relative to its start and the cross, and the cup's position on the plate."""
    plate, goal = plate_pose(scene.data), goal_pose()
    cup = (plate.inverse() @ scene.tool).position
    return {
        "lift": float(plate.position[2] - situation.plate.position[2]),
        "to cross": float(np.linalg.norm((plate.position - goal.position)[:2])),
        "rotation": float(np.linalg.norm(relative_rotation_vector(goal.quaternion, plate.quaternion))),
        "tilt": float(np.arccos(np.clip(rotation_matrix(plate.quaternion)[2, 2], -1.0, 1.0))),
        "cup above": float(cup[2]),
        "cup beside": float(np.linalg.norm(np.maximum(np.abs(cup[:2]) - np.array(HALF[:2]), 0.0))),
        "suction": scene.grip,
        "obstacle force": max(scene.forces.get(name, 0.0) for name in FRAGILE_GEOMS),
    }


def _describe_progress(now: Measurements) -> str:
    if now["lift"] > LIFTED:
        return "picked up"
    if now["to cross"] < NEAR:
        return "on the cross"
    return "suction on" if now["suction"] > SUCKING else "moving"


def _explain_failure(history: History, outcome: Outcome) -> Failure:
    """Explain a failure by the first of: pick up, carry, put down, release, and force on the obstacle."""
    if not (history["lift"] > LIFTED).any():
        return Failure(Phase.GRASP, "never picked up", _describe_missed_plate(history))
    if failure := _explain_parting(history):
        return failure
    aside, rotation, tilt, force = (
        float(history[name][-1]) for name in ("to cross", "rotation", "tilt", "obstacle force")
    )
    turned = f"the plate is turned by {in_degrees(rotation)}, at most {in_degrees(STRAIGHT)} are allowed"
    pushed = f"the obstacle was pushed by {force:.1f} N, at most {TOUCH:.0f} N are allowed"
    checks = (
        (aside > NEAR, Phase.GOAL, "put down aside", f"the plate lies {in_mm(aside)} beside the cross"),
        (tilt > FLAT, Phase.GOAL, "put down tilted", f"the plate is tilted by {in_degrees(tilt)}"),
        (rotation > STRAIGHT, Phase.GOAL, "put down turned", turned),
        (force > TOUCH, Phase.CONTACT, "hit the obstacle", pushed),
    )
    return first_failure(checks, outcome)


def _explain_parting(history: History) -> Failure | None:
    """Return a failure if the plate left the cup before it was put down, or never did."""
    lift, suction = history["lift"], history["suction"] > SUCKING
    lifted = first_true(lift > LIFTED)
    apart = np.maximum(history["cup above"], history["cup beside"])[lifted:] > PARTED
    if not apart.any():
        return Failure(Phase.RELEASE, "not released", "the plate still hangs on the cup at the end")
    parted = lifted + first_true(apart)
    if (height := float(lift[parted - 1])) <= DROPPED:
        return None
    let_go = not suction[parted - 1 : parted + 1].all()
    how = "suction was switched off" if let_go else "it was torn off with suction on"
    place = f"{in_mm(height)} above the table, {in_mm(float(history['to cross'][parted - 1]))} from the cross"
    return Failure(
        Phase.RELEASE if let_go else Phase.MOTION, "dropped on the way", f"the plate fell {place}: {how}"
    )


def _describe_missed_plate(history: History) -> str:
    """Return why the plate was not picked up."""
    suction = history["suction"] > SUCKING
    if not suction.any():
        return f"suction never exceeded {history['suction'].max():.2f}, it begins at {SUCKING:g}"
    beside, above = history["cup beside"][suction], np.maximum(history["cup above"][suction], 0.0)
    nearest = int(np.argmin(np.hypot(beside, above)))
    if beside[nearest] > 0.0:
        return f"with suction on, the cup came no closer than {in_mm(beside[nearest])} beside the plate"
    return f"with suction on, the cup stayed {in_mm(above[nearest])} above the plate"


def _start_pose(situation: PlateSituation) -> Pose:
    del situation
    return Pose(np.array([0.56, -0.4, 0.18]), DOWN)


def _cup_above(target: Pose, height: float) -> Pose:
    """Return the cup pose at a height above a horizontal target, facing down [m]."""
    position = target.position + np.array([0.0, 0.0, height])
    return Pose(position, multiply(target.quaternion, DOWN))


def _cup_lifted(frames: Mapping[str, Pose]) -> Pose:
    """Return the cup pose above the initial plate, high enough to pass the bar."""
    height = frames["obstacle"].position[2] + PASS - frames["plate"].position[2]
    return _cup_above(frames["plate"], height)


def _cup_past_bar(frames: Mapping[str, Pose]) -> Pose:
    """Return the cup pose at the same height beyond the bar, on the side of the cross."""
    _, y, z = frames["obstacle"].position
    return _cup_above(Pose(np.array([CROSS_POSITION[0], y + 0.14, z]), goal_pose().quaternion), PASS)


def _demonstration_script(situation: PlateSituation) -> tuple[Subtask, ...]:
    del situation
    passing = partial(Subtask, position_tolerance=0.02, angle_tolerance=radians(6.0), passing=True)
    near = partial(Subtask, position_tolerance=0.006, angle_tolerance=radians(3.0))
    exact = partial(Subtask, position_tolerance=0.003, angle_tolerance=radians(1.5), speed_factor=0.5)
    return (
        passing("to the plate", lambda f: _cup_above(f["plate"], 0.05)),
        near("above the plate", lambda f: _cup_above(f["plate"], 0.014)),
        exact("touch", lambda f: _cup_above(f["plate"], -0.003), dwell=0.5),
        exact("suck", lambda f: _cup_above(f["plate"], -0.003), grip=1.0, dwell=0.8),
        passing("lift", _cup_lifted, grip=1.0),
        passing("over the obstacle", _cup_past_bar, grip=1.0),
        passing("to the cross", lambda f: _cup_above(goal_pose(), 0.05), grip=1.0),
        near("above the cross", lambda f: _cup_above(goal_pose(), 0.018), grip=1.0),
        exact("put down", lambda f: _cup_above(goal_pose(), -0.002), grip=1.0, dwell=0.5),
        exact("let go", lambda f: _cup_above(goal_pose(), -0.002), dwell=0.8),
        near("leave", lambda f: _cup_above(goal_pose(), 0.1), dwell=0.5),
    )


PLATE: Task[PlateSituation] = Task(
    name="plate",
    description="carry a glass plate over an obstacle and put it on a cross",
    frames=("plate", "obstacle"),
    has_gripper=True,
    unit="m",
    time_limit=40.0,
    mount_tool=mount_suction,
    sample_situation=_sample_situation,
    add_objects=_add_objects,
    start_pose=_start_pose,
    observe_frames=_observe_frames,
    check_success=_check_success,
    demonstration_script=_demonstration_script,
    fragile_geoms=FRAGILE_GEOMS,
    view=CameraView((0.66, -0.3, 0.1), 1.2, 75.0, -25.0),
    progress=Progress(_measure_progress, _describe_progress, _explain_failure),
)
