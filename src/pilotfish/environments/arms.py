"""One simulated arm: what its sensors read, and its motors."""

import mujoco
import numpy as np

from pilotfish.environments.baxter import arm_names
from pilotfish.geometry import Pose
from pilotfish.kernels import ArmState
from pilotfish.types import Array, Float

JOINTS = 7


class SimulatedArm:
    """The joints of one arm in a running simulation; readings are views of what it holds now."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, side: str, point: str) -> None:
        names = arm_names(side)
        first = model.joint(names.joints[0])
        q, v = int(first.qposadr[0]), int(first.dofadr[0])
        motor = int(model.actuator(names.joints[0]).id)
        self._model, self._data = model, data
        self._site = int(model.site(point).id)
        self._dofs = slice(v, v + JOINTS)
        self.q: Float[Array, " n"] = data.qpos[q : q + JOINTS]
        self.velocity: Float[Array, " n"] = data.qvel[self._dofs]
        self.motors: Float[Array, " n"] = data.ctrl[motor : motor + JOINTS]
        self.external_torques: Float[Array, " n"] = data.qfrc_applied[self._dofs]
        self._inertial = data.qfrc_bias[self._dofs]
        self._spring = data.qfrc_spring[self._dofs]
        self._position = data.site_xpos[self._site]
        self._quaternion = data.xquat[int(model.site_bodyid[self._site])]
        self._jacobian = np.zeros((2, 3, model.nv))

    @property
    def tool(self) -> Pose:
        """Where the tool point is, in the axes of the torso."""
        return Pose(self._position.copy(), self._quaternion.copy())

    @property
    def twist(self) -> Float[Array, " 6"]:
        """The velocity of the tool point [m/s] and of its turning [rad/s], in the axes of the torso."""
        return np.asarray(self.jacobian() @ self.velocity)

    @property
    def bias(self) -> Float[Array, " n"]:
        """What it takes to carry the arm [N m]: against gravity and motion, less what its springs carry."""
        return np.asarray(self._inertial - self._spring)

    def jacobian(self) -> Float[Array, "6 n"]:
        """What each joint's speed adds to the twist."""
        linear, angular = self._jacobian
        mujoco.mj_jacSite(self._model, self._data, linear, angular, self._site)
        return self._jacobian.reshape(6, -1)[:, self._dofs].copy()

    def reading(self) -> ArmState:
        """Joints, tool point, Jacobian and what it takes to carry the arm, of the last positions computed."""
        return ArmState(self.q, self.velocity, self._position, self._quaternion, self.jacobian(), self.bias)
