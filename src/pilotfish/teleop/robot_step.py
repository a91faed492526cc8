"""One step of the robot site, a pure function of state, time, messages and what the robot senses.

    messages -> stops, requests, skills, commands -> session -> motion -> reports

The order matters: a stop takes effect in the step in which it arrives, before any command. Time is that of
the robot's monotonic clock; no other clock enters. Nothing that arrives can raise an exception.
"""

from dataclasses import dataclass, replace

from pilotfish.teleop.messages import OutgoingMessage, ReceivedMessage, require_received
from pilotfish.teleop.robot_commands import accept_commands, watch_commands
from pilotfish.teleop.robot_motion import may_continue, move_target
from pilotfish.teleop.robot_reports import report_state
from pilotfish.teleop.robot_requests import apply_event, apply_requests, apply_stops, update_connections
from pilotfish.teleop.robot_site import MAX_TIME_NS, RobotSite
from pilotfish.teleop.robot_skills import prepare_skills, receive_skills, update_scene
from pilotfish.teleop.robot_values import RobotSettings, RobotState, RobotTarget
from pilotfish.teleop.session import Event
from pilotfish.validation import require_count, require_type, shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RobotStep:
    """Result of a step.

    Attributes:
        site: State for the next step.
        outgoing: Messages to be sent.
        target: What the arm controller shall do until the next step.
    """

    site: RobotSite
    outgoing: tuple[OutgoingMessage, ...]
    target: RobotTarget


def step_robot(
    settings: RobotSettings,
    site: RobotSite,
    time_ns: int,
    received: tuple[ReceivedMessage, ...],
    robot: RobotState,
) -> RobotStep:
    """Return the next state, the messages to be sent and the target of the arm.

    Args:
        settings: Settings.
        site: State of the step before.
        time_ns: Time on the robot's monotonic clock [ns]; a time before the last one counts as the last one.
        received: Messages of authenticated peers, in the order of their arrival.
        robot: What the robot senses now.

    Raises:
        InvalidInput: If an argument has another type. Messages and what the robot senses are not refused.

    Source:
        Specification of the runtime: delay contract, state machine and faults of docs/teleoperation.md.
    """
    require_type(settings, "settings", RobotSettings, "RobotSettings(decode_skill) makes one")
    require_type(site, "site", RobotSite, "start_robot makes one")
    require_type(robot, "robot", RobotState, "RobotState(pose, twist, grip, frames) makes one")
    require_received(received)
    time_ns = max(require_count(time_ns, "time_ns", MAX_TIME_NS, minimum=-MAX_TIME_NS), site.time)
    elapsed, site = time_ns - site.time, replace(site, time=time_ns)
    before = site.control.state
    received = tuple(each for each in received if each.sender in settings.peers)
    site, received = update_connections(site, received)
    site = apply_stops(site, received)
    if not robot.is_usable:
        site = apply_event(site, Event.PERCEPTION_LOST)
        robot = replace(site.scene.state, frames=robot.frames, reported=robot.reported)
    scene = update_scene(site.skills.assistant, site.scene, robot, time_ns)
    site = replace(site, scene=scene)
    site = accept_commands(site, received)
    site = receive_skills(settings, site, received)
    site = prepare_skills(site)
    site = apply_requests(settings, site, received)
    site = watch_commands(site, may_continue(site))
    site = move_target(settings, site, elapsed)
    if site.control.state is not before:
        site = replace(site, next_report=time_ns)
    site, outgoing = report_state(settings, site)
    target, grip = site.motion.target, robot.grip
    if target.pose.size > 7:
        grip = float(min(max(target.pose[7], 0.0), 1.0))
    return RobotStep(site, outgoing, RobotTarget(target.pose[:7], target.velocity[:6], grip))
