"""Aiming a sub-movement by the error that is seen, and missing by noise that grows with its length."""

import numpy as np

from pilotfish.environments.people.offsets import between, beyond, lengths, shortened
from pilotfish.environments.people.person import Person
from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.types import Array, Float


def aim(person: Person, hand: Pose, tool: Pose, goal: Pose, rng: np.random.Generator) -> Float[Array, " 6"]:
    """The way for the hand that takes the tool seen to the goal, but for gain and noise.

    The hand keeps what it is ahead of the tool, as a tool that hangs or presses needs it, up to the lean.
    """
    ahead = shortened(between(tool, hand), person.lean, person.turn_lean)
    wanted = beyond(tool, missed(person, person.gain * between(tool, goal), tool, rng))
    return between(hand, beyond(wanted, ahead))


def missed(
    person: Person, way: Float[Array, " 6"], tool: Pose, rng: np.random.Generator
) -> Float[Array, " 6"]:
    """The way as it comes out: its end scatters along and across it, and about three axes of the turn.

    Noise is drawn in the axes of the tool, so that it turns with the world.
    Source: Schmidt et al. 1979, Psychological Review 86, and Harris & Wolpert 1998, Nature 394: deviations
    proportional to amplitude; Gordon et al. 1994, Exp. Brain Research 99: larger along than across.
    """
    distance, angle = lengths(way)
    noise, turn_noise = rng.standard_normal((2, 3))
    noise = rotation_matrix(tool.quaternion) @ noise
    direction = way[:3] / distance if distance > 0.0 else np.zeros(3)
    on_it = (noise @ direction) * direction
    scatter = max(person.floor, person.along * distance) * on_it
    scatter = scatter + max(person.floor, person.across * distance) * (noise - on_it)
    turn_scatter = max(person.turn_floor, person.turn_noise * angle) * turn_noise
    return np.asarray(way + np.concatenate([scatter, turn_scatter]))
