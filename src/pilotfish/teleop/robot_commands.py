"""Commands of the holder: the newest fresh one is applied, and none is queued.

A command counts if it comes from the holder under the present lease, is newer than the last one, and is
fresh. Fresh: it names a report that the robot sent at most B + J ago, and its own deadline has not passed.
Both are times on the robot's clock. After a pause of the process only the newest command counts.

Late commands that name a new report each time say that the round trip has grown. Late commands that name the
same report say that reports do not arrive at the operator: they soon become stale, and the link is lost.
"""

from dataclasses import replace

from pilotfish.teleop.delay_contract import LATE_REPORTS, nanoseconds
from pilotfish.teleop.messages import CommandMessage, ReceivedMessage
from pilotfish.teleop.robot_requests import apply_event
from pilotfish.teleop.robot_site import NOBODY, RobotSite, find_report
from pilotfish.teleop.session import Event, SessionState

LISTENING = (SessionState.ALIGNING, SessionState.ACTIVE)


def accept_commands(site: RobotSite, received: tuple[ReceivedMessage, ...]) -> RobotSite:
    """Return the state with the newest fresh command of a step.

    Args:
        site: State before.
        received: Messages of authenticated peers.
    """
    control, commands = site.control, site.commands
    candidates = [
        each.message
        for each in received
        if isinstance(each.message, CommandMessage)
        and each.sender == control.holder
        and each.message.lease == control.lease
        and each.message.number > commands.number
    ]
    ages = {command.number: _age(site, command) for command in candidates}
    fresh = [command for command in candidates if ages[command.number] is not None]
    stale = commands.stale + len(candidates) - len(fresh)
    if not fresh:
        return replace(site, commands=replace(commands, stale=stale, is_new=False))
    newest = max(fresh, key=lambda command: command.number)
    age = ages[newest.number]
    assert age is not None
    is_other = commands.last is None or newest.report != commands.last.report
    late = commands.late + is_other if age > control.contract.budget else 0
    commands = replace(
        commands,
        last=newest,
        number=newest.number,
        arrived=site.time,
        age=age,
        late=late,
        stale=stale,
        is_new=True,
    )
    return replace(site, commands=commands)


def _age(site: RobotSite, command: CommandMessage) -> int | None:
    """Return the age of a command [ns]; None if it is stale."""
    report = find_report(site, command.report)
    if report is None:
        return None
    age = site.time - report.time
    is_fresh = age <= site.control.contract.max_age and age <= nanoseconds(command.valid)
    return age if is_fresh else None


def is_link_lost(site: RobotSite) -> bool:
    """Return whether no command was accepted for too long.

    Args:
        site: State of the robot site.
    """
    return site.time - site.commands.arrived > site.control.contract.loss_after


def watch_commands(site: RobotSite, may_continue: bool) -> RobotSite:
    """Return the state after what the commands say, or their absence.

    Args:
        site: State with the commands of this step.
        may_continue: Whether the envelope permits to continue alone.
    """
    control, commands = site.control, site.commands
    if control.holder == NOBODY:
        return site
    if commands.is_new and commands.last and not commands.last.is_dead_man_pressed:
        return apply_event(site, Event.DEAD_MAN_RELEASED)
    if control.state in LISTENING and is_link_lost(site):
        return apply_event(site, Event.LINK_LOST_AUTHORISED if may_continue else Event.LINK_LOST)
    if control.state in LISTENING and commands.late >= LATE_REPORTS:
        exceeded = Event.ROUND_TRIP_EXCEEDED_AUTHORISED if may_continue else Event.ROUND_TRIP_EXCEEDED
        return apply_event(site, exceeded)
    return site
