"""Kinematics of an arm as a serial chain of revolute joints."""

from dataclasses import dataclass

import numpy as np

from pilotfish.geometry import Pose, quaternion_from_rotation_matrix, rotation_matrix
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class SerialChain:
    """A base, n revolute joints in series, and a tool.

    Attributes:
        world_from_base: Pose of the base.
        positions: Position of each joint at q = 0 in the frame of the previous joint, the first in the base
            [m].
        quaternions: Orientation of each joint at q = 0 in the frame of the previous joint.
        axes: Unit axis of each joint, in its own frame.
        last_from_tool: Pose of the tool in the frame of the last joint.
    """

    world_from_base: Pose
    positions: Float[Array, "n 3"]
    quaternions: Float[Array, "n 4"]
    axes: Float[Array, "n 3"]
    last_from_tool: Pose

    def forward_kinematics(self, q: Float[Array, " n"]) -> Pose:
        """Return world_from_tool.

        Args:
            q: Joint angles [rad].
        """
        _, _, position, R = joint_frames(self, q)
        return Pose(position, quaternion_from_rotation_matrix(R))

    def tool_poses(self, q: Float[Array, "*B n"]) -> Float[Array, "*B 7"]:
        """Return world_from_tool of each row as a recording has it: position [m], then quaternion w x y z.

        Args:
            q: Joint angles [rad].
        """
        _, _, position, R = joint_frames(self, q)
        return np.concatenate([position, quaternion_from_rotation_matrix(R)], axis=-1)

    def jacobian(self, q: Float[Array, " n"]) -> Float[Array, "6 n"]:
        """Return the Jacobian from joint velocities [rad/s] to the twist in world axes [m/s, rad/s].

        Args:
            q: Joint angles [rad].
        """
        joints, axes, position, _ = joint_frames(self, q)
        return jacobian_from_joints(joints, axes, position)


def joint_frames(
    chain: SerialChain, q: Float[Array, "*B n"]
) -> tuple[Float[Array, "*B n 3"], Float[Array, "*B n 3"], Float[Array, "*B 3"], Float[Array, "*B 3 3"]]:
    """Return positions and axes of the joints, and position and rotation matrix of the tool, in the world.

    Source:
        Siciliano et al. 2009, Robotics: Modelling, Planning and Control, sections 2.8 and 3.1.
    """
    before_from_after = rotation_matrix(chain.quaternions) @ _joint_rotations(chain.axes, q)
    R = np.broadcast_to(rotation_matrix(chain.world_from_base.quaternion), (*q.shape[:-1], 3, 3))
    origin = np.broadcast_to(chain.world_from_base.position, (*q.shape[:-1], 3))
    joints, axes = np.empty((*q.shape, 3)), np.empty((*q.shape, 3))
    for i in range(q.shape[-1]):
        origin = origin + R @ chain.positions[i]
        R = R @ before_from_after[..., i, :, :]
        joints[..., i, :], axes[..., i, :] = origin, R @ chain.axes[i]
    tool = chain.last_from_tool
    return joints, axes, origin + R @ tool.position, R @ rotation_matrix(tool.quaternion)


def jacobian_from_joints(
    joints: Float[Array, "n 3"], axes: Float[Array, "n 3"], position: Float[Array, " 3"]
) -> Float[Array, "6 n"]:
    """Return the Jacobian of the tool from `joint_frames`."""
    return np.concatenate([np.cross(axes, position - joints), axes], axis=-1).T


def _joint_rotations(axes: Float[Array, "n 3"], q: Float[Array, "*B n"]) -> Float[Array, "*B n 3 3"]:
    """Return the rotations by q about the axes (Rodrigues' formula)."""
    cosine, sine = np.cos(q)[..., None, None], np.sin(q)[..., None, None]
    outer = axes[:, :, None] * axes[:, None, :]
    skew = np.cross(axes[:, None, :], np.eye(3)).swapaxes(-1, -2)  # [a] with [a] v = a x v
    return np.asarray(outer + cosine * (np.eye(3) - outer) + sine * skew)
