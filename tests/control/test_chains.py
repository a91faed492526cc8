"""Laws of chains of joints: motion against finite differences, and joints that reach a pose."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pilotfish.control import (
    SerialChain,
    arm_limits,
    forward_kinematics,
    inverse_kinematics,
    jacobian,
    tool_poses,
)
from pilotfish.geometry import Pose, angle, conjugate, multiply, to_rotation_vector

STEP = 1e-6  # rad; its square is what a central difference loses


def unit(rng, *shape):
    v = rng.normal(size=shape)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def chain_of(rng, n):
    """Joints anywhere, about any axes, a tool anyhow."""
    base, tool = (Pose(rng.normal(size=3), unit(rng, 4)) for _ in range(2))
    return SerialChain(base, 0.3 * rng.normal(size=(n, 3)), unit(rng, n, 4), unit(rng, n, 3), tool)


def limits_of(n, reach=2.5):
    return arm_limits([-reach] * n, [reach] * n, [1.0] * n, [1.0] * n)


def same(one, other, tolerance):
    np.testing.assert_allclose(one.position, other.position, atol=tolerance)
    assert angle(one.quaternion, other.quaternion) < tolerance


@pytest.mark.parametrize("n", [1, 2, 6, 7, 9])
def test_the_tool_is_where_poses_joined_one_by_one_bring_it(rng, n):
    """world_from_tool is the product of all poses on the way, the turns of joints among them by SciPy."""
    chain, q = chain_of(rng, n), rng.uniform(-4.0, 4.0, n)
    world_from_here = chain.world_from_base
    for place, turn, axis, one in zip(chain.positions, chain.quaternions, chain.axes, q, strict=True):
        turned = np.roll(Rotation.from_rotvec(one * axis).as_quat(), 1)
        world_from_here = world_from_here @ Pose(place, turn) @ Pose(np.zeros(3), turned)
    same(forward_kinematics(chain, q), world_from_here @ chain.last_from_tool, 1e-12)


@pytest.mark.parametrize("n", [1, 3, 7])
def test_the_jacobian_is_the_derivative_of_the_tool(rng, n):
    """Central differences: of the position, and of the turn in world axes, log(q+ q-^-1) over the step."""
    chain, q = chain_of(rng, n), rng.uniform(-3.0, 3.0, n)
    J = jacobian(chain, q)
    assert J.shape == (6, n)
    for i, push in enumerate(STEP * np.eye(n)):
        ahead, behind = forward_kinematics(chain, q + push), forward_kinematics(chain, q - push)
        between = multiply(ahead.quaternion, conjugate(behind.quaternion))
        turned = to_rotation_vector(between * np.copysign(1.0, between[0]))
        slope = np.concatenate([ahead.position - behind.position, turned]) / (2.0 * STEP)
        np.testing.assert_allclose(J[:, i], slope, atol=1e-8)


def test_a_batch_of_joints_is_one_pose_each(rng):
    """Leading axes are kept; each row is position and quaternion of the tool."""
    chain, q = chain_of(rng, 7), rng.normal(size=(4, 5, 7))
    poses = tool_poses(chain, q)
    assert poses.shape == (4, 5, 7)
    for i in np.ndindex(4, 5):
        one = forward_kinematics(chain, q[i])
        np.testing.assert_allclose(poses[i], [*one.position, *one.quaternion], atol=1e-13)
    assert tool_poses(chain, np.empty((0, 7))).shape == (0, 7)


def test_moving_the_base_moves_the_tool(rng):
    """The tool as seen from the base does not know where the base is."""
    chain, q = chain_of(rng, 5), rng.normal(size=5)
    there = Pose(rng.normal(size=3), unit(rng, 4))
    moved = dataclasses.replace(chain, world_from_base=there @ chain.world_from_base)
    same(forward_kinematics(moved, q), there @ forward_kinematics(chain, q), 1e-12)


@pytest.mark.parametrize("n", [6, 7, 9])
def test_the_pose_of_near_joints_is_reached(rng, n):
    """From a start .2 rad or so away from joints that have the pose, joints with that pose are found."""
    chain, limits = chain_of(rng, n), limits_of(n)
    for _ in range(5):
        q = rng.uniform(-2.2, 2.2, n)
        target = forward_kinematics(chain, q)
        reach = inverse_kinematics(chain, target, q + 0.2 * rng.uniform(-1.0, 1.0, n), limits)
        assert reach.converged
        same(forward_kinematics(chain, reach.q), target, 2e-5)


def test_poses_that_need_joints_at_their_limits_are_reached(rng):
    """A third of all joints at a limit: 19 in 20 such poses or more are found from a start near by, for what
    a joint at its limit cannot do the others do. With steps only cut at the limits it would be half of them.
    """
    reached = 0
    for _ in range(40):
        chain, q = chain_of(rng, 7), np.clip(rng.uniform(-1.5, 1.5, 7), -1.0, 1.0)
        start = q + 0.2 * rng.normal(size=7)
        reached += inverse_kinematics(chain, forward_kinematics(chain, q), start, limits_of(7, 1.0)).converged
    assert reached >= 38


def test_what_is_told_of_a_reach_is_so(rng):
    """Errors are those of the tool at the joints given back, reached or not; limits hold either way, and the
    same search finds the same joints.
    """
    chain, limits = chain_of(rng, 7), limits_of(7, 1.0)
    outcomes = set()
    for scale in (0.3, 0.3, 1.0, 3.0, 3.0):
        target = forward_kinematics(chain, scale * rng.uniform(-1.0, 1.0, 7))
        for posture in (None, np.zeros(7)):
            reach = inverse_kinematics(chain, target, 5.0 * rng.normal(size=7), limits, posture=posture)
            tool = forward_kinematics(chain, reach.q)
            apart = np.linalg.norm(tool.position - target.position)
            np.testing.assert_allclose(reach.position_error, apart, atol=1e-12)
            np.testing.assert_allclose(
                reach.angle_error, angle(tool.quaternion, target.quaternion), atol=1e-7
            )
            assert (np.abs(reach.q) <= 1.0).all()
            outcomes.add(reach.converged)
    assert outcomes == {True, False}
    start = rng.normal(size=7)
    one, other = (inverse_kinematics(chain, target, start, limits) for _ in range(2))
    np.testing.assert_array_equal(one.q, other.q)


def test_a_pose_out_of_reach_is_an_outcome():
    """A planar arm of two links of 1 m stretches towards a point 5 m away: 3 m are left."""
    still = np.array([1.0, 0.0, 0.0, 0.0])
    elbow = SerialChain(
        Pose(np.zeros(3), still),
        np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        np.stack([still, still]),
        np.array([[0.0, 0.0, 1.0]] * 2),
        Pose(np.array([1.0, 0.0, 0.0]), still),
    )
    reach = inverse_kinematics(
        elbow, Pose(np.array([5.0, 0.0, 0.0]), still), np.array([0.4, -0.9]), limits_of(2)
    )
    assert not reach.converged
    np.testing.assert_allclose(reach.position_error, 3.0, atol=1e-3)
    np.testing.assert_allclose(reach.q, 0.0, atol=0.02)


def test_the_posture_decides_among_joints_that_reach(rng):
    """No joints with this pose nearby are nearer to the posture: what is left to it has no part in the null
    space of the Jacobian, up to joints that are held at their limits.
    """
    chain, limits = chain_of(rng, 7), limits_of(7)
    posture, q = rng.uniform(-1.0, 1.0, 7), rng.uniform(-1.0, 1.0, 7)
    target = forward_kinematics(chain, q)
    nearest = inverse_kinematics(chain, target, q, limits, posture=posture)
    free = inverse_kinematics(chain, target, q, limits)
    assert nearest.converged
    assert free.converged
    assert np.linalg.norm(nearest.q - posture) <= np.linalg.norm(free.q - posture)
    if (np.abs(nearest.q) < 2.5).all():
        slide = np.linalg.svd(jacobian(chain, nearest.q))[2][6]  # the one direction that keeps the tool
        assert abs(slide @ (posture - nearest.q)) < 1e-3
