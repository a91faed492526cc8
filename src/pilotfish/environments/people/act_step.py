"""One step of a person at work: look, move, wait, look again, or follow a moving goal; stay; go on."""

from dataclasses import replace
from math import inf

import numpy as np

from pilotfish.environments.people.acts import Act, Errand, Seen, Wish, within
from pilotfish.environments.people.aiming import aim
from pilotfish.environments.people.crossover import (
    ROUNDING,
    Glance,
    goal_speed,
    remembered,
    tracking_speed,
)
from pilotfish.environments.people.doing import Doing, Phase, next_act
from pilotfish.environments.people.movements import Movement, duration, hand_after, hand_at, still_to_go
from pilotfish.environments.people.offsets import between, beyond, lengths, shortened
from pilotfish.geometry import Pose


def act_step(
    errand: Errand, doing: Doing, time: float, seen: Seen, rng: np.random.Generator
) -> tuple[Doing, Wish]:
    """The person at a later time, having seen the picture that arrives then, and what the hand asks.

    Looks and endings fall on steps: what is due between two happens at the second.
    Source: Ferrell 1965, IEEE Trans. Human Factors in Electronics 6, for moving and waiting; McRuer &
    Jex 1967, the same 8(3), for tracking.
    """
    time = float(time)  # comparing numbers of NumPy gives no plain True
    then, doing = doing, _moved(doing, time)
    if doing.phase is not Phase.DONE and time >= doing.until - ROUNDING:
        doing = next_act(doing, len(errand.script))
    if doing.phase is not Phase.DONE:
        act = errand.script[doing.act]
        now = Glance(time, seen.tool, act.goal(seen.frames))
        if act.tracking:
            doing = replace(doing, memory=remembered(doing.memory, now, errand.person.tau_e))
        if doing.phase is Phase.TRACKING:
            doing = _track(errand, doing, now, time - then.time)
        else:
            doing = _move_and_wait(errand, doing, now, rng)
    travelled = float(np.linalg.norm(doing.hand.position - then.hand.position))
    doing = replace(doing, path=doing.path + travelled)
    return doing, Wish(doing.hand, doing.grip, doing.act, doing.phase is Phase.DONE)


def _moved(doing: Doing, time: float) -> Doing:
    """The hand where its moves have taken it; moves that are over, and none is before them, become rest."""
    rest, moves = doing.rest, doing.moves
    while moves and moves[0].end <= time:
        rest, moves = beyond(rest, moves[0].way), moves[1:]
    return replace(doing, time=time, hand=hand_at(rest, moves, time), rest=rest, moves=moves)


def _move_and_wait(errand: Errand, doing: Doing, now: Glance, rng: np.random.Generator) -> Doing:
    """Nothing while a movement is under way or its effect not yet seen, and a look at what came of it then.

    The first look at an act is at once: a hand that is still moving will take the tool where it was aimed.
    """
    act, person = errand.script[doing.act], errand.person
    if act.passing and doing.tries and _nearly_there(act, doing):
        return next_act(replace(doing, grip=act.grip), len(errand.script))
    if doing.until < inf and not act.tracking:
        return doing
    settled = now.time >= doing.at_rest + person.reaction + errand.round_trip - ROUNDING
    watching = act.tracking and now.time < doing.act_began + person.reaction - ROUNDING
    if watching or (doing.tries and not settled):
        return doing
    if settled:
        ahead = shortened(between(now.tool, doing.hand), person.lean, person.turn_lean)
        return _look(errand, replace(doing, ahead=ahead), now, settled, rng)
    expected = beyond(hand_after(doing.rest, doing.moves), -doing.ahead)
    return _look(errand, doing, replace(now, tool=expected), settled, rng)


def _nearly_there(act: Act, doing: Doing) -> bool:
    distance, angle = lengths(still_to_go(doing.moves, doing.time))
    return distance <= act.position_tolerance and angle <= act.angle_tolerance


def _look(errand: Errand, doing: Doing, now: Glance, settled: bool, rng: np.random.Generator) -> Doing:
    """What the person decides on seeing or, unsettled, expecting the tool there.

    The goal is reached; or track it; or give up; or aim again.
    """
    act = errand.script[doing.act]
    there = (settled or act.passing) and within(now.tool, now.goal, act)
    if there and doing.until == inf:
        doing = replace(doing, until=now.time + act.dwell, grip=act.grip)
    if act.tracking and errand.round_trip <= errand.person.wait_above and (there or doing.tries):
        return replace(doing, phase=Phase.TRACKING, rest=doing.hand, moves=())
    if _out_of_patience(errand, doing):
        return next_act(replace(doing, given_up=doing.given_up + 1), len(errand.script))
    led = _led(errand, doing, now)
    return doing if within(now.tool, led, act) else _aimed(errand, doing, replace(now, goal=led), rng)


def _out_of_patience(errand: Errand, doing: Doing) -> bool:
    return doing.until == inf and doing.time - doing.act_began > errand.person.patience


def _led(errand: Errand, doing: Doing, now: Glance) -> Pose:
    """Where a moving goal will be seen at the next look, as long as it keeps its speed."""
    if not doing.memory:
        return now.goal
    act, person = errand.script[doing.act], errand.person
    cycle = duration(person, person.gain * between(now.tool, now.goal), act.speed)
    cycle += person.reaction + errand.round_trip
    return Pose(now.goal.position + cycle * goal_speed(doing.memory), now.goal.quaternion)


def _aimed(errand: Errand, doing: Doing, now: Glance, rng: np.random.Generator) -> Doing:
    """The person as the next sub-movement begins."""
    person, speed = errand.person, errand.script[doing.act].speed
    way = aim(person, hand_after(doing.rest, doing.moves), now.tool, now.goal, rng)
    move = Movement(way, now.time, duration(person, way, speed))
    return replace(
        doing,
        moves=(*doing.moves, move),
        at_rest=max(doing.at_rest, move.end),
        tries=doing.tries + 1,
        movements=doing.movements + 1,
    )


def _track(errand: Errand, doing: Doing, now: Glance, elapsed: float) -> Doing:
    """The hand moved on by the speed that the error asks for.

    The goal is reached when it has stayed within tolerance for a reaction time.
    """
    act, person = errand.script[doing.act], errand.person
    if errand.round_trip > person.wait_above:
        return replace(doing, phase=Phase.MOVE_AND_WAIT)
    if _out_of_patience(errand, doing):
        return next_act(replace(doing, given_up=doing.given_up + 1), len(errand.script))
    hand = _followed(errand, doing, now, elapsed)
    near = min(doing.near, now.time) if within(now.tool, now.goal, act) else inf
    doing = replace(doing, hand=hand, rest=hand, near=near, at_rest=now.time)
    if doing.until == inf and now.time - near >= person.reaction - ROUNDING:
        return replace(doing, until=now.time + act.dwell, grip=act.grip)
    return doing


def _followed(errand: Errand, doing: Doing, now: Glance, elapsed: float) -> Pose:
    """Where tracking takes the hand: ahead of the tool by at most the lean and the way gone in the delay."""
    person, share = errand.person, errand.script[doing.act].speed
    speed = tracking_speed(person, doing.memory, errand.round_trip, share)
    hand = beyond(doing.hand, elapsed * speed)
    delay = share * (person.tau_e + errand.round_trip)
    furthest = person.lean + person.peak_speed * delay, person.turn_lean + person.peak_turn * delay
    return beyond(now.tool, shortened(between(now.tool, hand), *furthest))
