"""A valve is open when its handle stands at the mark and is let go, and it turns only if it is turned."""

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


def turned_to(robot: Workcell, to: float) -> Workcell:
    """The same cell, its handle put at an angle [rad]."""
    robot.data.qpos[robot.model.joint("valve").qposadr[0]] = to
    mujoco.mj_forward(robot.model, robot.data)
    return robot


@pytest.mark.parametrize("seed", range(3))
def test_it_is_judged_by_its_angle_to_the_tolerance(seed):
    """With the hand away: done within five degrees of the mark on either side, not done beyond, and told by
    how far; not done where it stood at the beginning.
    """
    robot = cell(seed)
    assert not robot.outcome().success
    end = robot.situation.end
    for off in (-1.02, -0.98, 0.0, 0.98, 1.02):
        outcome = turned_to(robot, end + off * TOLERANCE).outcome()
        assert outcome.success == (abs(off) < 1.0)
        assert outcome.error == pytest.approx(abs(off) * TOLERANCE, abs=1e-12)
    assert "5.1 degrees" in turned_to(robot, end + 1.02 * TOLERANCE).outcome().reason


def test_it_is_not_done_while_the_hand_is_at_the_handle():
    """At the mark, but held: not done, with the distance."""
    robot = turned_to(cell(), cell().situation.end)
    place, start_pose = robot.situation.valve.position, robot.arm.tool
    near = place + 0.9 * CLEAR * np.array([-1.0, 0.0, 0.0])
    robot.arm.q[:] = solve_posture(Pose(near, start_pose.quaternion), robot.mounted_tool.length)
    mujoco.mj_forward(robot.model, robot.data)
    outcome = robot.outcome()
    assert not outcome.success
    assert "from the handle" in outcome.reason


def test_nothing_turns_it_but_a_push():
    """Left alone it stands still; a moment below its friction does not move it, one above does."""
    robot = cell()
    dof = int(robot.model.joint("valve").dofadr[0])
    address = int(robot.model.joint("valve").qposadr[0])
    for moment, moves in ((0.0, False), (0.2, False), (0.6, True)):
        began = float(robot.data.qpos[address])
        robot.data.qfrc_applied[dof] = moment
        for _ in range(50):
            robot.step_impedance(robot.target, 0.0, 20)
        assert (abs(float(robot.data.qpos[address]) - began) > radians(5.0)) == moves


@pytest.mark.parametrize("seed", range(5))
def test_frames_are_where_the_handle_is_and_is_to_be(seed):
    """The frame before is the handle's body; the frame after is the same body, turned by what is asked."""
    robot = cell(seed)
    frames, body = robot.frames(), robot.data.body("valve")
    assert np.allclose(frames["before"].position, body.xpos)
    assert angle(frames["before"].quaternion, body.xquat) < 1e-7
    turned_to(robot, robot.situation.end)
    assert np.allclose(frames["after"].position, body.xpos)
    assert angle(frames["after"].quaternion, body.xquat) < 1e-7
    between = angle(frames["before"].quaternion, frames["after"].quaternion)
    assert between == pytest.approx(robot.situation.end - robot.situation.begin)


def test_every_handle_can_be_reached_before_and_after():
    """Of fifty situations, the tool poses of the script's acts are within reach; the same seed draws the same
    one.
    """
    for seed in range(50):
        where, again = (VALVE.sample_situation(np.random.default_rng(seed)) for _ in range(2))
        assert np.array_equal(where.valve.position, again.valve.position)
        assert (where.begin, where.end) == (again.begin, again.end)
        seen = {"before": handle_pose(where, where.begin), "after": handle_pose(where, where.end)}
        for subtask in VALVE.demonstration_script(where):
            solve_posture(subtask.goal(seen), 0.15)
