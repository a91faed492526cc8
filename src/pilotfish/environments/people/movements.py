"""Sub-movements: open-loop pieces of a hand's way, each of minimum jerk; where two overlap they add up."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.environments.people.minimum_jerk import PEAK, minimum_jerk
from pilotfish.environments.people.offsets import beyond, lengths
from pilotfish.environments.people.person import Person
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """A way to go: metres in world axes and a rotation vector [rad] in the hand's axes, over duration [s]."""

    way: Float[Array, " 6"]
    began: float
    duration: float

    @property
    def end(self) -> float:
        return self.began + self.duration


def duration(person: Person, way: Float[Array, " 6"], speed: float) -> float:
    """The time [s] in which neither the hand's speed nor its turning exceeds that share of its peak."""
    distance, angle = lengths(way)
    fastest = max(distance / person.peak_speed, angle / person.peak_turn) / speed
    return max(person.shortest, PEAK * fastest)


def hand_at(rest: Pose, moves: Sequence[Movement], time: float) -> Pose:
    """Where a hand is that rested at rest before the moves, and goes each of them on its own clock."""
    for move in moves:
        share = minimum_jerk(np.asarray((time - move.began) / move.duration))
        rest = beyond(rest, share * move.way)
    return rest


def hand_after(rest: Pose, moves: Sequence[Movement]) -> Pose:
    """Where the hand rests again."""
    for move in moves:
        rest = beyond(rest, move.way)
    return rest


def still_to_go(moves: Sequence[Movement], time: float) -> Float[Array, " 6"]:
    """The sum of what the moves have not gone yet."""
    left = np.zeros(6)
    for move in moves:
        left += (1.0 - minimum_jerk(np.asarray((time - move.began) / move.duration))) * move.way
    return left
