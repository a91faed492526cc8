"""The robot at work: the physics of one task in one situation, and its arm under control at 1 kHz."""

from collections.abc import Sequence
from typing import Generic, TypeVar

import mujoco
import numpy as np

from pilotfish.control import impedance, impedance_torque, posture_torque
from pilotfish.environments.arms import JOINTS, SimulatedArm
from pilotfish.environments.baxter import (
    Tool,
    VisualMesh,
    add_arm,
    add_visual_meshes,
    baxter_limits,
    empty_world,
    mirror_posture,
    mount_handle,
    solve_posture,
)
from pilotfish.environments.contacts import contact_forces, elementwise_max
from pilotfish.environments.steering import RelativeMapping, guidance_wrench, linear_path
from pilotfish.environments.tasks.task import Outcome, Scene, Task
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.kernels import ToolTarget
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, float_array, require_count, require_number, require_type

S = TypeVar("S")
TIMESTEP = 0.001  # s, of physics and of control
MAX_STEPS = 10**6  # of one call: quarter of an hour
GUIDANCE_DAMPING = 0.5  # N m s/rad, of the joints of an arm that a person leads
# Position mode, N m/rad and N m s/rad: about 4 Hz, well damped.
POSITION_STIFFNESS = np.array([400.0, 400.0, 200.0, 200.0, 60.0, 60.0, 40.0])
POSITION_DAMPING = np.array([40.0, 40.0, 20.0, 20.0, 4.0, 4.0, 2.0])
IDLE_POSTURE = (-0.6, -0.9, -0.9, 2.1, 0.6, 0.6, 0.0)  # rad, of a left arm that nobody needs: out of the way


class Workcell(Generic[S]):
    """The physics of a task in a situation, from the moment when the arm waits at its home.

    With lead, the robot's left arm is free to be led by a person, and the right one follows it: see led. The
    robot wears surfaces, if any, in pictures: they weigh nothing and touch nothing.
    Raises: InvalidInput, when the arm does not reach its home.
    """

    def __init__(
        self, task: Task[S], situation: S, *, lead: bool = False, visual_meshes: Sequence[VisualMesh] = ()
    ) -> None:
        require_type(task, "task", Task, "TASKS holds them by name")
        require_type(visual_meshes, "visual_meshes", Sequence, "give a list of them")
        self.task, self.situation, self.limits = task, situation, baxter_limits()
        self.model, self.mounted_tool = _compile_model(task, situation, lead, visual_meshes)
        self.data = mujoco.MjData(self.model)
        self.arm = SimulatedArm(self.model, self.data, "right", self.mounted_tool.point)
        posture = solve_posture(task.start_pose(situation), self.mounted_tool.length)
        self.impedance = impedance(posture)
        self.arm.q[:] = posture
        self.leader_arm = SimulatedArm(self.model, self.data, "left", "left_tool") if lead else None
        if self.leader_arm:
            self.leader_arm.q[:] = mirror_posture(posture)
        self._initialise()

    def _initialise(self) -> None:
        self._actuate_scene()
        mujoco.mj_forward(self.model, self.data)
        self.target, self.grip = self.arm.tool, 0.0
        self._command_grip(self.grip)
        if self.leader_arm:
            self._mapping = RelativeMapping(self.leader_arm.tool, self.target)
            self._hand = self.leader_arm.tool
        self.forces = contact_forces(self.model, self.data, self.task.contact_limits)
        self.peak_forces = self.forces

    @property
    def time(self) -> float:
        """Seconds since the beginning."""
        return float(self.data.time)

    def frames(self) -> dict[str, Pose]:
        """Where the objects stand now."""
        return self.task.observe_frames(self.model, self.data, self.situation)

    def outcome(self) -> Outcome:
        """Whether the work is done."""
        scene = Scene(self.model, self.data, self.arm.tool, self.grip, self.peak_forces)
        return self.task.check_success(scene, self.situation)

    def step_impedance(self, target: Pose, grip: float, n_steps: int) -> None:
        """So many ticks later: the arm was drawn towards a target that moved evenly to this one."""
        path = linear_path(self.target, _validate_target(target), _validate_n_steps(n_steps), TIMESTEP)
        self._command_grip(grip)
        for n in range(n_steps):
            self._step(self._impedance_torque(path.at(n)))
        self.target = target

    def step_position(self, posture: Float[Array, " 7"], grip: float, n_steps: int) -> None:
        """So many ticks later: position mode, the joints were drawn to a posture [rad]."""
        posture = finite_array(posture, "posture", (JOINTS,))
        self._command_grip(grip)
        for _ in range(_validate_n_steps(n_steps)):
            arm_command = posture_torque(
                POSITION_STIFFNESS, POSITION_DAMPING, self.limits, self.arm.reading(), posture
            )
            self._step(arm_command.torque)
        self.target = self.arm.tool

    def step_guidance(self, target: Pose, grip: float, n_steps: int) -> None:
        """So many ticks later: a person moved their hand so that the arm would be led to the wish.

        The hand pulls the input arm by a spring; where that arm's tool goes, the other's follows.
        """
        if self.leader_arm is None:
            raise InvalidInput("the cell has no arm to lead; make it with lead=True")
        hand = self._mapping.leader_pose(_validate_target(target))
        path = linear_path(self._hand, hand, _validate_n_steps(n_steps), TIMESTEP)
        self._command_grip(grip)
        for n in range(n_steps):
            self._apply_guidance(path.at(n))
            self.target = self._mapping.follower_pose(self.leader_arm.tool)
            tool_target = ToolTarget(self.target.position, self.target.quaternion, self.leader_arm.twist)
            self._step(self._impedance_torque(tool_target))
        self._hand = hand

    def _apply_guidance(self, tool_target: ToolTarget) -> None:
        assert self.leader_arm
        J = self.leader_arm.jacobian()
        hand = Pose(tool_target.position, tool_target.quaternion)
        self.leader_arm.external_torques[:] = J.T @ guidance_wrench(
            hand, self.leader_arm.tool, J @ self.leader_arm.velocity
        )
        self.leader_arm.motors[:] = self.leader_arm.bias - GUIDANCE_DAMPING * self.leader_arm.velocity

    def _impedance_torque(self, tool_target: ToolTarget) -> Float[Array, " 7"]:
        return impedance_torque(self.impedance, self.limits, self.arm.reading(), tool_target).torque

    def _step(self, torque: Float[Array, " 7"]) -> None:
        self._actuate_scene()
        self.arm.motors[:] = torque
        mujoco.mj_step2(self.model, self.data)
        self._measure_forces()  # before contacts are found anew, which have no forces yet
        mujoco.mj_step1(self.model, self.data)  # positions and all that hangs on them are those of now

    def _actuate_scene(self) -> None:
        if self.task.actuate_scene:
            self.task.actuate_scene(self.model, self.data, self.situation, self.time)

    def _command_grip(self, grip: float) -> None:
        self.grip = require_number(grip, "grip")
        if self.mounted_tool.motor:
            share = min(max(grip, 0.0), 1.0)
            command = self.mounted_tool.open + share * (self.mounted_tool.shut - self.mounted_tool.open)
            self.data.ctrl[self.model.actuator(self.mounted_tool.motor).id] = command

    def _measure_forces(self) -> None:
        self.forces = contact_forces(self.model, self.data, self.task.contact_limits)
        self.peak_forces = elementwise_max(self.peak_forces, self.forces)


def _compile_model(
    task: Task[S], situation: S, lead: bool, visual_meshes: Sequence[VisualMesh]
) -> tuple[mujoco.MjModel, Tool]:
    spec = empty_world(TIMESTEP)
    tool = task.mount_tool(spec, add_arm(spec, "right"), "right")
    if lead:
        mount_handle(spec, add_arm(spec, "left"), "left")
    else:
        add_arm(spec, "left", posture=IDLE_POSTURE)
    if visual_meshes:
        add_visual_meshes(spec, visual_meshes)
    task.add_objects(spec, situation)
    try:
        return spec.compile(), tool
    except ValueError as error:
        raise InvalidInput(
            f"{situation} cannot be set up: {error}; draw one: task.sample_situation(rng)"
        ) from error


def _validate_target(target: Pose) -> Pose:
    require_type(target, "the pose asked for", Pose, "geometry.pose(position, quaternion) makes one")
    float_array(target.position, "the position asked for", 3)
    float_array(target.quaternion, "the quaternion asked for", 4)
    return target


def _validate_n_steps(n_steps: int) -> int:
    return require_count(n_steps, "n_steps", MAX_STEPS, minimum=1)
