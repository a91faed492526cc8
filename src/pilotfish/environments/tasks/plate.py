"""Pick and place: carry a glass plate over an obstacle, whose height varies, onto a cross on the table.

The plate is 14 by 10 cm and 8 mm thick. What is simpler than in life: glass does not break, suction is a
force that needs no seal, and the obstacle stands fixed; how hard it was pushed is measured instead.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import degrees, pi, radians

import mujoco
import numpy as np

from pilotfish.environments.baxter import mount_suction
from pilotfish.environments.human import Subtask
from pilotfish.environments.tasks.furniture import (
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
from pilotfish.environments.tasks.situation_checks import validate_object_pose
from pilotfish.environments.tasks.task import Outcome, Scene, Task
from pilotfish.geometry import Pose, multiply, relative_rotation_vector, rotation_matrix
from pilotfish.validation import require_count

LEVELS, STEP, LOWEST = 8, 0.02, 0.09  # heights of the obstacle: how many, from one to the next, the first [m]
POSSIBLE = (-3, 20)  # levels: from just above the table to as high as the arm reaches with a plate
TABLE = -0.12  # m, its top
HALF: Triple = (0.07, 0.05, 0.004)  # m, half of its sides and of its thickness
WEIGHT = 0.28  # kg: as glass of this size
BAR: Triple = (0.16, 0.02, 0.015)  # m, half of its sides: what the plate has to be carried over
BAR_AT = (0.68, -0.3)  # m, its middle in x and y
CROSS_AT = (0.66, -0.1)
NEAR, STRAIGHT, FLAT = 0.02, radians(10.0), radians(3.0)
PASS = 0.1  # m, how high the cup passes above the middle of the bar
CLEAR, STILL, TOUCH = 0.03, 0.02, 1.0  # m from plate to cup; m/s; N that the obstacle may feel
# The tool looks down and the hand's x axis to the robot; of a frame on the table z points up.
DOWN = axis_angle_quaternion((0.0, 1.0, 0.0), pi)


@dataclass(frozen=True, slots=True, eq=False)
class PlateSituation:
    """Where the plate lies at first, the middle of its upper face, z up; the obstacle's level.

    Levels 0 to 7 are drawn; the others of POSSIBLE are for situations beyond those of demonstrations.
    """

    plate: Pose
    level: int

    def __post_init__(self) -> None:
        validate_object_pose(self.plate, "the plate", TABLE)
        require_count(self.level, "the level of the obstacle", POSSIBLE[1], POSSIBLE[0])


def situation_for_level(level: int, rng: np.random.Generator) -> PlateSituation:
    """The obstacle at that height, the plate somewhere."""
    x, y = np.array([0.66, -0.52]) + rng.uniform(-1.0, 1.0, 2) * np.array([0.08, 0.06])
    yaw = rng.uniform(-1.0, 1.0) * radians(25.0)
    place = np.array([x, y, TABLE + 2 * HALF[2]])
    return PlateSituation(Pose(place, axis_angle_quaternion((0.0, 0.0, 1.0), yaw)), level)


def _sample_situation(rng: np.random.Generator) -> PlateSituation:
    return situation_for_level(int(rng.integers(LEVELS)), rng)


def obstacle_pose(level: int) -> Pose:
    """The middle of the obstacle at one of its heights."""
    place = np.array([*BAR_AT, TABLE + LOWEST + level * STEP])
    return Pose(place, np.array([1.0, 0.0, 0.0, 0.0]))


def goal_pose() -> Pose:
    """Where the plate is to lie: the middle of its upper face."""
    return Pose(np.array([*CROSS_AT, TABLE + 2 * HALF[2]]), np.array([1.0, 0.0, 0.0, 0.0]))


def _add_objects(spec: mujoco.MjSpec, situation: PlateSituation) -> None:
    table = add_solid(spec.worldbody, "table", BOX, (0.24, 0.4, 0.015), (0.67, -0.3, TABLE - 0.015), WOOD)
    # A rubber mat: the cup slides on the glass sooner than the glass there.
    table.friction = (1.2, 0.005, 0.0001)
    add_post(spec, "leg", np.array([0.67, -0.3, TABLE - 0.03]))
    for name, size in (("along", (0.05, 0.006, 0.0004)), ("across", (0.006, 0.05, 0.0004))):
        arm = add_solid(spec.worldbody, f"cross_{name}", BOX, size, (*CROSS_AT, TABLE + 0.0002), GREEN)
        arm.contype = arm.conaffinity = 0  # paint
    _obstacle(spec, obstacle_pose(situation.level).position[2])
    _plate(spec, situation.plate)


def _obstacle(spec: mujoco.MjSpec, height: float) -> None:
    """A bar along x that hangs between two rods."""
    x, y = BAR_AT
    add_solid(spec.worldbody, "obstacle", BOX, BAR, (x, y, height), YELLOW)
    for n, sign in enumerate((-1.0, 1.0)):
        half = (height - TABLE) / 2
        pos = x + sign * (BAR[0] - 0.01), y, TABLE + half
        add_solid(spec.worldbody, f"rod_{n}", CYLINDER, (0.008, half, 0.0), pos, STEEL)


def _plate(spec: mujoco.MjSpec, at: Pose) -> None:
    body = spec.worldbody.add_body(name="plate", pos=at.position, quat=at.quaternion)
    body.add_freejoint(name="plate")
    glass = add_solid(body, "plate", BOX, HALF, (0.0, 0.0, -HALF[2]), GLASS)
    glass.mass, glass.friction = WEIGHT, (0.6, 0.005, 0.0001)


def _observe_frames(model: mujoco.MjModel, data: mujoco.MjData, situation: PlateSituation) -> dict[str, Pose]:
    """Where the plate lay at first: it is what the robot sees before it moves."""
    del model, data
    return {"plate": situation.plate, "obstacle": obstacle_pose(situation.level)}


def plate_pose(data: mujoco.MjData) -> Pose:
    """The middle of the plate's upper face."""
    body = data.body("plate")
    return Pose(np.array(body.xpos), np.array(body.xquat))


def _check_success(scene: Scene, situation: PlateSituation) -> Outcome:
    del situation
    plate, goal = plate_pose(scene.data), goal_pose()
    error = float(np.linalg.norm(plate.position - goal.position))
    turn = float(np.linalg.norm(relative_rotation_vector(goal.quaternion, plate.quaternion)))
    lean = float(np.arccos(np.clip(rotation_matrix(plate.quaternion)[2, 2], -1.0, 1.0)))
    away = float(np.linalg.norm(scene.tool.position - plate.position))
    speed = float(np.linalg.norm(scene.data.joint("plate").qvel[:3]))
    pushed = max(scene.forces.get(name, 0.0) for name in CONTACT_LIMITS)
    for wrong, reason in (
        (error > NEAR, f"the plate lies {error:.3f} m from the cross"),
        (lean > FLAT, f"the plate leans by {degrees(lean):.1f} degrees"),
        (turn > STRAIGHT, f"the plate is turned by {degrees(turn):.1f} degrees"),
        (away < CLEAR, f"the cup is still {away:.3f} m from the plate"),
        (speed > STILL, f"the plate still moves, at {speed:.3f} m/s"),
        (pushed > TOUCH, f"the obstacle was pushed by {pushed:.1f} N"),
    ):
        if wrong:
            return Outcome(False, error, reason)
    return Outcome(True, error)


CONTACT_LIMITS = ("obstacle", "rod_0", "rod_1")


def _start_pose(situation: PlateSituation) -> Pose:
    del situation
    return Pose(np.array([0.56, -0.4, 0.18]), DOWN)


def _over(place: Pose, height: float) -> Pose:
    """The cup above a place, looking down on it, its axes turned with it."""
    up = place.position + np.array([0.0, 0.0, height])
    return Pose(up, multiply(place.quaternion, DOWN))


def _lifted(frames: Mapping[str, Pose]) -> Pose:
    """The cup above where the plate was, high enough to pass the bar."""
    up = frames["obstacle"].position[2] + PASS - frames["plate"].position[2]
    return _over(frames["plate"], up)


def _past(frames: Mapping[str, Pose]) -> Pose:
    """The cup beyond the bar, on the side of the cross, as high."""
    _, y, z = frames["obstacle"].position
    return _over(Pose(np.array([CROSS_AT[0], y + 0.14, z]), goal_pose().quaternion), PASS)


def _demonstration_script(situation: PlateSituation) -> tuple[Subtask, ...]:
    del situation
    passing = partial(Subtask, position_tolerance=0.02, angle_tolerance=radians(6.0), passing=True)
    near = partial(Subtask, position_tolerance=0.006, angle_tolerance=radians(3.0))
    exact = partial(Subtask, position_tolerance=0.003, angle_tolerance=radians(1.5), speed=0.5)
    return (
        passing("to the plate", lambda f: _over(f["plate"], 0.05)),
        near("above the plate", lambda f: _over(f["plate"], 0.014)),
        exact("touch", lambda f: _over(f["plate"], -0.003), dwell=0.5),
        exact("suck", lambda f: _over(f["plate"], -0.003), grip=1.0, dwell=0.8),
        passing("lift", _lifted, grip=1.0),
        passing("over the obstacle", _past, grip=1.0),
        passing("to the cross", lambda f: _over(goal_pose(), 0.05), grip=1.0),
        near("above the cross", lambda f: _over(goal_pose(), 0.018), grip=1.0),
        exact("put down", lambda f: _over(goal_pose(), -0.002), grip=1.0, dwell=0.5),
        exact("let go", lambda f: _over(goal_pose(), -0.002), dwell=0.8),
        near("leave", lambda f: _over(goal_pose(), 0.1), dwell=0.5),
    )


PLATE: Task[PlateSituation] = Task(
    name="plate",
    description="carry a glass plate over an obstacle and put it on a cross",
    frames=("plate", "obstacle"),
    has_gripper=True,
    unit="m",
    time_limit=40.0,
    contact_limits=CONTACT_LIMITS,
    mount_tool=mount_suction,
    sample_situation=_sample_situation,
    add_objects=_add_objects,
    start_pose=_start_pose,
    observe_frames=_observe_frames,
    check_success=_check_success,
    demonstration_script=_demonstration_script,
)
