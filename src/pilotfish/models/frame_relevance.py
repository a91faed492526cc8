"""Relevance of each frame at each state, estimated from the demonstrations.

A task-parameterised model (TP-GMM, TP-HSMM) describes every state by one Gaussian per frame; their product
in the world is the adapted state. A frame that has nothing to do with the task still takes part in the
product and pulls the motion towards its object. Relevance raises the Gaussian of frame p at state k to a
power v_pk in [0, 1], that is, it divides the covariance by v_pk; 0 excludes the frame.

Estimate, for each state separately:

1. Hold out each demonstration in turn. Compute the Gaussian of every frame from the other demonstrations, by
   subtracting the moments of the segment that is held out. All segments share one E-step.
2. Shrink each covariance S towards the target T, which has one variance per part of the layout and no
   correlation: (E + 1) / (E + 1 + M) T + M / (E + 1 + M) S, for E columns and M demonstrations. This is the
   mean of an inverse-Wishart posterior with prior weight E + 1. Few demonstrations would otherwise give
   frames a precision that they do not have. A rotation of the axes of a part does not change its target.
3. Pool the Gaussians log-linearly (opinion_pools.py). The weights v maximise the held-out log-probability.
4. Backward elimination: exclude the frame with the smallest cost, refit, and repeat while the cost is at most
   3 nats and its standard error over demonstrations.

Points of one segment are strongly correlated. A segment therefore counts as one datapoint, with the mean
log-probability of its points; a sum over points would reach certainty from two demonstrations.

Invariants. Frames with equal Gaussians share the weight, or one of them has it. The largest weight of a state
is 1, because a common factor does not change the mean of the product. A state in fewer than two
demonstrations has weight 1 in all frames.

Keep in step: `adapt` divides covariances by these weights; columns of deviations are those of
`Layout.tangent`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration, Layout, Quantity, Views, views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Moments, precision_cholesky
from pilotfish.models.opinion_pools import FrameOpinions, HeldOutSegment, eliminate_frames
from pilotfish.models.skill import Skill
from pilotfish.types import Array, Float
from pilotfish.validation import require_type, shorten_repr

MIN_EVIDENCE = 3.0  # nats: odds of twenty to one, strong evidence on the scale of Kass & Raftery 1995
MIN_DATAPOINTS = 1.0  # expected datapoints of a segment, for its demonstration to count at a state


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class FrameRelevance:
    """Relevance of each frame at each state.

    Attributes:
        values: Power in [0, 1] of the Gaussian of frame p at state k, relative to the most relevant frame of
            the state, which has 1. Zero excludes the frame.
        costs: Loss of held-out log-probability if frame p alone is excluded at state k [nats]. A
            demonstration counts as one datapoint; infinite for the only frame.
        frame_names: Name of each frame.
    """

    values: Float[Array, "P K"]
    costs: Float[Array, "P K"]
    frame_names: tuple[str, ...]

    @property
    def distractors(self) -> tuple[str, ...]:
        """Names of the frames that have relevance 0 at every state."""
        return tuple(name for name, row in zip(self.frame_names, self.values, strict=True) if not row.any())


def relevance(skill: Skill, demonstrations: Sequence[Demonstration]) -> FrameRelevance:
    """Estimate how relevant each frame is at each state, from held-out demonstrations.

    The head of this file describes the method. Orientations on S^3 are compared in the tangent space, to
    first order of their deviations. The cost is one E-step, and at most P^2 / 2 small concave problems per
    state.

    Args:
        skill: Skill learned from the demonstrations.
        demonstrations: At least two, in different situations, with fixed frames.

    Returns:
        Powers for `adapt(skill, frames, relevance=...)`, and the costs of excluding frames.

    Raises:
        InvalidInput: If there are fewer than two demonstrations, if they are not those of the skill, or if a
            frame moves.

    Source:
        Heskes 1998 (logarithmic pooling with weights by likelihood); Yao et al. 2018 (scores on held-out
        data, predictive stacking). The elimination and the count of segments are ours.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    data = views(demonstrations)
    _validate_demonstrations(skill, demonstrations)
    segments = _segment_moments(skill, data)
    maps = [
        _frame_from_world(demo, x)
        for demo, x in zip(demonstrations, _split_demonstrations(data), strict=True)
    ]
    columns = [_state_relevance(skill, k, segments, maps) for k in range(skill.states)]
    values, costs = (np.stack(rows, axis=1) for rows in zip(*columns, strict=True))
    return FrameRelevance(values, costs, skill.frame_names)


def select_frames(
    demonstrations: Sequence[Demonstration], frame_relevance: FrameRelevance
) -> tuple[Demonstration, ...]:
    """Return the demonstrations without the frames that are relevant at no state, to learn again.

    Args:
        demonstrations: Demonstrations that the relevance was estimated from.
        frame_relevance: Result of `relevance`.

    Raises:
        InvalidInput: If the frames of a demonstration are not those of the relevance.
    """
    require_type(
        frame_relevance, "frame_relevance", FrameRelevance, "relevance(skill, demonstrations) returns one"
    )
    for demo in demonstrations:
        if sorted(names := [f.name for f in demo.frames]) != sorted(frame_relevance.frame_names):
            raise InvalidInput(
                f"demonstration {demo.name!r} has frames {names}, expected those of frame_relevance, "
                f"{list(frame_relevance.frame_names)}; give the demonstrations that it was estimated from"
            )
    removed = frame_relevance.distractors
    return tuple(
        replace(d, frames=tuple(f for f in d.frames if f.name not in removed)) for d in demonstrations
    )


def _validate_demonstrations(skill: Skill, demonstrations: Sequence[Demonstration]) -> None:
    if len(demonstrations) < 2:
        raise InvalidInput(
            "one demonstration was given, expected at least two in different situations; record another one"
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
                f"frame {moving[0]!r} of demonstration {demo.name!r} moves, expected fixed frames; give "
                "frame.at(t) for one step t"
            )


def _split_demonstrations(data: Views) -> list[Float[Array, "P T D"]]:
    return np.split(data.x, np.cumsum(data.lengths)[:-1], axis=1)


def _segment_moments(skill: Skill, data: Views) -> list[tuple[Moments, ...]]:
    """Compute, for each demonstration and frame, moments of the deviations from the means of the skill."""
    W = np.stack([c.precision_cholesky("the covariance of state") for c in skill.covariances])
    emissions = kernels.Emissions(skill.means, W, data.orientation_starts)
    moments: list[tuple[Moments, ...]] = []
    for m, x in enumerate(_split_demonstrations(data)):
        T = x.shape[1]
        step, _ = skill.dynamics.e_step(np.ascontiguousarray(x), np.array([T]), emissions, max_duration=T)
        if not np.isfinite(step.log_likelihoods[0]):
            raise InvalidInput(
                f"demonstration {m} (first is 0) has probability zero under the skill; give the "
                "demonstrations that it was learned from"
            )
        zero = np.zeros(step.deviation_sums.shape[1:])
        moments.append(
            tuple(
                Moments.from_sums(zero, step.counts, sums, scatter)
                for sums, scatter in zip(step.deviation_sums, step.scatter_matrices, strict=True)
            )
        )
    return moments


def _frame_from_world(demo: Demonstration, view: Float[Array, "P T D"]) -> Float[Array, "P E E"]:
    """Return the matrices that map deviations in the world to deviations in each frame.

    A frame multiplies an orientation on S^3 from the left, which does not change deviations in body axes.
    Quaternions in R^4 have the sign that they have in the views.
    """
    layout, tangent = demo.layout, demo.layout.tangent
    flat = np.concatenate(
        [
            np.arange(columns.start, columns.start + part.size)
            for part, columns in zip(tangent.parts, layout.slices, strict=True)
        ]
    )
    maps = np.zeros((len(demo.frames), tangent.width, tangent.width))
    for B, frame, x in zip(maps, demo.frames, view, strict=True):
        inverse = np.linalg.solve(frame.A, np.eye(len(frame.b)))
        raw = (demo.x - frame.b) @ inverse.T
        negated = [c for c in layout.quaternions if np.sum(raw[:, c] * x[:, c]) < 0.0]
        inverse *= layout.quaternion_signs(negated)[:, None]
        B[:] = inverse[np.ix_(flat, flat)]
        for part, columns in zip(layout.parts, tangent.slices, strict=True):
            if part.quantity is Quantity.ORIENTATION:
                B[columns], B[:, columns] = 0.0, 0.0
                B[columns, columns] = np.eye(columns.stop - columns.start)
    return maps


def _state_relevance(
    skill: Skill, k: int, segments: Sequence[tuple[Moments, ...]], maps: Sequence[Float[Array, "P E E"]]
) -> tuple[Float[Array, " P"], Float[Array, " P"]]:
    """Return the relevance of the frames at state k, and the cost of excluding each."""
    P = len(skill.frame_names)
    present = [m for m, moments in enumerate(segments) if moments[0].counts[k] >= MIN_DATAPOINTS]
    if len(present) < 2:
        return np.ones(P), np.zeros(P)
    held_out = [_hold_out(skill, k, [segments[n] for n in present if n != m], segments[m]) for m in present]
    opinions = FrameOpinions.from_frames([maps[m] for m in present], held_out)
    return eliminate_frames(opinions, MIN_EVIDENCE)


def _hold_out(
    skill: Skill, k: int, others: Sequence[tuple[Moments, ...]], own: tuple[Moments, ...]
) -> HeldOutSegment:
    """Return offsets, precision factors and scatter of state k, with Gaussians of the others."""
    offsets, factors, scatter_matrices = [], [], []
    for p, own_moments in enumerate(own):
        rest = reduce(add, (moments[p] for moments in others))
        covariance = _shrink_covariance(rest.scatter_matrices[k] / rest.counts[k], skill.layout, len(others))
        if skill.regularisation is not None:
            covariance += np.diag(skill.regularisation)
        offsets.append(rest.means[k] - own_moments.means[k])
        factors.append(precision_cholesky(covariance[None], f"held-out covariance of state {k}, number")[0])
        scatter_matrices.append(own_moments.scatter_matrices[k] / own_moments.counts[k])
    return np.stack(offsets), np.stack(factors), np.stack(scatter_matrices)


def _shrink_covariance(
    covariance: Float[Array, "E E"], layout: Layout, demonstrations: int
) -> Float[Array, "E E"]:
    """Shrink towards one variance per part, with the weight of E + 1 demonstrations."""
    E = len(covariance)
    target = np.zeros(E)
    for columns in layout.tangent.slices:
        target[columns] = np.diag(covariance)[columns].mean()
    weight = (E + 1) / (E + 1 + demonstrations)
    return weight * np.diag(target) + (1.0 - weight) * covariance
