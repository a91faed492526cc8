"""Requests of the peers: control, arming, stop and reset.

Exactly one operator holds control, under a numbered lease. Observers may stop the robot and nothing else. A
request or a stop is handled once, whatever is repeated or reordered: its number must be larger than the last
one of the peer in its connection.
"""

from collections.abc import Callable
from dataclasses import replace

from pilotfish.teleop.delay_contract import agree, allows_mode, nanoseconds
from pilotfish.teleop.messages import (
    NO_ENVELOPE,
    Envelope,
    ReceivedMessage,
    Refusal,
    Request,
    SkillState,
    Stop,
)
from pilotfish.teleop.robot_site import NOBODY, AcceptedCommands, RobotSite
from pilotfish.teleop.robot_values import RobotSettings
from pilotfish.teleop.session import (
    CLEARING_ACTIONS,
    MOVING,
    Action,
    Event,
    SessionState,
    next_state,
)

SKILL_REFUSALS = {  # of skills that are not prepared; READY ones lack their frames
    SkillState.MISSING: Refusal.SKILL_MISSING,
    SkillState.PARTIAL: Refusal.SKILL_MISSING,
    SkillState.READY: Refusal.FRAMES_STALE,
}
Handler = Callable[[RobotSettings, RobotSite, int, Request], RobotSite | Refusal]


def apply_event(site: RobotSite, event: Event) -> RobotSite:
    """Return the state after an event of the session.

    Args:
        site: State before.
        event: Event.
    """
    control = site.control
    state, reason = next_state(control.state, control.reason, event)
    if state is control.state and reason is control.reason:
        return site
    control = replace(
        control, state=state, reason=reason, is_rearmed=control.is_rearmed and state is control.state
    )
    if state is not site.control.state:
        control = replace(control, since=site.time, first_report=_next_report(site))
    return replace(site, control=control)


def _next_report(site: RobotSite) -> int:
    return site.reports[-1].number + 1 if site.reports else 1


def update_connections(
    site: RobotSite, received: tuple[ReceivedMessage, ...]
) -> tuple[RobotSite, tuple[ReceivedMessage, ...]]:
    """Return the state with the connection of each peer, and the messages that belong to them.

    A peer that starts again counts from 1 again. What arrives late from its former connection is left out,
    unless it is a stop.

    Args:
        site: State before.
        received: Messages of authenticated peers.
    """
    for each in received:
        control = site.control
        if each.connection <= control.connections.get(each.sender, -1):
            continue
        control = replace(
            control,
            connections={**control.connections, each.sender: each.connection},
            requests={**control.requests, each.sender: (0, Refusal.NONE)},
            stops={**control.stops, each.sender: 0},
        )
        site = replace(site, control=control)
        if each.sender == control.holder:
            mission = replace(site.skills.mission, number=0)
            skills = replace(site.skills, mission=mission)
            site = replace(site, skills=skills, commands=replace(site.commands, number=0))
    current = site.control.connections
    return site, tuple(
        each for each in received if each.connection == current[each.sender] or isinstance(each.message, Stop)
    )


def apply_stops(site: RobotSite, received: tuple[ReceivedMessage, ...]) -> RobotSite:
    """Return the state after the stops of a step, of whatever peer; a reset must know of the last of them.

    Args:
        site: State before.
        received: Messages of authenticated peers.
    """
    for each in received:
        if isinstance(each.message, Stop):
            control, number = site.control, each.message.number
            if number > control.stops.get(each.sender, 0):
                control = replace(control, stops={**control.stops, each.sender: number})
                site = apply_event(replace(site, control=control), Event.STOP)
                control = replace(site.control, first_report=_next_report(site))
                site = replace(site, control=control)
    return site


def apply_requests(
    settings: RobotSettings, site: RobotSite, received: tuple[ReceivedMessage, ...]
) -> RobotSite:
    """Return the state after the requests of a step, in the order of their numbers.

    Args:
        settings: Settings.
        site: State before.
        received: Messages of authenticated peers.
    """
    requests = [(each.sender, each.message) for each in received if isinstance(each.message, Request)]
    for sender, request in sorted(requests, key=lambda pair: pair[1].number):
        last, _ = site.control.requests.get(sender, (0, Refusal.NONE))
        if request.number > last:
            after = _handle(settings, site, sender, request)
            refusal = after if isinstance(after, Refusal) else Refusal.NONE
            site = site if isinstance(after, Refusal) else after
            handled = {**site.control.requests, sender: (request.number, refusal)}
            site = replace(site, control=replace(site.control, requests=handled))
    return site


def _handle(settings: RobotSettings, site: RobotSite, sender: int, request: Request) -> RobotSite | Refusal:
    if sender not in settings.operators:
        return Refusal.NOT_OPERATOR
    is_holder, is_free = sender == site.control.holder, site.control.holder == NOBODY
    may_act = is_holder or (is_free and request.action is Action.RESET)
    if request.action is not Action.ACQUIRE and not may_act:
        return Refusal.NOT_HOLDER
    return HANDLERS[request.action](settings, site, sender, request)


def _acquire(settings: RobotSettings, site: RobotSite, sender: int, request: Request) -> RobotSite | Refusal:
    control = site.control
    is_silent = site.time - site.commands.arrived > nanoseconds(settings.lease_timeout)
    if control.holder not in (NOBODY, sender) and not is_silent:
        return Refusal.HELD
    if control.state in MOVING:
        return Refusal.WRONG_STATE if control.holder == sender else Refusal.HELD
    contract = agree(settings.contract, request.budget, request.jitter, control.contract.period)
    if contract is None:
        return Refusal.BUDGET
    control = replace(
        control, holder=sender, lease=control.lease + 1, contract=contract, envelope=NO_ENVELOPE
    )
    number = site.commands.number if control.holder == site.control.holder else 0
    commands = AcceptedCommands(None, number, site.time, stale=site.commands.stale)
    return apply_event(replace(site, control=control, commands=commands), Event.ACQUIRED)


def _release(settings: RobotSettings, site: RobotSite, sender: int, request: Request) -> RobotSite:
    del settings, sender, request
    site = apply_event(site, Event.LEASE_RELEASED)
    control = replace(site.control, holder=NOBODY, lease=site.control.lease + 1, envelope=NO_ENVELOPE)
    return replace(site, control=control, commands=replace(site.commands, last=None))


def _arm(settings: RobotSettings, site: RobotSite, sender: int, request: Request) -> RobotSite | Refusal:
    del sender, request
    control, last = site.control, site.commands.last
    if control.state is SessionState.HOLD and CLEARING_ACTIONS[control.reason] is not Action.ARM:
        return Refusal.WRONG_STATE
    if control.state in (SessionState.STOPPED, SessionState.ACTIVE):
        return Refusal.WRONG_STATE
    if last is None or site.time - site.commands.arrived > control.contract.loss_after:
        return Refusal.DEAD_MAN_OPEN
    if not last.is_dead_man_pressed:
        return Refusal.DEAD_MAN_OPEN
    if not _knows_state(site):
        return Refusal.STATE_UNKNOWN
    if not allows_mode(settings.contract, control.contract, last.mode):
        return Refusal.MODE_NOT_ALLOWED
    if last.mode != "direct" and (refusal := skill_refusal(site, last.skill)) is not Refusal.NONE:
        return refusal
    if control.state is SessionState.CONTINUING:
        return replace(site, control=replace(control, is_rearmed=True))
    return apply_event(site, Event.ARM)


def _knows_state(site: RobotSite) -> bool:
    """Return whether the holder's last command names a report of the present state.

    A request that was sent before a stop or a hold, and arrives after it, must not clear it. Without a
    holder, a report must have been sent.
    """
    last, first = site.commands.last, site.control.first_report
    if site.control.holder == NOBODY:
        return bool(site.reports) and site.reports[-1].number >= first
    return last is not None and first <= last.report <= site.reports[-1].number


def skill_refusal(site: RobotSite, number: int) -> Refusal:
    """Return why a skill of the mission cannot be used; NONE if it can.

    Args:
        site: State of the robot site.
        number: Index of the skill in the mission.
    """
    if site.skills.index(number) is not None:
        return Refusal.NONE
    mission = site.skills.mission.skills
    if number >= len(mission):
        return Refusal.SKILL_MISSING
    state = site.skills.store.status(mission[number]).state
    return SKILL_REFUSALS.get(state, Refusal.SKILL_UNUSABLE)


def _disarm(settings: RobotSettings, site: RobotSite, sender: int, request: Request) -> RobotSite:
    del settings, sender, request
    return apply_event(site, Event.DISARM)


def _reset(settings: RobotSettings, site: RobotSite, sender: int, request: Request) -> RobotSite | Refusal:
    del settings, sender, request
    if site.control.state is not SessionState.STOPPED:
        return Refusal.WRONG_STATE
    if not _knows_state(site):
        return Refusal.STATE_UNKNOWN
    return apply_event(site, Event.RESET)


def _authorise(
    settings: RobotSettings, site: RobotSite, sender: int, request: Request
) -> RobotSite | Refusal:
    del sender
    if not is_permitted(settings, request.envelope):
        return Refusal.ENVELOPE
    return replace(site, control=replace(site.control, envelope=request.envelope))


def is_permitted(settings: RobotSettings, envelope: Envelope) -> bool:
    """Return whether an envelope permits something, and nothing beyond what the robot allows.

    Args:
        settings: Settings of the robot site.
        envelope: Envelope.
    """
    is_solid = all(low < high for low, high in zip(envelope.lower, envelope.upper, strict=True))
    return is_solid and bool(envelope.modes) and 0.0 < envelope.duration <= settings.max_envelope


def _revoke(settings: RobotSettings, site: RobotSite, sender: int, request: Request) -> RobotSite:
    del settings, sender, request
    return replace(site, control=replace(site.control, envelope=NO_ENVELOPE))


HANDLERS: dict[Action, Handler] = {
    Action.ACQUIRE: _acquire,
    Action.RELEASE: _release,
    Action.ARM: _arm,
    Action.DISARM: _disarm,
    Action.RESET: _reset,
    Action.AUTHORISE: _authorise,
    Action.REVOKE: _revoke,
}
