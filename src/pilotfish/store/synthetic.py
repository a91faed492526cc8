"""A generated stand-in for the valve recording, for machines that reach neither a folder nor a network."""

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    demonstration,
    frame_from_pose,
    pose_layout,
    with_derivatives,
)
from pilotfish.geometry import Pose, conjugate, continuous, exp, log, multiply, normalise, pose
from pilotfish.types import Array, Float

ANGLES = ("180", "135", "90", "45", "157.5", "112.5", "67.5", "22.5")  # degrees
PERIOD, STEPS = 0.1, 200  # s, rows
CENTRE, RADIUS = np.array([0.59, -1.085, 0.26]), 0.175  # m, the valve's axis and its handle
HOME = pose([0.43, -0.73, 0.16], normalise(np.array([0.15, 0.13, -0.73, 0.65])))
REST = pose([0.93, -0.59, 0.18], normalise(np.array([0.72, 0.68, -0.08, 0.1])))
GRASP, TURN, RELEASE, LEAVE = 60, 75, 125, 140  # the rows at which the hand begins to, give or take three


def synthetic_valve(rng: np.random.Generator) -> tuple[Demonstration, ...]:
    """Eight generated openings of a valve. They are synthetic: no person and no robot made them.

    The hand reaches for the handle, holds it, turns it along its circle, lets go and moves away, in smooth
    minimum-jerk segments with small variations of place, turn and time. Columns, period, length, angles and
    frames ("valve before", "valve after") are those of datasets.valve(), so that code which runs on one runs
    on the other; numbers learned from it say nothing about the recording.
    Source: Flash & Hogan 1985, J. Neuroscience 5(7), for the minimum-jerk profile.
    """
    return tuple(_opening(rng, degrees) for degrees in ANGLES)


def _opening(rng: np.random.Generator, degrees: str) -> Demonstration:
    layout, turn = pose_layout(), np.radians(float(degrees))
    grasp, start, release, leave = (row + int(rng.integers(-3, 4)) for row in (GRASP, TURN, RELEASE, LEAVE))
    grip = Pose(rng.normal(scale=0.003, size=3), exp(rng.normal(scale=0.02, size=3)))  # handle_from_hand
    hands = _carried(_handles(turn * (1 - _minimum_jerk(start, release))), grip)
    x = _blended(_fixed(_varied(rng, HOME)), hands, _minimum_jerk(0, grasp))
    x = _blended(x, _fixed(_varied(rng, REST)), _minimum_jerk(leave, STEPS - 1))
    x = np.hstack([x[:, :3] + _wobble(rng, 0.002), _turned(x[:, 3:], _wobble(rng, 0.005))])
    poses = {"valve before": _handle(turn), "valve after": _handle(0.0)}
    frames = [frame_from_pose(name, layout, where) for name, where in poses.items()]
    return with_derivatives(demonstration(x, PERIOD, layout, frames, f"synthetic valve {degrees} deg"))


def _minimum_jerk(start: int, end: int) -> Float[Array, " T"]:
    """From 0 at the start row to 1 at the end row, with speed and acceleration zero at both."""
    s = np.clip((np.arange(STEPS) - start) / (end - start), 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def _handle(turn: float) -> Pose:
    """Where the handle is when the valve is so far from open [rad]; it turns about the world's y."""
    place = CENTRE + RADIUS * np.array([np.cos(turn), 0.0, -np.sin(turn)])
    upright = exp(np.array([np.pi / 4, 0.0, 0.0]))  # the handle's z points into the valve
    return Pose(place, multiply(exp(np.array([0.0, turn / 2, 0.0])), upright))


def _handles(turns: Float[Array, " T"]) -> list[Pose]:
    return [_handle(float(turn)) for turn in turns]


def _carried(handles: list[Pose], grip: Pose) -> Float[Array, "T 7"]:
    """World poses of a hand that holds the handle so, as rows."""
    hands = [handle @ grip for handle in handles]
    return np.stack([np.concatenate([hand.position, hand.quaternion]) for hand in hands])


def _fixed(where: Pose) -> Float[Array, "T 7"]:
    return np.tile(np.concatenate([where.position, where.quaternion]), (STEPS, 1))


def _varied(rng: np.random.Generator, where: Pose) -> Pose:
    return where @ Pose(rng.normal(scale=0.02, size=3), exp(rng.normal(scale=0.03, size=3)))


def _blended(
    a: Float[Array, "T 7"], b: Float[Array, "T 7"], share: Float[Array, " T"]
) -> Float[Array, "T 7"]:
    """From the path a to the path b: straight in place, along the geodesic in orientation."""
    places = a[:, :3] + share[:, None] * (b[:, :3] - a[:, :3])
    p, q = a[:, 3:], b[:, 3:]
    q = np.where(np.einsum("td,td->t", p, q)[:, None] < 0, -q, q)
    return np.hstack([places, continuous(multiply(p, exp(share[:, None] * log(multiply(conjugate(p), q)))))])


def _turned(q: Float[Array, "T 4"], by: Float[Array, "T 3"]) -> Float[Array, "T 4"]:
    return multiply(q, exp(by))


def _wobble(rng: np.random.Generator, scale: float) -> Float[Array, "T 3"]:
    """A smooth trembling about zero of standard deviation scale: four slow waves an axis."""
    waves = np.arange(1, 5)[:, None] * np.linspace(0, 2 * np.pi, STEPS)
    heights, shifts = (
        rng.normal(scale=scale / np.sqrt(2), size=(3, 4)),
        rng.uniform(0, 2 * np.pi, size=(3, 4)),
    )
    return np.asarray(np.einsum("aw,awt->ta", heights, np.sin(waves[None] + shifts[..., None])))
