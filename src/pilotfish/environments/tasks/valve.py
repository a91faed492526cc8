"""Valve task: grip the handle, turn it to a mark, release it. Friction holds the valve where it is left."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees, pi, radians

import mujoco
import numpy as np

from pilotfish.environments.baxter.tools import mount_gripper
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
    CYLINDER,
    GREEN,
    STEEL,
    YELLOW,
    add_solid,
    axis_angle_quaternion,
)
from pilotfish.environments.tasks.task import Task
from pilotfish.environments.tasks.task_state import Outcome, Scene
from pilotfish.environments.tasks.validation import MAX_ANGLE, validate_object_pose
from pilotfish.environments.world import FLOOR
from pilotfish.geometry import Pose
from pilotfish.validation import require_number, shorten_repr

TOLERANCE = radians(5.0)
CLEAR = 0.08  # m, smallest distance from handle to tool at the end
# rad, grip and m: smallest turn that counts, closed gripper, and largest distance of a grasp.
TURNING, CLOSED, GRASPED = radians(3.0), 0.5, 0.03
STICTION, DRAG = 0.3, 0.3  # N m; N m s/rad
# Orientation of the tool at the grasp: z ahead along x, fingers closing horizontally.
FACING = axis_angle_quaternion((0.0, 1.0, 0.0), pi / 2)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ValveSituation:
    """Situation of the valve.

    Attributes:
        valve: Pose of the valve; its axis is x and points away from the robot.
        start_angle: Angle of the handle about the axis at the start [rad].
        goal_angle: Angle to which the handle must be turned [rad].
    """

    valve: Pose
    start_angle: float
    goal_angle: float

    def __post_init__(self) -> None:
        """Check the poses and ranges."""
        validate_object_pose(self.valve, "the valve", FLOOR + 0.01)
        for name in ("start_angle", "goal_angle"):
            require_number(getattr(self, name), f"the {name} of the handle", -MAX_ANGLE, MAX_ANGLE)


def _sample_situation(rng: np.random.Generator) -> ValveSituation:
    position = np.array([0.86, -0.3, 0.12]) + rng.uniform(-1.0, 1.0, 3) * np.array([0.05, 0.1, 0.08])
    rotation = axis_angle_quaternion((0.0, 0.0, 1.0), rng.uniform(-0.25, 0.25))
    start_angle = rng.uniform(-0.5, 0.3)
    return ValveSituation(Pose(position, rotation), start_angle, start_angle + rng.uniform(1.0, 1.4))


def _add_objects(spec: mujoco.MjSpec, situation: ValveSituation) -> None:
    at = situation.valve.position
    stand = spec.worldbody.add_body(name="stand", pos=at, quat=situation.valve.quaternion)
    add_solid(stand, "panel", BOX, (0.01, 0.14, 0.14), (0.085, 0.0, 0.0), (0.35, 0.42, 0.5, 1.0))
    add_solid(stand, "post", BOX, (0.03, 0.03, (at[2] - FLOOR) / 2), (0.125, 0.0, (FLOOR - at[2]) / 2), STEEL)
    # The mark shows the goal of the handle.
    mark = add_solid(stand, "mark", BOX, (0.002, 0.012, 0.012), (0.074, 0.0, 0.0), GREEN)
    mark.pos = 0.074, -0.12 * np.sin(situation.goal_angle), 0.12 * np.cos(situation.goal_angle)
    mark.contype = mark.conaffinity = 0
    valve = spec.worldbody.add_body(
        name="valve", pos=at, quat=handle_pose(situation, situation.start_angle).quaternion
    )
    hinge = valve.add_joint(name="valve", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[1, 0, 0])
    hinge.ref, hinge.frictionloss, hinge.armature = situation.start_angle, STICTION, 0.002
    hinge.damping[0] = DRAG
    stem = add_solid(valve, "stem", CYLINDER, (0.008, 0.035, 0.0), (0.04, 0.0, 0.0), STEEL)
    stem.quat, stem.mass = FACING, 0.2
    bar = add_solid(valve, "handle", BOX, (0.012, 0.011, 0.065), (0.0, 0.0, 0.0), YELLOW)
    bar.mass, bar.friction = 0.2, (1.0, 0.01, 0.001)


def handle_pose(situation: ValveSituation, angle: float) -> Pose:
    """Return the pose of the handle at an angle [rad]: x along the axis, z along its bar."""
    return situation.valve @ Pose(np.zeros(3), axis_angle_quaternion((1.0, 0.0, 0.0), angle))


def _observe_frames(model: mujoco.MjModel, data: mujoco.MjData, situation: ValveSituation) -> dict[str, Pose]:
    del model, data
    return {
        "before": handle_pose(situation, situation.start_angle),
        "after": handle_pose(situation, situation.goal_angle),
    }


def _valve_angle(scene: Scene) -> float:
    return float(scene.data.qpos[scene.model.joint("valve").qposadr[0]])


def _check_success(scene: Scene, situation: ValveSituation) -> Outcome:
    error = abs(_valve_angle(scene) - situation.goal_angle)
    distance = float(np.linalg.norm(scene.tool.position - situation.valve.position))
    if error > TOLERANCE:
        return Outcome(False, error, f"the valve is {degrees(error):.1f} degrees from its goal")
    if distance < CLEAR:
        return Outcome(
            False, error, f"the tool is still {distance:.3f} m from the handle, expected {CLEAR:g} m"
        )
    return Outcome(True, error)


def _measure_progress(scene: Scene, situation: ValveSituation) -> Measurements:
    """Return the angle of the valve, grip, and the distance of the tool from the handle."""
    goal = situation.goal_angle - situation.start_angle
    return {
        "turned": (_valve_angle(scene) - situation.start_angle) * float(np.sign(goal) or 1.0),
        "goal": abs(goal),
        "grip": scene.grip,
        "distance": float(np.linalg.norm(scene.tool.position - situation.valve.position)),
    }


def _describe_progress(now: Measurements) -> str:
    if now["turned"] < TURNING:
        return "gripper closed" if now["grip"] > CLOSED else "moving"
    return f"turned by {degrees(now['turned']):.0f} of {degrees(now['goal']):.0f} degrees"


def _explain_failure(history: History, outcome: Outcome) -> Failure:
    """Explain a failure by the first of: grip, turn, release."""
    most = float(history["turned"].max())
    if most < TURNING:
        return _explain_missed_grasp(history, most)
    goal, end, left = (float(history[name][-1]) for name in ("goal", "turned", "distance"))
    total = f"of {in_degrees(goal)}"
    turned_back = f"turned by {in_degrees(most)}, then back to {in_degrees(end)} {total}"
    too_far = f"turned by {in_degrees(end)} instead {total}"
    too_near = f"the tool is still {in_mm(left)} from the handle, expected {in_mm(CLEAR)}"
    too_little, enough = end < goal - TOLERANCE, most >= goal - TOLERANCE
    checks = (
        (too_little and enough, Phase.RELEASE, "turned back while letting go", turned_back),
        (too_little, Phase.GOAL, "turned too little", f"turned by only {in_degrees(end)} {total}"),
        (end > goal + TOLERANCE, Phase.GOAL, "turned too far", too_far),
        (left < CLEAR, Phase.RELEASE, "hand not withdrawn", too_near),
    )
    return first_failure(checks, outcome)


def _explain_missed_grasp(history: History, most: float) -> Failure:
    """Explain why the valve has not been turned, or only by an angle that does not count."""
    closed = history["grip"] > CLOSED
    if not closed.any():
        strongest = f"the gripper closed to {history['grip'].max():.2f} at most, 1 is closed"
        return Failure(Phase.GRASP, "never gripped", strongest)
    if (nearest := smallest(history["distance"][closed])) > GRASPED:
        detail = f"the closed gripper came no closer to the handle than {in_mm(nearest)}"
        return Failure(Phase.GRASP, "never gripped", detail)
    return Failure(Phase.MOTION, "gripped but not turned", f"turned by only {in_degrees(max(most, 0.0))}")


def _start_pose(situation: ValveSituation) -> Pose:
    del situation
    return Pose(np.array([0.62, -0.35, 0.15]), FACING)


def _grasp_pose(frames: Mapping[str, Pose], frame: str, distance: float) -> Pose:
    """Return the tool pose in front of the handle at a distance [m]."""
    return frames[frame] @ Pose(np.array([-distance, 0.0, 0.0]), FACING)


def _demonstration_script(situation: ValveSituation) -> tuple[Subtask, ...]:
    del situation
    near, exact = (0.012, radians(5.0)), (0.005, radians(2.5))  # m, rad
    return (
        Subtask("line up", lambda f: _grasp_pose(f, "before", 0.13), *near, grip=0.0, dwell=0.1),
        Subtask("reach", lambda f: _grasp_pose(f, "before", 0.0), *exact, grip=1.0, dwell=0.6),
        Subtask("turn", lambda f: _grasp_pose(f, "after", 0.0), *exact, grip=0.0, dwell=0.5),
        Subtask("leave", lambda f: _grasp_pose(f, "after", 0.15), *near, grip=0.0, dwell=0.3),
    )


VALVE: Task[ValveSituation] = Task(
    name="valve",
    description="grip the handle of a valve, turn it to a mark, release it",
    frames=("before", "after"),
    has_gripper=True,
    unit="rad",
    time_limit=30.0,
    mount_tool=mount_gripper,
    sample_situation=_sample_situation,
    add_objects=_add_objects,
    start_pose=_start_pose,
    observe_frames=_observe_frames,
    check_success=_check_success,
    demonstration_script=_demonstration_script,
    view=CameraView((0.68, -0.3, 0.12), 1.25, 62.0, -18.0),
    progress=Progress(_measure_progress, _describe_progress, _explain_failure),
)
