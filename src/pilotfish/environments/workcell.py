"""Physics of one task in one situation, with the arm under torque control at 1 kHz.

A step of `Workcell` simulates a number of timesteps under one of three controllers. Impedance control draws
the tool to a target by springs and dampers. Position control draws the joints to a posture. In guidance a
person's hand pulls the robot's leader arm by its handle, and the arm with the tool repeats the motion by
impedance control. Baxter has such a second arm. Without one, the hand of the person is the leader: its own
motion, without an arm in between, is the target of impedance control. The person then feels no inertia.

Each timestep runs mj_step2 (forces, integration), then mj_step1 (positions and what depends on them). So a
controller always reads the positions of now, and contact forces are read between the two calls: after the
first they belong to the timestep, after the second the new contacts have no forces yet.
"""

from collections.abc import Sequence
from typing import Generic, TypeVar

import mujoco

from pilotfish.control import impedance_torque, posture_torque
from pilotfish.environments.baxter.tools import Tool, mount_handle
from pilotfish.environments.baxter.visual_meshes import VisualMesh, add_visual_meshes
from pilotfish.environments.contacts import contact_forces
from pilotfish.environments.guidance import follow_relative_motion, guidance_wrench, linear_path
from pilotfish.environments.robots.baxter import BAXTER
from pilotfish.environments.robots.robot import Robot, solve_posture
from pilotfish.environments.simulated_arm import SimulatedArm
from pilotfish.environments.tasks.progress import Measurements
from pilotfish.environments.tasks.task import Task
from pilotfish.environments.tasks.task_state import Outcome, Scene
from pilotfish.environments.world import empty_scene
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.kernels import ToolTarget
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, float_array, require_count, require_number, require_type

S = TypeVar("S")
MAX_STEPS = 10**6  # of one call: a quarter of an hour
GUIDANCE_DAMPING = 0.5  # N m s/rad, of the joints of a guided arm


class Workcell(Generic[S]):
    """Simulation of a task in a situation; it starts with the arm at rest at the task's start pose.

    Attributes:
        timestep: Period of physics and control [s].
        task: Task that is simulated.
        situation: Situation of the task.
        model: Compiled MuJoCo model.
        data: State of the model.
        robot: Robot that performs the task.
        arm: Arm that holds the tool.
        leader_arm: Second arm that a person guides; None without one.
        target: Last commanded tool pose.
        grip: Last commanded grip, 0 (open) to 1 (closed).
        forces: Contact forces of the last timestep [N]: "tool" and each fragile geom.
        peak_forces: Largest of these forces since the start [N].
    """

    timestep = 0.001

    def __init__(
        self,
        task: Task[S],
        situation: S,
        *,
        robot: Robot = BAXTER,
        guided: bool = False,
        visual_meshes: Sequence[VisualMesh] = (),
    ) -> None:
        """Build and compile the model, and place the arm at the start pose.

        Args:
            task: Task from `TASKS`.
            situation: Situation from `task.sample_situation(rng)`.
            robot: Robot from `ROBOTS`, or from `robot_from_file`.
            guided: Let a person guide the robot, for `step_guidance`; a second arm gets a handle.
            visual_meshes: Meshes that images show in place of the robot's simple shapes. They have no mass
                and no contacts.

        Raises:
            InvalidInput: If the arm cannot reach the start pose, or the situation cannot be compiled.
        """
        require_type(task, "task", Task, "take one from TASKS")
        require_type(visual_meshes, "visual_meshes", Sequence, "give a list of them")
        require_type(robot, "robot", Robot, "take one from ROBOTS")
        _validate_meshes(robot, visual_meshes)
        self.task, self.situation, self.robot, self.limits = task, situation, robot, robot.limits
        self.model, self.mounted_tool = _compile_model(task, situation, robot, guided, visual_meshes)
        self.data = mujoco.MjData(self.model)
        self.arm = SimulatedArm(self.model, self.data, robot.joints, self.mounted_tool.point)
        posture = solve_posture(robot, task.start_pose(situation), self.mounted_tool.length)
        self.impedance = robot.impedance(posture)
        self.arm.q[:] = posture
        self._is_guided, self.leader_arm = guided, None
        if guided and robot.leader:
            self.leader_arm = SimulatedArm(self.model, self.data, robot.leader.joints, "left_tool")
            self.leader_arm.q[:] = robot.leader.mirror(posture)
        self._initialise()

    def _initialise(self) -> None:
        self._actuate_scene()
        mujoco.mj_forward(self.model, self.data)
        self.target, self.grip = self.arm.tool, 0.0
        self._command_grip(self.grip)
        leader = self.leader_arm.tool if self.leader_arm else self.target
        self._leader_start, self._follower_start, self._hand = leader, self.target, leader
        self.forces = contact_forces(self.model, self.data, self.task.fragile_geoms)
        self.peak_forces = self.forces

    @property
    def time(self) -> float:
        """Return the simulated time since the start [s]."""
        return float(self.data.time)

    def frames(self) -> dict[str, Pose]:
        """Return the present pose of each frame of the task, in torso axes."""
        return self.task.observe_frames(self.model, self.data, self.situation)

    def outcome(self) -> Outcome:
        """Return whether the task is done now."""
        return self.task.check_success(self._scene(), self.situation)

    def measure_progress(self) -> Measurements:
        """Return the quantities that explain a failure of the task, now; empty if it has none."""
        progress = self.task.progress
        return progress.measure(self._scene(), self.situation) if progress else {}

    def _scene(self) -> Scene:
        return Scene(self.model, self.data, self.arm.tool, self.grip, self.peak_forces)

    def step_impedance(self, target: Pose, grip: float, n_steps: int) -> None:
        """Simulate impedance control to a target that moves at constant speed from the last one.

        Args:
            target: Tool pose at the end of the steps, in torso axes.
            grip: 0 (open) to 1 (closed); values outside are clipped.
            n_steps: Number of timesteps of 1 ms.

        Raises:
            InvalidInput: If an argument cannot be used.
        """
        path = linear_path(self.target, _validate_target(target), _validate_n_steps(n_steps), self.timestep)
        self._command_grip(grip)
        for tool_target in path:
            self._step(self._impedance_torque(tool_target))
        self.target = target

    def step_position(self, posture: Float[Array, " n"], grip: float, n_steps: int) -> None:
        """Simulate position control to a posture.

        Args:
            posture: Joint positions [rad].
            grip: 0 (open) to 1 (closed); values outside are clipped.
            n_steps: Number of timesteps of 1 ms.

        Raises:
            InvalidInput: If an argument cannot be used.
        """
        posture = finite_array(posture, "posture", (len(self.robot.joint_names),))
        stiffness, damping = self.robot.position_stiffness, self.robot.position_damping
        self._command_grip(grip)
        for _ in range(_validate_n_steps(n_steps)):
            arm_command = posture_torque(stiffness, damping, self.limits, self.arm.read_state(), posture)
            self._step(arm_command.torque)
        self.target = self.arm.tool

    def step_guidance(self, target: Pose, grip: float, n_steps: int) -> None:
        """Simulate a hand that guides the robot so that its tool should reach a target.

        The hand pulls the leader arm by a spring, and the arm with the tool follows the motion of the
        leader's. Without a leader arm, the tool is drawn to the hand itself.

        Args:
            target: Pose that the person intends for the tool, in torso axes.
            grip: 0 (open) to 1 (closed); values outside are clipped.
            n_steps: Number of timesteps of 1 ms.

        Raises:
            InvalidInput: If the workcell is not guided, or an argument cannot be used.
        """
        path = self._guidance_path(target, n_steps)
        leader = self.leader_arm
        if leader is None:
            self.step_impedance(target, grip, n_steps)
            return
        self._command_grip(grip)
        for hand_target in path:
            self._apply_guidance(leader, hand_target)
            self.target = self.guided_tool
            tool_target = ToolTarget(self.target.position, self.target.quaternion, leader.twist)
            self._step(self._impedance_torque(tool_target))

    def step_teleoperation(self, hand: Pose, target: Pose, grip: float, n_steps: int) -> None:
        """Simulate a hand that guides the leader arm, while the arm with the tool follows another target.

        Args:
            hand: Pose that the person intends for the tool, in torso axes; see `guided_tool`.
            target: Pose of the tool at the end of the steps.
            grip: 0 (open) to 1 (closed); values outside are clipped.
            n_steps: Number of timesteps of 1 ms.

        Raises:
            InvalidInput: If the workcell is not guided, or an argument cannot be used.
        """
        n_steps = _validate_n_steps(n_steps)
        target_path = linear_path(self.target, _validate_target(target), n_steps, self.timestep)
        path = self._guidance_path(hand, n_steps)
        self._command_grip(grip)
        for hand_target, tool_target in zip(path, target_path, strict=True):
            if self.leader_arm:
                self._apply_guidance(self.leader_arm, hand_target)
            self._step(self._impedance_torque(tool_target))
        self.target = target

    @property
    def guided_tool(self) -> Pose:
        """Pose of the tool after the motion of the leader so far: of its arm, or of the hand without one.

        Raises:
            InvalidInput: If the workcell is not guided.
        """
        self._require_guided()
        if self.leader_arm is None:
            return self._hand
        return follow_relative_motion(self._leader_start, self.leader_arm.tool, self._follower_start)

    def _guidance_path(self, target: Pose, n_steps: int) -> list[ToolTarget]:
        """Return the path of the hand that guides the robot."""
        self._require_guided()
        hand = follow_relative_motion(self._follower_start, _validate_target(target), self._leader_start)
        path = linear_path(self._hand, hand, _validate_n_steps(n_steps), self.timestep)
        self._hand = hand
        return path

    def _require_guided(self) -> None:
        if not self._is_guided:
            raise InvalidInput("the workcell has no guided arm; create it with guided=True")

    def _apply_guidance(self, leader: SimulatedArm, hand: ToolTarget) -> None:
        J = leader.jacobian()
        wrench = guidance_wrench(Pose(hand.position, hand.quaternion), leader.tool, J @ leader.velocity)
        leader.external_torques[:] = J.T @ wrench
        leader.motors[:] = leader.bias - GUIDANCE_DAMPING * leader.velocity

    def _impedance_torque(self, tool_target: ToolTarget) -> Float[Array, " n"]:
        return impedance_torque(self.impedance, self.limits, self.arm.read_state(), tool_target).torque

    def _step(self, torque: Float[Array, " n"]) -> None:
        self._actuate_scene()
        self.arm.motors[:] = torque
        mujoco.mj_step2(self.model, self.data)
        self._measure_forces()
        mujoco.mj_step1(self.model, self.data)

    def _actuate_scene(self) -> None:
        if self.task.actuate_scene:
            self.task.actuate_scene(self.model, self.data, self.situation, self.time)

    def _command_grip(self, grip: float) -> None:
        self.grip = require_number(grip, "grip")
        tool = self.mounted_tool
        if tool.motor:
            share = min(max(grip, 0.0), 1.0)
            self.data.ctrl[self.model.actuator(tool.motor).id] = tool.open + share * (tool.shut - tool.open)

    def _measure_forces(self) -> None:
        self.forces = contact_forces(self.model, self.data, self.task.fragile_geoms)
        peaks = self.peak_forces
        self.peak_forces = {name: max(peaks[name], force) for name, force in self.forces.items()}


def _compile_model(
    task: Task[S], situation: S, robot: Robot, guided: bool, visual_meshes: Sequence[VisualMesh]
) -> tuple[mujoco.MjModel, Tool]:
    spec = empty_scene(robot.name, Workcell.timestep)
    robot.add_body(spec)
    tool = task.mount_tool(spec, robot.add_arm(spec), "right")
    if robot.leader and guided:
        mount_handle(spec, robot.leader.add_arm(spec), "left")
    elif robot.leader:
        robot.leader.add_idle_arm(spec)
    if visual_meshes:
        add_visual_meshes(spec, visual_meshes)
    task.add_objects(spec, situation)
    try:
        return spec.compile(), tool
    except ValueError as error:
        raise InvalidInput(
            f"{situation} cannot be compiled: {error}; sample one: task.sample_situation(rng)"
        ) from error


def _validate_meshes(robot: Robot, visual_meshes: Sequence[VisualMesh]) -> None:
    if visual_meshes and robot is not BAXTER:
        raise InvalidInput(f"visual_meshes are of Baxter, and the robot is {robot.name}; leave them out")


def _validate_target(target: Pose) -> Pose:
    require_type(target, "the target", Pose, "geometry.pose(position, quaternion) creates one")
    float_array(target.position, "the position of the target", 3)
    float_array(target.quaternion, "the quaternion of the target", 4)
    return target


def _validate_n_steps(n_steps: int) -> int:
    return require_count(n_steps, "n_steps", MAX_STEPS, minimum=1)
