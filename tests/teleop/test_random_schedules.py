"""Invariants of the robot's site over random schedules of messages, times and perceptions.

`PILOTFISH_SCHEDULES=100000 pytest -m slow tests/teleop/test_random_schedules.py` tries as many schedules.
"""

import os
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from teleop_sites import object_poses, path, robot_settings, skill_bytes

from pilotfish import teleop
from pilotfish.teleop import Action, ReceivedMessage, SessionState

SCHEDULES, STEPS = 60, 15
OPERATORS, OBSERVER = (1, 2), 3
MOVING = (SessionState.ACTIVE, SessionState.CONTINUING)
MILLISECOND = 1_000_000
TIMES = [0, 5, 20, 20, 20, 20, 20, 20, 40, 300, 1500, 6000]  # ms between two steps


@cache
def prepared_site() -> teleop.RobotSite:
    """Return a site of operator 1 that has the skill."""
    settings, robot = robot_settings(operators=OPERATORS, observers=(OBSERVER,)), sensed(path()[0])
    site = teleop.start_robot(settings, 0, robot)
    name = teleop.skill_hash(skill_bytes())
    messages: list[object] = [
        teleop.Request(1, Action.ACQUIRE, 1.0, 0.2),
        teleop.Mission(1, (name,)),
        *teleop.split_skill(skill_bytes()),
    ]
    for n, message in enumerate(messages):
        step = teleop.step_robot(settings, site, n * MILLISECOND, (ReceivedMessage(1, message),), robot)
        site = step.site
    assert site.skills.index(0) is not None
    return site


def sensed(pose: np.ndarray) -> teleop.RobotState:
    return teleop.RobotState(pose, np.zeros(6), 0.0, object_poses())


def random_messages(rng: np.random.Generator, site: teleop.RobotSite) -> tuple[ReceivedMessage, ...]:
    messages = []
    for _ in range(int(rng.integers(0, 4))):
        sender = int(rng.choice([1, 1, 1, 2, OBSERVER]))
        kind, connection = rng.uniform(), int(rng.choice([0, 0, 0, 0, 0, 0, 0, 1]))
        last = site.control.requests.get(sender, (0, None))[0]
        message: object
        if kind < 0.6:
            message = random_command(rng, site)
        elif kind < 0.92:
            message = teleop.Request(
                last + int(rng.choice([1, 1, 1, 0, 2])),
                Action(int(rng.integers(len(Action)))),
                float(rng.choice([0.5, 1.0, 100.0])),
                float(rng.choice([0.2, 0.05])),
                teleop.Envelope(2.0, (-2.0,) * 3, (2.0,) * 3, 10.0, teleop.MODES),
            )
        elif kind < 0.97:
            message = teleop.Request(last + 1, Action.ARM)
        else:
            message = teleop.Stop(site.control.stops.get(sender, 0) + int(rng.integers(0, 2)))
        messages.append(ReceivedMessage(sender, message, connection))
    return tuple(messages)


def ordinary_messages(site: teleop.RobotSite) -> tuple[ReceivedMessage, ...]:
    """Return what an operator sends who arms and then holds the hand still, and authorises an envelope."""
    command = teleop.CommandMessage(
        number=site.commands.number + 1,
        report=site.reports[-1].number if site.reports else 0,
        lease=site.control.lease,
        valid=1.2,
        pose=tuple(site.motion.target.pose[:7].tolist()),
        twist=(0.0,) * 6,
        grip=0.0,
        is_clutch_closed=True,
        is_dead_man_pressed=True,
        mode="shared",
        skill=0,
    )
    number = site.control.requests[1][0] + 1
    envelope = teleop.Envelope(2.0, (-2.0,) * 3, (2.0,) * 3, 10.0, teleop.MODES)
    action = Action.AUTHORISE if not site.control.envelope.duration else Action.ARM
    request = teleop.Request(number, action, envelope=envelope)
    return (ReceivedMessage(1, command), ReceivedMessage(1, request))


def random_command(rng: np.random.Generator, site: teleop.RobotSite) -> teleop.CommandMessage:
    newest = site.reports[-1].number if site.reports else 0
    pose = site.motion.target.pose[:7].copy()
    if rng.uniform() < 0.3:
        pose[:3] += rng.normal(size=3) * rng.choice([0.01, 0.2, 5.0])
    return teleop.CommandMessage(
        number=site.commands.number + int(rng.choice([1, 1, 1, 2, 0, -1])) if site.commands.number else 1,
        report=max(0, newest - int(rng.choice([0, 0, 1, 5, 100]))),
        lease=site.control.lease + int(rng.choice([0, 0, 0, 0, -1, 1])),
        valid=float(rng.choice([1.2, 1.2, 0.1])),
        pose=tuple(pose.tolist()),
        twist=(0.0,) * 6,
        grip=0.0,
        is_clutch_closed=bool(rng.uniform() < 0.9),
        is_dead_man_pressed=bool(rng.uniform() < 0.93),
        mode=str(rng.choice(["direct"] * 4 + ["shared"] * 4 + ["autonomous"])),
        skill=int(rng.choice([0, 0, 0, 1])),
    )


def check_step(
    settings: teleop.RobotSettings,
    before: teleop.RobotSite,
    step: teleop.RobotStep,
    received: tuple[ReceivedMessage, ...],
) -> None:
    after, control = step.site, step.site.control
    assert np.isfinite(step.target.pose).all()
    assert control.holder in (0, *OPERATORS)
    assert control.lease >= before.control.lease
    assert control.holder == before.control.holder or control.lease > before.control.lease
    same = (control.lease, control.connections) == (before.control.lease, before.control.connections)
    assert not after.commands.is_new or not same or after.commands.number > before.commands.number
    speed, speed_before = (float(np.linalg.norm(site.motion.target.velocity[:3])) for site in (after, before))
    assert speed <= settings.limits.speed + 1e-9
    moved = float(np.linalg.norm(step.target.pose[:3] - before.motion.target.pose[:3]))
    if control.state not in MOVING:
        assert speed <= speed_before + 1e-9
        assert moved <= settings.max_step * speed_before + 1e-9
    assert moved <= settings.max_step * settings.limits.speed + 1e-9
    for each in received:
        newer = each.message.number > before.control.stops.get(each.sender, 0) if is_stop(each) else False
        current = each.connection == before.control.connections.get(each.sender, 0)
        assert not (newer and current) or control.state is SessionState.STOPPED
    if control.state is SessionState.ACTIVE and before.control.state not in MOVING:
        assert before.control.state is not SessionState.STOPPED
    if step.outgoing:
        teleop.encode(step.outgoing[0].message)


def is_stop(each: ReceivedMessage) -> bool:
    return isinstance(each.message, teleop.Stop)


def run_schedule(seed: int) -> set[SessionState]:
    """Run one schedule; return the states that it visited."""
    rng, settings = np.random.default_rng(seed), robot_settings(operators=OPERATORS, observers=(OBSERVER,))
    site, pose, visited = prepared_site(), path()[0], set[SessionState]()
    regular = int(rng.choice([0, 5]))  # steps of an ordinary start
    for n in range(regular + STEPS):
        robot, time = sensed(pose), site.time + 20 * MILLISECOND
        if n < regular:
            received = ordinary_messages(site)
        else:
            received = random_messages(rng, site)
            time = site.time + int(rng.choice(TIMES)) * MILLISECOND
            if rng.uniform() < 0.05:
                robot = replace(robot, frames=None)
            if rng.uniform() < 0.02:
                robot = replace(robot, twist=np.full(6, np.nan))
        step = teleop.step_robot(settings, site, time, received, robot)
        check_step(settings, site, step, received)
        site, pose = step.site, step.target.pose
        visited.add(site.control.state)
    return visited


def test_step_robot_random_schedules_keep_invariants_and_visit_every_state(rng):
    start = int(rng.integers(2**32))
    visited = [run_schedule(start + n) for n in range(SCHEDULES)]
    assert set().union(*visited) >= set(SessionState) - {SessionState.ALIGNING}


@pytest.mark.slow  # half a minute
@pytest.mark.usefixtures("unchecked")
def test_step_robot_many_random_schedules_keep_invariants():
    visited = [run_schedule(n) for n in range(int(os.environ.get("PILOTFISH_SCHEDULES", "2000")))]
    assert set().union(*visited) == set(SessionState)
