"""Synthetic valve recordings, for machines without the real ones and without a network."""

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
CENTRE, RADIUS = np.array([0.59, -1.085, 0.26]), 0.175  # m: axis of the valve, distance of its handle
START_POSITION, END_POSITION = np.array([0.43, -0.73, 0.16]), np.array([0.93, -0.59, 0.18])  # m, of the hand
START_ANGLE = 2 * np.pi / 3  # rad: initial orientation of the hand; no handle is half a turn away from it
# Rows at which the handle is grasped, begins to turn, is turned, and is left; each varies by up to 3.
GRASP, TURN_START, TURN_END, LEAVE = 60, 75, 125, 140


def synthetic_valve(rng: np.random.Generator) -> tuple[Demonstration, ...]:
    """Return eight synthetic openings of a valve, with the same columns and frames as `datasets.valve()`.

    The hand reaches for the handle, turns it along a circle and moves away, in minimum-jerk segments with
    small random variations of position, orientation and time. Period, length, angles and frames ("valve
    before", "valve after") are those of the recordings, so code for one runs on the other. Results on one do
    not hold for the other.

    Args:
        rng: Source of the variations; a seed gives the same demonstrations on every machine.

    Source:
        Flash & Hogan 1985, J. Neuroscience 5(7), for the minimum-jerk profile.
    """
    return tuple(_generate_demonstration(rng, degrees) for degrees in ANGLES)


def _generate_demonstration(rng: np.random.Generator, degrees: str) -> Demonstration:
    angle, layout = np.radians(float(degrees)), pose_layout()
    rows = (GRASP, TURN_START, TURN_END, LEAVE)
    grasp, start, end, leave = (row + int(rng.integers(-3, 4)) for row in rows)
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


def _handle_poses(angles: Float[Array, " T"]) -> Float[Array, "T 7"]:
    """Return poses of the handle for angles from the open position [rad], about the y axis of the world."""
    zero = np.zeros_like(angles)
    positions = CENTRE + RADIUS * np.stack([np.cos(angles), zero, -np.sin(angles)], axis=1)
    z_into_valve = quaternion_exp(np.array([np.pi / 4, 0.0, 0.0]))
    return np.hstack(
        [positions, multiply(quaternion_exp(np.stack([zero, angles / 2, zero], axis=1)), z_into_valve)]
    )


def _constant_pose(position: Float[Array, " 3"], angle: float, offset: Pose) -> Float[Array, "T 7"]:
    """Return rows of one pose: a position, with the orientation of the handle at an angle, then an offset."""
    orientation = _handle_poses(np.array([angle]))[0, 3:]
    return _compose_poses(np.tile(np.concatenate([position, orientation]), (STEPS, 1)), offset)


def _random_offset(rng: np.random.Generator, scale: float) -> Pose:
    """Draw an offset: scale [m] in position, 0.02 half-angle [rad] about each axis."""
    return Pose(rng.normal(scale=scale, size=3), quaternion_exp(rng.normal(scale=0.02, size=3)))


def _compose_poses(poses: Float[Array, "T 7"], offset: Pose) -> Float[Array, "T 7"]:
    """Return world_from_hand for poses world_from_handle and the offset handle_from_hand."""
    q = poses[:, 3:]
    return np.hstack([poses[:, :3] + rotation_matrix(q) @ offset.position, multiply(q, offset.quaternion)])


def _interpolate_poses(
    a: Float[Array, "T 7"], b: Float[Array, "T 7"], share: Float[Array, " T"]
) -> Float[Array, "T 7"]:
    """Interpolate between paths: linearly in position, along the shorter rotation in orientation."""
    p, q = a[:, 3:], b[:, 3:]
    q = np.where(np.einsum("td,td->t", p, q)[:, None] < 0, -q, q)
    between = multiply(p, quaternion_exp(share[:, None] * quaternion_log(multiply(conjugate(p), q))))
    return np.hstack([a[:, :3] + share[:, None] * (b[:, :3] - a[:, :3]), unwrap_quaternions(between)])


def _smooth_noise(rng: np.random.Generator, scale: float) -> Float[Array, "T 3"]:
    """Draw smooth noise about zero: four slow waves for each axis, with amplitudes of about scale."""
    phases = np.arange(1, 5)[:, None] * np.linspace(0, 2 * np.pi, STEPS)  # (4, T)
    amplitudes, shifts = rng.normal(scale=scale / 2, size=(3, 4)), rng.uniform(0, 2 * np.pi, size=(3, 4))
    return np.asarray(np.einsum("aw,awt->ta", amplitudes, np.sin(phases + shifts[..., None])))
