"""Following a moving goal in one closed loop: the crossover model, and what a person remembers for it."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from pilotfish.environments.human.offsets import clip_offset, pose_difference
from pilotfish.environments.human.person import HumanModel
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float

TIME_TOLERANCE = 1e-9  # s: times are sums of periods


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """What was seen at a time: the tool, and where it should have been."""

    time: float
    tool: Pose
    goal: Pose


def crossover_frequency(human_model: HumanModel, round_trip: float) -> float:
    """w_c [rad/s]: a loop w_c exp(-j w (tau_e + round_trip)) / (j w) crosses unit gain with the phase margin.

    Source: McRuer & Jex 1967, IEEE Trans. Human Factors in Electronics 8(3); the margin fixes w_c.
    """
    return (pi / 2 - human_model.phase_margin) / (human_model.tau_e + round_trip)


def append_sample(samples: Sequence[Sample], now: Sample, span: float) -> tuple[Sample, ...]:
    """The glances of the last span [s], and the one just before them."""
    old = [n for n, glance in enumerate(samples) if glance.time <= now.time - span + TIME_TOLERANCE]
    return (*samples[old[-1] if old else 0 :], now)


def goal_velocity(samples: Sequence[Sample]) -> Float[Array, " 3"]:
    """The goal's speed as seen over what is remembered [m/s]; nothing after a single glance."""
    first, last = samples[0], samples[-1]
    if last.time <= first.time:
        return np.zeros(3)
    return np.asarray((last.goal.position - first.goal.position) / (last.time - first.time))


def tracking_velocity(
    human_model: HumanModel, samples: Sequence[Sample], round_trip: float, share: float
) -> Float[Array, " 6"]:
    """The hand's speed [m/s] and turning [rad/s]: w_c times the error seen tau_e ago.

    No faster than the share of the peaks; nothing before tau_e has passed.
    """
    then, now = samples[0], samples[-1]
    if then.time > now.time - human_model.tau_e + TIME_TOLERANCE:
        return np.zeros(6)
    answer = crossover_frequency(human_model, round_trip) * pose_difference(then.tool, then.goal)
    answer[:3] += human_model.feedforward_gain * goal_velocity(samples)
    return clip_offset(answer, share * human_model.peak_speed, share * human_model.peak_angular_speed)
