"""The kinematic chain of Baxter's arm agrees with joints and tool poses logged by a real robot."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from pilotfish.environments.baxter import arm_chain
from pilotfish.geometry import Pose, from_rotation_vector, multiply, relative_rotation_vector, rotation_matrix

LEVER = 0.3  # m, weight of a radian in the fit
ROS = [2, 3, 0, 1, 4, 5, 6]  # indices of s0 s1 e0 e1 w0 w1 w2 in alphabetical order


@pytest.fixture(scope="module")
def logged(data_folder):
    """Joints [rad] and tool poses of all logs: eight of the valve before, one of it after."""
    with np.load(data_folder / "valve" / "valve_demos.npz") as file:
        logs = [f"reg{m}_0_" for m in range(8)] + ["reg0_1_"]
        parts = ("rq", "rpos", "rquat")
        q, position, quaternion = (np.concatenate([file[log + part] for log in logs]) for part in parts)
    return np.float64(q), np.float64(position), np.float64(quaternion)


def pose_from_vector(v):
    """Return the pose of a position and a rotation vector."""
    return Pose(v[:3], from_rotation_vector(v[3:]))


def displace(poses, v):
    """Return positions and quaternions of the tool with base displaced by v[:6] and tool by v[6:]."""
    base, tool = pose_from_vector(v[:6]), pose_from_vector(v[6:])
    turns = multiply(base.quaternion, poses[:, 3:])
    places = base.position + poses[:, :3] @ rotation_matrix(base.quaternion).T
    return places + rotation_matrix(turns) @ tool.position, multiply(turns, tool.quaternion)


def fit(poses, position, quaternion):
    """Return the best displacements of base and tool, and the RMS residuals [m, rad]."""

    def residuals(v):
        places, turns = displace(poses, v)
        return np.concatenate(
            [(places - position).ravel(), LEVER * relative_rotation_vector(turns, quaternion).ravel()]
        )

    starts = ([*np.zeros(9), 0.0, 0.0, turn] for turn in (0.0, np.pi / 2, np.pi, -np.pi / 2))
    best = min((least_squares(residuals, start) for start in starts), key=lambda found: found.cost)
    places, turns = displace(poses, best.x)
    apart, angles = places - position, relative_rotation_vector(turns, quaternion)
    return best.x, *(float(np.sqrt((left**2).sum(axis=1).mean())) for left in (apart, angles))


def test_arm_chain_equals_logged_poses(logged):
    q, *tool = logged
    _, way, angle = fit(arm_chain("right").tool_poses(q), *tool)
    assert way < 5e-6
    assert angle < np.radians(1e-3)


@pytest.mark.usefixtures("unchecked")
def test_arm_chain_right_side_and_joint_order_match_logs(logged):
    q, *tool = logged
    right, *_ = fit(arm_chain("right").tool_poses(q), *tool)
    assert np.linalg.norm(right[:3]) < 0.02
    assert np.linalg.norm(right[3:6]) < np.radians(0.5)
    np.testing.assert_allclose(right[6:], [0.0, 0.0, right[8], 0.0, 0.0, 0.0], atol=1e-4)
    left, *_ = fit(arm_chain("left").tool_poses(q), *tool)
    assert np.linalg.norm(left[3:6]) > np.radians(80.0)
    _, way, _ = fit(arm_chain("right").tool_poses(q[:, ROS]), *tool)
    assert way > 0.01


def test_arm_chain_wrong_length_disagrees_with_logs(logged):
    q, *tool = logged
    chain = arm_chain("right")
    for link in (2, 3, 4, 5):
        longer = chain.positions.copy()
        longer[link] *= 1.0 + 1e-3 / np.linalg.norm(longer[link])
        off = type(chain)(chain.world_from_base, longer, chain.quaternions, chain.axes, chain.last_from_tool)
        assert fit(off.tool_poses(q), *tool)[1] > 1e-4
