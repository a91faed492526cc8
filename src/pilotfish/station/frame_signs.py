"""q and -q are one pose of an object: the sign in which a skill's frames speak of the same orientations."""

from collections.abc import Sequence

import numpy as np

from pilotfish.demonstrations import Frame, Layout, Quantity
from pilotfish.models import Skill
from pilotfish.types import Array, Float


def agreeing(frames: Sequence[Frame], free: Sequence[bool], skill: Skill) -> tuple[Frame, ...]:
    """The same frames, the free ones with the sign of their quaternion in which they agree with the first.

    The first is one that is not free, if there is one. Frames agree when they carry the skill's orientations
    to the same half of S^3, states counting as much as they are precise: q and -q would be averaged else.
    Frames that are not those of the skill are left as they are, for `adapt` to refuse.
    """
    widths = {len(frame.b) for frame in frames}
    if sorted(frame.name for frame in frames) != sorted(skill.frame_names) or widths != {skill.width}:
        return tuple(frames)
    first = min(range(len(frames)), key=lambda n: free[n])
    return tuple(
        _negated(frame, skill.layout) if free[n] and _opposed(frame, frames[first], skill) else frame
        for n, frame in enumerate(frames)
    )


def nearest_signs(x: Float[Array, " D"], reference: Float[Array, " D"], layout: Layout) -> Float[Array, " D"]:
    """The same state, each orientation (with its derivatives) on the reference's half of S^3."""
    nearest = x.copy()
    for part, here in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.QUATERNION:
            place = layout.columns(part.name)
            nearest[here] *= -1.0 if x[place] @ reference[place] < 0.0 else 1.0
    return nearest


def _opposed(frame: Frame, first: Frame, skill: Skill) -> bool:
    agreement = 0.0
    for columns in skill.layout.quaternions:
        (q, spread), (p, spread_first) = (_seen(one, skill, columns) for one in (frame, first))
        agreement += float((np.einsum("kd,kd->k", q, p) / (spread + spread_first)).sum())
    return agreement < 0.0


def _seen(frame: Frame, skill: Skill, columns: slice) -> tuple[Float[Array, "K 4"], Float[Array, " K"]]:
    """The orientations of the states as this frame carries them into the world, and their variances."""
    p = skill.frame_names.index(frame.name)
    dense = skill.covariances[p].dense[:, columns, columns]
    return skill.means[p][:, columns] @ frame.A[columns, columns].T, np.trace(dense, axis1=1, axis2=2)


def _negated(frame: Frame, layout: Layout) -> Frame:
    A = frame.A.copy()
    for part, here in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.QUATERNION:
            A[here, here] *= -1.0
    return Frame(frame.name, A, frame.b)
