"""A tool path becomes joint positions at 500 Hz that follow it, or is refused with time and factor."""

import numpy as np
import pytest

from pilotfish.environments.robots import ROBOTS, joint_trajectory
from pilotfish.errors import InvalidInput

ARMS = ("baxter", "panda", "ur5e")
PERIOD = 0.1


def arc(length: int = 31, radius: float = 0.08) -> np.ndarray:
    """Return a circle of the tool, pointing down, in the middle of the tasks' objects."""
    angles = np.linspace(0.0, 2.0 * np.pi, length)
    rows = np.tile([0.62, -0.32, 0.15, 0.0, 0.0, 1.0, 0.0], (length, 1))
    rows[:, 0] += radius * np.cos(angles)
    rows[:, 1] += radius * np.sin(angles)
    return rows


@pytest.mark.parametrize("name", ARMS)
def test_joints_follow_the_path_within_limits(name):
    robot, rows = ROBOTS[name], arc()
    motion = joint_trajectory(robot, rows, PERIOD)
    assert motion.joint_names == robot.joint_names
    np.testing.assert_allclose(np.diff(motion.times), 0.002, atol=1e-9)
    assert motion.times[-1] == pytest.approx(3.0)
    tools = robot.chain.tool_poses(motion.q[::50])
    np.testing.assert_allclose(tools[:, :3], rows[:, :3], atol=1e-3)
    dots = np.abs(np.sum(tools[:, 3:] * rows[:, 3:], axis=1))
    assert dots.min() > 1.0 - 1e-6
    assert (abs(motion.velocity) <= robot.limits.velocity).all()
    assert 5e-4 < motion.max_deviation < 3e-3  # the chord of the circle, and the start at full speed


def test_velocity_is_the_derivative_and_zero_at_both_ends():
    motion = joint_trajectory(ROBOTS["ur5e"], arc(), PERIOD)
    difference = (motion.q[2:] - motion.q[:-2]) / 0.004
    np.testing.assert_allclose(motion.velocity[1:-1], difference, atol=2e-3)
    np.testing.assert_allclose(motion.velocity[[0, -1]], 0.0, atol=1e-9)


def test_redundant_arm_returns_to_its_first_posture():
    motion = joint_trajectory(ROBOTS["panda"], arc(), PERIOD)
    np.testing.assert_allclose(motion.q[-1], motion.q[0], atol=1e-3)


def test_rate_is_that_of_the_controller():
    assert len(joint_trajectory(ROBOTS["ur5e"], arc(), PERIOD, controller_period=0.008).times) == 376


def test_motion_too_fast_is_refused_with_the_factor_that_suffices():
    robot = ROBOTS["ur5e"]
    with pytest.raises(InvalidInput, match=r"make period (.*) times as long") as refused:
        joint_trajectory(robot, arc(), 0.001)
    factor = float(str(refused.value).split("make period ")[1].split()[0])
    joint_trajectory(robot, arc(), 0.001 * factor * 1.01)
    with pytest.raises(InvalidInput, match="times as long"):
        joint_trajectory(robot, arc(), 0.001 * factor * 0.98)


def test_row_out_of_reach_is_refused_with_time_and_distance():
    rows = arc()
    rows[20:, 0] += 2.0
    with pytest.raises(InvalidInput, match=r"panda does not reach row 20 of poses \(at 2.00 s\).* m and"):
        joint_trajectory(ROBOTS["panda"], rows, PERIOD)


LONG = np.tile(arc(), (40, 1))
BAD = {
    "one row": ({"poses": arc()[:1]}, "expected .S, 7."),
    "eight columns": ({"poses": np.ones((5, 8))}, "expected .S, 7."),
    "nan": ({"poses": np.where(arc() > 0.6, np.nan, arc())}, "poses"),
    "zero quaternion": ({"poses": arc() * [1, 1, 1, 0, 0, 0, 0]}, "quaternion of length 0"),
    "no period": ({"period": 0.0}, "period"),
    "no controller period": ({"controller_period": np.inf}, "controller_period"),
    "too many samples": ({"period": 10.0, "controller_period": 1e-4, "poses": LONG}, "enlarge"),
    "other robot": ({"robot": "panda"}, "robot"),
    "start of another arm": ({"start": np.zeros(3)}, "start"),
    "tool": ({"tool_length": -1.0}, "tool_length"),
}  # fmt: skip


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize("case", sorted(BAD))
def test_bad_argument_is_refused(case):
    change, message = BAD[case]
    arguments = {"robot": ROBOTS["ur5e"], "poses": arc(), "period": PERIOD} | change
    with pytest.raises(InvalidInput, match=message):
        joint_trajectory(**arguments)
