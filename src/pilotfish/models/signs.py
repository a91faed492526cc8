"""Signs of quaternions: q and -q are the same orientation, and frames, skill and start must agree on one.

A sign applies to a quaternion and its derivatives. It is represented by a row of signs, one per column, that
multiplies datapoints.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import compress, product

import numpy as np

from pilotfish.demonstrations import Frame, Layout
from pilotfish.models.skill import AdaptedSkill, Skill
from pilotfish.types import Array, Float


def align_frame_signs(
    frames: Sequence[Frame], skill: Skill, frame_weights: Float[Array, "P K"]
) -> list[Frame]:
    """Return the frames, with quaternions in the sign that agrees with the frames before.

    Frames agree when they map the orientations of the states to the same half of S^3. States count in
    proportion to the precision of both frames. Without this, the product of q and -q would average to zero.
    """
    aligned: list[Frame] = []
    for frame in frames:
        signs = _frame_signs([*aligned, frame], skill, frame_weights)
        aligned.append(replace(frame, A=signs[:, None] * frame.A))
    return aligned


def align_quaternion_signs(start: Float[Array, " D"], model: AdaptedSkill) -> AdaptedSkill:
    """Return the skill with the quaternion signs under which it most probably begins at start.

    A robot that reports -q is where one that reports q is; without this its plan would rotate by 360 degrees.

    Args:
        start: First state of the robot.
        model: Adapted skill; a mixture has no first state and is returned unchanged.
    """
    if not (model.dynamics.has_time_order and model.layout.quaternions):
        return model
    with np.errstate(divide="ignore"):
        log_initial = np.log(model.dynamics.initial)

    def evidence(signs: Float[Array, " D"]) -> float:
        return float(np.logaddexp.reduce(log_initial + model.log_state_likelihoods((signs * start)[None])[0]))

    return _multiply_signs(model, max(sign_combinations(model.layout), key=evidence))


def _multiply_signs(model: AdaptedSkill, signs: Float[Array, " D"]) -> AdaptedSkill:
    return replace(
        model,
        means=signs * model.means,
        covariances=np.outer(signs, signs) * model.covariances,
        endpoints=model.endpoints and _multiply_signs(model.endpoints, signs),
    )


def nearest_quaternion_signs(
    x: Float[Array, "T D"], means: Float[Array, "K D"], layout: Layout
) -> Float[Array, " D"]:
    """Return the signs under which the sum of squared distances to the nearest means is smallest."""
    if not layout.quaternions or not len(means):
        return np.ones(layout.width)

    def distance(signs: Float[Array, " D"]) -> float:
        squares = [np.sum((signs * x - mean) ** 2, axis=1) for mean in means]
        return float(np.min(squares, axis=0).sum())

    return min(sign_combinations(layout), key=distance)


def sign_combinations(layout: Layout) -> Iterator[Float[Array, " D"]]:
    """Yield every combination of signs of the quaternions of a layout, ones first."""
    for negated in product((False, True), repeat=len(layout.quaternions)):
        yield layout.quaternion_signs(list(compress(layout.quaternions, negated)))


def _frame_signs(
    frames: Sequence[Frame], skill: Skill, frame_weights: Float[Array, "P K"]
) -> Float[Array, " D"]:
    """Return the signs of the last frame that agree with the others, which agree already."""
    *aligned, last = range(len(frames))
    negated = []
    for columns in skill.layout.quaternions:
        q, variances = _world_orientations(frames[last], last, skill, columns, frame_weights)
        agreement = 0.0
        for p in aligned:
            q_p, variances_p = _world_orientations(frames[p], p, skill, columns, frame_weights)
            agreement += float((np.sum(q * q_p, axis=1) / (variances + variances_p)).sum())
        if agreement < 0.0:
            negated.append(columns)
    return skill.layout.quaternion_signs(negated)


def _world_orientations(
    frame: Frame, p: int, skill: Skill, columns: slice, frame_weights: Float[Array, "P K"]
) -> tuple[Float[Array, "K 4"], Float[Array, " K"]]:
    """Return the orientations of the states in the world as frame p maps them, and their total variance."""
    before = sum(start < columns.start for start in skill.layout.orientation_starts)
    tangent = slice(
        columns.start - before, columns.stop - before
    )  # each orientation has a tangent column less
    variances = np.trace(skill.covariances[p].dense[:, tangent, tangent], axis1=1, axis2=2)
    weighted = np.divide(
        variances, frame_weights[p], out=np.full_like(variances, np.inf), where=frame_weights[p] > 0.0
    )
    return skill.means[p][:, columns] @ frame.A[columns, columns].T, weighted
