"""A skill where the objects stand now: the product of what every frame says (3.33-3.37, 4.26-4.27)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.demonstrations import Frame, Layout, MovingFrame
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Gaussian, RiemannianGaussian, affine_transform, product, riemannian_product
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import normalise
from pilotfish.models.signs import align_frame_signs
from pilotfish.models.skill import AdaptedSkill, Skill
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array, require_type

MIN_RELEVANCE = 1e-50  # covariances are divided by it


def adapt(
    skill: Skill, frames: Sequence[Frame | MovingFrame], *, relevance: Float[Array, "P K"] | None = None
) -> AdaptedSkill:
    """The skill in the world, for objects whose frames stand as given, in any order.

    Each state's Gaussians are carried into the world by their frames and multiplied; a state is then precise
    where any frame was. Quaternion means are brought back to unit length; a frame may give q or -q. On S^3
    the product is that of Riemannian Gaussians, and covariances are of deviations in body axes.
    relevance[p, k], from 0 to 1, is the power to which frame p (in the skill's order) is heard about state k:
    its covariance is divided by it, and at 0 it is not heard at all. None hears every frame in full.
    Raises: InvalidInput, when a frame is missing, unknown, moving, singular or of another width, or when a
    state is left without any frame.
    Source: Tanwani 2018, equations 3.33-3.37, with the inner inverse that (3.34) leaves out.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    dense = tuple(DenseCovariances(c.dense) for c in skill.covariances)  # once, not for every state
    skill = replace(skill, covariances=dense)
    frames_in_order = _match_frames(skill, frames)
    pool_weights = _validate_relevance(relevance, skill)
    aligned = align_frame_signs(frames_in_order, skill, pool_weights)
    frame_product = _riemannian_frame_product if skill.layout.orientation_starts else _frame_product
    with np.errstate(over="ignore", invalid="ignore"):
        states = [frame_product(skill, aligned, pool_weights, k) for k in range(skill.states)]
    _validate_finite(states, aligned)
    means = _normalise_quaternions(np.stack([g.mean for g in states]), skill.layout)
    return AdaptedSkill(
        skill.dynamics, means, np.stack([g.covariance for g in states]), skill.layout, skill.period
    )


def _validate_finite(states: Sequence[Gaussian | RiemannianGaussian], frames: Sequence[Frame]) -> None:
    """Raises: InvalidInput, naming the frame of the largest numbers, when a product of its is not finite."""
    for k, state in enumerate(states):
        if not (np.isfinite(state.mean).all() and np.isfinite(state.covariance).all()):
            largest = max(frames, key=lambda frame: max(np.abs(frame.A).max(), np.abs(frame.b).max()))
            raise InvalidInput(
                f"state {k} is not finite where the frames stand, of which {largest.name!r} has the largest "
                "numbers; check its A and b, or choose a larger unit"
            )


def _frame_product(
    skill: Skill, frames: Sequence[Frame], pool_weights: Float[Array, "P K"], k: int
) -> Gaussian:
    """State k in the world: the product of what its frames say, each to its power."""
    return product(
        [
            affine_transform(
                Gaussian(skill.means[p, k], skill.covariances[p].dense[k] / pool_weights[p, k]),
                frame.A,
                frame.b,
            )
            for p, frame in enumerate(frames)
            if pool_weights[p, k] > 0.0
        ]
    )


def _riemannian_frame_product(
    skill: Skill, frames: Sequence[Frame], pool_weights: Float[Array, "P K"], k: int
) -> RiemannianGaussian:
    """The same where the skill has orientations on S^3."""
    orientation_starts, frame_gaussians = skill.layout.orientation_starts, []
    for p, frame in enumerate(frames):
        if pool_weights[p, k] > 0.0:
            tangent_rotation = frame.tangent_map(skill.layout)
            covariance = (
                tangent_rotation @ (skill.covariances[p].dense[k] / pool_weights[p, k]) @ tangent_rotation.T
            )
            frame_gaussians.append(
                RiemannianGaussian(frame.A @ skill.means[p, k] + frame.b, covariance, orientation_starts)
            )
    return riemannian_product(frame_gaussians)


def _validate_relevance(relevance: Float[Array, "P K"] | None, skill: Skill) -> Float[Array, "P K"]:
    """The relevance, checked; ones when there is none."""
    P, K = len(skill.frame_names), skill.states
    if relevance is None:
        return np.ones((P, K))
    require_type(relevance, "relevance", np.ndarray, "give an array with a row for each frame")
    relevance = numeric_array(relevance, "relevance")
    if relevance.shape != (P, K):
        raise InvalidInput(
            f"relevance has shape {relevance.shape}, expected ({P}, {K}): frames {list(skill.frame_names)} "
            "in this order, and a column for each state"
        )
    valid = (relevance == 0.0) | ((relevance >= MIN_RELEVANCE) & (relevance <= 1.0))
    if (bad := np.argwhere(~valid)).size:
        p, k = bad[0].tolist()
        raise InvalidInput(
            f"relevance of frame {skill.frame_names[p]!r} to state {k} is {relevance[p, k]}, expected 0 to 1"
            f"{f', and 0 in place of less than {MIN_RELEVANCE:g}' if 0.0 < relevance[p, k] < 1.0 else ''}"
        )
    if (without_frame := np.flatnonzero(~relevance.any(axis=0))).size:
        raise InvalidInput(
            f"state {without_frame[0]} (first is 0) has relevance 0 in every frame, {len(without_frame)} states in all; "
            "leave it at least one frame, or drop the state"
        )
    return relevance


def _match_frames(skill: Skill, frames: Sequence[Frame | MovingFrame]) -> list[Frame]:
    """The frames in the skill's order, checked."""
    fix = "give a list of frames, say a demonstration's .frames"
    require_type(frames, "frames", Sequence, fix)
    for frame in frames:
        require_type(frame, "a frame", (Frame, MovingFrame), fix)
    if moving := [frame.name for frame in frames if isinstance(frame, MovingFrame)]:
        raise InvalidInput(f"frame {moving[0]!r} moves; adapt to where it stands at a step, frame.at(t)")
    fixed = [frame for frame in frames if isinstance(frame, Frame)]
    by_name = {frame.name: frame for frame in fixed}
    if sorted(by_name) != sorted(skill.frame_names) or len(frames) != len(skill.frame_names):
        raise InvalidInput(
            f"frames {[f.name for f in frames]} were given, the skill knows {list(skill.frame_names)}; "
            "give each of these once"
        )
    for frame in fixed:
        for array in (frame.A, frame.b):
            require_type(array, f"an array of frame {frame.name!r}", np.ndarray, "see demonstrations.frame")
        if frame.b.shape != (skill.width,) or frame.A.shape != (skill.width, skill.width):
            columns = frame.b.shape[0] if frame.b.ndim else 0
            raise InvalidInput(
                f"frame {frame.name!r} has {columns} columns and A of shape {frame.A.shape}, the skill has "
                f"{skill.width}"
            )
        frame.require_magnitudes()
        if (condition := float(np.linalg.cond(frame.A))) > 1e12:
            raise InvalidInput(
                f"frame {frame.name!r} is singular: the condition number of A is {condition:.3g}"
            )
        frame.require_left_multiplication(skill.layout)
    return [by_name[name] for name in skill.frame_names]


def _normalise_quaternions(means: Float[Array, "K D"], layout: Layout) -> Float[Array, "K D"]:
    means = means.copy()
    for start in layout.orientation_starts:
        means[:, start : start + 4] = normalise(means[:, start : start + 4])
    for columns in layout.quaternions:
        norms = np.linalg.norm(means[:, columns], axis=1, keepdims=True)
        if (norms < 0.1).any():
            k = int(norms.argmin())
            raise InvalidInput(
                f"the frames disagree about the orientation of state {k}: the fused quaternion has norm "
                f"{norms.min():.3g}; make the quaternions of demonstrations and frames consistent in sign"
            )
        means[:, columns] /= norms
    return means
