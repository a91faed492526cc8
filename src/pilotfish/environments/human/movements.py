"""Sub-movements: open-loop pieces of a hand's way, each of minimum jerk; where two overlap they add up."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.environments.human.minimum_jerk import PEAK_TO_MEAN_SPEED, minimum_jerk
from pilotfish.environments.human.offsets import add_offset, offset_norms
from pilotfish.environments.human.person import HumanModel
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True, eq=False)
class Submovement:
    """A way to go: metres in world axes and a rotation vector [rad] in the hand's axes, over duration [s]."""

    displacement: Float[Array, " 6"]
    start: float
    duration: float

    @property
    def end(self) -> float:
        return self.start + self.duration


def duration(human_model: HumanModel, displacement: Float[Array, " 6"], speed: float) -> float:
    """The time [s] in which neither the hand's speed nor its turning exceeds that share of its peak."""
    distance, angle = offset_norms(displacement)
    fastest = max(distance / human_model.peak_speed, angle / human_model.peak_angular_speed) / speed
    return max(human_model.min_duration, PEAK_TO_MEAN_SPEED * fastest)


def hand_pose(rest_pose: Pose, submovements: Sequence[Submovement], time: float) -> Pose:
    """Where a hand is that rested at rest before the moves, and goes each of them on its own clock."""
    for move in submovements:
        share = minimum_jerk(np.asarray((time - move.start) / move.duration))
        rest_pose = add_offset(rest_pose, share * move.displacement)
    return rest_pose


def final_hand_pose(rest_pose: Pose, submovements: Sequence[Submovement]) -> Pose:
    """Where the hand rests again."""
    for move in submovements:
        rest_pose = add_offset(rest_pose, move.displacement)
    return rest_pose


def remaining_displacement(submovements: Sequence[Submovement], time: float) -> Float[Array, " 6"]:
    """The sum of what the moves have not gone yet."""
    left = np.zeros(6)
    for move in submovements:
        left += (1.0 - minimum_jerk(np.asarray((time - move.start) / move.duration))) * move.displacement
    return left
