"""Session state machine of the robot site, as a table of states and events.

    DISARMED -> ALIGNING -> ACTIVE -> HOLD, STOPPED

Invariants. STOP leads to STOPPED from every state, and only RESET leaves STOPPED. ACTIVE is entered from
ALIGNING, and from CONTINUING, where an operator has armed and aligned again as well. The robot moves in
ACTIVE and CONTINUING; elsewhere it comes to rest and holds.

ACTIVE follows the operator. In CONTINUING the link is lost, or its round trip too long, and the robot
continues alone inside the envelope that the operator authorised before. HOLD and STOPPED latch a reason,
which one action of the operator clears (`CLEARING_ACTIONS`).
"""

from enum import IntEnum

from pilotfish.validation import require_type


class SessionState(IntEnum):
    """State of a session.

    Attributes:
        DISARMED: At rest, no operator is about to move the robot.
        ALIGNING: Armed; motion begins when the operator's hand is at the robot.
        ACTIVE: Follows the operator in one of the modes.
        CONTINUING: Continues alone inside the envelope.
        HOLD: Came to rest for a reason, and waits to be armed again.
        STOPPED: Came to rest after a stop, and waits for a reset.
    """

    DISARMED = 0
    ALIGNING = 1
    ACTIVE = 2
    CONTINUING = 3
    HOLD = 4
    STOPPED = 5


class Event(IntEnum):
    """What may change the state of a session.

    Attributes:
        ARM: The holder of control asks for motion, with the dead-man switch pressed.
        DISARM: The holder asks for rest.
        ALIGNED: The holder armed, and the hand is at rest at the robot.
        DEAD_MAN_RELEASED: The holder released the dead-man switch.
        LINK_LOST: No fresh command arrived for too long.
        LINK_LOST_AUTHORISED: The same, and the envelope permits to continue alone.
        ROUND_TRIP_EXCEEDED: Commands are older than the budget of the round trip.
        ROUND_TRIP_EXCEEDED_AUTHORISED: The same, and the envelope permits to continue alone.
        ENVELOPE_TIME_OVER: The time of the envelope is over.
        ENVELOPE_VOLUME_LEFT: The target would leave the volume of the envelope.
        ENVELOPE_LIKELIHOOD_LOW: The target is too far from the demonstrations.
        PLAN_ENDED: The motion without operator came to its end.
        ACQUIRED: An operator took control, or agreed on other times.
        LEASE_RELEASED: The holder gave up control.
        PERCEPTION_LOST: The robot's own state is missing or not finite.
        STOP: An authenticated peer asked for a stop.
        RESET: An operator clears a stop.
    """

    ARM = 0
    DISARM = 1
    ALIGNED = 2
    DEAD_MAN_RELEASED = 3
    LINK_LOST = 4
    LINK_LOST_AUTHORISED = 5
    ROUND_TRIP_EXCEEDED = 6
    ROUND_TRIP_EXCEEDED_AUTHORISED = 7
    ENVELOPE_TIME_OVER = 8
    ENVELOPE_VOLUME_LEFT = 9
    ENVELOPE_LIKELIHOOD_LOW = 10
    PLAN_ENDED = 11
    ACQUIRED = 12
    LEASE_RELEASED = 13
    PERCEPTION_LOST = 14
    STOP = 15
    RESET = 16


class Reason(IntEnum):
    """Why the robot holds or is stopped; NONE otherwise."""

    NONE = 0
    DEAD_MAN_RELEASED = 1
    LINK_LOST = 2
    ROUND_TRIP_EXCEEDED = 3
    ENVELOPE_TIME_OVER = 4
    ENVELOPE_VOLUME_LEFT = 5
    ENVELOPE_LIKELIHOOD_LOW = 6
    PLAN_ENDED = 7
    LEASE_RELEASED = 8
    PERCEPTION_LOST = 9
    STOPPED = 10


class Action(IntEnum):
    """What a peer asks the robot site to do.

    Attributes:
        ACQUIRE: Take control, with a budget of the round trip and of its jitter.
        RELEASE: Give up control.
        ARM: Begin to align.
        DISARM: Come to rest.
        RESET: Clear a stop.
        AUTHORISE: Permit to continue alone inside an envelope.
        REVOKE: Withdraw that permission.
    """

    ACQUIRE = 0
    RELEASE = 1
    ARM = 2
    DISARM = 3
    RESET = 4
    AUTHORISE = 5
    REVOKE = 6


MOVING = (SessionState.ACTIVE, SessionState.CONTINUING)

# For each event, the state after it in the order DISARMED, ALIGNING, ACTIVE, CONTINUING, HOLD, STOPPED.
_D, _AL, _AC, _C, _H, _S = SessionState
TRANSITIONS: dict[Event, tuple[SessionState, ...]] = {
    Event.ARM: (_AL, _AL, _AC, _C, _AL, _S),
    Event.DISARM: (_D, _D, _D, _D, _D, _S),
    Event.ALIGNED: (_D, _AC, _AC, _AC, _H, _S),
    Event.DEAD_MAN_RELEASED: (_D, _H, _H, _H, _H, _S),
    Event.LINK_LOST: (_D, _H, _H, _C, _H, _S),
    Event.LINK_LOST_AUTHORISED: (_D, _H, _C, _C, _H, _S),
    Event.ROUND_TRIP_EXCEEDED: (_D, _H, _H, _C, _H, _S),
    Event.ROUND_TRIP_EXCEEDED_AUTHORISED: (_D, _H, _C, _C, _H, _S),
    Event.ENVELOPE_TIME_OVER: (_D, _AL, _AC, _H, _H, _S),
    Event.ENVELOPE_VOLUME_LEFT: (_D, _AL, _AC, _H, _H, _S),
    Event.ENVELOPE_LIKELIHOOD_LOW: (_D, _AL, _AC, _H, _H, _S),
    Event.PLAN_ENDED: (_D, _AL, _AC, _H, _H, _S),
    Event.ACQUIRED: (_D, _D, _H, _H, _D, _S),
    Event.LEASE_RELEASED: (_D, _H, _H, _H, _H, _S),
    Event.PERCEPTION_LOST: (_D, _H, _H, _H, _H, _S),
    Event.STOP: (_S, _S, _S, _S, _S, _S),
    Event.RESET: (_D, _AL, _AC, _C, _H, _D),
}

REASONS = {  # that an event latches when it leads to HOLD or STOPPED
    Event.DEAD_MAN_RELEASED: Reason.DEAD_MAN_RELEASED,
    Event.LINK_LOST: Reason.LINK_LOST,
    Event.LINK_LOST_AUTHORISED: Reason.LINK_LOST,
    Event.ROUND_TRIP_EXCEEDED: Reason.ROUND_TRIP_EXCEEDED,
    Event.ROUND_TRIP_EXCEEDED_AUTHORISED: Reason.ROUND_TRIP_EXCEEDED,
    Event.ENVELOPE_TIME_OVER: Reason.ENVELOPE_TIME_OVER,
    Event.ENVELOPE_VOLUME_LEFT: Reason.ENVELOPE_VOLUME_LEFT,
    Event.ENVELOPE_LIKELIHOOD_LOW: Reason.ENVELOPE_LIKELIHOOD_LOW,
    Event.PLAN_ENDED: Reason.PLAN_ENDED,
    Event.ACQUIRED: Reason.LEASE_RELEASED,
    Event.LEASE_RELEASED: Reason.LEASE_RELEASED,
    Event.PERCEPTION_LOST: Reason.PERCEPTION_LOST,
    Event.STOP: Reason.STOPPED,
}

CLEARING_ACTIONS = {  # the one action that clears a reason; ARM leads to ALIGNING, RESET to DISARMED
    Reason.DEAD_MAN_RELEASED: Action.ARM,
    Reason.LINK_LOST: Action.ARM,
    Reason.ROUND_TRIP_EXCEEDED: Action.ACQUIRE,
    Reason.ENVELOPE_TIME_OVER: Action.ARM,
    Reason.ENVELOPE_VOLUME_LEFT: Action.ARM,
    Reason.ENVELOPE_LIKELIHOOD_LOW: Action.ARM,
    Reason.PLAN_ENDED: Action.ARM,
    Reason.LEASE_RELEASED: Action.ACQUIRE,
    Reason.PERCEPTION_LOST: Action.ARM,
    Reason.STOPPED: Action.RESET,
}


def next_state(state: SessionState, reason: Reason, event: Event) -> tuple[SessionState, Reason]:
    """Return state and reason after an event.

    The first reason stays latched until the state changes: a later event in HOLD does not replace it. ARM
    leaves HOLD only if it clears the reason.

    Args:
        state: State before the event.
        reason: Reason that is latched; NONE outside HOLD and STOPPED.
        event: Event.

    Raises:
        InvalidInput: If an argument has another type.
    """
    require_type(state, "state", SessionState, "choose one of SessionState")
    require_type(reason, "reason", Reason, "choose one of Reason")
    require_type(event, "event", Event, "choose one of Event")
    after = TRANSITIONS[event][state]
    if state is SessionState.HOLD and event is Event.ARM and CLEARING_ACTIONS.get(reason) is not Action.ARM:
        return state, reason
    if after not in (SessionState.HOLD, SessionState.STOPPED):
        return after, Reason.NONE
    return (after, reason) if after is state else (after, REASONS.get(event, reason))
