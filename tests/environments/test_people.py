"""People reach what they set out to reach, in the time that moving and waiting takes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import ceil, inf, radians

import numpy as np
import pytest

from pilotfish.environments.people import (
    Act,
    Doing,
    Errand,
    Person,
    Phase,
    Seen,
    Wish,
    act_step,
    begin,
    duration,
    within,
)
from pilotfish.environments.people.offsets import beyond
from pilotfish.geometry import Pose, angle, exp, normalise

TICK = 0.025  # of which all delays are multiples
DELAYS = [0.0, 0.25, 0.5, 1.0, 2.0]
EXACT = 1e-12
PRECISE = Person(along=0.0, across=0.0, floor=0.0, turn_noise=0.0, turn_floor=0.0, gain=1.0)
AT = Pose(np.array([0.6, -0.2, 0.3]), np.array([1.0, 0.0, 0.0, 0.0]))


def random_pose(rng: np.random.Generator, spread: float = 0.3) -> Pose:
    return Pose(rng.uniform(-spread, spread, 3), normalise(rng.normal(size=4)))


def to(name: str, **settings: object) -> Act:
    """An act whose goal is the frame of that name."""
    tolerances = {"position_tolerance": 0.005, "angle_tolerance": radians(3.0)}
    return Act(name, lambda frames: frames[name], **(tolerances | settings))


@dataclass
class Remote:
    """An imaginary tool that goes where it is asked with a first-order lag, over a line with a delay."""

    tool: Pose
    delay: float
    lag: float = 0.0
    wall: float = inf
    wishes: list[Pose] = field(default_factory=list)

    def follow(self, wish: Pose) -> Pose:
        """The tool one tick on; it hears what was wished a delay ago, and cannot pass the wall in x."""
        self.wishes.append(wish)
        heard = self.wishes[max(0, len(self.wishes) - 1 - round(self.delay / TICK))]
        share = 1.0 if self.lag == 0.0 else 1.0 - np.exp(-TICK / self.lag)
        position = self.tool.position + share * (heard.position - self.tool.position)
        position[0] = min(position[0], self.wall)
        turned = self.tool.quaternion if share < 1.0 else heard.quaternion
        turned = turned if turned @ heard.quaternion >= 0 else -turned
        self.tool = Pose(position, normalise(turned + share * (heard.quaternion - turned)))
        return self.tool


def acted(
    errand: Errand,
    remote: Remote,
    frames: Mapping[str, Pose],
    rng: np.random.Generator,
    longest: float = 300.0,
) -> tuple[list[Doing], list[Wish], list[Pose]]:
    """All steps until the person is done."""
    doing = begin(remote.tool, 0.0)
    history: tuple[list[Doing], list[Wish], list[Pose]] = [], [], []
    for n in range(1, round(longest / TICK)):
        doing, wish = act_step(errand, doing, n * TICK, Seen(remote.tool, frames), rng)
        for kept, value in zip(history, (doing, wish, remote.follow(wish.pose)), strict=True):
            kept.append(value)
        if wish.done:
            return history
    raise AssertionError(f"not done after {longest} s")


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("seed", range(6))
def test_people_reach_their_goals_whatever_the_delay(delay: float, seed: int):
    """At the end of each act the tool is within the act's tolerances of its goal, by its own lag or none."""
    rng = np.random.default_rng(seed)
    frames = {name: random_pose(rng) for name in ("near", "far")}
    script = (to("near", dwell=0.2, grip=1.0), to("far", grip=0.3))
    remote = Remote(random_pose(rng), delay, lag=0.1)
    doings, wishes, tools = acted(Errand(Person(), script, delay), remote, frames, rng)
    assert doings[-1].given_up == 0
    left = next(n for n, wish in enumerate(wishes) if wish.act == 1)
    assert within(tools[left - 1], frames["near"], script[0])
    assert within(tools[-1], frames["far"], script[1])
    assert wishes[left].grip == 1.0
    assert wishes[-1].grip == 0.3


@pytest.mark.parametrize("delay", DELAYS)
def test_reaching_takes_its_movements_and_a_wait_after_each(delay: float, rng: np.random.Generator):
    """The time is that of n sub-movements and n times reaction + round trip, on whole ticks."""
    person, act = Person(), to("goal")
    frames = {"goal": random_pose(rng)}
    doings, _, _ = acted(Errand(person, (act,), delay), Remote(random_pose(rng), delay), frames, rng)
    begun = [
        doing for doing, before in zip(doings[1:], doings, strict=False) if doing.movements > before.movements
    ]
    moves = [doings[0].moves[0], *(doing.moves[0] for doing in begun)]
    assert len(moves) == doings[-1].movements
    ticks = sum(ceil((move.duration + person.reaction + delay) / TICK - 1e-6) for move in moves)
    reached = next(doing.time for doing in doings if doing.until < inf)
    assert reached == pytest.approx(TICK + ticks * TICK, abs=1e-9)


def test_time_grows_with_the_delay():
    """With the same aim one movement is made, and every second of delay adds a second."""
    frames, act = {"goal": AT}, to("goal")
    start = Pose(AT.position - 0.2, AT.quaternion)
    times = []
    for delay in DELAYS:
        errand = Errand(PRECISE, (act,), delay)
        doings, _, _ = acted(errand, Remote(start, delay), frames, np.random.default_rng(0))
        assert doings[-1].movements == 1
        times.append(doings[-1].time)
    np.testing.assert_allclose(np.array(times) - times[0], DELAYS, atol=1e-9)


def test_a_precise_hand_goes_straight(rng: np.random.Generator):
    """Without noise and delay the path is the distance, and the speed never above the peak."""
    start, goal = random_pose(rng), random_pose(rng)
    doings, wishes, _ = acted(Errand(PRECISE, (to("goal"),)), Remote(start, 0.0), {"goal": goal}, rng)
    assert doings[-1].path == pytest.approx(np.linalg.norm(goal.position - start.position), rel=1e-9)
    steps = np.diff([wish.pose.position for wish in wishes], axis=0)
    assert np.linalg.norm(steps, axis=1).max() <= PRECISE.peak_speed * TICK * (1 + 1e-9)


@pytest.mark.parametrize("speed", [1.0, 0.3])
def test_careful_acts_are_slower(speed: float):
    """The peak speed is the act's share of the person's."""
    start = Pose(AT.position - 0.3, AT.quaternion)
    errand = Errand(PRECISE, (to("goal", speed=speed),))
    _, wishes, _ = acted(errand, Remote(start, 0.0), {"goal": AT}, np.random.default_rng(0))
    steps = np.linalg.norm(np.diff([wish.pose.position for wish in wishes], axis=0), axis=1) / TICK
    assert steps.max() == pytest.approx(speed * PRECISE.peak_speed, rel=1e-3)


def test_a_dwell_is_stayed(rng: np.random.Generator):
    """After the grip has changed the hand stays for the dwell, then goes on."""
    script = (to("near", dwell=0.7, grip=0.8), to("far"))
    frames = {"near": random_pose(rng), "far": random_pose(rng)}
    _, wishes, _ = acted(Errand(PRECISE, script), Remote(random_pose(rng), 0.0), frames, rng)
    gripped = next(n for n, wish in enumerate(wishes) if wish.grip == 0.8)
    left = next(n for n, wish in enumerate(wishes) if wish.act == 1)
    assert (left - gripped) * TICK == pytest.approx(0.7)
    for wish in wishes[gripped : left + 1]:
        np.testing.assert_array_equal(wish.pose.position, wishes[gripped].pose.position)


@pytest.mark.parametrize("delay", [0.0, 0.5, 2.0])
def test_passed_goals_are_passed_within_tolerance_and_without_stopping(
    delay: float, rng: np.random.Generator
):
    """A precise hand comes as near to a goal on the way as its tolerance, at speed, and ends at the last."""
    tolerance = 0.02
    start, end = (beyond(AT, np.array([*way, 0.0, 0.0, 0.0])) for way in ((-0.2,) * 3, (0.2, -0.2, -0.1)))
    frames = {"over": AT, "end": end}
    script = (to("over", passing=True, position_tolerance=tolerance, grip=0.5), to("end"))
    doings, wishes, tools = acted(Errand(PRECISE, script, delay), Remote(start, delay), frames, rng)
    hands = np.array([wish.pose.position for wish in wishes])
    assert np.linalg.norm(hands - AT.position, axis=1).min() <= tolerance
    assert wishes[-1].grip == 0.0
    assert doings[-1].movements == 2
    assert within(tools[-1], end, script[1])
    turning = next(n for n, wish in enumerate(wishes) if wish.act == 1)
    assert wishes[turning].grip == 0.5
    moving = np.linalg.norm(np.diff(hands, axis=0), axis=1)[turning - 2 : turning + 8] / TICK
    assert moving.min() > 0.01
    assert np.abs(np.diff(moving)).max() < 0.04  # no jump: a minimum-jerk movement begins with no speed


def test_a_hand_does_not_wind_up_against_a_wall(rng: np.random.Generator):
    """Where the tool cannot go on, the hand stays ahead of it by the lean and what is still to go at most,
    and the act is given up when patience ends.
    """
    person = replace(Person(), patience=20.0, lean=0.03)
    start = Pose(AT.position - np.array([0.3, 0.1, 0.0]), AT.quaternion)
    remote = Remote(start, 0.25, lag=0.05, wall=AT.position[0] - 0.05)
    errand = Errand(person, (to("goal", grip=1.0), to("start")), 0.25)
    doings, wishes, tools = acted(errand, remote, {"goal": AT, "start": start}, rng)
    pressed = [n for n, wish in enumerate(wishes) if n * TICK > 4.0 and wish.act == 0]
    ahead = [np.linalg.norm(wishes[n].pose.position - tools[n].position) for n in pressed]
    assert max(ahead) < person.lean + 0.05 + 5 * person.along * 0.05
    assert max(ahead) > person.lean
    assert doings[-1].given_up == 1
    assert wishes[pressed[-1]].grip == 0.0
    assert pressed[-1] * TICK == pytest.approx(person.patience, abs=1.0)
    assert within(tools[-1], start, errand.script[1])


def test_a_tool_that_hangs_is_brought_to_its_goal(rng: np.random.Generator):
    """What comes of a wish may differ from it by less than the lean: the error seen is corrected still."""
    droop = Pose(np.array([0.0, 0.0, -0.03]), exp(0.5 * np.array([0.0, 0.1, 0.0])))
    errand, doing, tool = Errand(Person(), (to("goal"),)), begin(AT, 0.0), AT
    frames = {"goal": Pose(AT.position + 0.1, AT.quaternion)}
    for n in range(1, 3000):
        doing, wish = act_step(errand, doing, n * TICK, Seen(tool, frames), rng)
        tool = Pose(wish.pose.position + droop.position, (wish.pose @ droop).quaternion)
        if wish.done:
            break
    assert doing.given_up == 0
    assert within(tool, frames["goal"], errand.script[0])


@pytest.mark.parametrize("delay", [0.0, 1.0])
@pytest.mark.parametrize("tracking", [False, True])
def test_moving_the_world_moves_the_wish(delay: float, tracking: bool, rng: np.random.Generator):
    """With tool and objects moved by a pose, and the same noise, the hand is moved by it at all times."""
    new_from_old, start, goal = (random_pose(rng) for _ in range(3))
    over = random_pose(rng)
    script = (to("over", passing=True, position_tolerance=0.03), to("goal", tracking=tracking, dwell=0.5))
    runs = []
    for moved in (Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])), new_from_old):
        frames = {"goal": moved @ goal, "over": moved @ over}
        noise = np.random.default_rng(7)
        _, wishes, _ = acted(Errand(Person(), script, delay), Remote(moved @ start, delay), frames, noise)
        runs.append(wishes)
    assert len(runs[0]) == len(runs[1])
    for old, new in zip(*runs, strict=True):
        np.testing.assert_allclose(new.pose.position, (new_from_old @ old.pose).position, atol=1e-9)
        assert angle(new.pose.quaternion, (new_from_old @ old.pose).quaternion) < 1e-7


def test_the_same_seed_gives_the_same_bits(rng: np.random.Generator):
    """A person is a function: repeated with the same noise, every wish is the same to the last bit."""
    start, goal = random_pose(rng), random_pose(rng)
    runs = []
    for _ in range(2):
        errand, remote = Errand(Person(), (to("goal"),), 0.5), Remote(start, 0.5, lag=0.1)
        runs.append(acted(errand, remote, {"goal": goal}, np.random.default_rng(3))[1])
    for one, other in zip(*runs, strict=True):
        assert one.pose.position.tobytes() == other.pose.position.tobytes()
        assert one.pose.quaternion.tobytes() == other.pose.quaternion.tobytes()


def test_a_step_changes_no_value_it_was_given(rng: np.random.Generator):
    """A step from an earlier value again gives what it gave before: nothing was kept elsewhere."""
    errand, seen = Errand(Person(), (to("goal"),)), Seen(AT, {"goal": random_pose(rng)})
    first, _ = act_step(errand, begin(AT, 0.0), TICK, seen, rng)
    once, again = (act_step(errand, first, 0.2, seen, rng)[1] for _ in range(2))
    np.testing.assert_array_equal(once.pose.position, again.pose.position)
    assert first.time == TICK
    assert first.phase is Phase.MOVE_AND_WAIT


def test_quaternion_signs_do_not_matter(rng: np.random.Generator):
    """q and -q are one orientation: the hand goes the short way whichever is given."""
    goal = beyond(AT, np.array([0.1, 0.0, 0.0, 0.5, 0.0, 0.0]))
    flipped = Pose(goal.position, -goal.quaternion)
    ends = []
    for target in (goal, flipped):
        doings, _, _ = acted(
            Errand(PRECISE, (to("goal"),)), Remote(AT, 0.0), {"goal": target}, np.random.default_rng(0)
        )
        ends.append(doings[-1])
    assert ends[0].time == ends[1].time
    assert duration(PRECISE, np.array([0.1, 0, 0, 0.5, 0, 0]), 1.0) < 1.0
    np.testing.assert_allclose(ends[0].hand.quaternion, ends[1].hand.quaternion, atol=EXACT)
