"""Demonstrations as their frames see them: the data that skills are learned from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations.frames import Frame, MovingFrame
from pilotfish.demonstrations.layouts import Layout, Quantity
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type, short_list


@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """Demonstrations one after the other, seen from each of P frames; N is the sum of their lengths.

    turns holds the first column of each unit quaternion that is treated as a point of S^3 (Layout.turns).
    """

    x: Float[Array, "P N D"]
    lengths: Int[Array, " M"]
    orientation_starts: tuple[int, ...] = ()


def views(demonstrations: Sequence[Demonstration]) -> Views:
    """x[j] solves A_j x[j] + b_j = world, for frame j of each demonstration.

    An orientation that runs closer to the first demonstration's after a change of sign has it changed, its
    derivatives with it: q and -q are one orientation, whether recordings or poses of frames differ so.
    Raises: InvalidInput, when there is none, or when they differ in layout, period or names of frames.
    Source: Tanwani 2018, eq. 3.21.
    """
    require_compatible(demonstrations)
    one, lengths = demonstrations[0], np.array([len(demo.x) for demo in demonstrations], dtype=np.int64)
    x = np.empty(
        (len(one.frames), lengths.sum(), one.layout.width)
    )  # filled in place: each view is held once
    for demo, end in zip(demonstrations, np.cumsum(lengths), strict=True):
        for given, view in zip(demo.frames, x, strict=True):
            local = view[end - len(demo.x) : end]
            local[:] = _to_frame(given, demo.x)
            local *= _alignment_signs(
                local, view[: lengths[0]], one.layout
            )  # ones, for the first demonstration
    return Views(x, lengths, one.layout.orientation_starts)


def require_compatible(demonstrations: Sequence[Demonstration]) -> None:
    """Raises: InvalidInput, when there is none, or when they differ in layout, period or names of frames."""
    require_type(demonstrations, "demonstrations", Sequence, "give a list, also of one")
    for demo in demonstrations:
        require_type(demo, "a demonstration", Demonstration, "pf.demonstration makes one of an array")
    if not demonstrations:
        raise InvalidInput("there are no demonstrations, expected at least one")
    first = demonstrations[0]
    for m, demo in enumerate(demonstrations):
        if reason := incompatibility(first, demo):
            raise InvalidInput(f"demonstration {m} ({demo.name!r}) and the first ({first.name!r}) {reason}")


def incompatibility(first: Demonstration, other: Demonstration) -> str:
    """Why the two cannot be learned from together; empty when they can."""
    if first.layout != other.layout:
        return f"differ in layout: {short_list(other.layout.names)} and {short_list(first.layout.names)}"
    if first.period != other.period:
        return f"differ in period: {other.period} s and {first.period} s; resample one of them"
    names, expected = ([given.name for given in demo.frames] for demo in (other, first))
    if names != expected:
        found = f"{short_list(names)} and {short_list(expected)}"
        return f"differ in frames: {found}; give the same frames in the same order"
    return ""


def _alignment_signs(
    x: Float[Array, "T D"], first: Float[Array, "S D"], layout: Layout
) -> Float[Array, " D"]:
    """Minus one for the columns of orientations that run closer to the first's when negated."""
    signs = np.ones(layout.width)
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.QUATERNION and has_opposite_sign(
            *(v[:, layout.columns(part.name)] for v in (x, first))
        ):
            signs[columns] = -1.0
    return signs


def has_opposite_sign(q: Float[Array, "T 4"], reference: Float[Array, "S 4"]) -> bool:
    """Whether -q runs closer to the reference than q, both stretched to the same duration."""
    steps = np.linspace(0, len(reference) - 1, len(q)).round().astype(int)
    return bool(np.einsum("td,td->", q, reference[steps]) < 0)


def _to_frame(given: Frame | MovingFrame, x: Float[Array, "T D"]) -> Float[Array, "T D"]:
    if isinstance(given, MovingFrame):
        return np.asarray(np.linalg.solve(given.A, (x - given.b)[..., None])[..., 0])
    return np.asarray(np.linalg.solve(given.A, (x - given.b).T).T)
