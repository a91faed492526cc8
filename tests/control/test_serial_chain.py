"""Forward and inverse kinematics of serial chains."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pilotfish.control import (
    SerialChain,
    arm_limits,
    inverse_kinematics,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, angle, conjugate, multiply, to_rotation_vector

STEP = 1e-6  # rad; the error of a central difference is its square


def unit_vectors(rng, *shape):
    v = rng.normal(size=shape)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def random_chain(rng, n):
    """Return a chain with random joints, axes and tool."""
    base, tool = (Pose(rng.normal(size=3), unit_vectors(rng, 4)) for _ in range(2))
    return SerialChain(
        base, 0.3 * rng.normal(size=(n, 3)), unit_vectors(rng, n, 4), unit_vectors(rng, n, 3), tool
    )


def symmetric_limits(n, bound=2.5):
    return arm_limits([-bound] * n, [bound] * n, [1.0] * n, [1.0] * n)


def assert_same_pose(one, other, tolerance):
    np.testing.assert_allclose(one.position, other.position, atol=tolerance)
    assert angle(one.quaternion, other.quaternion) < tolerance


@pytest.mark.parametrize("n", [1, 2, 6, 7, 9])
def test_forward_kinematics_equals_product_of_poses(rng, n):
    """world_from_tool is the product of all poses, with the joint rotations by SciPy."""
    chain, q = random_chain(rng, n), rng.uniform(-4.0, 4.0, n)
    world_from_joint = chain.world_from_base
    for position, quaternion, axis, angle_ in zip(
        chain.positions, chain.quaternions, chain.axes, q, strict=True
    ):
        joint = np.roll(Rotation.from_rotvec(angle_ * axis).as_quat(), 1)
        world_from_joint = world_from_joint @ Pose(position, quaternion) @ Pose(np.zeros(3), joint)
    assert_same_pose(chain.forward_kinematics(q), world_from_joint @ chain.last_from_tool, 1e-12)


@pytest.mark.parametrize("n", [1, 3, 7])
def test_jacobian_equals_central_differences(rng, n):
    """Central differences of the position, and of the rotation vector in world axes."""
    chain, q = random_chain(rng, n), rng.uniform(-3.0, 3.0, n)
    J = chain.jacobian(q)
    assert J.shape == (6, n)
    for i, step in enumerate(STEP * np.eye(n)):
        ahead, behind = chain.forward_kinematics(q + step), chain.forward_kinematics(q - step)
        between = multiply(ahead.quaternion, conjugate(behind.quaternion))
        rotation = to_rotation_vector(between * np.copysign(1.0, between[0]))
        slope = np.concatenate([ahead.position - behind.position, rotation]) / (2.0 * STEP)
        np.testing.assert_allclose(J[:, i], slope, atol=1e-8)


def test_tool_poses_batch_equals_forward_kinematics(rng):
    """Leading axes are kept; each row is position and quaternion of the tool."""
    chain, q = random_chain(rng, 7), rng.normal(size=(4, 5, 7))
    poses = chain.tool_poses(q)
    assert poses.shape == (4, 5, 7)
    for i in np.ndindex(4, 5):
        pose = chain.forward_kinematics(q[i])
        np.testing.assert_allclose(poses[i], [*pose.position, *pose.quaternion], atol=1e-13)
    assert chain.tool_poses(np.empty((0, 7))).shape == (0, 7)


def test_forward_kinematics_moved_base_moves_tool(rng):
    """The pose of the tool in the base does not depend on the base."""
    chain, q = random_chain(rng, 5), rng.normal(size=5)
    transform = Pose(rng.normal(size=3), unit_vectors(rng, 4))
    moved = dataclasses.replace(chain, world_from_base=transform @ chain.world_from_base)
    assert_same_pose(moved.forward_kinematics(q), transform @ chain.forward_kinematics(q), 1e-12)


@pytest.mark.parametrize("n", [6, 7, 9])
def test_inverse_kinematics_near_start_reaches_pose(rng, n):
    """From a start about 0.2 rad away, joints with the pose are found."""
    chain, limits = random_chain(rng, n), symmetric_limits(n)
    for _ in range(5):
        q = rng.uniform(-2.2, 2.2, n)
        target = chain.forward_kinematics(q)
        found, _, _, converged = inverse_kinematics(
            chain, target, q + 0.2 * rng.uniform(-1.0, 1.0, n), limits
        )
        assert converged
        assert_same_pose(chain.forward_kinematics(found), target, 2e-5)


def test_inverse_kinematics_joints_at_limits_reach_pose(rng):
    """At least 19 of 20 poses with a third of the joints at a limit are reached from a near start.

    Without holding joints at their limits it would be half of them.
    """
    reached = 0
    for _ in range(40):
        chain, q = random_chain(rng, 7), np.clip(rng.uniform(-1.5, 1.5, 7), -1.0, 1.0)
        start = q + 0.2 * rng.normal(size=7)
        reached += inverse_kinematics(chain, chain.forward_kinematics(q), start, symmetric_limits(7, 1.0))[3]
    assert reached >= 38


def test_inverse_kinematics_errors_and_limits_are_those_of_result(rng):
    """The errors are those of the returned joints, limits hold, and the search is deterministic."""
    chain, limits = random_chain(rng, 7), symmetric_limits(7, 1.0)
    outcomes = set()
    for scale in (0.3, 0.3, 1.0, 3.0, 3.0):
        target = chain.forward_kinematics(scale * rng.uniform(-1.0, 1.0, 7))
        for posture in (None, np.zeros(7)):
            q, position_error, angle_error, converged = inverse_kinematics(
                chain, target, 5.0 * rng.normal(size=7), limits, posture=posture
            )
            tool = chain.forward_kinematics(q)
            distance = np.linalg.norm(tool.position - target.position)
            np.testing.assert_allclose(position_error, distance, atol=1e-12)
            np.testing.assert_allclose(angle_error, angle(tool.quaternion, target.quaternion), atol=1e-7)
            assert (np.abs(q) <= 1.0).all()
            outcomes.add(converged)
    assert outcomes == {True, False}
    start = rng.normal(size=7)
    first, second = (inverse_kinematics(chain, target, start, limits) for _ in range(2))
    np.testing.assert_array_equal(first[0], second[0])


def test_inverse_kinematics_unreachable_pose_is_not_converged():
    """A planar arm of two links of 1 m reaches towards a point 5 m away: 3 m are left."""
    identity = np.array([1.0, 0.0, 0.0, 0.0])
    elbow = SerialChain(
        Pose(np.zeros(3), identity),
        np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        np.stack([identity, identity]),
        np.array([[0.0, 0.0, 1.0]] * 2),
        Pose(np.array([1.0, 0.0, 0.0]), identity),
    )
    q, distance, _, converged = inverse_kinematics(
        elbow, Pose(np.array([5.0, 0.0, 0.0]), identity), np.array([0.4, -0.9]), symmetric_limits(2)
    )
    assert not converged
    np.testing.assert_allclose(distance, 3.0, atol=1e-3)
    np.testing.assert_allclose(q, 0.0, atol=0.02)


def test_inverse_kinematics_posture_selects_nearest_solution(rng):
    """The distance to the posture has no component in the null space, except at joint limits."""
    chain, limits = random_chain(rng, 7), symmetric_limits(7)
    posture, q = rng.uniform(-1.0, 1.0, 7), rng.uniform(-1.0, 1.0, 7)
    target = chain.forward_kinematics(q)
    nearest, _, _, nearest_converged = inverse_kinematics(chain, target, q, limits, posture=posture)
    free, _, _, free_converged = inverse_kinematics(chain, target, q, limits)
    assert nearest_converged
    assert free_converged
    assert np.linalg.norm(nearest - posture) <= np.linalg.norm(free - posture)
    if (np.abs(nearest) < 2.5).all():
        null = np.linalg.svd(chain.jacobian(nearest))[2][6]  # the one direction that keeps the tool
        assert abs(null @ (posture - nearest)) < 1e-3


@pytest.mark.usefixtures("unchecked")  # wrong shapes on purpose
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"target": Pose(np.array([np.nan, 0.0, 0.0]), np.eye(4)[0])}, "position of the target.* nan"),
        ({"target": Pose(np.zeros(3), np.full(4, np.inf))}, "quaternion of the target.* inf"),
        ({"target": Pose(np.zeros(2), np.eye(4)[0])}, r"position of the target has shape \(2,\)"),
        ({"target": [0.0, 0.0, 0.0]}, "target has type list"),
        ({"start": np.zeros(5)}, r"start has shape \(5,\)"),
        ({"start": np.full(6, np.nan)}, "start"),
        ({"posture": np.zeros(7)}, r"posture has shape \(7,\)"),
        ({"limits": symmetric_limits(7)}, r"the lower limits has shape \(7,\)"),
    ],
)
def test_inverse_kinematics_wrong_arguments_are_named(change, message):
    given = {"target": Pose(np.zeros(3), np.eye(4)[0]), "start": np.zeros(6), "limits": symmetric_limits(6)}
    with pytest.raises(InvalidInput, match=message):
        inverse_kinematics(random_chain(np.random.default_rng(0), 6), **{**given, **change})
