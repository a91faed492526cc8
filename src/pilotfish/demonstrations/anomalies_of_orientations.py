"""Anomalies of orientations over a set: opposite signs, and quaternions in the order x y z w."""

from collections.abc import Iterator, Sequence

import numpy as np

from pilotfish.demonstrations.anomalies_in_rows import Anomaly
from pilotfish.demonstrations.frames import Frame
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.demonstrations.signs import has_opposite_sign
from pilotfish.geometry import conjugate, multiply, normalise
from pilotfish.types import Array, Float

MIN_TURN = 0.1  # rad, by which the frames of a set differ before they reveal an order
MAX_RATIO = 0.3  # of the spread in the other order to that in the stated order
SAMPLES = 20  # rows of a demonstration that are compared
MIN_DEMONSTRATIONS = 3


def sign_anomalies(demonstrations: Sequence[Demonstration]) -> Iterator[tuple[int, Anomaly]]:
    """Yield demonstrations whose quaternions have the opposite sign of the first's.

    Args:
        demonstrations: Demonstrations with equal layouts.
    """
    first, layout = demonstrations[0], demonstrations[0].layout
    for columns in layout.unit_quaternions:
        name = next(part.name for part, c in zip(layout.parts, layout.slices, strict=True) if c == columns)
        for m, demo in enumerate(demonstrations[1:], start=1):
            if has_opposite_sign(demo.x[:, columns], first.x[:, columns]):
                message = (
                    f"{name} has the opposite sign of the first demonstration's; q and -q are one rotation, "
                    "and learning makes the signs equal"
                )
                yield m, Anomaly("note", "opposite signs", name, message)


def order_anomalies(demonstrations: Sequence[Demonstration]) -> Iterator[Anomaly]:
    """Yield whether quaternions of the tool or of a frame seem to be x y z w instead of w x y z.

    Where an object turns from one demonstration to the next, the tool turns with it at some time. In the
    right order, orientations relative to the object then differ less than in the other.

    Args:
        demonstrations: Demonstrations with equal layouts and frames.
    """
    quaternions = list(demonstrations[0].layout.unit_quaternions)
    if len(demonstrations) < MIN_DEMONSTRATIONS or not quaternions:
        return
    columns = quaternions[0]
    tool = np.stack([_sampled(demo.x[:, columns]) for demo in demonstrations])
    for n, frame in enumerate(demonstrations[0].frames):
        given = [demo.frames[n] for demo in demonstrations]
        if frame.is_world or not all(isinstance(other, Frame) for other in given):
            continue
        first = np.stack([other.A[columns, columns.start] for other in given])
        norms = np.linalg.norm(first, axis=1)
        if np.abs(norms - 1.0).max() > 1e-3 or _spread(np.ones((1, 1, 4)) * first[:, None]) < MIN_TURN:
            continue
        turn = first / norms[:, None]
        stated = _relative_spread(turn, tool)
        for subject, value in (
            ("the tool", _relative_spread(turn, _swapped(tool))),
            (f"frame {frame.name!r}", _relative_spread(_swapped(turn), tool)),
        ):
            if value < MAX_RATIO * stated:
                message = (
                    f"the quaternions of {subject} seem to be x y z w, expected w x y z: relative to frame "
                    f"{frame.name!r} orientations would agree to {np.degrees(value):.2g} instead of "
                    f"{np.degrees(stated):.2g} deg"
                )
                yield Anomaly("warning", "quaternion order", subject, message)
                return


def _sampled(q: Float[Array, "T 4"]) -> Float[Array, "S 4"]:
    return normalise(q[np.linspace(0, len(q) - 1, SAMPLES).round().astype(int)])


def _swapped(q: Float[Array, "*B 4"]) -> Float[Array, "*B 4"]:
    """Return numbers w x y z read as x y z w."""
    return np.asarray(np.roll(q, 1, axis=-1))


def _relative_spread(turn: Float[Array, "M 4"], tool: Float[Array, "M S 4"]) -> float:
    """Return the smallest spread over time of orientations relative to a frame [rad]."""
    return _spread(multiply(conjugate(turn)[:, None], tool))


def _spread(q: Float[Array, "M S 4"]) -> float:
    """Return the smallest root mean square angle from the mean over S times [rad]."""
    moments = np.einsum("msi,msj->sij", q, q) / len(q)
    largest = np.linalg.eigvalsh(moments)[:, -1]  # mean squared cosine of half the angle
    return float(2.0 * np.sqrt(np.clip(1.0 - largest, 0.0, 1.0).min()))
