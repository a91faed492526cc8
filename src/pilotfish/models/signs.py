"""q and -q are one orientation: the signs in which frames, skill and start speak of it alike."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from pilotfish.demonstrations import Frame, Layout, Quantity
from pilotfish.models.sequences import log_state_likelihoods
from pilotfish.models.skill import AdaptedSkill, Skill
from pilotfish.types import Array, Float


def align_frame_signs(
    frames: Sequence[Frame], skill: Skill, pool_weights: Float[Array, "P K"]
) -> list[Frame]:
    """The same poses of the skill's objects, quaternions with the sign that agrees with the frames before.

    Frames agree when they carry the states' orientations to the same half of S^3, states counting as much as
    both are precise about them, to the powers given. Without this, fusing q with -q would average them to
    nothing.
    """
    aligned: list[Frame] = []
    for frame in frames:
        aligned.append(_apply_signs(frame, _frame_signs([*aligned, frame], skill, pool_weights)))
    return aligned


def align_quaternion_signs(start: Float[Array, " D"], model: AdaptedSkill) -> AdaptedSkill:
    """The same skill, its orientations on the half of S^3 on which it most probably begins at start.

    A robot that reports -q is where one that reports q is; its plan must not make it turn all the way round.
    """
    if not (model.dynamics.has_time_order and model.layout.quaternions):
        return model
    with np.errstate(divide="ignore"):
        log_initial = np.log(model.dynamics.initial)

    def evidence(signs: Float[Array, " D"]) -> float:
        return float(
            np.logaddexp.reduce(log_initial + log_state_likelihoods(model, (signs * start)[None])[0])
        )

    signs = max(sign_combinations(model.layout), key=evidence)
    return replace(model, means=signs * model.means, covariances=np.outer(signs, signs) * model.covariances)


def sign_combinations(layout: Layout) -> Iterator[Float[Array, " D"]]:
    """Ones, and every way to negate quaternions together with their derivatives; ones come first."""
    names = [
        part.name for part in layout.parts if part.quantity is Quantity.QUATERNION and not part.derivative
    ]
    for chosen in product((1.0, -1.0), repeat=len(names)):
        yield _column_signs(layout, dict(zip(names, chosen, strict=True)))


def _column_signs(layout: Layout, sign_of: dict[str, float]) -> Float[Array, " D"]:
    orientation_starts = [
        sign_of.get(p.name, 1.0) if p.quantity is Quantity.QUATERNION else 1.0 for p in layout.parts
    ]
    return np.repeat(orientation_starts, [part.size for part in layout.parts])


def _frame_signs(
    frames: Sequence[Frame], skill: Skill, pool_weights: Float[Array, "P K"]
) -> Float[Array, " D"]:
    """Those of the last frame that agree with the others, which agree already."""
    *others, last = range(len(frames))
    sign_of = {}
    for part, columns in zip(skill.layout.parts, skill.layout.slices, strict=True):
        if part.quantity is Quantity.QUATERNION and part.derivative == 0:
            q, spread = _orientations_in_world(frames[last], last, skill, columns, pool_weights)
            agreement = 0.0
            for p in others:
                other, spread_other = _orientations_in_world(frames[p], p, skill, columns, pool_weights)
                agreement += float((np.sum(q * other, axis=1) / (spread + spread_other)).sum())
            sign_of[part.name] = -1.0 if agreement < 0.0 else 1.0
    return _column_signs(skill.layout, sign_of)


def _orientations_in_world(
    frame: Frame, p: int, skill: Skill, columns: slice, pool_weights: Float[Array, "P K"]
) -> tuple[Float[Array, "K 4"], Float[Array, " K"]]:
    """The states' orientations as frame p carries them into the world, and how uncertain they are there."""
    before = sum(
        start < columns.start for start in skill.layout.orientation_starts
    )  # each has one deviation less
    own = slice(columns.start - before, columns.stop - before)
    variances = np.trace(skill.covariances[p].dense[:, own, own], axis1=1, axis2=2)
    spread = np.divide(
        variances, pool_weights[p], out=np.full_like(variances, np.inf), where=pool_weights[p] > 0.0
    )
    return skill.means[p][:, columns] @ frame.A[columns, columns].T, spread


def _apply_signs(frame: Frame, signs: Float[Array, " D"]) -> Frame:
    return replace(frame, A=signs[:, None] * frame.A)
