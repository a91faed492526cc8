"""Which frames matter at which state, told by the demonstrations alone."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import add
from typing import cast

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration, Frame, Layout, MovingFrame, Quantity, Views, views
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.gaussians import Moments, moments_about, whiteners
from pilotfish.models.dynamics import Dynamics, SemiMarkovChain
from pilotfish.models.pools import Held, Opinions, best_powers, log_scores, opinions
from pilotfish.models.skill import Skill
from pilotfish.models.statistics import one_step_chain
from pilotfish.models.visits import visit_tables
from pilotfish.types import Array, Bool, Float, Int

STRONG = 3.0  # nats: odds of twenty to one, strong evidence on the scale of Kass & Raftery 1995
FEWEST = 1.0  # datapoints of a visit that speaks for a demonstration


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
    require_kind("skill", skill, Skill, "a fit holds one: fit.skill")
    data = views(demonstrations)
    _refuse(skill, demonstrations)
    visits = _visits(skill, data)
    charts = [_from_world(demo, x) for demo, x in zip(demonstrations, _each(data), strict=True)]
    P, K = skill.means.shape[:2]
    values, costs = np.empty((P, K)), np.empty((P, K))
    for k in range(K):
        values[:, k], costs[:, k] = _of_state(skill, k, visits, charts)
    return FrameRelevance(values, costs, skill.frame_names)


def select_frames(
    demonstrations: Sequence[Demonstration], relevant: FrameRelevance
) -> tuple[Demonstration, ...]:
    """The demonstrations without the frames that matter at no state, to learn from anew.

    Raises: InvalidInput, when their frames are not those that the relevance speaks of.
    """
    require_kind("relevant", relevant, FrameRelevance, "relevance(skill, demonstrations) makes one")
    for demo in demonstrations:
        if sorted(names := [f.name for f in demo.frames]) != sorted(relevant.frame_names):
            raise InvalidInput(
                f"demonstration {demo.name!r} has frames {names}, the relevance speaks of "
                f"{list(relevant.frame_names)}; give the demonstrations that it was told by"
            )
    gone = relevant.distractors
    return tuple(replace(d, frames=tuple(f for f in d.frames if f.name not in gone)) for d in demonstrations)


def _refuse(skill: Skill, demonstrations: Sequence[Demonstration]) -> None:
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
        if moving := [f.name for f in demo.frames if isinstance(f, MovingFrame)]:
            raise InvalidInput(
                f"frame {moving[0]!r} of demonstration {demo.name!r} moves; relevance is told "
                "for frames that stand, say frame.at(t)"
            )


def _each(data: Views) -> list[Float[Array, "P T D"]]:
    return np.split(data.x, np.cumsum(data.lengths)[:-1], axis=1)


def _visits(skill: Skill, data: Views) -> list[tuple[Moments, ...]]:
    """For each demonstration and frame, moments of the deviations from the skill's means."""
    W = np.stack([c.whiteners("the covariance of state") for c in skill.covariances])
    emissions = kernels.Emissions(skill.means, W, data.turns)
    found: list[tuple[Moments, ...]] = []
    for x in _each(data):
        step = _e_step(skill.dynamics, x, emissions)
        if not np.isfinite(step.log_likelihoods[0]):
            raise InvalidInput(
                f"demonstration {len(found)} (first is 0) is impossible under the skill; give the "
                "demonstrations that it was learned from"
            )
        zero = np.zeros(step.offsets.shape[1:])
        found.append(
            tuple(
                moments_about(zero, step.mass, o, s) for o, s in zip(step.offsets, step.scatters, strict=True)
            )
        )
    return found


def _e_step(
    dynamics: Dynamics, x: Float[Array, "P T D"], emissions: kernels.Emissions
) -> kernels.EStep | kernels.SemiMarkovEStep:
    """Posterior moments of one demonstration about the means of the states."""
    x, length = np.ascontiguousarray(x), np.array([x.shape[1]])
    if isinstance(dynamics, SemiMarkovChain):
        tables = visit_tables(dynamics, x.shape[1])
        return kernels.semi_markov_e_step(x, length, tables, emissions)
    return kernels.e_step(x, length, *one_step_chain(dynamics), emissions)


def _from_world(demo: Demonstration, seen: Float[Array, "P T D"]) -> Float[Array, "P E E"]:
    """Matrices that take deviations in the world to deviations that each frame sees.

    A frame turns an orientation of S^3 from the left, which leaves deviations in body axes as they are.
    Quaternions treated as flat have the sign in which the views have them.
    """
    parts = _tangent_parts(demo.layout)
    standing = cast("tuple[Frame, ...]", demo.frames)
    flat, tangent = (np.concatenate(ranges).astype(np.int64) for ranges in zip(*parts, strict=True))
    maps = np.zeros((len(standing), len(tangent), len(tangent)))
    for B, frame, x in zip(maps, standing, seen, strict=True):
        inverse = np.linalg.solve(frame.A, np.eye(len(frame.b)))
        inverse *= _signs((demo.x - frame.b) @ inverse.T, x, demo.layout)[:, None]
        B[:] = inverse[np.ix_(flat, flat)]
        for part, (_, columns) in zip(demo.layout.parts, parts, strict=True):
            if part.quantity is Quantity.ORIENTATION:
                B[columns], B[:, columns] = 0.0, 0.0
                B[columns, columns] = 1.0
    return maps


def _tangent_parts(layout: Layout) -> list[tuple[Int[Array, " d"], Int[Array, " d"]]]:
    """For each part, its first columns and those of its deviations: three for an orientation of S^3."""
    parts, done = [], 0
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        size = part.size - (part.quantity is Quantity.ORIENTATION)
        parts.append((np.arange(columns.start, columns.start + size), np.arange(done, done + size)))
        done += size
    return parts


def _signs(raw: Float[Array, "T D"], viewed: Float[Array, "T D"], layout: Layout) -> Float[Array, " D"]:
    """Minus one for the quaternions that the views have negated."""
    agreement = [float(np.sum(raw[:, c] * viewed[:, c])) for c in layout.slices]
    sizes = [part.size for part in layout.parts]
    return np.repeat(np.where(np.array(agreement) < 0.0, -1.0, 1.0), sizes)


def _of_state(
    skill: Skill, k: int, visits: Sequence[tuple[Moments, ...]], charts: Sequence[Float[Array, "P E E"]]
) -> tuple[Float[Array, " P"], Float[Array, " P"]]:
    """Powers of the frames at state k relative to the largest, and what leaving out each alone costs."""
    P = len(skill.frame_names)
    speaking = [m for m, moments in enumerate(visits) if moments[0].mass[k] >= FEWEST]
    if len(speaking) < 2:
        return np.ones(P), np.zeros(P)
    held = [_held_out(skill, k, [visits[n] for n in speaking if n != m], visits[m]) for m in speaking]
    return _relevant_powers(opinions([charts[m] for m in speaking], held))


def _held_out(skill: Skill, k: int, others: Sequence[tuple[Moments, ...]], own: tuple[Moments, ...]) -> Held:
    """State k as each frame tells it from the other demonstrations, beside the visit that was held out."""
    shrink = partial(_towards_parts, layout=skill.layout, demonstrations=len(others))
    offsets, whitening, scatters = [], [], []
    for p, mine in enumerate(own):
        rest = reduce(add, (moments[p] for moments in others))
        covariance = shrink(rest.scatters[k] / rest.mass[k])
        covariance += skill.provenance.regularisation * np.eye(len(covariance))
        offsets.append(rest.means[k] - mine.means[k])
        whitening.append(whiteners(covariance[None], f"held-out covariance of state {k}, number")[0])
        scatters.append(mine.scatters[k] / mine.mass[k])
    return Held(np.stack(offsets), np.stack(whitening), np.stack(scatters))


def _towards_parts(
    covariance: Float[Array, "E E"], layout: Layout, demonstrations: int
) -> Float[Array, "E E"]:
    """Drawn towards one variance for each part, uncorrelated, with the weight of E + 1 demonstrations.

    The mean of an inverse-Wishart posterior with 2 (E + 1) degrees of freedom, a visit being one datapoint.
    Frames that turn the axes of a part do not change its target.
    """
    E = len(covariance)
    target = np.zeros(E)
    for _, columns in _tangent_parts(layout):
        target[columns] = np.diag(covariance)[columns].mean()
    weight = (E + 1) / (E + 1 + demonstrations)
    return weight * np.diag(target) + (1.0 - weight) * covariance


def _relevant_powers(told: Opinions) -> tuple[Float[Array, " P"], Float[Array, " P"]]:
    """The powers, relative to the largest, of the frames that are worth hearing; and each frame's cost."""
    everyone = np.ones(told.frames, dtype=bool)
    costs = np.array([_price(told, everyone, p)[0] for p in range(told.frames)])
    heard = everyone
    while heard.sum() > 1:
        prices = {p: _price(told, heard, p) for p in np.flatnonzero(heard).tolist()}
        cheapest = min(prices, key=lambda p: prices[p][0])
        cost, error = prices[cheapest]
        if cost > STRONG + error:
            break
        heard = _but(heard, cheapest)
    powers = best_powers(told, heard)
    return powers / powers.max(), costs


def _price(told: Opinions, heard: Bool[Array, " P"], p: int) -> tuple[float, float]:
    """What leaving frame p out costs all held-out visits together [nats], and the standard error of that."""
    rest = _but(heard, p)
    if not rest.any():
        return np.inf, 0.0
    losses = log_scores(told, best_powers(told, heard)) - log_scores(told, best_powers(told, rest))
    return float(losses.sum()), float(np.sqrt(len(losses)) * losses.std(ddof=1))


def _but(heard: Bool[Array, " P"], p: int) -> Bool[Array, " P"]:
    rest = heard.copy()
    rest[p] = False
    return rest
