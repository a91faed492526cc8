"""The simulated arm obeys its controllers: gravity compensation, impedance, posture, guidance and limits."""

import mujoco
import numpy as np
import pytest

from pilotfish.environments import TASKS, Workcell
from pilotfish.environments.baxter import arm_chain, baxter_limits
from pilotfish.environments.baxter.body import add_arm, empty_world
from pilotfish.environments.baxter.parameters import JOINT_NAMES
from pilotfish.environments.baxter.tools import mount_handle
from pilotfish.environments.guidance import follow_relative_motion, linear_path
from pilotfish.geometry import (
    Pose,
    angle,
    multiply,
    normalise,
    quaternion_exp,
    relative_rotation_vector,
    rotation_vector_in_world,
)
from pilotfish.kernels import ArmState

pytestmark = pytest.mark.usefixtures("unchecked")

VALVE = TASKS["valve"]
SIDES = ("left", "right")


def cell(seed: int = 0, *, guided: bool = False) -> Workcell:
    return Workcell(VALVE, VALVE.sample_situation(np.random.default_rng(seed)), guided=guided)


def sample_joints(rng: np.random.Generator) -> np.ndarray:
    limits = baxter_limits()
    return rng.uniform(0.9 * limits.lower, 0.9 * limits.upper)


def both_arms() -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = empty_world(0.001)
    for side in SIDES:
        mount_handle(spec, add_arm(spec, side), side)
    model = spec.compile()
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("side", SIDES)
def test_arm_chain_equals_simulated_arm(rng, side):
    model, data = both_arms()
    q, chain = sample_joints(rng), arm_chain(side, 0.06)
    first = int(model.joint(f"{side}_{JOINT_NAMES[0]}").qposadr[0])
    data.qpos[first : first + 7] = q
    mujoco.mj_forward(model, data)
    site, pose = model.site(f"{side}_tool").id, chain.forward_kinematics(q)
    assert np.allclose(data.site_xpos[site], pose.position, atol=1e-12)
    assert angle(data.xquat[model.site_bodyid[site]], pose.quaternion) < 1e-7
    J = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, J[:3], J[3:], site)
    assert np.allclose(J[:, first : first + 7], chain.jacobian(q), atol=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_simulated_jacobian_equals_finite_difference(rng, side):
    model, data = both_arms()
    q, h = sample_joints(rng), 1e-6
    first = int(model.joint(f"{side}_{JOINT_NAMES[0]}").qposadr[0])
    site = model.site(f"{side}_tool").id

    def tool(joints: np.ndarray) -> Pose:
        data.qpos[first : first + 7] = joints
        mujoco.mj_forward(model, data)
        return Pose(data.site_xpos[site].copy(), data.xquat[model.site_bodyid[site]].copy())

    J = np.zeros((6, model.nv))
    tool(q)
    mujoco.mj_jacSite(model, data, J[:3], J[3:], site)
    for n, step in enumerate(h * np.eye(7)):
        back, ahead = tool(q - step), tool(q + step)
        moved = np.append(
            ahead.position - back.position, rotation_vector_in_world(back.quaternion, ahead.quaternion)
        )
        assert np.allclose(J[:, first + n], moved / (2 * h), atol=1e-7)


def test_arm_gravity_compensation_hangs_still():
    robot = cell()
    start = robot.arm.tool
    for _ in range(10_000):
        robot.arm.motors[:] = robot.arm.bias
        mujoco.mj_step(robot.model, robot.data)
    assert robot.time == pytest.approx(10.0)
    assert np.linalg.norm(robot.arm.tool.position - start.position) < 1e-3


def test_arm_without_torque_falls():
    robot = cell()
    start = robot.arm.tool
    for _ in range(1000):
        robot.arm.motors[:] = 0.0
        mujoco.mj_step(robot.model, robot.data)
    assert np.linalg.norm(robot.arm.tool.position - start.position) > 0.05


@pytest.mark.parametrize("axis", range(6))
def test_step_impedance_under_force_yields_by_stiffness(axis):
    robot, push = cell(), np.zeros(6)
    start = robot.arm.tool
    push[axis] = 10.0 if axis < 3 else 1.0
    for _ in range(150):
        robot.arm.external_torques[:] = robot.arm.jacobian().T @ push
        robot.step_impedance(robot.target, 0.0, 20)
    away = np.append(
        robot.arm.tool.position - start.position,
        rotation_vector_in_world(start.quaternion, robot.arm.tool.quaternion),
    )
    expected = push / robot.impedance.stiffness
    assert away[axis] == pytest.approx(expected[axis], rel=0.01)
    assert np.abs(away - expected).max() < 1e-3


def test_step_impedance_posture_does_not_move_tool():
    from dataclasses import replace

    robot = cell()
    start, q = robot.arm.tool, robot.arm.q.copy()
    robot.impedance = replace(robot.impedance, posture=robot.impedance.posture + 0.3)
    for _ in range(250):
        robot.step_impedance(robot.target, 0.0, 20)
    assert np.abs(robot.arm.q - q).max() > 0.02
    assert np.linalg.norm(robot.arm.tool.position - start.position) < 1e-4


def test_step_position_reaches_posture():
    robot = cell()
    posture = robot.arm.q + np.array([0.1, -0.1, 0.1, 0.1, -0.2, 0.1, 0.2])
    for _ in range(150):
        robot.step_position(posture, 0.0, 20)
    assert np.abs(robot.arm.q - posture).max() < 2e-3


def test_step_impedance_unreachable_target_respects_torque_limits():
    robot = cell()
    far = Pose(np.array([3.0, -2.0, 2.0]), np.array([0.0, 1.0, 0.0, 0.0]))
    limits = baxter_limits()
    for _ in range(40):
        robot.step_impedance(far, 0.0, 20)
        assert (np.abs(robot.arm.motors) <= limits.torque + 1e-9).all()
    assert np.isfinite(robot.arm.q).all()
    assert (robot.arm.q > limits.lower - 0.02).all()
    assert (robot.arm.q < limits.upper + 0.02).all()


def test_step_guidance_moves_both_arms():
    robot = cell(guided=True)
    start = robot.arm.tool
    target = Pose(
        start.position + np.array([0.03, -0.02, 0.04]),
        multiply(quaternion_exp(np.array([0.0, 0.0, 0.1])), start.quaternion),
    )
    for _ in range(150):
        robot.step_guidance(target, 0.0, 20)
    assert np.linalg.norm(robot.arm.tool.position - target.position) < 2e-3
    assert angle(robot.arm.tool.quaternion, target.quaternion) < 0.02


def test_step_guidance_repeated_is_bit_identical():
    def run() -> np.ndarray:
        robot = cell(3, guided=True)
        for n in range(20):
            away = np.array([0.002 * n, 0.0, 0.001 * n])
            robot.step_guidance(Pose(robot.target.position + away, robot.target.quaternion), 1.0, 20)
        return robot.data.qpos.copy()

    assert np.array_equal(run(), run())


def test_linear_path_has_constant_speed(rng):
    a = Pose(rng.normal(size=3), normalise(rng.normal(size=4)))
    b = Pose(rng.normal(size=3), normalise(rng.normal(size=4)))
    path = linear_path(a, b, 50, 0.001)
    assert np.allclose(path[-1].position, b.position)
    assert angle(path[-1].quaternion, b.quaternion) < 1e-7
    steps = np.diff(np.vstack([a.position, *(target.position for target in path)]), axis=0)
    assert np.allclose(steps, path[0].twist[:3] * 0.001)
    assert np.allclose(np.linalg.norm(path[0].twist[3:]) * 0.05, angle(a.quaternion, b.quaternion))
    assert np.linalg.norm(relative_rotation_vector(a.quaternion, b.quaternion)) <= np.pi + 1e-9


def test_follow_relative_motion_inverse_returns_leader(rng):
    poses = [Pose(rng.normal(size=3), normalise(rng.normal(size=4))) for _ in range(3)]
    follower = follow_relative_motion(poses[0], poses[2], poses[1])
    leader = follow_relative_motion(poses[1], follower, poses[0])
    assert np.allclose(leader.position, poses[2].position)
    assert angle(leader.quaternion, poses[2].quaternion) < 1e-7
    assert np.allclose(follower.position - poses[1].position, poses[2].position - poses[0].position)
    turn = rotation_vector_in_world(poses[0].quaternion, poses[2].quaternion)
    assert np.allclose(rotation_vector_in_world(poses[1].quaternion, follower.quaternion), turn)


def test_read_state_equals_fresh_computation():
    robot = cell()
    goal = Pose(robot.target.position + np.array([0.05, 0.02, -0.03]), robot.target.quaternion)
    robot.step_impedance(goal, 0.0, 100)
    state: ArmState = robot.arm.read_state()
    fresh = mujoco.MjData(robot.model)
    fresh.qpos[:], fresh.qvel[:] = robot.data.qpos, robot.data.qvel
    mujoco.mj_forward(robot.model, fresh)
    assert np.allclose(state.position, fresh.site_xpos[robot.model.site("right_tool").id], atol=1e-12)
    assert np.allclose(state.bias, (fresh.qfrc_bias - fresh.qfrc_spring)[:7], atol=1e-9)
