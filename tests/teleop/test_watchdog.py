"""The watchdog stops the arm at a constant deceleration when targets stop, and not before."""

import numpy as np

from pilotfish.teleop import Braking, RobotTarget, start_watchdog, watch_target

MS = 1_000_000


def target(x: float, speed: float = 0.0) -> RobotTarget:
    pose = np.array([x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    return RobotTarget(pose, np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]), 0.5)


def test_watch_target_silence_stops_after_three_periods_at_two_metres_per_second_squared():
    arm = start_watchdog(target(0.0), 0)
    for n in range(1, 20):
        arm = watch_target(arm, 20 * n * MS, target(0.004 * n, 0.2), Braking())
    last, x = arm.time, arm.motion.pose[0]
    positions = []
    for n in range(1, 301):
        arm = watch_target(arm, last + n * MS, None, Braking())
        positions.append(arm.motion.pose[0])
        assert arm.is_silent == (n > 60)
    assert not arm.motion.velocity.any()
    np.testing.assert_allclose(positions[59], x)
    np.testing.assert_allclose(positions[-1] - x, 0.2**2 / (2 * 2.0), rtol=0.02)
    assert positions[60 + 101] == positions[-1]
    assert arm.grip == 0.5


def test_watch_target_after_silence_follows_near_targets_only():
    arm = start_watchdog(target(0.0), 0)
    arm = watch_target(arm, 100 * MS, None, Braking())
    assert arm.is_silent
    far = watch_target(arm, 101 * MS, target(0.1), Braking())
    assert far.is_silent
    assert far.motion.pose[0] == 0.0
    near = watch_target(arm, 101 * MS, target(0.01), Braking())
    assert not near.is_silent
    assert near.motion.pose[0] == 0.01
