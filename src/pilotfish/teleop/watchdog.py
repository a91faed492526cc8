"""Watchdog of the arm: a controlled stop when the robot's site gives no target any more.

The driver of the arm calls it at its own rate. It knows no session and no network: a target that is too old
is a reason to stop, whatever happened to the process that should have sent the next one.
"""

from dataclasses import dataclass
from types import NoneType

import numpy as np

from pilotfish.teleop.controlled_stop import Braking, TargetMotion, brake
from pilotfish.teleop.delay_contract import SECOND
from pilotfish.teleop.robot_site import MAX_TIME_NS
from pilotfish.teleop.robot_values import RobotTarget
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_type, shorten_repr

MAX_SILENCE = 60_000_000  # ns: three periods of 20 ms


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class WatchedTarget:
    """Target that the arm follows.

    Attributes:
        motion: Pose and velocity.
        grip: Grip, 0 to 1.
        received: When the last target of the robot's site arrived [ns].
        time: Time of this step [ns].
        is_silent: Whether the robot's site is silent, and the arm stops or stands still.
    """

    motion: TargetMotion
    grip: float
    received: int
    time: int
    is_silent: bool = False


def start_watchdog(target: RobotTarget, time_ns: int) -> WatchedTarget:
    """Return the state of an arm at rest.

    Args:
        target: Pose at which the arm stands.
        time_ns: Time on the driver's monotonic clock [ns].

    Raises:
        InvalidInput: If an argument has another type.
    """
    require_type(target, "target", RobotTarget, "step_robot returns one")
    require_count(time_ns, "time_ns", MAX_TIME_NS)
    rest = TargetMotion(target.pose, np.zeros(target.velocity.size))
    return WatchedTarget(rest, target.grip, time_ns, time_ns)


def watch_target(
    before: WatchedTarget,
    time_ns: int,
    target: RobotTarget | None,
    braking: Braking,
    *,
    max_silence: int = MAX_SILENCE,
) -> WatchedTarget:
    """Return what the arm follows at one step of its driver.

    A target that arrives after a silence is followed only if it is near the pose at which the arm stopped;
    otherwise the arm stays, and the robot's site starts from the measured pose when it is armed again.

    Args:
        before: State of the step before.
        time_ns: Time on the driver's monotonic clock [ns].
        target: Target that arrived since the step before; None if none did.
        braking: Decelerations of a controlled stop.
        max_silence: Time without a target after which the arm stops [ns].

    Raises:
        InvalidInput: If an argument has another type.
    """
    require_type(before, "before", WatchedTarget, "start_watchdog makes one")
    require_count(time_ns, "time_ns", MAX_TIME_NS)
    require_type(target, "target", (RobotTarget, NoneType), "step_robot returns one")
    require_type(braking, "braking", Braking, "Braking() makes one")
    require_count(max_silence, "max_silence", MAX_TIME_NS)
    dt = max(time_ns - before.time, 0) / SECOND
    if target is not None and not (before.is_silent and _is_far(before.motion.pose, target.pose)):
        motion = TargetMotion(target.pose, target.velocity)
        return WatchedTarget(motion, target.grip, time_ns, time_ns)
    if not before.is_silent and time_ns - before.received <= max_silence:
        return WatchedTarget(before.motion, before.grip, before.received, time_ns)
    stopping = brake(before.motion, braking, dt)
    return WatchedTarget(stopping, before.grip, before.received, time_ns, is_silent=True)


def _is_far(pose: Float[Array, " 7"], target: Float[Array, " 7"]) -> bool:
    """Return whether a target is more than 2 cm or .1 rad away."""
    distance = float(np.linalg.norm(target[:3] - pose[:3]))
    angle = 2.0 * float(np.arccos(min(1.0, abs(float(pose[3:] @ target[3:])))))
    return distance > 0.02 or angle > 0.1
