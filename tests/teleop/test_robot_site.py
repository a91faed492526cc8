"""The robot's site, message by message, without links: lease, arming, commands, envelope and reports."""

from dataclasses import replace

import numpy as np
import pytest
from teleop_sites import object_poses, path, robot_settings, skill_bytes

from pilotfish import teleop
from pilotfish.errors import InvalidInput
from pilotfish.teleop import Action, Reason, ReceivedMessage, Refusal, SessionState

PERIOD = 20_000_000
WIDE = teleop.Envelope(5.0, (-3.0,) * 3, (3.0,) * 3, 1e3, teleop.MODES)


class Bench:
    """A robot's site that is given messages directly; the operator names the newest report."""

    def __init__(self, **settings) -> None:
        self.settings = robot_settings(**settings)
        self.pose, self.frames, self.time, self.number = path()[0].copy(), object_poses(), 0, 0
        self.site = teleop.start_robot(self.settings, 0, self.sense())
        self.request_numbers: dict[int, int] = {}
        self.step: teleop.RobotStep | None = None

    def sense(self) -> teleop.RobotState:
        return teleop.RobotState(self.pose, np.zeros(6), 0.0, self.frames)

    def send(self, *messages, sender: int = 1, elapsed: int = PERIOD, robot=None) -> teleop.Report:
        self.time += elapsed
        received = tuple(ReceivedMessage(sender, message) for message in messages)
        step = teleop.step_robot(self.settings, self.site, self.time, received, robot or self.sense())
        self.step, self.site, self.pose = step, step.site, step.target.pose.copy()
        reports = [each.message for each in step.outgoing if isinstance(each.message, teleop.Report)]
        return reports[0] if reports else None

    def request(self, action: Action, sender: int = 1, **fields) -> Refusal:
        number = self.request_numbers.get(sender, 0) + 1
        self.request_numbers[sender] = number
        fields = {"budget": 0.5, "jitter": 0.1} | fields if action is Action.ACQUIRE else fields
        self.send(teleop.Request(number, action, **fields), sender=sender)
        return self.site.control.requests[sender][1]

    def command(self, hand=None, *, mode="direct", **fields) -> teleop.CommandMessage:
        self.number += 1
        command = teleop.CommandMessage(
            number=self.number,
            report=self.site.reports[-1].number if self.site.reports else 0,
            lease=self.site.control.lease,
            valid=1.0,
            pose=tuple((self.pose if hand is None else hand).tolist()),
            twist=(0.0,) * 6,
            grip=0.0,
            is_clutch_closed=True,
            is_dead_man_pressed=True,
            mode=mode,
            skill=0,
        )
        return replace(command, **fields)

    def activate(self, mode="direct", steps=60, budget=0.5) -> None:
        assert self.request(Action.ACQUIRE, budget=budget) is Refusal.NONE
        if mode != "direct":
            self.send_skill()
        for _ in range(4):
            self.send(self.command(mode=mode))
        assert self.request(Action.ARM) is Refusal.NONE
        for _ in range(steps):
            if self.state is SessionState.ACTIVE:
                return
            self.send(self.command(mode=mode))
        raise AssertionError(self.state)

    def send_skill(self) -> None:
        self.send(teleop.Mission(1, (teleop.skill_hash(skill_bytes()),)))
        self.send(*teleop.split_skill(skill_bytes()))

    @property
    def state(self) -> SessionState:
        return self.site.control.state

    @property
    def reason(self) -> Reason:
        return self.site.control.reason


def test_robot_direct_control_follows_the_hand_within_its_limits():
    bench = Bench()
    bench.activate()
    hand = bench.pose.copy()
    hand[0] += 0.1
    for _ in range(100):
        bench.send(bench.command(hand))
    np.testing.assert_allclose(bench.pose, hand, atol=1e-6)


def test_robot_lease_second_operator_gets_it_after_release_only():
    bench = Bench(operators=(1, 2), observers=(3,))
    assert bench.request(Action.ACQUIRE) is Refusal.NONE
    assert bench.request(Action.ACQUIRE, sender=2) is Refusal.HELD
    assert bench.request(Action.RELEASE, sender=2) is Refusal.NOT_HOLDER
    for action in Action:
        assert bench.request(action, sender=3) is Refusal.NOT_OPERATOR
    assert bench.request(Action.RELEASE) is Refusal.NONE
    lease = bench.site.control.lease
    assert bench.request(Action.ACQUIRE, sender=2) is Refusal.NONE
    assert (bench.site.control.holder, bench.site.control.lease) == (2, lease + 1)


def test_robot_silent_holder_loses_the_lease_after_the_timeout():
    bench = Bench(operators=(1, 2), lease_timeout=2.0)
    bench.activate()
    bench.send(elapsed=1_900_000_000)
    assert bench.state is SessionState.HOLD
    assert bench.request(Action.ACQUIRE, sender=2) is Refusal.HELD
    bench.send(elapsed=200_000_000)
    assert bench.request(Action.ACQUIRE, sender=2) is Refusal.NONE
    assert bench.state is SessionState.DISARMED


@pytest.mark.parametrize(
    ("fields", "refusal"),
    [
        ({"is_dead_man_pressed": False}, Refusal.DEAD_MAN_OPEN),
        ({"mode": "shared"}, Refusal.SKILL_MISSING),
        ({"mode": "fixture"}, Refusal.SKILL_MISSING),
    ],
)
def test_robot_arm_without_its_conditions_is_refused_by_name(fields, refusal):
    bench = Bench()
    bench.request(Action.ACQUIRE)
    for _ in range(4):
        bench.send(bench.command(**fields))
    assert bench.request(Action.ARM) is refusal
    assert bench.state is SessionState.DISARMED


def test_robot_direct_mode_beyond_its_budget_is_refused():
    bench = Bench()
    bench.request(Action.ACQUIRE, budget=1.0)
    for _ in range(4):
        bench.send(bench.command())
    assert bench.request(Action.ARM) is Refusal.MODE_NOT_ALLOWED
    assert bench.request(Action.ACQUIRE, budget=100.0) is Refusal.BUDGET


def test_robot_direct_mode_beyond_its_budget_right_after_alignment_does_not_move():
    bench = Bench()
    bench.activate("shared", budget=1.0)
    stood, hand = bench.pose.copy(), bench.pose.copy()
    hand[0] += 0.1
    for _ in range(50):
        bench.send(bench.command(hand, mode="direct"))
    assert bench.site.motion.refusal is Refusal.MODE_NOT_ALLOWED
    np.testing.assert_array_equal(bench.pose, stood)
    for _ in range(50):
        bench.send(bench.command(hand, mode="shared"))
    assert bench.site.motion.assistance.mode == "shared"
    assert np.linalg.norm(bench.pose[:3] - stood[:3]) > 0.001


def test_robot_dead_man_released_holds_and_arms_again():
    bench = Bench()
    bench.activate()
    bench.send(bench.command(is_dead_man_pressed=False))
    assert (bench.state, bench.reason) == (SessionState.HOLD, Reason.DEAD_MAN_RELEASED)
    for _ in range(4):
        bench.send(bench.command())
    assert bench.request(Action.ARM) is Refusal.NONE


def test_robot_arm_that_was_sent_before_the_hold_is_refused():
    bench = Bench()
    bench.activate()
    old = bench.command()
    bench.send(bench.command(is_dead_man_pressed=False))
    bench.send(replace(bench.command(), report=old.report))
    assert bench.request(Action.ARM) is Refusal.STATE_UNKNOWN
    assert bench.state is SessionState.HOLD


def test_robot_stop_of_an_observer_stops_and_only_a_reset_clears_it():
    bench = Bench(observers=(3,))
    bench.activate()
    bench.send(teleop.Stop(1), bench.command(), sender=3)
    assert (bench.state, bench.reason) == (SessionState.STOPPED, Reason.STOPPED)
    for _ in range(4):
        bench.send(bench.command())
    for action in set(Action) - {Action.RESET, Action.RELEASE, Action.ACQUIRE, Action.AUTHORISE}:
        bench.request(action)
        assert bench.state is SessionState.STOPPED
    assert bench.request(Action.RESET, sender=1) is Refusal.NONE
    assert bench.state is SessionState.DISARMED


def test_robot_command_older_than_the_contract_is_refused_and_counted():
    bench = Bench()
    bench.activate()
    old = bench.command()
    for _ in range(40):  # .8 s, more than B + J = .6 s
        bench.send(bench.command())
    applied = bench.site.commands.number
    bench.send(replace(old, number=applied + 1))
    assert bench.site.commands.number == applied
    assert bench.site.commands.stale == 1
    bench.send(replace(bench.command(), valid=0.0, report=bench.site.reports[-3].number))
    assert bench.site.commands.stale == 2


def test_robot_modes_that_the_envelope_does_not_name_hold_at_a_loss():
    bench = Bench()
    bench.activate("shared")
    assert bench.request(Action.AUTHORISE, envelope=replace(WIDE, modes=("autonomous",))) is Refusal.NONE
    for _ in range(4):
        bench.send(bench.command(mode="shared"))
    bench.send(elapsed=300_000_000)
    assert (bench.state, bench.reason) == (SessionState.HOLD, Reason.LINK_LOST)


def test_robot_continues_under_the_envelope_until_its_time_is_over():
    bench = Bench()
    bench.activate("shared")
    assert bench.request(Action.AUTHORISE, envelope=replace(WIDE, duration=1.0)) is Refusal.NONE
    bench.send(bench.command(mode="shared"))
    began = bench.pose.copy()
    bench.send(elapsed=300_000_000)
    assert bench.state is SessionState.CONTINUING
    for _ in range(48):
        bench.send()
    assert bench.state is SessionState.CONTINUING
    assert np.linalg.norm(bench.pose[:3] - began[:3]) > 0.005
    for _ in range(4):
        bench.send()
    assert (bench.state, bench.reason) == (SessionState.HOLD, Reason.ENVELOPE_TIME_OVER)


@pytest.mark.parametrize(
    "envelope",
    [
        replace(WIDE, duration=0.0),
        replace(WIDE, duration=1000.0),
        replace(WIDE, modes=()),
        replace(WIDE, lower=(4.0, 0.0, 0.0)),
    ],
)
def test_robot_envelope_that_is_empty_or_too_long_is_refused(envelope):
    bench = Bench()
    bench.activate()
    assert bench.request(Action.AUTHORISE, envelope=envelope) is Refusal.ENVELOPE
    assert not bench.site.control.envelope.duration


def test_robot_pause_of_its_process_moves_the_target_one_short_step():
    bench = Bench()
    bench.activate()
    hand = bench.pose.copy()
    hand[0] += 0.5
    for _ in range(20):
        bench.send(bench.command(hand))
    before = bench.pose.copy()
    bench.send(bench.command(hand), elapsed=80_000_000)
    assert np.linalg.norm(bench.pose[:3] - before[:3]) <= 0.05 * 0.25 + 1e-9


def test_robot_time_that_goes_back_counts_as_no_time():
    bench = Bench()
    bench.activate()
    step = teleop.step_robot(bench.settings, bench.site, bench.time - 10 * PERIOD, (), bench.sense())
    assert step.site.time == bench.site.time


def test_robot_disarmed_and_moved_by_hand_starts_from_the_measured_pose():
    bench = Bench()
    moved = bench.sense()
    pose = bench.pose.copy()
    pose[1] += 0.2
    bench.send(robot=replace(moved, pose=pose))
    np.testing.assert_array_equal(bench.pose, pose)


def test_robot_mission_while_moving_is_ignored():
    bench = Bench()
    bench.activate("shared")
    mission = bench.site.skills.mission
    bench.send(bench.command(mode="shared"), teleop.Mission(2, (bytes(32),)))
    assert bench.site.skills.mission is mission


def test_start_robot_pose_that_is_not_finite_is_refused():
    bench = Bench()
    bad = replace(bench.sense(), twist=np.full(6, np.nan))
    with pytest.raises(InvalidInput, match="not finite"):
        teleop.start_robot(bench.settings, 0, bad)


@pytest.mark.parametrize(
    "settings",
    [
        {"operators": ()},
        {"operators": (1,), "observers": (1,)},
        {"operators": (0,)},
        {"command_period": 0.0},
        {"max_step": 5.0},
    ],
)
def test_robot_settings_that_cannot_be_used_are_refused(settings):
    with pytest.raises(InvalidInput):
        robot_settings(**settings)
