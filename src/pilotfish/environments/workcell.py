"""The robot at work: the physics of one task in one situation, and its arm under control at 1 kHz."""

from collections.abc import Sequence
from typing import Generic, TypeVar

import mujoco
import numpy as np

from pilotfish.control import ToolTarget, impedance, impedance_torque, posture_torque
from pilotfish.environments.arms import JOINTS, SimulatedArm
from pilotfish.environments.baxter import (
    Surface,
    Tool,
    add_arm,
    baxter_limits,
    dress,
    empty_world,
    mirrored,
    mount_handle,
    posture_for,
)
from pilotfish.environments.contacts import contact_forces, larger
from pilotfish.environments.steering import Clutch, hand_wrench, straight
from pilotfish.environments.tasks.task import Scene, Task, Verdict
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, float_array, require_count, require_number

S = TypeVar("S")
TICK = 0.001  # s, of physics and of control
MOST_TICKS = 10**6  # of one call: quarter of an hour
LED_DAMPING = 0.5  # N m s/rad, of the joints of an arm that a person leads
# Position mode, N m/rad and N m s/rad: about 4 Hz, well damped.
HOLDING = np.array([400.0, 400.0, 200.0, 200.0, 60.0, 60.0, 40.0])
HOLDING_DAMPING = np.array([40.0, 40.0, 20.0, 20.0, 4.0, 4.0, 2.0])
RESTING = (-0.6, -0.9, -0.9, 2.1, 0.6, 0.6, 0.0)  # rad, of a left arm that nobody needs: out of the way


class Workcell(Generic[S]):
    """The physics of a task in a situation, from the moment when the arm waits at its home.

    With lead, the robot's left arm is free to be led by a person, and the right one follows it: see led. The
    robot wears surfaces, if any, in pictures: they weigh nothing and touch nothing.
    Raises: InvalidInput, when the arm does not reach its home.
    """

    def __init__(
        self, task: Task[S], situation: S, *, lead: bool = False, surfaces: Sequence[Surface] = ()
    ) -> None:
        require_kind("task", task, Task, "TASKS holds them by name")
        require_kind("surfaces", surfaces, Sequence, "give a list of them")
        self.task, self.situation, self.limits = task, situation, baxter_limits()
        self.model, self.fitted = _built(task, situation, lead, surfaces)
        self.data = mujoco.MjData(self.model)
        self.arm = SimulatedArm(self.model, self.data, "right", self.fitted.point)
        posture = posture_for(task.home(situation), self.fitted.length)
        self.impedance = impedance(posture)
        self.arm.q[:] = posture
        self.input = SimulatedArm(self.model, self.data, "left", "left_tool") if lead else None
        if self.input:
            self.input.q[:] = mirrored(posture)
        self._settle()

    def _settle(self) -> None:
        self._stir()
        mujoco.mj_forward(self.model, self.data)
        self.target, self.grip = self.arm.tool, 0.0
        self._grasp(self.grip)
        if self.input:
            self._clutch = Clutch(self.input.tool, self.target)
            self._hand = self.input.tool
        self.forces = contact_forces(self.model, self.data, self.task.fragile)
        self.peaks = self.forces

    @property
    def time(self) -> float:
        """Seconds since the beginning."""
        return float(self.data.time)

    def frames(self) -> dict[str, Pose]:
        """Where the objects stand now."""
        return self.task.see(self.model, self.data, self.situation)

    def verdict(self) -> Verdict:
        """Whether the work is done."""
        scene = Scene(self.model, self.data, self.arm.tool, self.grip, self.peaks)
        return self.task.judge(scene, self.situation)

    def follow(self, target: Pose, grip: float, ticks: int) -> None:
        """So many ticks later: the arm was drawn towards a target that moved evenly to this one."""
        path = straight(self.target, _checked(target), _ticks(ticks), TICK)
        self._grasp(grip)
        for n in range(ticks):
            self._tick(self._drawn(path.at(n)))
        self.target = target

    def hold(self, posture: Float[Array, " 7"], grip: float, ticks: int) -> None:
        """So many ticks later: position mode, the joints were drawn to a posture [rad]."""
        posture = finite_array(posture, "posture", (JOINTS,))
        self._grasp(grip)
        for _ in range(_ticks(ticks)):
            effort = posture_torque(HOLDING, HOLDING_DAMPING, self.limits, self.arm.reading(), posture)
            self._tick(effort.torque)
        self.target = self.arm.tool

    def led(self, wish: Pose, grip: float, ticks: int) -> None:
        """So many ticks later: a person moved their hand so that the arm would be led to the wish.

        The hand pulls the input arm by a spring; where that arm's tool goes, the other's follows.
        """
        if self.input is None:
            raise InvalidInput("the cell has no arm to lead; make it with lead=True")
        hand = self._clutch.lead(_checked(wish))
        path = straight(self._hand, hand, _ticks(ticks), TICK)
        self._grasp(grip)
        for n in range(ticks):
            self._pull(path.at(n))
            self.target = self._clutch.follow(self.input.tool)
            wanted = ToolTarget(self.target.position, self.target.quaternion, self.input.twist)
            self._tick(self._drawn(wanted))
        self._hand = hand

    def _pull(self, wanted: ToolTarget) -> None:
        assert self.input
        J = self.input.jacobian()
        hand = Pose(wanted.position, wanted.quaternion)
        self.input.push[:] = J.T @ hand_wrench(hand, self.input.tool, J @ self.input.velocity)
        self.input.motors[:] = self.input.bias - LED_DAMPING * self.input.velocity

    def _drawn(self, wanted: ToolTarget) -> Float[Array, " 7"]:
        return impedance_torque(self.impedance, self.limits, self.arm.reading(), wanted).torque

    def _tick(self, torque: Float[Array, " 7"]) -> None:
        self._stir()
        self.arm.motors[:] = torque
        mujoco.mj_step2(self.model, self.data)
        self._feel()  # before contacts are found anew, which have no forces yet
        mujoco.mj_step1(self.model, self.data)  # positions and all that hangs on them are those of now

    def _stir(self) -> None:
        if self.task.stir:
            self.task.stir(self.model, self.data, self.situation, self.time)

    def _grasp(self, grip: float) -> None:
        self.grip = require_number(grip, "grip")
        if self.fitted.motor:
            share = min(max(grip, 0.0), 1.0)
            command = self.fitted.open + share * (self.fitted.shut - self.fitted.open)
            self.data.ctrl[self.model.actuator(self.fitted.motor).id] = command

    def _feel(self) -> None:
        self.forces = contact_forces(self.model, self.data, self.task.fragile)
        self.peaks = larger(self.peaks, self.forces)


def _built(
    task: Task[S], situation: S, lead: bool, surfaces: Sequence[Surface]
) -> tuple[mujoco.MjModel, Tool]:
    spec = empty_world(TICK)
    tool = task.mount(spec, add_arm(spec, "right"), "right")
    if lead:
        mount_handle(spec, add_arm(spec, "left"), "left")
    else:
        add_arm(spec, "left", posture=RESTING)
    if surfaces:
        dress(spec, surfaces)
    task.furnish(spec, situation)
    try:
        return spec.compile(), tool
    except ValueError as error:
        raise InvalidInput(f"{situation} cannot be set up: {error}; draw one: task.draw(rng)") from error


def _checked(target: Pose) -> Pose:
    require_kind("the pose asked for", target, Pose, "geometry.pose(position, quaternion) makes one")
    float_array(target.position, "the position asked for", 3)
    float_array(target.quaternion, "the quaternion asked for", 4)
    return target


def _ticks(ticks: int) -> int:
    return require_count(ticks, "ticks", MOST_TICKS, lowest=1)
