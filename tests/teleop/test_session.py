"""The session table covers every state and event, and keeps its invariants."""

from itertools import product

import pytest

from pilotfish.teleop.session import (
    CLEARING_ACTIONS,
    MOVING,
    REASONS,
    TRANSITIONS,
    Action,
    Event,
    Reason,
    SessionState,
    next_state,
)

LATCHED = (SessionState.HOLD, SessionState.STOPPED)
EVERY = [
    (state, reason, event)
    for state, reason, event in product(SessionState, Reason, Event)
    if (reason is not Reason.NONE) == (state in LATCHED)
    and (reason is Reason.STOPPED) == (state is SessionState.STOPPED)
]


def test_table_every_event_has_one_state_after_each_state():
    assert set(TRANSITIONS) == set(Event)
    assert all(len(row) == len(SessionState) for row in TRANSITIONS.values())


@pytest.mark.parametrize(("state", "reason", "event"), EVERY)
def test_next_state_every_state_reason_and_event_keeps_invariants(state, reason, event):
    after, latched = next_state(state, reason, event)
    assert event is not Event.STOP or after is SessionState.STOPPED
    assert state is not SessionState.STOPPED or after is state or event is Event.RESET
    assert (latched is not Reason.NONE) == (after in LATCHED)
    assert after is not state or state not in LATCHED or latched is reason
    if after is SessionState.ACTIVE and state is not after:
        assert event is Event.ALIGNED
        assert state in (SessionState.ALIGNING, SessionState.CONTINUING)
    if after in MOVING and state not in MOVING:
        assert state is SessionState.ALIGNING


def test_clearing_actions_every_reason_has_one_that_leaves_the_state():
    assert set(CLEARING_ACTIONS) == set(Reason) - {Reason.NONE}
    events = {Action.ARM: Event.ARM, Action.ACQUIRE: Event.ACQUIRED, Action.RESET: Event.RESET}
    for reason, action in CLEARING_ACTIONS.items():
        state = SessionState.STOPPED if reason is Reason.STOPPED else SessionState.HOLD
        cleared = {
            each for each, event in events.items() if next_state(state, reason, event)[1] is Reason.NONE
        }
        # taking control again clears every hold, so that an operator who takes over is never caught
        assert cleared == {action} | ({Action.ACQUIRE} if state is SessionState.HOLD else set())


@pytest.mark.parametrize("event", Event)
def test_reasons_every_event_that_ends_a_motion_in_a_latched_state_names_one(event):
    ends_latched = any(TRANSITIONS[event][before] in LATCHED for before in MOVING)
    assert ends_latched == (event in REASONS) or event in (
        Event.LINK_LOST_AUTHORISED,
        Event.ROUND_TRIP_EXCEEDED_AUTHORISED,  # they latch from ALIGNING
    )
