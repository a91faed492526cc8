"""Task with the valve of the thesis' recording: a lever on an axle at the robot's right side.

The axle and the length of the lever are those of the circle on which the sixteen frames of the recording lie,
to 12 mm. Friction, masses and the shape of the lever are chosen. A skill that was learned from a person who
opened the real valve can be executed: a `RecordedValve` is built from the frames of a demonstration.
"""

from dataclasses import dataclass
from math import atan2, degrees, pi, radians

import mujoco
import numpy as np

from pilotfish.environments.baxter.tools import Tool, mount_gripper
from pilotfish.environments.human import Subtask
from pilotfish.environments.scene_renderer import CameraView
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
from pilotfish.environments.tasks.validation import validate_object_pose
from pilotfish.environments.world import FLOOR
from pilotfish.geometry import Pose, multiply
from pilotfish.validation import shorten_repr

BEFORE, AFTER = "valve before", "valve after"
CENTRE, LEVER = np.array([0.591, -1.086, 0.256]), 0.177  # m, fitted to the frames
TOLERANCE = radians(10.0)
STICTION, DRAG = 0.5, 0.5  # N m; N m s/rad
END = 0.22  # m, length of the lever from the axle
TOOL = 0.204  # m from the hand to the tool point of the recording


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RecordedValve:
    """Situation of a recorded demonstration.

    Attributes:
        before: Pose of the handle before it was turned.
        after: Pose of the handle after it was turned.
        start_pose: Pose of the tool at the start.
    """

    before: Pose
    after: Pose
    start_pose: Pose

    def __post_init__(self) -> None:
        """Check the poses and ranges."""
        for name in ("before", "after", "start_pose"):
            validate_object_pose(getattr(self, name), f"the pose {name!r}", FLOOR)

    @property
    def start_angle(self) -> float:
        """Return the angle of the lever at the start [rad]."""
        return lever_angle(self.before)

    @property
    def goal_angle(self) -> float:
        """Return the angle to which the lever must be turned [rad]."""
        return lever_angle(self.after)

    @property
    def turn(self) -> float:
        """Return the angle between start and goal [rad], at most pi."""
        return _angle_between(self.start_angle, self.goal_angle)


def lever_angle(handle: Pose) -> float:
    """Return the angle of the lever about its axle [rad], zero ahead and positive downward."""
    offset = handle.position - CENTRE
    return atan2(-offset[2], offset[0])


def _angle_between(a: float, b: float) -> float:
    """Return the absolute difference of two angles [rad], at most pi."""
    return abs(float(np.angle(np.exp(1j * (a - b)))))


def _add_objects(spec: mujoco.MjSpec, situation: RecordedValve) -> None:
    """Add the valve with its lever at the start angle, and a mark at the goal angle."""
    stand = spec.worldbody.add_body(name="stand", pos=CENTRE)
    add_solid(
        stand,
        "post",
        BOX,
        (0.035, 0.035, (CENTRE[2] - FLOOR) / 2),
        (0.0, -0.12, (FLOOR - CENTRE[2]) / 2),
        STEEL,
    )
    plate = add_solid(stand, "plate", CYLINDER, (0.16, 0.01, 0.0), (0.0, -0.09, 0.0), (0.35, 0.42, 0.5, 1.0))
    plate.quat = axis_angle_quaternion((1.0, 0.0, 0.0), pi / 2)
    mark_position = 0.145 * np.array(
        [np.cos(situation.goal_angle), 0.0, -np.sin(situation.goal_angle)]
    ) + np.array([0.0, -0.079, 0.0])
    mark = add_solid(stand, "mark", BOX, (0.012, 0.002, 0.012), tuple(mark_position), GREEN)
    mark.contype = mark.conaffinity = 0
    lever = spec.worldbody.add_body(
        name="lever", pos=CENTRE, quat=axis_angle_quaternion((0.0, 1.0, 0.0), situation.start_angle)
    )
    hinge = lever.add_joint(name="valve", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    hinge.ref, hinge.frictionloss, hinge.armature = situation.start_angle, STICTION, 0.01
    hinge.damping[0] = DRAG
    axle = add_solid(lever, "axle", CYLINDER, (0.015, 0.04, 0.0), (0.0, -0.04, 0.0), STEEL)
    axle.quat, axle.mass = axis_angle_quaternion((1.0, 0.0, 0.0), pi / 2), 0.3
    bar = add_solid(lever, "handle", BOX, (END / 2, 0.012, 0.012), (END / 2, 0.0, 0.0), YELLOW)
    bar.mass, bar.friction = 0.3, (1.0, 0.01, 0.001)
    balance = add_solid(lever, "balance", BOX, (0.04, 0.012, 0.03), (-0.0825, 0.0, 0.0), YELLOW)
    balance.mass = 0.4  # the lever is balanced


def _check_success(scene: Scene, situation: RecordedValve) -> Outcome:
    """Require the lever within ten degrees of the goal, and nearer to the goal than to the start."""
    error = _angle_between(
        float(scene.data.qpos[scene.model.joint("valve").qposadr[0]]), situation.goal_angle
    )
    if error > TOLERANCE:
        return Outcome(False, error, f"the lever is {degrees(error):.1f} degrees from its goal")
    if error > 0.5 * situation.turn:
        return Outcome(
            False, error, f"the lever was turned less than half way, {degrees(error):.1f} degrees remain"
        )
    return Outcome(True, error)


def _mount_tool(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str) -> Tool:
    return mount_gripper(spec, hand, side, TOOL)


def handle_pose(angle: float) -> Pose:
    """Return the pose of the handle at an angle of the lever [rad]: x outward, z into the valve."""
    position = CENTRE + LEVER * np.array([np.cos(angle), 0.0, -np.sin(angle)])
    return Pose(
        position,
        multiply(
            axis_angle_quaternion((0.0, 1.0, 0.0), angle), axis_angle_quaternion((1.0, 0.0, 0.0), pi / 2)
        ),
    )


def _sample_situation(rng: np.random.Generator) -> RecordedValve:
    start_pose = Pose(np.array([0.43, -0.73, 0.16]), handle_pose(2 * pi / 3).quaternion)
    return RecordedValve(handle_pose(rng.uniform(0.35, pi)), handle_pose(0.0), start_pose)


def _demonstration_script(situation: RecordedValve) -> tuple[Subtask, ...]:
    del situation
    near, exact = (0.012, radians(5.0)), (0.005, radians(2.5))  # m, rad

    def retreat(distance: float) -> Pose:
        return Pose(np.array([0.0, 0.0, -distance]), np.array([1.0, 0.0, 0.0, 0.0]))

    return (
        Subtask("line up", lambda f: f[BEFORE] @ retreat(0.12), *near),
        Subtask("reach", lambda f: f[BEFORE], *exact, grip=1.0, dwell=0.6),
        Subtask("turn", lambda f: f[AFTER], *exact, dwell=0.5),
        Subtask("leave", lambda f: f[AFTER] @ retreat(0.15), *near),
    )


RECORDED_VALVE: Task[RecordedValve] = Task(
    name="recorded valve",
    description="turn the lever of the recorded valve as the person did",
    frames=(BEFORE, AFTER),
    has_gripper=True,
    unit="rad",
    time_limit=30.0,
    mount_tool=_mount_tool,
    sample_situation=_sample_situation,
    add_objects=_add_objects,
    start_pose=lambda situation: situation.start_pose,
    observe_frames=lambda model, data, situation: {BEFORE: situation.before, AFTER: situation.after},
    check_success=_check_success,
    demonstration_script=_demonstration_script,
    view=CameraView((0.55, -0.95, 0.2), 1.15, 28.0, -14.0),
)
