"""Following a moving goal in one closed loop: the crossover model, and what a person remembers for it."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from pilotfish.environments.people.offsets import between, shortened
from pilotfish.environments.people.person import Person
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float

ROUNDING = 1e-9  # s: times are sums of periods


@dataclass(frozen=True, slots=True, eq=False)
class Glance:
    """What was seen at a time: the tool, and where it should have been."""

    time: float
    tool: Pose
    goal: Pose


def crossover_frequency(person: Person, round_trip: float) -> float:
    """w_c [rad/s]: a loop w_c exp(-j w (tau_e + round_trip)) / (j w) crosses unit gain with the phase margin.

    Source: McRuer & Jex 1967, IEEE Trans. Human Factors in Electronics 8(3); the margin fixes w_c.
    """
    return (pi / 2 - person.phase_margin) / (person.tau_e + round_trip)


def remembered(memory: Sequence[Glance], now: Glance, span: float) -> tuple[Glance, ...]:
    """The glances of the last span [s], and the one just before them."""
    old = [n for n, glance in enumerate(memory) if glance.time <= now.time - span + ROUNDING]
    return (*memory[old[-1] if old else 0 :], now)


def goal_speed(memory: Sequence[Glance]) -> Float[Array, " 3"]:
    """The goal's speed as seen over what is remembered [m/s]; nothing after a single glance."""
    first, last = memory[0], memory[-1]
    if last.time <= first.time:
        return np.zeros(3)
    return np.asarray((last.goal.position - first.goal.position) / (last.time - first.time))


def tracking_speed(
    person: Person, memory: Sequence[Glance], round_trip: float, share: float
) -> Float[Array, " 6"]:
    """The hand's speed [m/s] and turning [rad/s]: w_c times the error seen tau_e ago.

    No faster than the share of the peaks; nothing before tau_e has passed.
    """
    then, now = memory[0], memory[-1]
    if then.time > now.time - person.tau_e + ROUNDING:
        return np.zeros(6)
    answer = crossover_frequency(person, round_trip) * between(then.tool, then.goal)
    answer[:3] += person.pursuit * goal_speed(memory)
    return shortened(answer, share * person.peak_speed, share * person.peak_turn)
