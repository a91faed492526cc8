"""Reports of the robot: its state, the session, and which request, stop and command were handled."""

from dataclasses import replace
from zlib import crc32

import numpy as np

from pilotfish.geometry import Pose, normalise
from pilotfish.teleop.delay_contract import SECOND, nanoseconds
from pilotfish.teleop.messages import (
    MAX_FRAMES,
    MAX_MISSION,
    Numbers,
    OutgoingMessage,
    Refusal,
    Report,
    ReportedFrame,
)
from pilotfish.teleop.robot_commands import is_link_lost
from pilotfish.teleop.robot_motion import may_continue
from pilotfish.teleop.robot_site import NOBODY, RobotSite, SentReport
from pilotfish.teleop.robot_values import RobotSettings
from pilotfish.teleop.session import SessionState

STATUS_PERIOD = 0.5  # s
FORGET_AFTER = 1.0  # s after a command that names a report would be stale
UPPER_TRIANGLE = np.triu_indices(6)


def report_state(settings: RobotSettings, site: RobotSite) -> tuple[RobotSite, tuple[OutgoingMessage, ...]]:
    """Return the state and the reports of this step: at their period, and at once when the state changes.

    Args:
        settings: Settings.
        site: State after the motion of this step.
    """
    outgoing: list[OutgoingMessage] = []
    if site.time >= site.next_report:
        number = site.reports[-1].number + 1 if site.reports else 1
        common = _report(site, number)
        outgoing += [OutgoingMessage(peer, _for_peer(site, common, peer)) for peer in settings.peers]
        sent = SentReport(number, site.time, site.scene.reported)
        due = max(site.next_report + nanoseconds(settings.report_period), site.time)
        site = replace(site, reports=_remember(site, sent), next_report=due)
    if site.time >= site.next_status:
        skills = site.skills
        if site.control.holder != NOBODY:
            states = [skills.store.status(name) for name in skills.mission.skills]
            outgoing += [OutgoingMessage(site.control.holder, status) for status in states]
        site = replace(site, next_status=site.time + nanoseconds(STATUS_PERIOD))
    return site, tuple(outgoing)


def _remember(site: RobotSite, sent: SentReport) -> tuple[SentReport, ...]:
    """Return the reports that a command may still name."""
    oldest = site.time - site.control.contract.max_age - nanoseconds(FORGET_AFTER)
    first = 0
    while first < len(site.reports) and site.reports[first].time < oldest:
        first += 1
    return (*site.reports[first:], sent)


def _report(site: RobotSite, number: int) -> Report:
    """Return the report without what differs between the peers."""
    control, commands, motion, robot = site.control, site.commands, site.motion, site.scene.state
    target, last = motion.target, motion.last
    best = int(last.probabilities.argmax()) if last else 0
    return Report(
        number=number,
        state=control.state,
        reason=control.reason,
        mode=motion.assistance.mode,
        refusal=motion.refusal,
        skill=_mission_index(site),
        is_link_lost=control.holder != NOBODY and is_link_lost(site),
        is_authorised=may_continue(site),
        is_plan_moving=_is_plan_moving(site),
        is_clutch_closed=motion.assistance.is_clutch_closed,
        is_limited=motion.is_limited,
        holder=control.holder,
        lease=control.lease,
        request=0,
        request_refusal=Refusal.NONE,
        stop=0,
        mission=site.skills.mission.number,
        command=commands.number,
        command_age=(site.time - commands.arrived) / SECOND,
        loop_age=commands.age / SECOND,
        budget=control.contract.budget / SECOND,
        jitter=control.contract.jitter / SECOND,
        stale=commands.stale,
        pose=_numbers(robot.pose),
        twist=_numbers(robot.twist),
        grip=float(np.clip(robot.grip, 0.0, 1.0)),
        target=_numbers(target.pose[:7]),
        covariance=_numbers(last.covariance[:6, :6][UPPER_TRIANGLE]) if last else (0.0,) * 21,
        authority=last.authority if last else 0.0,
        misalignment=motion.misalignment,
        envelope_left=_time_left(site),
        skill_state=best,
        probability=float(last.probabilities[best]) if last else 0.0,
        frames=_reported_frames(site),
    )


def _is_plan_moving(site: RobotSite) -> bool:
    plan = site.motion.assistance.plan
    return plan is not None and plan.is_moving


def _time_left(site: RobotSite) -> float:
    """Return the time left of an envelope in use [s]."""
    control = site.control
    if control.state is not SessionState.CONTINUING:
        return 0.0
    return max(0.0, control.envelope.duration - (site.time - control.since) / SECOND)


def _for_peer(site: RobotSite, report: Report, peer: int) -> Report:
    number, refusal = site.control.requests.get(peer, (0, Refusal.NONE))
    return replace(report, request=number, request_refusal=refusal, stop=site.control.stops.get(peer, 0))


def _mission_index(site: RobotSite) -> int:
    """Return the index in the mission of the skill in effect; MAX_MISSION without a skill."""
    in_effect = site.motion.assistance.skill
    for number, name in enumerate(site.skills.mission.skills):
        if in_effect and site.skills.prepared.get(name) == in_effect:
            return number
    return MAX_MISSION


def _reported_frames(site: RobotSite) -> tuple[ReportedFrame, ...]:
    poses = site.scene.state.reported or site.scene.state.frames
    if poses is None or site.scene.reported is None:
        return ()
    return tuple(
        ReportedFrame(frame_number(name), _pose_numbers(pose))
        for name, pose in list(poses.items())[:MAX_FRAMES]
    )


def frame_number(name: str) -> int:
    """Return the number that stands for the name of a frame in reports: its CRC-32.

    Args:
        name: Name of the frame.
    """
    return crc32(name.encode())


def _pose_numbers(pose: Pose) -> Numbers:
    return (*pose.position.tolist(), *normalise(pose.quaternion).tolist())


def _numbers(values: np.ndarray) -> Numbers:
    return tuple(values.tolist())
