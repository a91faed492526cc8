"""Demonstrations as their frames see them: the data that skills are learned from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int


@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """Demonstrations one after the other, seen from each of P frames; N is the sum of their lengths."""

    x: Float[Array, "P N D"]
    lengths: Int[Array, " M"]


def views(demonstrations: Sequence[Demonstration]) -> Views:
    """x[j] solves A_j x[j] + b_j = world, for frame j of each demonstration.

    Raises: InvalidInput, when there is none, or when they differ in layout, period or names of frames.
    Source: Tanwani 2018, eq. 3.21.
    """
    refuse_disagreement(demonstrations)
    seen = [np.stack([_seen(given, demo.x) for given in demo.frames]) for demo in demonstrations]
    lengths = np.array([len(demo.x) for demo in demonstrations], dtype=np.int64)
    return Views(np.ascontiguousarray(np.concatenate(seen, axis=1)), lengths)


def refuse_disagreement(demonstrations: Sequence[Demonstration]) -> None:
    """Raises: InvalidInput, when there is none, or when they differ in layout, period or names of frames."""
    if not demonstrations:
        raise InvalidInput("there are no demonstrations, expected at least one")
    first = demonstrations[0]
    for m, demo in enumerate(demonstrations):
        if reason := disagreement(first, demo):
            raise InvalidInput(f"demonstration {m} ({demo.name!r}) and the first ({first.name!r}) {reason}")


def disagreement(first: Demonstration, other: Demonstration) -> str:
    """Why the two cannot be learned from together; empty when they can."""
    if first.layout != other.layout:
        return f"differ in layout: {', '.join(other.layout.names)} and {', '.join(first.layout.names)}"
    if first.period != other.period:
        return f"differ in period: {other.period} s and {first.period} s; resample one of them"
    names, expected = ([given.name for given in demo.frames] for demo in (other, first))
    if names != expected:
        return f"differ in frames: {names} and {expected}; give the same frames in the same order"
    return ""


def _seen(given: Frame | MovingFrame, x: Float[Array, "T D"]) -> Float[Array, "T D"]:
    if isinstance(given, MovingFrame):
        return np.asarray(np.linalg.solve(given.A, (x - given.b)[..., None])[..., 0])
    return np.asarray(np.linalg.solve(given.A, (x - given.b).T).T)
