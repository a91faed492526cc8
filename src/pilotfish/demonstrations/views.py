"""Demonstrations in the coordinates of their frames: the data that skills are learned from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations.layouts import Layout
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.demonstrations.signs import has_opposite_sign
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type, short_list, shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """Demonstrations one after the other, in the coordinates of each of P frames.

    Attributes:
        x: Local points; N is the sum of the lengths.
        lengths: Number of rows of each demonstration.
        orientation_starts: First column of each orientation on S^3, as `Layout.orientation_starts`.
    """

    x: Float[Array, "P N D"]
    lengths: Int[Array, " M"]
    orientation_starts: tuple[int, ...] = ()


def views(demonstrations: Sequence[Demonstration], reference: Demonstration | None = None) -> Views:
    """Return demonstrations in the coordinates of their frames: A_j x[j] + b_j = world for frame j.

    If a quaternion in R^4 is closer to that of the first demonstration after a change of sign, its sign and
    that of its derivatives is changed.

    Args:
        demonstrations: At least one; all have the same layout, period and frame names.
        reference: Demonstration to whose signs quaternions are aligned; None takes the first.

    Raises:
        InvalidInput: If there is none, or if they differ in layout, period or frame names.

    Source:
        Tanwani 2018, eq. 3.21.
    """
    require_compatible(demonstrations, reference)
    first, lengths = demonstrations[0], np.array([len(demo.x) for demo in demonstrations], dtype=np.int64)
    x = np.empty((len(first.frames), lengths.sum(), first.layout.width))  # filled in place, to save memory
    references = [frame.to_local(reference.x) for frame in reference.frames] if reference else []
    for demo, end in zip(demonstrations, np.cumsum(lengths), strict=True):
        for p, (given, view) in enumerate(zip(demo.frames, x, strict=True)):
            local = view[end - len(demo.x) : end]
            local[:] = given.to_local(demo.x)
            aligned_to = references[p] if references else view[: lengths[0]]
            local *= _alignment_signs(local, aligned_to, first.layout)
    return Views(x, lengths, first.layout.orientation_starts)


def incompatibility(first: Demonstration, other: Demonstration) -> str:
    """Return why one skill cannot be learned from two demonstrations; empty if it can."""
    if first.layout != other.layout:
        return f"differ in layout: {short_list(other.layout.names)} and {short_list(first.layout.names)}"
    if first.period != other.period:
        return f"differ in period: {other.period} s and {first.period} s; resample one of them"
    names, expected = ([given.name for given in demo.frames] for demo in (other, first))
    if names != expected:
        found = f"{short_list(names)} and {short_list(expected)}"
        return f"differ in frames: {found}; give the same frames in the same order"
    return ""


def require_compatible(
    demonstrations: Sequence[Demonstration], reference: Demonstration | None = None, start: int = 0
) -> None:
    """Raise unless one skill can be learned from these demonstrations.

    Args:
        demonstrations: Demonstrations.
        reference: First demonstration of the set; None: these are the whole set.
        start: Number in the set of the first of these, for messages.

    Raises:
        InvalidInput: If there is none, or if they differ in layout, period or frame names.
    """
    require_type(demonstrations, "demonstrations", Sequence, "pass a list, also for a single one")
    for demo in (*demonstrations, *([] if reference is None else [reference])):
        require_type(demo, "a demonstration", Demonstration, "create one with pf.demonstration")
    if not demonstrations:
        raise InvalidInput("demonstrations is empty, expected at least one")
    first = demonstrations[0] if reference is None else reference
    for m, demo in enumerate(demonstrations, start=start):
        if reason := incompatibility(first, demo):
            raise InvalidInput(f"demonstration {m} ({demo.name!r}) and the first ({first.name!r}) {reason}")


def _alignment_signs(
    x: Float[Array, "T D"], first: Float[Array, "S D"], layout: Layout
) -> Float[Array, " D"]:
    """Return -1 for columns of quaternions that are closer to the first demonstration when negated."""
    negated = [c for c in layout.quaternions if has_opposite_sign(x[:, c], first[:, c])]
    return layout.quaternion_signs(negated)
