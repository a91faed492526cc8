"""The valve is done when its handle is at the mark and released, and it turns only if it is pushed."""

from math import radians

import mujoco
import numpy as np
import pytest

from pilotfish.environments import TASKS, Workcell
from pilotfish.environments.baxter import solve_posture
from pilotfish.environments.tasks.valve import CLEAR, TOLERANCE, handle_pose
from pilotfish.geometry import Pose, angle

pytestmark = pytest.mark.usefixtures("unchecked")

VALVE = TASKS["valve"]


def cell(seed: int = 0) -> Workcell:
    return Workcell(VALVE, VALVE.sample_situation(np.random.default_rng(seed)))


def set_angle(robot: Workcell, angle: float) -> Workcell:
    """Set the angle of the handle [rad]."""
    robot.data.qpos[robot.model.joint("valve").qposadr[0]] = angle
    mujoco.mj_forward(robot.model, robot.data)
    return robot


@pytest.mark.parametrize("seed", range(3))
def test_check_success_depends_on_angle(seed):
    robot = cell(seed)
    assert not robot.outcome().success
    goal = robot.situation.goal_angle
    for off in (-1.02, -0.98, 0.0, 0.98, 1.02):
        outcome = set_angle(robot, goal + off * TOLERANCE).outcome()
        assert outcome.success == (abs(off) < 1.0)
        assert outcome.error == pytest.approx(abs(off) * TOLERANCE, abs=1e-12)
    assert "5.1 degrees" in set_angle(robot, goal + 1.02 * TOLERANCE).outcome().reason


def test_check_success_hand_at_handle_fails():
    robot = set_angle(cell(), cell().situation.goal_angle)
    position, start_pose = robot.situation.valve.position, robot.arm.tool
    near = position + 0.9 * CLEAR * np.array([-1.0, 0.0, 0.0])
    robot.arm.q[:] = solve_posture(Pose(near, start_pose.quaternion), robot.mounted_tool.length)
    mujoco.mj_forward(robot.model, robot.data)
    outcome = robot.outcome()
    assert not outcome.success
    assert "from the handle" in outcome.reason


def test_valve_turns_only_above_friction_moment():
    robot = cell()
    dof = int(robot.model.joint("valve").dofadr[0])
    address = int(robot.model.joint("valve").qposadr[0])
    for moment, moves in ((0.0, False), (0.2, False), (0.6, True)):
        start = float(robot.data.qpos[address])
        robot.data.qfrc_applied[dof] = moment
        for _ in range(50):
            robot.step_impedance(robot.target, 0.0, 20)
        assert (abs(float(robot.data.qpos[address]) - start) > radians(5.0)) == moves


@pytest.mark.parametrize("seed", range(5))
def test_frames_equal_handle_body(seed):
    robot = cell(seed)
    frames, body = robot.frames(), robot.data.body("valve")
    assert np.allclose(frames["before"].position, body.xpos)
    assert angle(frames["before"].quaternion, body.xquat) < 1e-7
    set_angle(robot, robot.situation.goal_angle)
    assert np.allclose(frames["after"].position, body.xpos)
    assert angle(frames["after"].quaternion, body.xquat) < 1e-7
    between = angle(frames["before"].quaternion, frames["after"].quaternion)
    assert between == pytest.approx(robot.situation.goal_angle - robot.situation.start_angle)


def test_demonstration_script_every_goal_is_reachable():
    for seed in range(50):
        situation, again = (VALVE.sample_situation(np.random.default_rng(seed)) for _ in range(2))
        assert np.array_equal(situation.valve.position, again.valve.position)
        assert (situation.start_angle, situation.goal_angle) == (again.start_angle, again.goal_angle)
        frames = {
            "before": handle_pose(situation, situation.start_angle),
            "after": handle_pose(situation, situation.goal_angle),
        }
        for subtask in VALVE.demonstration_script(situation):
            solve_posture(subtask.goal(frames), 0.15)
