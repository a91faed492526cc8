"""Compensatory tracking of a moving goal by the crossover model.

The loop of person and tool behaves like w_c exp(-j w (tau_e + round_trip)) / (j w) near its crossover: the
hand moves with a velocity proportional to the error that was observed tau_e ago. So the person must remember
what was observed during the last tau_e.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from pilotfish.environments.human.human_model import HumanModel
from pilotfish.environments.human.pose_offsets import clip_offset, pose_difference
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

TIME_TOLERANCE = 1e-9  # s: times are sums of periods


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """Tool and goal as observed at one time.

    Attributes:
        time: Time of the observation [s].
        tool: Pose of the tool.
        goal: Pose where it should be.
    """

    time: float
    tool: Pose
    goal: Pose


def crossover_frequency(human_model: HumanModel, round_trip: float) -> float:
    """Return w_c [rad/s], at which the loop crosses unit gain with the person's phase margin.

    Source:
        McRuer & Jex 1967, IEEE Trans. Human Factors in Electronics 8(3); here the margin determines w_c.
    """
    return (pi / 2 - human_model.phase_margin) / (human_model.tau_e + round_trip)


def append_sample(samples: Sequence[Sample], sample: Sample, span: float) -> tuple[Sample, ...]:
    """Append a sample, and drop all but one of those older than the span [s]."""
    old = [n for n, s in enumerate(samples) if s.time <= sample.time - span + TIME_TOLERANCE]
    return (*samples[old[-1] if old else 0 :], sample)


def goal_velocity(samples: Sequence[Sample]) -> Float[Array, " 3"]:
    """Return the mean velocity of the goal over the samples [m/s]; zero for a single sample."""
    first, last = samples[0], samples[-1]
    if last.time <= first.time:
        return np.zeros(3)
    return np.asarray((last.goal.position - first.goal.position) / (last.time - first.time))


def tracking_velocity(
    human_model: HumanModel, samples: Sequence[Sample], round_trip: float, speed_factor: float
) -> Float[Array, " 6"]:
    """Return the velocity of the hand [m/s, rad/s]: w_c times the error observed tau_e ago.

    It is limited to the speed factor times the person's peak speeds, and zero before tau_e has passed.
    """
    oldest, newest = samples[0], samples[-1]
    if oldest.time > newest.time - human_model.tau_e + TIME_TOLERANCE:
        return np.zeros(6)
    error = pose_difference(oldest.tool, oldest.goal)
    velocity = crossover_frequency(human_model, round_trip) * error
    velocity[:3] += human_model.feedforward_gain * goal_velocity(samples)
    return clip_offset(
        velocity, speed_factor * human_model.peak_speed, speed_factor * human_model.peak_angular_speed
    )
