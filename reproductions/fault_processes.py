"""Faults R9 to R11 of processes, each as a function of a seed.

An empty list means that the fault was survived.
"""

import numpy as np
from fault_rig import PERIOD, PERIOD_NS, ROUNDING, SECOND, Pilot, Rig

from pilotfish import teleop
from pilotfish.teleop import LinkSettings, Reason, SessionState

MODES_OF_HAND = ("direct", "shared")
DRIVER_NS = 5_000_000  # ns between two steps of the arm's driver


def killed_operator(seed: int) -> list[str]:
    """R9: the operator's process is killed, and another one starts 5 s later."""
    rng = np.random.default_rng(seed)
    delay, jitter = rng.uniform(0.0, 0.5), rng.uniform(0.1, 0.5)
    link = LinkSettings(delay=delay)
    pilot = Pilot(str(rng.choice(MODES_OF_HAND)))
    rig = Rig(rng, [pilot], forward=link, backward=link, budget=2.0 * delay + 0.1, jitter=jitter)
    rig.run_until_active()
    rig.run(rng.uniform(0.5, 3.0))
    for _ in range(250):
        rig.step_robot()
        rig.session.operators[1].backward.receive(rig.time_ns)
        rig.time_ns += PERIOD_NS
    held = next((row for row in rig.rows if row.reason is Reason.LINK_LOST), None)
    last = max(b.time for a, b in zip(rig.rows, rig.rows[1:], strict=False) if b.command > a.command)
    rig.require(held is not None and held.time - last <= jitter + 3.0 * PERIOD + ROUNDING, "declared late")
    rig.require(rig.control is SessionState.HOLD, f"the robot is in {rig.control.name}")
    stood, lease = rig.pose.copy(), rig.session.site.control.lease
    rig.session.operators[1].restart()
    rig.views[1], rig.pilots[1] = teleop.start_view(), Pilot(pilot.mode, is_arming=False)
    rig.run(3.0 + 4.0 * delay)
    rig.require((rig.pose == stood).all(), "moved for a process that did not arm")
    rig.pilots[1].is_arming = True
    rig.run_until_active()
    rig.require(rig.session.site.control.lease >= lease, "the lease went back")
    return rig.broken


def killed_robot(seed: int) -> list[str]:
    """R10: the robot's process is killed; the watchdog stops the arm, and the new process is disarmed."""
    rng = np.random.default_rng(seed)
    delay = rng.uniform(0.0, 0.5)
    link = LinkSettings(delay=delay)
    pilot = Pilot(str(rng.choice([*MODES_OF_HAND, "autonomous"])))
    rig = Rig(rng, [pilot], forward=link, backward=link, budget=2.0 * delay + 0.1)
    rig.run_until_active()
    rig.run(rng.uniform(0.5, 3.0))
    motion = rig.session.site.motion.target
    target = teleop.RobotTarget(motion.pose, motion.velocity, 0.0)
    arm = teleop.watch_target(
        teleop.start_watchdog(target, rig.time_ns), rig.time_ns, target, rig.settings.braking
    )
    died, stopped, speeds = rig.time_ns, None, [float(np.linalg.norm(motion.velocity[:3]))]
    while rig.time_ns < died + 2 * SECOND:
        rig.time_ns += DRIVER_NS
        arm = teleop.watch_target(arm, rig.time_ns, None, rig.settings.braking)
        if arm.is_silent:
            speeds.append(float(np.linalg.norm(arm.motion.velocity[:3])))
        if arm.is_silent and stopped is None and not arm.motion.velocity.any():
            stopped = rig.time_ns
    fall = -np.diff(speeds) / (DRIVER_NS / SECOND)
    rig.require(stopped is not None and stopped - died <= 0.3 * SECOND, "the arm moves after .3 s")
    rig.require(bool((fall <= 2.0 + 1e-6).all()), f"the arm brakes at {fall.max():.2f} m/s^2")
    rig.pose = arm.motion.pose[:7].copy()
    rig.twist = np.zeros(6)
    old = rig.session.site.commands.number
    rig.session.restart_robot(rig.time_ns, rig.sense())
    pilot.is_arming = False
    for _ in range(200):
        rig.step()
    control = rig.session.site.control
    rig.require(control.state is SessionState.DISARMED, f"started in {control.state.name}")
    rig.require(rig.session.site.commands.number == 0 < old, "a command of the old epoch was applied")
    rig.require((rig.pose == arm.motion.pose[:7]).all(), "moved before it was armed")
    pilot.is_arming = True
    rig.run_until_active()
    return rig.broken


def frozen_robot(seed: int) -> list[str]:
    """R11: the robot's process is frozen for 3 s, while commands arrive."""
    rng = np.random.default_rng(seed)
    delay = rng.uniform(0.0, 0.5)
    link = LinkSettings(delay=delay)
    pilot = Pilot(str(rng.choice(MODES_OF_HAND)))
    rig = Rig(rng, [pilot], forward=link, backward=link, budget=2.0 * delay + 0.1)
    rig.run_until_active()
    rig.run(rng.uniform(0.5, 3.0))
    before = rig.rows[-1]
    for _ in range(150):
        rig.step_operators()
        rig.time_ns += PERIOD_NS
    rig.step()
    after = rig.rows[-1]
    moved = float(np.linalg.norm(after.pose[:3] - before.pose[:3]))
    longest = rig.settings.limits.speed * rig.settings.max_step
    rig.require(moved <= longest + ROUNDING, f"the target moved by {1000.0 * moved:.1f} mm in the first step")
    commands = [each for each in rig.session.received if isinstance(each.message, teleop.CommandMessage)]
    rig.require(len(commands) > 100, "the commands did not wait")
    rig.run(1.0)
    return rig.broken


def frozen_operator(seed: int) -> list[str]:
    """R11: the operator's process is frozen for 3 s, then continues with old reports."""
    rng = np.random.default_rng(seed)
    delay = rng.uniform(0.0, 0.5)
    link = LinkSettings(delay=delay)
    pilot = Pilot(str(rng.choice(MODES_OF_HAND)))
    rig = Rig(rng, [pilot], forward=link, backward=link, budget=2.0 * delay + 0.1)
    rig.run_until_active()
    rig.run(rng.uniform(0.5, 3.0))
    pilot.is_arming = False
    for _ in range(150):
        rig.step_robot()
        rig.time_ns += PERIOD_NS
    rig.require(rig.control is SessionState.HOLD, f"the robot is in {rig.control.name}")
    stood = rig.pose.copy()
    rig.run(2.0)
    rig.require((rig.pose == stood).all(), "moved before it was armed")
    return rig.broken


SCENARIOS = {
    "R9": killed_operator,
    "R10": killed_robot,
    "R11, robot": frozen_robot,
    "R11, operator": frozen_operator,
}
