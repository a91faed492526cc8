"""Panda and UR5e have the published kinematics, masses and limits, in our chain and in MuJoCo."""

from math import cos, pi, sin

import mujoco
import numpy as np
import pytest

from pilotfish.environments import TASKS, Workcell
from pilotfish.environments.robots import ROBOTS, chain_with_tool, solve_posture
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, pose, rotation_matrix

ARMS = ("panda", "ur5e")


def turn(axis: str, angle: float) -> np.ndarray:
    """Return the homogeneous matrix of a rotation about x or z."""
    c, s = cos(angle), sin(angle)
    T = np.eye(4)
    rows = slice(1, 3) if axis == "x" else slice(0, 2)
    T[rows, rows] = [[c, -s], [s, c]]
    return T


def move(x: float, z: float) -> np.ndarray:
    T = np.eye(4)
    T[[0, 2], 3] = x, z
    return T


def panda_flange(q: np.ndarray) -> np.ndarray:
    """Return base_from_flange by Franka's table of Craig's parameters."""
    a = [0, 0, 0, 0.0825, -0.0825, 0, 0.088]
    d = [0.333, 0, 0.316, 0, 0.384, 0, 0]
    alpha = [0, -pi / 2, pi / 2, pi / 2, -pi / 2, pi / 2, pi / 2]
    T = np.eye(4)
    for n in range(7):
        T = T @ turn("x", alpha[n]) @ move(a[n], 0) @ turn("z", q[n]) @ move(0, d[n])
    return T @ move(0, 0.107)


def ur5e_flange(q: np.ndarray) -> np.ndarray:
    """Return base_from_flange by Universal Robots' table of Denavit and Hartenberg's parameters."""
    a = [0, -0.425, -0.3922, 0, 0, 0]
    d = [0.1625, 0, 0, 0.1333, 0.0997, 0.0996]
    alpha = [pi / 2, 0, 0, pi / 2, -pi / 2, 0]
    T = np.eye(4)
    for n in range(6):
        T = T @ turn("z", q[n]) @ move(a[n], d[n]) @ turn("x", alpha[n])
    return T


FLANGES = {"panda": panda_flange, "ur5e": ur5e_flange}
HAND_TURNS = {"panda": pi, "ur5e": 0.0}  # rad, of the hand about z of the flange


def homogeneous(value: Pose) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation_matrix(value.quaternion), value.position
    return T


def random_posture(name: str, rng: np.random.Generator) -> np.ndarray:
    limits = ROBOTS[name].limits
    return rng.uniform(limits.lower, limits.upper)


@pytest.mark.parametrize("name", ARMS)
def test_forward_kinematics_equals_denavit_hartenberg_product(name, rng):
    robot = ROBOTS[name]
    base = homogeneous(robot.chain.world_from_base)
    for _ in range(20):
        q = random_posture(name, rng)
        expected = base @ FLANGES[name](q) @ turn("z", HAND_TURNS[name])
        np.testing.assert_allclose(homogeneous(robot.chain.forward_kinematics(q)), expected, atol=1e-12)


def test_panda_ready_posture_is_where_franka_puts_it():
    """The flange of a Panda in its "ready" posture points down, 0.307 m ahead of the base and 0.590 m up."""
    q = np.array([0, -pi / 4, 0, -3 * pi / 4, 0, pi / 2, pi / 4])
    hand = ROBOTS["panda"].chain.world_from_base.inverse() @ ROBOTS["panda"].chain.forward_kinematics(q)
    np.testing.assert_allclose(hand.position, [0.306891, 0.0, 0.590282], atol=1e-6)
    np.testing.assert_allclose(rotation_matrix(hand.quaternion)[:, 2], [0, 0, -1], atol=1e-12)


def test_ur5e_stretched_arm_is_as_long_as_published():
    """At q = 0 the arm lies along -x of the base: a2 + a3 away, and d4 + d6 to the side."""
    hand = ROBOTS["ur5e"].chain.world_from_base.inverse() @ ROBOTS["ur5e"].chain.forward_kinematics(
        np.zeros(6)
    )
    np.testing.assert_allclose(hand.position, [-0.8172, -0.2329, 0.0628], atol=1e-12)


@pytest.mark.parametrize("name", ARMS)
def test_chain_equals_kinematics_of_mujoco(name, rng):
    task, robot = TASKS["stab"], ROBOTS[name]
    cell = Workcell(task, task.sample_situation(rng), robot=robot)
    chain = chain_with_tool(robot, cell.mounted_tool.length)
    for _ in range(10):
        cell.arm.q[:] = q = random_posture(name, rng)
        mujoco.mj_kinematics(cell.model, cell.data)
        mujoco.mj_comPos(cell.model, cell.data)
        expected = homogeneous(chain.forward_kinematics(q))
        np.testing.assert_allclose(homogeneous(cell.arm.tool), expected, atol=1e-9)
        np.testing.assert_allclose(cell.arm.jacobian(), chain.jacobian(q), atol=1e-9)


@pytest.mark.parametrize("name", ARMS)
def test_model_has_limits_and_masses_of_the_robot(name, rng):
    task, robot = TASKS["carabiner"], ROBOTS[name]
    model = Workcell(task, task.sample_situation(rng), robot=robot).model
    limits = robot.limits
    for n, joint in enumerate(robot.joints):
        np.testing.assert_allclose(model.joint(joint).range, [limits.lower[n], limits.upper[n]])
        np.testing.assert_allclose(model.actuator(joint).ctrlrange, [-limits.torque[n], limits.torque[n]])
    mass = sum(model.body(f"{joint}_link").mass[0] for joint in robot.joints)
    assert mass == pytest.approx({"panda": 16.062132, "ur5e": 17.7}[name], abs=1e-5)


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("task", sorted(TASKS))
def test_start_of_every_task_is_in_reach_and_held(name, task, rng):
    cell = Workcell(TASKS[task], TASKS[task].sample_situation(rng), robot=ROBOTS[name])
    start = cell.arm.tool
    cell.step_impedance(cell.target, 0.0, 100)
    assert np.linalg.norm(cell.arm.tool.position - start.position) < 1e-3
    assert cell.peak_forces["tool"] == 0.0


def test_solve_posture_returns_a_posture_at_the_pose_within_limits(rng):
    for name in ROBOTS:
        robot = ROBOTS[name]
        q = 0.9 * robot.posture
        target = chain_with_tool(robot, 0.1).forward_kinematics(q)
        found = solve_posture(robot, target, 0.1)
        reached = chain_with_tool(robot, 0.1).forward_kinematics(found)
        np.testing.assert_allclose(homogeneous(reached), homogeneous(target), atol=1e-3)
        assert (np.clip(found, robot.limits.lower, robot.limits.upper) == found).all()


@pytest.mark.parametrize("name", ARMS)
def test_solve_posture_out_of_reach_names_robot_and_distance(name):
    with pytest.raises(InvalidInput, match=f"the arm of {name} does not reach position .* rad away"):
        solve_posture(ROBOTS[name], pose([3.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]))


def test_guidance_without_second_arm_draws_the_tool_to_the_hand(rng):
    task = TASKS["stab"]
    cell = Workcell(task, task.sample_situation(rng), robot=ROBOTS["panda"], guided=True)
    assert cell.leader_arm is None
    hand = Pose(cell.target.position + np.array([0.0, 0.0, 0.05]), cell.target.quaternion)
    cell.step_guidance(hand, 0.0, 500)
    np.testing.assert_allclose(cell.guided_tool.position, hand.position, atol=1e-12)
    cell.step_guidance(hand, 0.0, 800)
    assert np.linalg.norm(cell.arm.tool.position - hand.position) < 0.005
    cell.step_teleoperation(hand, cell.target, 0.0, 10)
    with pytest.raises(InvalidInput, match="guided=True"):
        Workcell(task, task.sample_situation(rng), robot=ROBOTS["panda"]).step_guidance(hand, 0.0, 1)
