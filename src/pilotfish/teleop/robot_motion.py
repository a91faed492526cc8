"""Motion of the target in each state of the session.

    ACTIVE       the assistance, with the last command of the operator
    CONTINUING   autonomous control inside the envelope
    elsewhere    a controlled stop, then rest

In ALIGNING the assistance computes where the hand would move the robot, and the robot stays. It is aligned
when the hand is at the robot, by itself or as corrected, and at rest. The motion that follows begins with a
blend. Limits of the target are those of the assistance, except that a
controlled stop brakes along the present path.
"""

from dataclasses import replace

import numpy as np

from pilotfish import kernels
from pilotfish.assistance import (
    AssistanceState,
    Command,
    Target,
    misalignment,
    rest_target,
    step_assistance,
)
from pilotfish.geometry import log_map
from pilotfish.teleop.controlled_stop import TargetMotion, brake, stopping_point
from pilotfish.teleop.delay_contract import SECOND, allows_mode, nanoseconds
from pilotfish.teleop.messages import CommandMessage, Refusal
from pilotfish.teleop.robot_commands import is_link_lost
from pilotfish.teleop.robot_requests import apply_event, skill_refusal
from pilotfish.teleop.robot_site import Motion, RobotSite, find_report
from pilotfish.teleop.robot_values import RobotSettings
from pilotfish.teleop.session import Event, SessionState

MIN_STEP, SETTLED = 1e-6, 1e-3  # s; change of the authority in one step
BEHIND = 0.01  # m: a target that is farther from the desired pose is limited


def move_target(settings: RobotSettings, site: RobotSite, elapsed: int) -> RobotSite:
    """Return the state with the target of this step.

    Args:
        settings: Settings.
        site: State after the events of this step.
        elapsed: Time since the last step [ns].
    """
    dt = min(max(elapsed / SECOND, MIN_STEP), settings.max_step)
    state = site.control.state
    if state is SessionState.ACTIVE:
        return _follow_operator(settings, site, dt)
    if state is SessionState.CONTINUING:
        return _continue_alone(settings, site, dt)
    if state is SessionState.ALIGNING:
        return _align(settings, site, dt)
    return _rest(settings, site, dt)


def may_continue(site: RobotSite) -> bool:
    """Return whether the robot may continue alone if the link drops now.

    Args:
        site: State of the robot site.
    """
    control, assistance = site.control, site.motion.assistance
    skill = site.skills.assistant.skills[assistance.skill]
    if control.state is SessionState.CONTINUING:
        return True
    return (
        control.state is SessionState.ACTIVE
        and control.envelope.duration > 0.0
        and assistance.mode in control.envelope.modes
        and assistance.skill > 0
        and skill.can_plan
        and (assistance.plan is None or assistance.plan.is_moving)
    )


def _follow_operator(settings: RobotSettings, site: RobotSite, dt: float) -> RobotSite:
    command = site.commands.last
    assert command is not None
    assistance, target, refusal = _step_command(settings, site, site.motion.assistance, command, dt)
    if not allows_mode(settings.contract, site.control.contract, assistance.mode):
        return _wait_for_mode(settings, site, refusal, dt)
    motion = TargetMotion(target.pose, target.velocity)
    is_limited = _is_limited(settings, assistance)
    return replace(site, motion=Motion(assistance, motion, target, (0.0, 0.0), refusal, is_limited))


def _wait_for_mode(settings: RobotSettings, site: RobotSite, refusal: Refusal, dt: float) -> RobotSite:
    """Return the state at rest: the mode that was refused would leave one that is not allowed either.

    Rest is direct control for the assistance. An operator who asks for direct control right after aligning in
    another mode must not get it beyond its budget.
    """
    target = brake(site.motion.target, settings.braking, dt)
    assistance = rest_target(site.skills.assistant, site.motion.assistance, target.pose)
    motion = replace(site.motion, assistance=assistance, target=target, refusal=refusal)
    return replace(site, motion=motion)


def _is_limited(settings: RobotSettings, assistance: AssistanceState) -> bool:
    """Return whether speed or workspace keep the target from the desired pose."""
    memory, limits = assistance.memory, settings.limits
    at_wall = (memory.desired[:3] <= limits.lower) | (memory.desired[:3] >= limits.upper)
    behind = memory.desired[:3] - memory.pose[:3]
    return bool(at_wall.any()) or float(np.sqrt(behind @ behind)) > BEHIND


def _step_command(
    settings: RobotSettings, site: RobotSite, before: AssistanceState, command: CommandMessage, dt: float
) -> tuple[AssistanceState, Target, Refusal]:
    """Return state and target of the assistance, and why mode or skill are not those of the command."""
    assistant, index = site.skills.assistant, site.skills.index(command.skill)
    mode, refusal = command.mode, Refusal.NONE
    if not allows_mode(settings.contract, site.control.contract, mode):
        mode, refusal = before.mode, Refusal.MODE_NOT_ALLOWED
    elif mode != "direct" and index is None:
        mode, refusal = before.mode, skill_refusal(site, command.skill)
    wanted = before.skill if index is None or refusal is not Refusal.NONE else index
    report, hand = find_report(site, command.report), np.array(command.pose)
    if assistant.layout.width > len(hand):
        hand = np.append(hand, command.grip)
    after, target = step_assistance(
        assistant,
        before,
        Command(hand, mode, command.is_clutch_closed, wanted),
        report.frames if report else None,
        site.scene.actual,
        dt,
    )
    if refusal is Refusal.NONE and after.skill != wanted:
        refusal = Refusal.FRAMES_STALE
    elif refusal is Refusal.NONE and after.mode != mode:
        refusal = Refusal.NOT_POSSIBLE
    return after, target, refusal


def _align(settings: RobotSettings, site: RobotSite, dt: float) -> RobotSite:
    """Return the state at rest, or active if the operator's hand is at the robot."""
    motion, command = brake(site.motion.target, settings.braking, dt), site.commands.last
    assistant = site.skills.assistant
    if command is None or motion.velocity.any():
        return replace(site, motion=replace(site.motion, target=motion))
    held = rest_target(assistant, site.motion.assistance, motion.pose)
    assistance, target, refusal = _step_command(settings, site, held, command, dt)
    is_aligned, offset = _compare_hand(settings, site, held, assistance, command)
    after = rest_target(assistant, assistance, motion.pose)
    site = replace(site, motion=Motion(after, motion, target, offset, refusal))
    if refusal is Refusal.NONE and is_aligned and not is_link_lost(site):
        return apply_event(site, Event.ALIGNED)
    return site


def _compare_hand(
    settings: RobotSettings,
    site: RobotSite,
    before: AssistanceState,
    after: AssistanceState,
    command: CommandMessage,
) -> tuple[bool, tuple[float, float]]:
    """Return whether the hand is at the robot and at rest, and the distance [m] and angle [rad] between them.

    The hand is at the robot if its command is, or the command that the skill corrected: an operator who sees
    displaced objects holds the hand elsewhere. The latter counts when the authority has settled. Before, the
    hand may be far away and look near.
    """
    memory, assistant = after.memory, site.skills.assistant
    v = log_map(memory.command, before.memory.pose, assistant.layout.orientation_starts)
    limits, hand = settings.alignment, (float(np.linalg.norm(v[:3])), float(np.linalg.norm(v[3:6])))
    corrected = misalignment(assistant, after)
    is_settled = abs(memory.authority - before.memory.authority) < SETTLED
    near = [
        distance <= limits.distance and angle <= limits.angle
        for distance, angle in (hand, corrected)[: 1 + is_settled]
    ]
    is_at_rest = float(np.linalg.norm(command.twist[:3])) <= limits.hand_speed
    return any(near) and is_at_rest and command.is_clutch_closed, min(hand, corrected)


def _continue_alone(settings: RobotSettings, site: RobotSite, dt: float) -> RobotSite:
    """Return the state after a step without operator, or braking at the edge of the envelope."""
    site = _resume(settings, site, dt)
    if site.control.state is SessionState.ACTIVE:
        return _follow_operator(settings, site, dt)
    assistance, control = site.motion.assistance, site.control
    if site.time - control.since > nanoseconds(control.envelope.duration):
        return _rest(settings, apply_event(site, Event.ENVELOPE_TIME_OVER), dt)
    if site.time - site.scene.perceived > nanoseconds(settings.max_frame_age):
        return _rest(settings, apply_event(site, Event.PERCEPTION_LOST), dt)
    command = Command(assistance.memory.command, "autonomous", False, assistance.skill)
    actual = site.scene.actual
    after, target = step_assistance(site.skills.assistant, assistance, command, actual, actual, dt)
    event = _leaves_envelope(settings, site, after, target)
    if event is not None:
        return _rest(settings, apply_event(site, event), dt)
    motion = TargetMotion(target.pose, target.velocity)
    return replace(site, motion=replace(site.motion, assistance=after, target=motion, last=target))


def _leaves_envelope(
    settings: RobotSettings, site: RobotSite, after: AssistanceState, target: Target
) -> Event | None:
    """Return the event of a target that ends the motion without operator; None if it may continue."""
    envelope, plan = site.control.envelope, after.plan
    if target.mode != "autonomous" or plan is None:
        return Event.PLAN_ENDED
    end = stopping_point(TargetMotion(target.pose, target.velocity), settings.braking)
    points = np.stack([target.pose[:3], end])
    if (points < envelope.lower).any() or (points > envelope.upper).any():
        return Event.ENVELOPE_VOLUME_LEFT
    scalars = target.pose.size - 7
    # The step was given the actual frames for both scenes, so that this is the distance in the actual one.
    if kernels.coverage_distance(after.situation.carried, target.pose, scalars) > envelope.max_distance:
        return Event.ENVELOPE_LIKELIHOOD_LOW
    is_at_rest = not target.velocity[:3].any() or float(np.linalg.norm(target.velocity)) < 1e-3
    return None if plan.is_moving or not is_at_rest else Event.PLAN_ENDED


def _resume(settings: RobotSettings, site: RobotSite, dt: float) -> RobotSite:
    """Return the state with the operator in control again, if armed again and aligned."""
    command = site.commands.last
    if not site.control.is_rearmed or command is None or is_link_lost(site):
        return site
    assistant, assistance = site.skills.assistant, site.motion.assistance
    if command.mode == "autonomous":
        return apply_event(site, Event.ALIGNED)
    held = rest_target(assistant, assistance, site.motion.target.pose)
    trial, _, refusal = _step_command(settings, site, held, command, dt)
    is_aligned, offset = _compare_hand(settings, site, held, trial, command)
    site = replace(site, motion=replace(site.motion, misalignment=offset, refusal=refusal))
    return apply_event(site, Event.ALIGNED) if is_aligned and refusal is Refusal.NONE else site


def _rest(settings: RobotSettings, site: RobotSite, dt: float) -> RobotSite:
    """Return the state after a step of the controlled stop; a disarmed robot may be moved by others."""
    target, robot = brake(site.motion.target, settings.braking, dt), site.scene.state
    if site.control.state is SessionState.DISARMED and robot.is_usable:
        measured = np.append(robot.pose, target.pose[7:])
        starts = site.skills.assistant.layout.orientation_starts
        offset = log_map(target.pose, measured, starts)
        limits = settings.alignment
        if np.linalg.norm(offset[:3]) > limits.distance or np.linalg.norm(offset[3:6]) > limits.angle:
            target = TargetMotion(measured, np.zeros_like(target.velocity))
    return replace(site, motion=replace(site.motion, target=target))
