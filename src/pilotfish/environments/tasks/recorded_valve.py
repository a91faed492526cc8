"""The valve of the thesis' own recording, in physics: a lever on an axle, at the robot's right side.

Its axle and the length of its lever are those of the circle on which the sixteen frames of the recording
lie, to 12 mm; friction, masses and the shape of the lever are chosen. So a skill that was learned from a
person who opened the real one can be carried out: a RecordedValve is made of the frames of a showing.
"""

from dataclasses import dataclass
from math import atan2, degrees, pi, radians

import mujoco
import numpy as np

from pilotfish.environments.baxter import FLOOR, Tool, mount_gripper
from pilotfish.environments.human import Subtask
from pilotfish.environments.tasks.furniture import (
    BOX,
    CYLINDER,
    GREEN,
    STEEL,
    YELLOW,
    add_solid,
    axis_angle_quaternion,
)
from pilotfish.environments.tasks.situation_checks import validate_object_pose
from pilotfish.environments.tasks.task import Outcome, Scene, Task
from pilotfish.geometry import Pose, multiply

BEFORE, AFTER = "valve before", "valve after"
CENTRE, LEVER = np.array([0.591, -1.086, 0.256]), 0.177  # m, fitted to the frames
TOLERANCE = radians(10.0)
STICTION, DRAG = 0.5, 0.5  # N m; N m s/rad
END = 0.22  # m, where the lever ends
TOOL = 0.204  # m from the hand to the tool point of the recording


@dataclass(frozen=True, slots=True, eq=False)
class RecordedValve:
    """Where the handle stood before and after it was turned, as recorded; home is where the hand began."""

    before: Pose
    after: Pose
    start_pose: Pose

    def __post_init__(self) -> None:
        for name in ("before", "after", "start_pose"):
            validate_object_pose(getattr(self, name), f"the pose {name!r}", FLOOR)

    @property
    def begin(self) -> float:
        return lever_angle(self.before)

    @property
    def end(self) -> float:
        return lever_angle(self.after)

    @property
    def turn(self) -> float:
        """How far the lever is to be turned [rad], the shorter way round."""
        return _apart(self.begin, self.end)


def lever_angle(handle: Pose) -> float:
    """How far the lever is turned about its axle [rad], zero ahead and positive downward."""
    away = handle.position - CENTRE
    return atan2(-away[2], away[0])


def _apart(a: float, b: float) -> float:
    """The angle [rad] between two, at most half a turn."""
    return abs(float(np.angle(np.exp(1j * (a - b)))))


def _add_objects(spec: mujoco.MjSpec, situation: RecordedValve) -> None:
    """The valve, its lever where the showing began, and a mark where it ended."""
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
    place = 0.145 * np.array([np.cos(situation.end), 0.0, -np.sin(situation.end)]) + np.array(
        [0.0, -0.079, 0.0]
    )
    mark = add_solid(stand, "mark", BOX, (0.012, 0.002, 0.012), tuple(place), GREEN)
    mark.contype = mark.conaffinity = 0
    lever = spec.worldbody.add_body(
        name="lever", pos=CENTRE, quat=axis_angle_quaternion((0.0, 1.0, 0.0), situation.begin)
    )
    hinge = lever.add_joint(name="valve", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    hinge.ref, hinge.frictionloss, hinge.armature = situation.begin, STICTION, 0.01
    hinge.damping[0] = DRAG
    axle = add_solid(lever, "axle", CYLINDER, (0.015, 0.04, 0.0), (0.0, -0.04, 0.0), STEEL)
    axle.quat, axle.mass = axis_angle_quaternion((1.0, 0.0, 0.0), pi / 2), 0.3
    bar = add_solid(lever, "handle", BOX, (END / 2, 0.012, 0.012), (END / 2, 0.0, 0.0), YELLOW)
    bar.mass, bar.friction = 0.3, (1.0, 0.01, 0.001)
    balance = add_solid(lever, "balance", BOX, (0.04, 0.012, 0.03), (-0.0825, 0.0, 0.0), YELLOW)
    balance.mass = 0.4  # the lever stays where it is left


def _check_success(scene: Scene, situation: RecordedValve) -> Outcome:
    """Done when the lever is within ten degrees of where the person left it, and nearer to that than to where
    it began; the error is an angle [rad].
    """
    error = _apart(float(scene.data.qpos[scene.model.joint("valve").qposadr[0]]), situation.end)
    if error > TOLERANCE:
        return Outcome(False, error, f"the lever stands {degrees(error):.1f} degrees from where it was to be")
    if error > 0.5 * situation.turn:
        return Outcome(
            False, error, f"the lever has hardly been turned, {degrees(error):.1f} degrees are left"
        )
    return Outcome(True, error)


def _mount_tool(spec: mujoco.MjSpec, hand: mujoco.MjsBody, side: str) -> Tool:
    return mount_gripper(spec, hand, side, TOOL)


def handle_pose(angle: float) -> Pose:
    """Where the handle is when the lever is turned to an angle [rad]: x outward, z into the valve."""
    place = CENTRE + LEVER * np.array([np.cos(angle), 0.0, -np.sin(angle)])
    return Pose(
        place,
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

    def back(distance: float) -> Pose:
        return Pose(np.array([0.0, 0.0, -distance]), np.array([1.0, 0.0, 0.0, 0.0]))

    return (
        Subtask("line up", lambda seen: seen[BEFORE] @ back(0.12), *near),
        Subtask("reach", lambda seen: seen[BEFORE], *exact, grip=1.0, dwell=0.6),
        Subtask("turn", lambda seen: seen[AFTER], *exact, dwell=0.5),
        Subtask("leave", lambda seen: seen[AFTER] @ back(0.15), *near),
    )


RECORDED_VALVE: Task[RecordedValve] = Task(
    name="recorded valve",
    description="turn the lever of the recorded valve as a person did",
    frames=(BEFORE, AFTER),
    has_gripper=True,
    unit="rad",
    time_limit=30.0,
    contact_limits=(),
    mount_tool=_mount_tool,
    sample_situation=_sample_situation,
    add_objects=_add_objects,
    start_pose=lambda situation: situation.start_pose,
    observe_frames=lambda model, data, situation: {BEFORE: situation.before, AFTER: situation.after},
    check_success=_check_success,
    demonstration_script=_demonstration_script,
)
