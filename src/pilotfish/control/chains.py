"""Arms as chains of revolute joints: where their tools are, and how they move."""

from dataclasses import dataclass

import numpy as np

from pilotfish.geometry import Pose, quaternion_from_rotation_matrix, rotation_matrix
from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class SerialChain:
    """A base, n revolute joints one after another, and a tool.

    At q = 0 joint i stands at positions[i] [m], turned by quaternions[i], seen from the joint before, the
    first from the base; it turns what comes after it by q[i] [rad] about the unit vector axes[i] through its
    place.
    """

    world_from_base: Pose
    positions: Float[Array, "n 3"]
    quaternions: Float[Array, "n 4"]
    axes: Float[Array, "n 3"]
    last_from_tool: Pose


@dataclass(frozen=True, slots=True, eq=False)
class ChainFrames:
    """Where joints and tool of a chain are, in world axes: places of the joints and their axes, the tool."""

    joints: Float[Array, "*B n 3"]
    axes: Float[Array, "*B n 3"]
    tool: Float[Array, "*B 3"]
    rotation: Float[Array, "*B 3 3"]  # world_from_tool

    @property
    def jacobian(self) -> Float[Array, "*B 6 n"]:
        """Velocities of the joints to the twist of the tool's point: linear rows, then angular."""
        lever_arms = self.tool[..., None, :] - self.joints
        rows = np.concatenate([np.cross(self.axes, lever_arms), self.axes], axis=-1)
        return np.swapaxes(rows, -1, -2)


def forward_kinematics(chain: SerialChain, q: Float[Array, " n"]) -> Pose:
    """world_from_tool with the joints at q [rad]."""
    frames = chain_frames(chain, q)
    return Pose(frames.tool, quaternion_from_rotation_matrix(frames.rotation))


def tool_poses(chain: SerialChain, q: Float[Array, "*B n"]) -> Float[Array, "*B 7"]:
    """world_from_tool of each q [rad], as recordings have it: position [m], then quaternion w x y z."""
    frames = chain_frames(chain, q)
    return np.concatenate([frames.tool, quaternion_from_rotation_matrix(frames.rotation)], axis=-1)


def jacobian(chain: SerialChain, q: Float[Array, " n"]) -> Float[Array, "6 n"]:
    """Velocities of the joints [rad/s] to the twist of the tool's point, world axes: m/s, then rad/s."""
    return chain_frames(chain, q).jacobian


def chain_frames(chain: SerialChain, q: Float[Array, "*B n"]) -> ChainFrames:
    """Everything that one walk along the chain tells.

    Source: Siciliano et al. 2009, Robotics: Modelling, Planning and Control, sections 2.8 and 3.1.
    """
    fixed = rotation_matrix(chain.quaternions)
    before_from_after = fixed @ _joint_rotations(
        chain.axes, q
    )  # (*B, n, 3, 3), before_from_after of each joint
    R = np.broadcast_to(rotation_matrix(chain.world_from_base.quaternion), (*q.shape[:-1], 3, 3))
    origin = np.broadcast_to(chain.world_from_base.position, (*q.shape[:-1], 3))
    joints, axes = np.empty((*q.shape, 3)), np.empty((*q.shape, 3))
    for i in range(q.shape[-1]):
        origin = origin + R @ chain.positions[i]
        R = R @ before_from_after[..., i, :, :]
        joints[..., i, :], axes[..., i, :] = origin, R @ chain.axes[i]
    tool = chain.last_from_tool
    return ChainFrames(joints, axes, origin + R @ tool.position, R @ rotation_matrix(tool.quaternion))


def _joint_rotations(axes: Float[Array, "n 3"], q: Float[Array, "*B n"]) -> Float[Array, "*B n 3 3"]:
    """Rotations by q about the axes, by Rodrigues' formula."""
    cosine, sine = np.cos(q)[..., None, None], np.sin(q)[..., None, None]
    along = axes[:, :, None] * axes[:, None, :]
    across = np.cross(axes[:, None, :], np.eye(3)).swapaxes(-1, -2)  # [a] with [a] v = a x v
    return np.asarray(along + cosine * (np.eye(3) - along) + sine * across)
