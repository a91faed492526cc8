"""How far a person has come with what they do."""

from dataclasses import dataclass, replace
from enum import Enum
from math import inf

import numpy as np

from pilotfish.environments.people.crossover import Glance
from pilotfish.environments.people.movements import Movement
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float

Phase = Enum("Phase", ["MOVE_AND_WAIT", "TRACKING", "DONE"])


@dataclass(frozen=True, slots=True, eq=False)
class Doing:
    """A person at work.

    time       of the last step [s]
    hand       where the hand was then
    grip       what it asks of the gripper
    act        index of the act, phase what is done for it
    act_began  time [s], and tries the sub-movements made since
    until      when the dwell is over [s]; infinite while the goal has not been reached
    near       since when a tracked goal is within tolerance [s]; infinite when it is not
    rest       where the hand rested before the moves that are not over
    at_rest    when the hand rests again, or rested [s]
    ahead      from the tool to the hand, as last seen when both rested [m], [rad]
    memory     what was seen of a moving goal and the tool, oldest first
    movements  sub-movements made in all: open-loop moves
    path       travelled by the hand [m]
    given_up   acts that were left without reaching their goal
    """

    time: float
    hand: Pose
    grip: float
    act: int
    phase: Phase
    act_began: float
    tries: int
    until: float
    near: float
    rest: Pose
    moves: tuple[Movement, ...]
    at_rest: float
    ahead: Float[Array, " 6"]
    memory: tuple[Glance, ...]
    movements: int
    path: float
    given_up: int


def begin(tool: Pose, time: float, grip: float = 0.0) -> Doing:
    """A person whose hand stands for the tool where it is, before the first act."""
    return Doing(
        time=float(time),
        hand=tool,
        grip=grip,
        act=0,
        phase=Phase.MOVE_AND_WAIT,
        act_began=float(time),
        tries=0,
        until=inf,
        near=inf,
        rest=tool,
        moves=(),
        at_rest=-inf,
        ahead=np.zeros(6),
        memory=(),
        movements=0,
        path=0.0,
        given_up=0,
    )


def next_act(doing: Doing, acts: int) -> Doing:
    """The same hand at the beginning of the next of so many acts, or done with all."""
    phase = Phase.DONE if doing.act + 1 == acts else Phase.MOVE_AND_WAIT
    return replace(
        doing,
        act=min(doing.act + 1, acts - 1),
        phase=phase,
        act_began=doing.time,
        tries=0,
        until=inf,
        near=inf,
        memory=(),
    )
