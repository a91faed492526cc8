"""A generated stand-in for the valve recording, for machines that reach neither a folder nor a network."""

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    add_derivatives,
    demonstration,
    frame_from_pose,
    pose_layout,
)
from pilotfish.geometry import (
    Pose,
    conjugate,
    minimum_jerk,
    multiply,
    quaternion_exp,
    quaternion_log,
    rotation_matrix,
    unwrap_quaternions,
)
from pilotfish.types import Array, Float

ANGLES = ("180", "135", "90", "45", "157.5", "112.5", "67.5", "22.5")  # degrees
PERIOD, STEPS = 0.1, 200  # s, rows
CENTRE, RADIUS = np.array([0.59, -1.085, 0.26]), 0.175  # m, the valve's axis and how far out its handle is
START_POSITION, END_POSITION = (
    np.array([0.43, -0.73, 0.16]),
    np.array([0.93, -0.59, 0.18]),
)  # m, where the hand starts and ends
START_ANGLE = 2 * np.pi / 3  # rad; the hand starts turned like this handle: no handle is half a turn away
# Rows by which the handle is grasped, from and to which it turns, and at which it is left; give or take 3.
GRASP, TURN, RELEASE, LEAVE = 60, 75, 125, 140


def synthetic_valve(rng: np.random.Generator) -> tuple[Demonstration, ...]:
    """Eight generated openings of a valve. They are synthetic: no person and no robot made them.

    The hand reaches for the handle, holds it, turns it along its circle, lets go and moves away, in smooth
    minimum-jerk segments with small variations of place, turn and time. Columns, period, length, angles and
    frames ("valve before", "valve after") are those of datasets.valve(), so that code which runs on one runs
    on the other; numbers learned from it say nothing about the recording.
    Source: Flash & Hogan 1985, J. Neuroscience 5(7), for the minimum-jerk profile.
    """
    return tuple(_generate_demonstration(rng, degrees) for degrees in ANGLES)


def _generate_demonstration(rng: np.random.Generator, degrees: str) -> Demonstration:
    angle, layout = np.radians(float(degrees)), pose_layout()
    grasp, start, end, leave = (row + int(rng.integers(-3, 4)) for row in (GRASP, TURN, RELEASE, LEAVE))
    handles = _handle_poses(angle * (1 - _minimum_jerk(start, end)))
    x = _interpolate_poses(
        _constant_pose(START_POSITION, START_ANGLE, _random_offset(rng, 0.02)),
        _compose_poses(handles, _random_offset(rng, 0.003)),
        _minimum_jerk(0, grasp),
    )
    x = _interpolate_poses(
        x, _constant_pose(END_POSITION, 0.0, _random_offset(rng, 0.02)), _minimum_jerk(leave, STEPS - 1)
    )
    x = np.hstack(
        [x[:, :3] + _smooth_noise(rng, 0.002), multiply(x[:, 3:], quaternion_exp(_smooth_noise(rng, 0.005)))]
    )
    frames = [
        frame_from_pose(name, layout, Pose(row[:3], row[3:]))
        for name, row in zip(
            ("valve before", "valve after"), _handle_poses(np.array([angle, 0.0])), strict=True
        )
    ]
    return add_derivatives(demonstration(x, PERIOD, layout, frames, f"synthetic valve {degrees} deg"))


def _minimum_jerk(start: int, end: int) -> Float[Array, " T"]:
    """Return the fraction of a minimum-jerk movement between two rows at each row."""
    return minimum_jerk((np.arange(STEPS) - start) / (end - start))


def _handle_poses(orientation_starts: Float[Array, " T"]) -> Float[Array, "T 7"]:
    """Poses of the handle when the valve is so far from open [rad]; it turns about the world's y."""
    zero = np.zeros_like(orientation_starts)
    positions = CENTRE + RADIUS * np.stack(
        [np.cos(orientation_starts), zero, -np.sin(orientation_starts)], axis=1
    )
    upright = quaternion_exp(np.array([np.pi / 4, 0.0, 0.0]))  # the handle's z points into the valve
    return np.hstack(
        [positions, multiply(quaternion_exp(np.stack([zero, orientation_starts / 2, zero], axis=1)), upright)]
    )


def _constant_pose(place: Float[Array, " 3"], angle: float, slip: Pose) -> Float[Array, "T 7"]:
    """A hand that stays at a place, turned as the handle is at that turn, but for a slip."""
    orientation = _handle_poses(np.array([angle]))[0, 3:]
    return _compose_poses(np.tile(np.concatenate([place, orientation]), (STEPS, 1)), slip)


def _random_offset(rng: np.random.Generator, scale: float) -> Pose:
    """How far off a hand is: scale [m] in place, a degree or two about each axis."""
    return Pose(rng.normal(scale=scale, size=3), quaternion_exp(rng.normal(scale=0.02, size=3)))


def _compose_poses(poses: Float[Array, "T 7"], by: Pose) -> Float[Array, "T 7"]:
    """Each pose followed by one and the same: world_from_handle, then handle_from_hand."""
    q = poses[:, 3:]
    return np.hstack([poses[:, :3] + rotation_matrix(q) @ by.position, multiply(q, by.quaternion)])


def _interpolate_poses(
    a: Float[Array, "T 7"], b: Float[Array, "T 7"], share: Float[Array, " T"]
) -> Float[Array, "T 7"]:
    """From the path a to the path b: straight in place, the shorter way round in orientation."""
    p, q = a[:, 3:], b[:, 3:]
    q = np.where(np.einsum("td,td->t", p, q)[:, None] < 0, -q, q)
    between = multiply(p, quaternion_exp(share[:, None] * quaternion_log(multiply(conjugate(p), q))))
    return np.hstack([a[:, :3] + share[:, None] * (b[:, :3] - a[:, :3]), unwrap_quaternions(between)])


def _smooth_noise(rng: np.random.Generator, scale: float) -> Float[Array, "T 3"]:
    """A smooth trembling about zero, a few times scale at most: four slow waves for each axis."""
    phases = np.arange(1, 5)[:, None] * np.linspace(0, 2 * np.pi, STEPS)  # (4, T)
    heights, shifts = rng.normal(scale=scale / 2, size=(3, 4)), rng.uniform(0, 2 * np.pi, size=(3, 4))
    return np.asarray(np.einsum("aw,awt->ta", heights, np.sin(phases + shifts[..., None])))
