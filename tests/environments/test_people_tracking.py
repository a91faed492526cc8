"""People follow moving goals in one closed loop where the delay lets them, and else move ahead and wait."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest

from pilotfish.environments.people import (
    Act,
    Doing,
    Errand,
    Person,
    Phase,
    Seen,
    act_step,
    begin,
    crossover_frequency,
)
from pilotfish.geometry import Pose, exp

pytestmark = pytest.mark.usefixtures("unchecked")  # thousands of looks; test_people.py checks each act

TICK = 0.005
STILL = np.array([1.0, 0.0, 0.0, 0.0])
AT = Pose(np.array([0.5, 0.1, 0.2]), STILL)
PRECISE = Person(along=0.0, across=0.0, floor=0.0, turn_noise=0.0, turn_floor=0.0, gain=1.0)


def follow(tolerance: float = 0.02, dwell: float = 0.0) -> Act:
    return Act("follow", lambda frames: frames["goal"], tolerance, 1.0, dwell=dwell, tracking=True)


def shifted(pose: Pose, x: float) -> Pose:
    return Pose(pose.position + np.array([x, 0.0, 0.0]), pose.quaternion)


def turned(pose: Pose, a: float) -> Pose:
    return Pose(pose.position, exp(0.5 * np.array([0.0, 0.0, a])))


@pytest.mark.parametrize("moved", [shifted, turned])
@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3])
def test_the_open_loop_crosses_unit_gain_with_the_phase_margin(
    delay: float, moved: Callable[[Pose, float], Pose]
):
    """With the loop cut at the tool, a sine of w_c comes back as large, its phase the margin short of -pi.

    The tool in the picture goes a small sine of its own whatever the hand does; the hand's sine, seen after
    the delay, is what the loop returns, and minus that is the open loop's transfer.
    """
    person = Person(lean=10.0, turn_lean=3.0)
    w, size = crossover_frequency(person, delay), 0.005
    errand, doing = Errand(person, (follow(1.0, dwell=1000.0),), delay), begin(AT, 0.0)
    periods = round(2 * pi / w / TICK)
    times = TICK * np.arange(1, 6 * periods + 1)
    hands = []
    for time in times:
        seen = Seen(moved(AT, size * np.sin(w * time)), {"goal": AT})
        doing, wish = act_step(errand, doing, time, seen, np.random.default_rng(0))
        x = wish.pose.position[0] - AT.position[0] if moved is shifted else 2.0 * wish.pose.quaternion[3]
        hands.append(x)
    assert doing.phase is Phase.TRACKING
    last = slice(-4 * periods, None)
    columns = np.column_stack([np.sin(w * times), np.cos(w * times), np.ones(len(times))])[last]
    fitted = np.linalg.lstsq(columns, np.array(hands)[last], rcond=None)[0]
    returned = (fitted[0] + 1j * fitted[1]) * np.exp(-1j * w * delay) / size
    assert abs(returned) == pytest.approx(1.0, abs=0.02)
    assert np.angle(-returned) == pytest.approx(-pi + person.phase_margin, abs=0.02)


def tracked(
    person: Person, speed: float, delay: float, seconds: float, act: Act
) -> tuple[list[Doing], np.ndarray]:
    """Doings, and the tool's errors, of following a goal of constant speed over a delay line."""
    errand, doing, tools, errors, doings = Errand(person, (act,), delay), begin(AT, 0.0), [AT], [], []
    rng = np.random.default_rng(0)
    for n in range(1, round(seconds / TICK)):
        time = n * TICK
        tool = tools[max(0, len(tools) - 1 - round(delay / TICK))]
        seen = Seen(tool, {"goal": shifted(AT, 0.1 + speed * time)})
        doing, wish = act_step(errand, doing, time, seen, rng)
        tools.append(wish.pose)
        errors.append(seen.frames["goal"].position[0] - tool.position[0])
        doings.append(doing)
    return doings, np.array(errors)


@pytest.mark.parametrize("delay", [0.0, 0.2, 0.4])
def test_a_tracked_goal_is_trailed_by_its_speed_over_the_crossover_frequency(delay: float):
    """A loop with one integrator follows a ramp u with the lasting error u / w_c; the tool as seen trails."""
    u = 0.02
    doings, errors = tracked(PRECISE, u, delay, 12.0, follow(dwell=100.0))
    assert doings[-1].phase is Phase.TRACKING
    assert errors[-1] == pytest.approx(u / crossover_frequency(PRECISE, delay), rel=0.02)


def test_a_goal_pursued_at_its_own_speed_is_not_trailed():
    """With all of the goal's speed in the hand's, nothing lasting is left to answer."""
    _, errors = tracked(replace(PRECISE, pursuit=1.0), 0.02, 0.2, 15.0, follow(dwell=100.0))
    assert errors[-1] == pytest.approx(0.0, abs=1e-4)


def test_reached_means_within_tolerance_for_a_reaction_time():
    """After a movement that fell short, the goal counts as reached when the tool, tracking, has been within
    tolerance for a reaction time, and not before.
    """
    person, act = replace(PRECISE, gain=0.8), follow(0.008, dwell=100.0)
    doings, errors = tracked(person, 0.02, 0.0, 8.0, act)
    reached = next(n for n, doing in enumerate(doings) if doing.until < inf)
    came = reached - round(person.reaction / TICK)
    assert doings[came - 1].phase is Phase.TRACKING
    assert np.abs(errors[came : reached + 1]).max() <= act.position_tolerance
    assert abs(errors[came - 1]) > act.position_tolerance


def test_above_its_longest_delay_nobody_tracks():
    """With a longer round trip the hand moves to where the goal will be seen: it is met at every look."""
    doings, errors = tracked(PRECISE, 0.02, 1.0, 15.0, follow(0.003, dwell=100.0))
    assert not [doing for doing in doings if doing.phase is Phase.TRACKING]
    looks = [
        n
        for n, (doing, before) in enumerate(zip(doings[1:], doings, strict=False), 1)
        if doing.movements > before.movements
    ]
    assert len(looks) > 5
    assert np.abs(errors[looks[2:]]).max() < 0.003
    assert doings[-1].until < inf
    assert doings[-1].given_up == 0


def test_people_stop_tracking_when_the_delay_grows_and_begin_again_when_it_shrinks():
    """The round trip is the errand's, which may be another one at every step."""
    doing, rng, phases = begin(AT, 0.0), np.random.default_rng(0), []
    for n in range(1, 2400):
        delay = 0.6 if 800 < n < 1600 else 0.1
        errand = Errand(Person(), (follow(1.0, dwell=1000.0),), delay)
        doing, _ = act_step(errand, doing, n * TICK, Seen(doing.hand, {"goal": AT}), rng)
        phases.append(doing.phase)
    assert phases[700] is Phase.TRACKING
    assert phases[1200] is Phase.MOVE_AND_WAIT
    assert phases[-1] is Phase.TRACKING


@pytest.mark.parametrize("delay", [0.0, 0.4])
def test_a_tracking_hand_keeps_to_its_speed_and_does_not_wind_up(delay: float):
    """A goal that runs away from a stuck tool is not followed beyond the lean and the loop's delay."""
    person, rng = Person(), np.random.default_rng(0)
    errand, doing, steps = Errand(person, (follow(1.0, dwell=1000.0),), delay), begin(AT, 0.0), []
    for n in range(1, 1600):
        seen = Seen(AT, {"goal": shifted(AT, 0.3 * n * TICK)})
        before = doing.hand
        doing, wish = act_step(errand, doing, n * TICK, seen, rng)
        steps.append(float(np.linalg.norm(wish.pose.position - before.position)))
    furthest = person.lean + person.peak_speed * (person.tau_e + delay)
    assert np.linalg.norm(doing.hand.position - AT.position) == pytest.approx(furthest)
    assert max(steps) <= person.peak_speed * TICK * (1 + 1e-9)
