"""The operator's site: what it repeats, what its clock cannot change, and what it predicts."""

from dataclasses import replace

import numpy as np
import pytest
from teleop_sites import path, robot_settings, skill_bytes

from pilotfish import teleop
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io import decode_assisted_skill
from pilotfish.teleop import Action, Reason, ReceivedMessage, SessionState

PERIOD = 20_000_000


def settings(**fields) -> teleop.OperatorSettings:
    return teleop.OperatorSettings(decode_assisted_skill, (skill_bytes(),), **fields)


def given(**fields) -> teleop.OperatorInput:
    return teleop.OperatorInput(path()[0], **fields)


def example_report(**fields) -> teleop.Report:
    """Return a report of a robot's site that was acquired by operator 1."""
    robot = teleop.RobotState(path()[0], np.zeros(6), 0.0, {})
    robot_site = teleop.start_robot(robot_settings(), 0, robot)
    request = ReceivedMessage(1, teleop.Request(1, Action.ACQUIRE, 0.5, 0.1))
    step = teleop.step_robot(robot_settings(), robot_site, PERIOD, (request,), robot)
    report = next(each.message for each in step.outgoing if isinstance(each.message, teleop.Report))
    return replace(report, **fields)


def run(site, inputs, *, clock=lambda n: n * PERIOD, options=None):
    """Return the site, all messages and the last view after some steps."""
    sent, view = [], None
    for n, (messages, each) in enumerate(inputs):
        received = tuple(ReceivedMessage(0, message) for message in messages)
        site, outgoing, view = teleop.step_operator(options or settings(), site, clock(n), received, each)
        sent.append(outgoing)
    return site, sent, view


def test_operator_request_is_repeated_until_its_number_is_reported():
    inputs = [((), given(actions=(Action.ACQUIRE,)))] + [((), given())] * 24
    _, sent, view = run(teleop.start_operator(settings()), inputs)
    steps = [n for n, each in enumerate(sent) if any(isinstance(m, teleop.Request) for m in each)]
    assert steps == [0, 10, 20]
    assert view.waiting == 1
    inputs += [((example_report(request=1),), given())] + [((), given())] * 24
    _, sent, view = run(teleop.start_operator(settings()), inputs)
    assert not any(isinstance(m, teleop.Request) for each in sent[25:] for m in each)
    assert view.waiting == 0


def test_operator_stop_is_sent_in_every_step_until_it_is_reported():
    inputs = [((), given(is_stopping=True))] + [((), given())] * 5
    inputs += [((example_report(stop=1),), given())] + [((), given())] * 5
    _, sent, _ = run(teleop.start_operator(settings()), inputs)
    stops = [any(isinstance(m, teleop.Stop) for m in each) for each in sent]
    assert stops == [True] * 6 + [False] * 6


def test_operator_clock_changes_no_message():
    inputs = [((), given(actions=(Action.ACQUIRE,)))] + [((), given())] * 10
    inputs += [((example_report(request=1),), given())] + [((), given())] * 30
    first, second = (
        run(teleop.start_operator(settings()), inputs, clock=clock)[1]
        for clock in (lambda n: n * PERIOD, lambda n: 3600 * 10**9 - 7 * n * PERIOD)
    )
    assert first == second


def test_operator_round_trip_is_measured_without_the_time_at_the_robot():
    report = example_report(command=3, command_age=0.03)
    inputs = [((), given())] * 10 + [((report,), given())]
    _, _, view = run(teleop.start_operator(settings()), inputs)
    np.testing.assert_allclose(view.round_trips, [8 * 0.02 - 0.03])  # sent in step 2, reported in step 10


def test_operator_old_report_after_a_newer_one_is_ignored_and_losses_are_counted():
    new, old = example_report(number=9), example_report(number=5)
    first = example_report(number=3)
    _, _, view = run(
        teleop.start_operator(settings()), [((first,), given()), ((new,), given()), ((old,), given())]
    )
    assert view.report.number == 9
    assert view.lost_reports == 5  # 4 to 8; what comes too late is lost as well


def test_operator_sends_mission_then_pieces_in_turn_until_the_robot_has_them():
    report = example_report(request=1)
    n = len(teleop.split_skill(skill_bytes()))
    inputs = [((report,), given())] + [((), given())] * 30
    _, sent, _ = run(teleop.start_operator(settings()), inputs)
    assert any(isinstance(m, teleop.Mission) for each in sent for m in each)
    inputs = [((replace(report, mission=1),), given())] + [((), given())] * (5 * n)
    _, sent, _ = run(teleop.start_operator(settings()), inputs)
    indices = [m.index for each in sent for m in each if isinstance(m, teleop.SkillPiece)]
    assert set(indices) == set(range(n))


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"holder": 0}, Action.ACQUIRE),
        ({"holder": 2}, Action.ACQUIRE),
        ({"state": SessionState.DISARMED}, Action.ARM),
        ({"state": SessionState.HOLD, "reason": Reason.LINK_LOST}, Action.ARM),
        ({"state": SessionState.HOLD, "reason": Reason.ROUND_TRIP_EXCEEDED}, Action.ACQUIRE),
        ({"state": SessionState.STOPPED, "reason": Reason.STOPPED}, Action.RESET),
        ({"state": SessionState.ACTIVE}, None),
        ({"state": SessionState.CONTINUING, "is_link_lost": True}, None),
        ({"state": SessionState.CONTINUING, "is_link_lost": False}, Action.ARM),
    ],
)
def test_next_action_is_the_one_that_leads_to_control(fields, expected):
    view = replace(teleop.start_view(), report=example_report(**fields), is_mission_known=True)
    assert teleop.next_action(view, 1) is expected
    assert teleop.next_action(replace(view, waiting=1), 1) is None


def test_robot_is_not_armed_before_it_knows_the_mission():
    """It would refuse the skills while it moves."""
    report = example_report(state=SessionState.DISARMED, mission=0)
    _, _, view = run(teleop.start_operator(settings()), [((report,), given())])
    assert not view.is_mission_known
    assert teleop.next_action(view, 1) is None
    assert teleop.next_action(view, 1, needs_skill=False) is Action.ARM
    _, _, view = run(teleop.start_operator(settings()), [((replace(report, mission=1),), given())])
    assert teleop.next_action(view, 1) is Action.ARM
    _, _, view = run(teleop.start_operator(replace(settings(), skills=())), [((report,), given())])
    assert teleop.next_action(view, 1) is Action.ARM


@pytest.mark.parametrize(
    ("fields", "match"),
    [
        ({"state": SessionState.HOLD}, "stays at rest"),
        ({"state": SessionState.ACTIVE, "is_authorised": False}, "stops and holds"),
        ({"state": SessionState.ACTIVE, "is_authorised": True}, "continues alone"),
        ({"state": SessionState.CONTINUING, "is_authorised": True, "envelope_left": 7.4}, "for 7 s"),
    ],
)
def test_describe_link_drop_says_what_the_robot_would_do(fields, match):
    assert match in teleop.describe_link_drop(example_report(**fields))


@pytest.mark.parametrize(
    "fields",
    [
        {"hand": np.zeros(7)},
        {"hand": np.full(7, np.nan)},
        {"hand": np.ones(6)},
        {"grip": 2.0},
        {"mode": "manual"},
        {"skill": 8},
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_operator_input_that_cannot_be_sent_is_refused(fields):
    with pytest.raises(InvalidInput):
        teleop.OperatorInput(**{"hand": path()[0], **fields})


def test_operator_skill_that_cannot_be_used_is_refused_before_the_session():
    with pytest.raises(SkillError):
        teleop.start_operator(teleop.OperatorSettings(decode_assisted_skill, (b"no skill",)))
    with pytest.raises(InvalidInput, match="expected 1 to"):
        teleop.OperatorSettings(decode_assisted_skill, (b"",))
