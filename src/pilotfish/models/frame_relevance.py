"""Which frames matter at which state, told by the demonstrations alone."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import add
from typing import cast

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    Layout,
    Quantity,
    Views,
    views,
)
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Moments, moments_from_sums, precision_cholesky
from pilotfish.models.opinion_pools import (
    HeldOutSegment,
    Opinions,
    fit_pool_weights,
    held_out_log_probs,
    pool_opinions,
)
from pilotfish.models.semi_markov import Dynamics
from pilotfish.models.skill import Skill
from pilotfish.types import Array, Bool, Float, Int
from pilotfish.validation import require_type

MIN_EVIDENCE = 3.0  # nats: odds of twenty to one, strong evidence on the scale of Kass & Raftery 1995
MIN_DATAPOINTS = 1.0  # datapoints of a visit that speaks for a demonstration


@dataclass(frozen=True, slots=True, eq=False)
class FrameRelevance:
    """How much each frame matters at each state.

    values[p, k] is the power, in [0, 1], to which frame p's opinion of state k should be raised, relative to
    the frame that matters most there, which has 1. Zero leaves the frame out.
    costs[p, k] is what leaving frame p alone out of state k would cost the held-out demonstrations [nats]
    in log-probability, a demonstration counting as one datapoint; infinite for the only frame.
    """

    values: Float[Array, "P K"]
    costs: Float[Array, "P K"]
    frame_names: tuple[str, ...]

    @property
    def distractors(self) -> tuple[str, ...]:
        """The frames that matter at no state."""
        return tuple(name for name, row in zip(self.frame_names, self.values, strict=True) if not row.any())


def relevance(skill: Skill, demonstrations: Sequence[Demonstration]) -> FrameRelevance:
    """The powers of the frames' Gaussians under which held-out demonstrations are most probable.

    Each demonstration is held out in turn: the others tell every frame's Gaussian anew (by subtracting
    its moments), each is raised to a power, and their normalised product is to explain the held-out visit.
    One set of powers for all held-out demonstrations maximises the sum of these log-probabilities; it is
    concave in them. Then the frame that is cheapest to do without is left out, and again, while that costs
    no more than 3 nats and a standard error over demonstrations.

    Points of one visit follow each other closely, so a visit counts as one datapoint, the mean of its points'
    log-probabilities; sums over points would claim certainty from two demonstrations. For the same reason
    the covariances of few demonstrations are drawn towards one variance for each part of the layout, with
    the weight of as many demonstrations as a covariance has columns, and one. Frames that say the same share
    the power, or one of them has it. A state that fewer than two demonstrations visit cannot tell: there all
    frames have 1.
    Orientations on S^3 are compared in the tangent space, which holds to first order of their deviations.
    Cost: one E-step, and for each state P^2 / 2 small concave problems at most.
    Raises: InvalidInput, for fewer than two demonstrations, others than the skill's, or moving frames.
    Source: logarithmic pooling with weights by likelihood, Heskes 1998; scored on what was held out as in
    predictive stacking, Yao et al. 2018. The elimination and the counting of visits are ours.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    data = views(demonstrations)
    _validate_demonstrations(skill, demonstrations)
    segments = _segment_moments(skill, data)
    world_maps = [
        _frame_from_world(demo, x)
        for demo, x in zip(demonstrations, _split_demonstrations(data), strict=True)
    ]
    P, K = skill.means.shape[:2]
    values, costs = np.empty((P, K)), np.empty((P, K))
    for k in range(K):
        values[:, k], costs[:, k] = _state_relevance(skill, k, segments, world_maps)
    return FrameRelevance(values, costs, skill.frame_names)


def select_frames(
    demonstrations: Sequence[Demonstration], frame_relevance: FrameRelevance
) -> tuple[Demonstration, ...]:
    """The demonstrations without the frames that matter at no state, to learn from anew.

    Raises: InvalidInput, when their frames are not those that the relevance speaks of.
    """
    require_type(
        frame_relevance, "frame_relevance", FrameRelevance, "relevance(skill, demonstrations) makes one"
    )
    for demo in demonstrations:
        if sorted(names := [f.name for f in demo.frames]) != sorted(frame_relevance.frame_names):
            raise InvalidInput(
                f"demonstration {demo.name!r} has frames {names}, the relevance speaks of "
                f"{list(frame_relevance.frame_names)}; give the demonstrations that it was told by"
            )
    removed = frame_relevance.distractors
    return tuple(
        replace(d, frames=tuple(f for f in d.frames if f.name not in removed)) for d in demonstrations
    )


def _validate_demonstrations(skill: Skill, demonstrations: Sequence[Demonstration]) -> None:
    if len(demonstrations) < 2:
        raise InvalidInput(
            "one demonstration was given, expected at least two in different situations: with nothing to "
            "hold out, frames cannot be told apart"
        )
    first = demonstrations[0]
    if first.layout != skill.layout or tuple(f.name for f in first.frames) != skill.frame_names:
        raise InvalidInput(
            f"the demonstrations have frames {[f.name for f in first.frames]} and columns "
            f"{', '.join(first.layout.names)}, the skill {list(skill.frame_names)} and "
            f"{', '.join(skill.layout.names)}; give the demonstrations that it was learned from"
        )
    for demo in demonstrations:
        if moving := [f.name for f in demo.frames if f.is_moving]:
            raise InvalidInput(
                f"frame {moving[0]!r} of demonstration {demo.name!r} moves; relevance is told "
                "for frames that stand, say frame.at(t)"
            )


def _split_demonstrations(data: Views) -> list[Float[Array, "P T D"]]:
    return np.split(data.x, np.cumsum(data.lengths)[:-1], axis=1)


def _segment_moments(skill: Skill, data: Views) -> list[tuple[Moments, ...]]:
    """For each demonstration and frame, moments of the deviations from the skill's means."""
    W = np.stack([c.precision_cholesky("the covariance of state") for c in skill.covariances])
    emissions = kernels.Emissions(skill.means, W, data.orientation_starts)
    found: list[tuple[Moments, ...]] = []
    for x in _split_demonstrations(data):
        step = _demonstration_e_step(skill.dynamics, x, emissions)
        if not np.isfinite(step.log_likelihoods[0]):
            raise InvalidInput(
                f"demonstration {len(found)} (first is 0) is impossible under the skill; give the "
                "demonstrations that it was learned from"
            )
        zero = np.zeros(step.offsets.shape[1:])
        found.append(
            tuple(
                moments_from_sums(zero, step.counts, o, s)
                for o, s in zip(step.offsets, step.scatter_matrices, strict=True)
            )
        )
    return found


def _demonstration_e_step(
    dynamics: Dynamics, x: Float[Array, "P T D"], emissions: kernels.Emissions
) -> kernels.EStep:
    """Posterior moments of one demonstration about the means of the states."""
    x, length = np.ascontiguousarray(x), np.array([x.shape[1]])
    return dynamics.e_step(x, length, emissions, max_duration=x.shape[1])[0]


def _frame_from_world(demo: Demonstration, view: Float[Array, "P T D"]) -> Float[Array, "P E E"]:
    """Matrices that take deviations in the world to deviations that each frame sees.

    A frame turns an orientation of S^3 from the left, which leaves deviations in body axes as they are.
    Quaternions treated as flat have the sign in which the views have them.
    """
    parts = _tangent_columns(demo.layout)
    fixed = cast("tuple[Frame, ...]", demo.frames)
    flat, tangent = (np.concatenate(ranges).astype(np.int64) for ranges in zip(*parts, strict=True))
    maps = np.zeros((len(fixed), len(tangent), len(tangent)))
    for B, frame, x in zip(maps, fixed, view, strict=True):
        inverse = np.linalg.solve(frame.A, np.eye(len(frame.b)))
        inverse *= _view_signs((demo.x - frame.b) @ inverse.T, x, demo.layout)[:, None]
        B[:] = inverse[np.ix_(flat, flat)]
        for part, (_, columns) in zip(demo.layout.parts, parts, strict=True):
            if part.quantity is Quantity.ORIENTATION:
                B[columns], B[:, columns] = 0.0, 0.0
                B[columns, columns] = 1.0
    return maps


def _tangent_columns(layout: Layout) -> list[tuple[Int[Array, " d"], Int[Array, " d"]]]:
    """For each part, its first columns and those of its deviations: three for an orientation of S^3."""
    parts, offset = [], 0
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        size = part.size - (part.quantity is Quantity.ORIENTATION)
        parts.append((np.arange(columns.start, columns.start + size), np.arange(offset, offset + size)))
        offset += size
    return parts


def _view_signs(raw: Float[Array, "T D"], viewed: Float[Array, "T D"], layout: Layout) -> Float[Array, " D"]:
    """Minus one for the quaternions that the views have negated."""
    agreement = [float(np.sum(raw[:, c] * viewed[:, c])) for c in layout.slices]
    sizes = [part.size for part in layout.parts]
    return np.repeat(np.where(np.array(agreement) < 0.0, -1.0, 1.0), sizes)


def _state_relevance(
    skill: Skill, k: int, segments: Sequence[tuple[Moments, ...]], world_maps: Sequence[Float[Array, "P E E"]]
) -> tuple[Float[Array, " P"], Float[Array, " P"]]:
    """Powers of the frames at state k relative to the largest, and what leaving out each alone costs."""
    P = len(skill.frame_names)
    visited = [m for m, moments in enumerate(segments) if moments[0].counts[k] >= MIN_DATAPOINTS]
    if len(visited) < 2:
        return np.ones(P), np.zeros(P)
    held = [_hold_out(skill, k, [segments[n] for n in visited if n != m], segments[m]) for m in visited]
    return _eliminate_frames(pool_opinions([world_maps[m] for m in visited], held))


def _hold_out(
    skill: Skill, k: int, others: Sequence[tuple[Moments, ...]], own: tuple[Moments, ...]
) -> HeldOutSegment:
    """State k as each frame tells it from the other demonstrations, beside the visit that was held out."""
    shrink = partial(_shrink_covariance, layout=skill.layout, demonstrations=len(others))
    offsets, precision_cholesky_factors, scatter_matrices = [], [], []
    for p, own_moments in enumerate(own):
        rest = reduce(add, (moments[p] for moments in others))
        covariance = shrink(rest.scatter_matrices[k] / rest.counts[k])
        covariance += skill.provenance.regularisation * np.eye(len(covariance))
        offsets.append(rest.means[k] - own_moments.means[k])
        precision_cholesky_factors.append(
            precision_cholesky(covariance[None], f"held-out covariance of state {k}, number")[0]
        )
        scatter_matrices.append(own_moments.scatter_matrices[k] / own_moments.counts[k])
    return HeldOutSegment(np.stack(offsets), np.stack(precision_cholesky_factors), np.stack(scatter_matrices))


def _shrink_covariance(
    covariance: Float[Array, "E E"], layout: Layout, demonstrations: int
) -> Float[Array, "E E"]:
    """Drawn towards one variance for each part, uncorrelated, with the weight of E + 1 demonstrations.

    The mean of an inverse-Wishart posterior with 2 (E + 1) degrees of freedom, a visit being one datapoint.
    Frames that turn the axes of a part do not change its target.
    """
    E = len(covariance)
    target = np.zeros(E)
    for _, columns in _tangent_columns(layout):
        target[columns] = np.diag(covariance)[columns].mean()
    weight = (E + 1) / (E + 1 + demonstrations)
    return weight * np.diag(target) + (1.0 - weight) * covariance


def _eliminate_frames(opinions: Opinions) -> tuple[Float[Array, " P"], Float[Array, " P"]]:
    """The powers, relative to the largest, of the frames that are worth hearing; and each frame's cost."""
    all_frames = np.ones(opinions.frames, dtype=bool)
    costs = np.array([ablation_cost(opinions, all_frames, p)[0] for p in range(opinions.frames)])
    weighted = all_frames
    while weighted.sum() > 1:
        ablation_costs = {p: ablation_cost(opinions, weighted, p) for p in np.flatnonzero(weighted).tolist()}
        cheapest = min(ablation_costs, key=lambda p: ablation_costs[p][0])
        cost, error = ablation_costs[cheapest]
        if cost > MIN_EVIDENCE + error:
            break
        weighted = _exclude(weighted, cheapest)
    pool_weights = fit_pool_weights(opinions, weighted)
    return pool_weights / pool_weights.max(), costs


def ablation_cost(opinions: Opinions, weighted: Bool[Array, " P"], p: int) -> tuple[float, float]:
    """What leaving frame p out costs all held-out visits together [nats], and the standard error of that."""
    rest = _exclude(weighted, p)
    if not rest.any():
        return np.inf, 0.0
    losses = held_out_log_probs(opinions, fit_pool_weights(opinions, weighted)) - held_out_log_probs(
        opinions, fit_pool_weights(opinions, rest)
    )
    return float(losses.sum()), float(np.sqrt(len(losses)) * losses.std(ddof=1))


def _exclude(weighted: Bool[Array, " P"], p: int) -> Bool[Array, " P"]:
    rest = weighted.copy()
    rest[p] = False
    return rest
