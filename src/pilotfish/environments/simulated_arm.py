"""Sensors and motors of one simulated arm."""

import mujoco
import numpy as np

from pilotfish.geometry import Pose
from pilotfish.kernels import ArmState
from pilotfish.types import Array, Float


class SimulatedArm:
    """Joints of one arm in a running simulation; the arrays are views of the simulation's memory.

    Attributes:
        q: Joint positions [rad].
        velocity: Joint velocities [rad/s].
        motors: Commanded torques [N m], to be written.
        external_torques: Torques that others apply to the joints [N m], to be written.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, joints: tuple[str, ...], point: str
    ) -> None:
        """Find the joints of an arm in a compiled model.

        Args:
            model: Compiled model.
            data: State of the model.
            joints: Names of the joints and of their motors, in series and adjacent in the model.
            point: Name of the site at the tool point.
        """
        first, n = model.joint(joints[0]), len(joints)
        q, v = int(first.qposadr[0]), int(first.dofadr[0])
        motor = int(model.actuator(joints[0]).id)
        self._model, self._data = model, data
        self._site = int(model.site(point).id)
        self._dofs = slice(v, v + n)
        self.q: Float[Array, " n"] = data.qpos[q : q + n]
        self.velocity: Float[Array, " n"] = data.qvel[self._dofs]
        self.motors: Float[Array, " n"] = data.ctrl[motor : motor + n]
        self.external_torques: Float[Array, " n"] = data.qfrc_applied[self._dofs]
        self._inertial = data.qfrc_bias[self._dofs]
        self._spring = data.qfrc_spring[self._dofs]
        self._position = data.site_xpos[self._site]
        self._quaternion = data.xquat[int(model.site_bodyid[self._site])]
        self._jacobian = np.zeros((2, 3, model.nv))

    @property
    def tool(self) -> Pose:
        """Return the pose of the tool point in torso axes."""
        return Pose(self._position.copy(), self._quaternion.copy())

    @property
    def twist(self) -> Float[Array, " 6"]:
        """Return linear [m/s] and angular velocity [rad/s] of the tool point in torso axes."""
        return np.asarray(self.jacobian() @ self.velocity)

    @property
    def bias(self) -> Float[Array, " n"]:
        """Return gravity and Coriolis torques minus the torques of the arm's springs [N m]."""
        return np.asarray(self._inertial - self._spring)

    def jacobian(self) -> Float[Array, "6 n"]:
        """Return the Jacobian of the tool point, linear rows first."""
        linear, angular = self._jacobian
        mujoco.mj_jacSite(self._model, self._data, linear, angular, self._site)
        return self._jacobian.reshape(6, -1)[:, self._dofs].copy()

    def read_state(self) -> ArmState:
        """Return joints, tool pose, Jacobian and bias at the positions that MuJoCo computed last."""
        return ArmState(self.q, self.velocity, self._position, self._quaternion, self.jacobian(), self.bias)
