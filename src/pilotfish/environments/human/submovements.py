"""Sub-movements: open-loop minimum-jerk displacements of the hand; overlapping ones add up."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.environments.human.human_model import HumanModel
from pilotfish.environments.human.pose_offsets import add_offset, offset_norms
from pilotfish.geometry import Pose, minimum_jerk
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

PEAK_TO_MEAN_SPEED = 1.875  # of a minimum-jerk movement


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Submovement:
    """Displacement of the hand by a minimum-jerk profile.

    Attributes:
        displacement: Translation in world axes [m], then rotation vector in hand axes [rad].
        start: Start time [s].
        duration: Duration [s].
    """

    displacement: Float[Array, " 6"]
    start: float
    duration: float

    @property
    def end(self) -> float:
        """Return the end time [s]."""
        return self.start + self.duration

    def at(self, time: float) -> Float[Array, " 6"]:
        """Return the part of the displacement that is completed at a time [s]."""
        return np.asarray(minimum_jerk(np.asarray((time - self.start) / self.duration)) * self.displacement)


def submovement_duration(
    human_model: HumanModel, displacement: Float[Array, " 6"], speed_factor: float
) -> float:
    """Return the duration in which no speed exceeds the speed factor times its peak [s]."""
    distance, angle = offset_norms(displacement)
    mean = max(distance / human_model.peak_speed, angle / human_model.peak_angular_speed) / speed_factor
    return max(human_model.min_duration, PEAK_TO_MEAN_SPEED * mean)


def hand_pose(rest_pose: Pose, submovements: Sequence[Submovement], time: float) -> Pose:
    """Return the pose at a time of a hand that rested at rest_pose before the sub-movements."""
    for submovement in submovements:
        rest_pose = add_offset(rest_pose, submovement.at(time))
    return rest_pose


def final_hand_pose(rest_pose: Pose, submovements: Sequence[Submovement]) -> Pose:
    """Return the pose of the hand after all sub-movements."""
    for submovement in submovements:
        rest_pose = add_offset(rest_pose, submovement.displacement)
    return rest_pose


def remaining_displacement(submovements: Sequence[Submovement], time: float) -> Float[Array, " 6"]:
    """Return the sum of the displacements that are not completed at a time [s]."""
    remaining = np.zeros(6)
    for submovement in submovements:
        share = minimum_jerk(np.asarray((time - submovement.start) / submovement.duration))
        remaining += (1.0 - share) * submovement.displacement
    return remaining
