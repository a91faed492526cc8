"""Baxter's arm as a chain against a real one: joints and tool that its own controller logged together."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from pilotfish.control import tool_poses
from pilotfish.environments.baxter import arm_chain
from pilotfish.geometry import (
    Pose,
    from_rotation_vector,
    multiply,
    relative_rotation_vector,
    rotation_matrix,
)

LEVER = 0.3  # m: what a radian is worth in the fit
ROS = [2, 3, 0, 1, 4, 5, 6]  # where s0 s1 e0 e1 w0 w1 w2 stand when names are in alphabetical order


@pytest.fixture(scope="module")
def logged(data_folder):
    """Joints [rad] and tool poses of all logs: eight of the valve before, one of it after."""
    with np.load(data_folder / "valve" / "valve_demos.npz") as file:
        logs = [f"reg{m}_0_" for m in range(8)] + ["reg0_1_"]
        parts = ("rq", "rpos", "rquat")
        q, position, quaternion = (np.concatenate([file[log + part] for log in logs]) for part in parts)
    return np.float64(q), np.float64(position), np.float64(quaternion)


def offsets_of(v):
    """The pose of six numbers: a place and a rotation vector."""
    return Pose(v[:3], from_rotation_vector(v[3:]))


def corrected(poses, v):
    """Places and turns of the tool, were the base displaced by v[:6] and the tool by v[6:]."""
    base, tool = offsets_of(v[:6]), offsets_of(v[6:])
    turns = multiply(base.quaternion, poses[:, 3:])
    places = base.position + poses[:, :3] @ rotation_matrix(base.quaternion).T
    return places + rotation_matrix(turns) @ tool.position, multiply(turns, tool.quaternion)


def fit(poses, position, quaternion):
    """Base and tool that explain the logs best, and what is left: rms in m and in rad."""

    def residuals(v):
        places, turns = corrected(poses, v)
        return np.concatenate(
            [(places - position).ravel(), LEVER * relative_rotation_vector(turns, quaternion).ravel()]
        )

    starts = ([*np.zeros(9), 0.0, 0.0, turn] for turn in (0.0, np.pi / 2, np.pi, -np.pi / 2))
    best = min((least_squares(residuals, start) for start in starts), key=lambda found: found.cost)
    places, turns = corrected(poses, best.x)
    apart, angles = places - position, relative_rotation_vector(turns, quaternion)
    return best.x, *(float(np.sqrt((left**2).sum(axis=1).mean())) for left in (apart, angles))


def test_the_chain_is_the_arm_that_was_recorded(logged):
    """After one base and one tool for all logs the tool is where the robot said, to 5 micrometres and 0.001
    degree. No more than that is left by logs in single precision and lengths given to the micrometre.
    """
    q, *tool = logged
    _, way, angle = fit(tool_poses(arm_chain("right"), q), *tool)
    assert way < 5e-6
    assert angle < np.radians(1e-3)


def test_it_is_the_right_arm_and_its_joints_go_from_shoulder_to_wrist(logged):
    """The right arm stands within 2 cm and half a degree of where the maker has it, its tool straight ahead
    of the hand. The left, an arm of the same links, would have to stand elsewhere, turned by a quarter;
    joints in alphabetical order explain nothing.
    """
    q, *tool = logged
    right, *_ = fit(tool_poses(arm_chain("right"), q), *tool)
    assert np.linalg.norm(right[:3]) < 0.02
    assert np.linalg.norm(right[3:6]) < np.radians(0.5)
    np.testing.assert_allclose(right[6:], [0.0, 0.0, right[8], 0.0, 0.0, 0.0], atol=1e-4)
    left, *_ = fit(tool_poses(arm_chain("left"), q), *tool)
    assert np.linalg.norm(left[3:6]) > np.radians(80.0)
    _, way, _ = fit(tool_poses(arm_chain("right"), q[:, ROS]), *tool)
    assert way > 0.01


def test_a_millimetre_more_of_forearm_would_be_noticed(logged):
    """The logs tell lengths: one link longer by 1 mm, from upper arm to wrist, leaves twenty times as much as
    the law above allows. The shoulder's and the hand's are the offsets' to explain.
    """
    q, *tool = logged
    chain = arm_chain("right")
    for link in (2, 3, 4, 5):
        longer = chain.positions.copy()
        longer[link] *= 1.0 + 1e-3 / np.linalg.norm(longer[link])
        off = type(chain)(chain.world_from_base, longer, chain.quaternions, chain.axes, chain.last_from_tool)
        assert fit(tool_poses(off, q), *tool)[1] > 1e-4
