"""Adaptation of a skill to new frames: the product of the frame Gaussians of each state (3.33-3.37)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Frame, Layout, MovingFrame
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Gaussian, affine_transform, precision_cholesky, product
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import normalise
from pilotfish.models.endpoints import endpoint_skill
from pilotfish.models.signs import align_frame_signs, nearest_quaternion_signs
from pilotfish.models.skill import AdaptedSkill, Skill
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import numeric_array, require_type

MIN_RELEVANCE = 1e-50  # covariances are divided by it


def adapt(
    skill: Skill, frames: Sequence[Frame | MovingFrame], *, relevance: Float[Array, "P K"] | None = None
) -> AdaptedSkill:
    """Adapt a skill to the present frames of its objects, in any order.

    Each state's Gaussians are transformed from the frames to the world and multiplied. The product is
    precise where any frame is. Means of quaternions in R^4 are normalised; a frame may give q or -q. For
    orientations on S^3 the product is that of Riemannian Gaussians, with covariances of deviations in body
    axes.

    Args:
        skill: Learned skill.
        frames: One fixed frame per name in `skill.frame_names`.
        relevance: Power in [0, 1] of the Gaussian of each frame (in the order of the skill) at each state:
            the covariance is divided by it, and 0 excludes the frame. None is 1 everywhere; see `relevance`.

    Returns:
        A skill with one Gaussian per state, in the world.

    Raises:
        InvalidInput: If a frame is missing, unknown, moving, singular or of another width, or if a state has
            relevance 0 in every frame.

    Source:
        Tanwani 2018, equations 3.33-3.37, with the inner inverse that (3.34) omits.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    dense = tuple(DenseCovariances(c.dense) for c in skill.covariances)  # once, not for every state
    skill = replace(skill, covariances=dense)
    frames_in_order = _match_frames(skill, frames)
    frame_weights = _validate_relevance(relevance, skill)
    aligned = align_frame_signs(frames_in_order, skill, frame_weights)
    adapted = _adapt_states(skill, aligned, frame_weights)
    if skill.endpoints is None:
        return adapted
    ends = _adapt_states(
        endpoint_skill(skill, skill.endpoints), aligned, _endpoint_weights(skill, frame_weights)
    )
    signs = [nearest_quaternion_signs(mean[None], adapted.means, skill.layout) for mean in ends.means]
    return replace(adapted, endpoints=_with_signs(ends, np.stack(signs)))


def _adapt_states(skill: Skill, frames: Sequence[Frame], frame_weights: Float[Array, "P K"]) -> AdaptedSkill:
    """Return the product of the frame Gaussians of each state."""
    frame_products = _riemannian_frame_products if skill.layout.orientation_starts else _frame_products
    with np.errstate(over="ignore", invalid="ignore"):
        means, covariances = frame_products(skill, frames, frame_weights)
    _validate_finite(means, covariances, frames)
    means = _normalise_quaternions(means, skill.layout)
    return AdaptedSkill(skill.dynamics, means, covariances, skill.layout, skill.period, skill.demonstrated)


def _endpoint_weights(skill: Skill, frame_weights: Float[Array, "P K"]) -> Float[Array, "P 2"]:
    """Return the relevance of frames to the first state and to the last."""
    first = int(skill.dynamics.initial.argmax())
    final = np.flatnonzero(skill.dynamics.final_states())
    return frame_weights[:, [first, int(final[-1]) if len(final) else skill.states - 1]]


def _with_signs(model: AdaptedSkill, signs: Float[Array, "K D"]) -> AdaptedSkill:
    """Return the states with other signs of their quaternions; on S^3 covariances do not depend on them."""
    if model.layout.orientation_starts:
        return model
    return replace(
        model, means=signs * model.means, covariances=signs[:, :, None] * signs[:, None] * model.covariances
    )


def _validate_finite(
    means: Float[Array, "K D"], covariances: Float[Array, "K E E"], frames: Sequence[Frame]
) -> None:
    """Raise InvalidInput unless all products are finite; name the frame with the largest numbers."""
    for k, (mean, covariance) in enumerate(zip(means, covariances, strict=True)):
        if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
            largest = max(frames, key=lambda frame: max(np.abs(frame.A).max(), np.abs(frame.b).max()))
            raise InvalidInput(
                f"state {k} is not finite in these frames, of which {largest.name!r} has the largest values; "
                "check its A and b, or choose a larger unit"
            )


def _frame_products(
    skill: Skill, frames: Sequence[Frame], frame_weights: Float[Array, "P K"]
) -> tuple[Float[Array, "K D"], Float[Array, "K D D"]]:
    """Return the products of the frame Gaussians in the world."""
    states = [
        product(
            [
                affine_transform(
                    Gaussian(skill.means[p, k], skill.covariances[p].dense[k] / frame_weights[p, k]),
                    frame.A,
                    frame.b,
                )
                for p, frame in enumerate(frames)
                if frame_weights[p, k] > 0.0
            ]
        )
        for k in range(skill.states)
    ]
    return np.stack([g.mean for g in states]), np.stack([g.covariance for g in states])


def _riemannian_frame_products(
    skill: Skill, frames: Sequence[Frame], frame_weights: Float[Array, "P K"]
) -> tuple[Float[Array, "K D"], Float[Array, "K E E"]]:
    """Return the products for a skill with orientations on S^3."""
    shape = skill.states, skill.layout.width - len(skill.layout.orientation_starts)
    means, covariances = np.empty((skill.states, skill.layout.width)), np.empty((*shape, shape[1]))
    for used in np.unique(frame_weights > 0.0, axis=1).T:  # all states that the same frames determine
        states = ((frame_weights > 0.0) == used[:, None]).all(axis=0)
        given = [
            _in_world(skill, frames[p], p, states, frame_weights[p, states])
            for p in np.flatnonzero(used).tolist()
        ]
        if len(given) == 1:
            means[states], covariances[states], _ = given[0]
            continue
        world_means, world_covariances, W = (np.stack(each) for each in zip(*given, strict=True))
        means[states], covariances[states] = kernels.riemannian_product(
            kernels.Emissions(world_means, W, skill.layout.orientation_starts), world_covariances
        )
    return means, covariances


def _in_world(
    skill: Skill, frame: Frame, p: int, states: Bool[Array, " K"], weights: Float[Array, " N"]
) -> tuple[Float[Array, "N D"], Float[Array, "N E E"], Float[Array, "N E E"]]:
    """Return means and covariances of some states of a frame in the world, and their precision factors."""
    tangent_map = frame.tangent_map(skill.layout)
    covariances = tangent_map @ (skill.covariances[p].dense[states] / weights[:, None, None]) @ tangent_map.T
    W = precision_cholesky(covariances, f"frame {frame.name!r}: the covariance of state")
    return skill.means[p, states] @ frame.A.T + frame.b, covariances, W


def _validate_relevance(relevance: Float[Array, "P K"] | None, skill: Skill) -> Float[Array, "P K"]:
    """Return the relevance after checking it; ones for None."""
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
            f"state {without_frame[0]} (first is 0) has relevance 0 in every frame ({len(without_frame)} "
            "such states), expected a positive relevance in one frame at least; remove the state otherwise"
        )
    return relevance


def _match_frames(skill: Skill, frames: Sequence[Frame | MovingFrame]) -> list[Frame]:
    """Return the frames in the order of the skill after checking them."""
    fix = "give a list of frames, say a demonstration's .frames"
    require_type(frames, "frames", Sequence, fix)
    for frame in frames:
        require_type(frame, "a frame", (Frame, MovingFrame), fix)
    if moving := [frame.name for frame in frames if isinstance(frame, MovingFrame)]:
        raise InvalidInput(
            f"frame {moving[0]!r} moves, expected fixed frames; give frame.at(t) for one step t"
        )
    fixed = [frame for frame in frames if isinstance(frame, Frame)]
    by_name = {frame.name: frame for frame in fixed}
    if sorted(by_name) != sorted(skill.frame_names) or len(frames) != len(skill.frame_names):
        raise InvalidInput(
            f"frames are {[f.name for f in frames]}, expected each of {list(skill.frame_names)} once; rename "
            "or add frames"
        )
    for frame in fixed:
        for array in (frame.A, frame.b):
            require_type(array, f"an array of frame {frame.name!r}", np.ndarray, "see demonstrations.frame")
        if frame.b.shape != (skill.width,) or frame.A.shape != (skill.width, skill.width):
            columns = frame.b.shape[0] if frame.b.ndim else 0
            raise InvalidInput(
                f"frame {frame.name!r} has {columns} columns and A of shape {frame.A.shape}, expected "
                f"{skill.width} columns as in the skill"
            )
        frame.require_magnitudes()
        if (condition := float(np.linalg.cond(frame.A))) > 1e12:
            raise InvalidInput(
                f"frame {frame.name!r} is singular: A has condition number {condition:.3g}, expected at most "
                "1e12; check its rotation"
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
                f"the frames give opposite orientations of state {k}: the product of their quaternions has "
                f"norm {norms.min():.3g}; give the quaternions of demonstrations and frames one sign"
            )
        means[:, columns] /= norms
    return means
