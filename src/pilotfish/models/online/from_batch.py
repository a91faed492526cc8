"""A stream that begins with what a batch fit of a few demonstrations learned, and penalties made from it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.models.online.model import Column, Head, OnlineModel, online_model
from pilotfish.models.online.settings import (
    DEFAULT_MAINTENANCE,
    SOSC,
    ConstantWeight,
    ExponentialDecay,
    Maintenance,
    OnlineSettings,
)
from pilotfish.models.sequences import state_segments, validated_views, viterbi
from pilotfish.models.skill import Skill
from pilotfish.types import Array, Bool, Float, Int
from pilotfish.validation import require_type

DISTANCE_QUANTILE, FADE_AT_QUANTILE = (
    0.99,
    0.6,
)  # of a state's datapoints that share is nearer than where rho falls to HELD
TRANSITION_PENALTY_RATIO = 0.025 / 3.6  # lambda_2 and lambda_3 as shares of lambda, in the thesis' experiment


@dataclass(frozen=True, slots=True, eq=False)
class LabelledDatapoints:
    """Datapoints as P frames see them, the state of each, and where demonstrations end."""

    x: Float[Array, "P N D"]
    lengths: Int[Array, " M"]
    states: Int[Array, " N"]


def estimate_penalties(
    skill: Skill,
    demonstrations: Sequence[Demonstration],
    *,
    explained_variance: float = 0.9,
    maintenance: Maintenance = DEFAULT_MAINTENANCE,
) -> SOSC:
    """Penalties under which a stream would see these demonstrations as the skill does.

    lambda_1 lies where the directions of all states and frames of larger variance explain that share of all
    variance, sigma^2 is the mean variance of the others, b_m fades a subspace to 60 % at the distance that
    99 % of a state's datapoints lie within, and lambda is the largest squared distance of a datapoint to
    its own state's subspaces, over frames: not one would have begun a cluster of its own. lambda_2 and
    lambda_3 are the shares of lambda that they are in the thesis' experiment (section 5.7.1). Where the
    upkeep names no merge_distance it is half the least distance between the means of two states, so that
    these stay apart. The 60 % and this half were chosen on the streams of reproductions/online_*.py.
    Raises: InvalidInput, when the skill and the demonstrations do not belong together.
    Source: the future work of Tanwani 2018, section 5.6, which asks for it and leaves the way open.
    """
    if not 0.0 < explained_variance < 1.0:
        raise InvalidInput(f"explained is {explained_variance}, expected a share between 0 and 1, say 0.9")
    data = _label_datapoints(skill, demonstrations)
    variances = np.stack([np.linalg.eigvalsh(c.dense)[:, ::-1] for c in skill.covariances])  # (P, K, D)
    shares = np.bincount(data.states, minlength=skill.states) / len(data.states)
    dimension, noise = _subspace_thresholds(
        variances, np.broadcast_to(shares[:, None], variances.shape), explained_variance
    )
    errors = data.x - skill.means[:, data.states]  # (P, N, D)
    squares = np.einsum("pnd,pnd->pn", errors, errors)
    bandwidth = float(np.quantile(squares, DISTANCE_QUANTILE)) / -np.log(FADE_AT_QUANTILE)
    if not bandwidth > 0.0:
        raise InvalidInput("all datapoints of every state are equal, expected states with some extent")
    projection_weight = 1.0 - np.expm1(-squares / bandwidth) ** 2
    costs = (squares - projection_weight * _squared_projections(skill, data, errors, dimension)).sum(
        axis=0
    )  # (N,)
    cluster = max(float(costs.max()) * (1.0 + 1e-9), noise)  # the farthest one stays too
    return SOSC(
        cluster=cluster,
        dimension=dimension,
        noise=noise,
        bandwidth=float(bandwidth),
        transition=TRANSITION_PENALTY_RATIO * cluster,
        new_transition=TRANSITION_PENALTY_RATIO * cluster,
        maintenance=_set_merge_distance(skill, maintenance),
    )


def from_batch_fit(
    skill: Skill, demonstrations: Sequence[Demonstration], settings: OnlineSettings
) -> OnlineModel:
    """A model that has learned the demonstrations as the skill did, ready for the next.

    Each state is a cluster with its means and covariances. Its datapoints, transitions and visits are those
    of the most likely state sequences; the last visit of each demonstration is cut off.
    Weights are the numbers of datapoints; of traces at most 1 / (1 - discount), all that a trace can hold.
    A state that no sequence visits is left out.
    Raises: InvalidInput, when the skill and the demonstrations do not belong together.
    """
    data = _label_datapoints(skill, demonstrations)
    model = online_model(settings, skill.layout, skill.period, skill.frame_names)
    capacity = min(model.parameters.max_dimension + model.parameters.extra_directions, skill.width)
    state = kernels.zero_stream(
        skill.states, len(skill.frame_names), skill.width, kernels.round_up_to_four(capacity)
    )
    points = np.bincount(data.states, minlength=skill.states).astype(np.float64)
    state.clusters[:, Column.POINTS] = points
    state.clusters[:, Column.WEIGHT] = _cluster_weights(points, settings)
    _add_transitions_and_segments(state, data)
    for p, covariances in enumerate(skill.covariances):
        for k, covariance in enumerate(covariances.dense):
            _pack_subspace(skill.means[p, k], covariance, state, (k, p), model.parameters)
    return replace(model, state=_select_clusters(points > 0.0, state, len(data.states)))


def _select_clusters(
    kept: Bool[Array, " K"], state: kernels.StreamState, datapoints: int
) -> kernels.StreamState:
    """The state of some of the clusters, named anew in their order."""
    rows = state.clusters[kept]
    rows[:, Column.CLUSTER_ID] = np.arange(len(rows))
    head = state.head.copy()
    head[Head.NEXT_CLUSTER_ID], head[Head.POINTS] = len(rows), datapoints
    return replace(
        state,
        head=head,
        clusters=rows,
        transition_counts=np.ascontiguousarray(state.transition_counts[kept][:, kept]),
    )


def _label_datapoints(skill: Skill, demonstrations: Sequence[Demonstration]) -> LabelledDatapoints:
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    if skill.layout.orientation_starts:
        raise InvalidInput(
            "the skill has orientations on their sphere, and streams learn quaternions as four numbers; "
            "learn it from demonstrations without on_sphere"
        )
    data = validated_views(skill, demonstrations)
    states = np.concatenate([viterbi(skill, demonstration) for demonstration in demonstrations])
    return LabelledDatapoints(data.x, data.lengths, states)


def _set_merge_distance(skill: Skill, maintenance: Maintenance) -> Maintenance:
    """The same, with a merge distance under which no two states of the skill would merge."""
    if maintenance.merge_distance is not None or skill.states == 1:
        return maintenance
    means = skill.means.transpose(1, 0, 2).reshape(skill.states, -1)
    squares = np.sum((means[:, None] - means) ** 2, axis=2)
    least = float(np.min(squares[~np.eye(skill.states, dtype=bool)]))
    return replace(maintenance, merge_distance=0.5 * float(np.sqrt(least)))


def _subspace_thresholds(
    variances: Float[Array, "P K D"], shares: Float[Array, "P K D"], explained_variance: float
) -> tuple[float, float]:
    """lambda_1 and sigma^2: the variance above which directions explain enough; the mean of the others."""
    order = np.argsort(variances, axis=None)[::-1]
    values, weights = variances.ravel()[order], shares.ravel()[order]
    statistics = np.cumsum(values * weights)
    n = min(int(np.searchsorted(statistics, explained_variance * statistics[-1])) + 1, len(values) - 1)
    dimension = float(np.sqrt(values[n - 1] * max(values[n], np.finfo(float).tiny)))
    rest = weights[n:].sum()
    noise = float((statistics[-1] - statistics[n - 1]) / rest) if rest > 0.0 else float(values[n])
    return dimension, max(noise, float(values[-1]), np.finfo(float).tiny)


def _squared_projections(
    skill: Skill, data: LabelledDatapoints, errors: Float[Array, "P N D"], dimension: float
) -> Float[Array, "P N"]:
    """How much of each datapoint's squared error lies in its state's subspace."""
    inside = np.empty(errors.shape[:2])
    for p, covariances in enumerate(skill.covariances):
        values, U = np.linalg.eigh(covariances.dense)
        along = np.einsum("ndi,nd->ni", U[data.states], errors[p])
        signal = values > dimension
        signal[:, 0] = False  # of D directions at most D - 1
        inside[p] = (along**2 * signal[data.states]).sum(axis=1)
    return inside


def _cluster_weights(points: Float[Array, " K"], settings: OnlineSettings) -> Float[Array, " K"]:
    match settings.maintenance.weighting:
        case ExponentialDecay(discount, _):
            return np.asarray(np.minimum(points, 1.0 / (1.0 - discount)))
        case ConstantWeight(weight):
            return np.full(len(points), float(weight))
        case _:
            return points


def _add_transitions_and_segments(state: kernels.StreamState, data: LabelledDatapoints) -> None:
    """The state gains how often each cluster followed each, and what visits there were."""
    rows = state.clusters
    for states in np.split(data.states, np.cumsum(data.lengths)[:-1]):
        np.add.at(state.transition_counts, (states[:-1], states[1:]), 1.0)
        visited, lengths = state_segments(states)
        rows[visited[0], Column.DEMONSTRATION_STARTS] += 1.0
        for place, (k, steps) in enumerate(zip(visited, lengths, strict=True)):
            cut = place == len(visited) - 1
            number, mean = (
                (Column.CENSORED, Column.MEAN_CENSORED_DURATION)
                if cut
                else (Column.SEGMENTS, Column.MEAN_DURATION)
            )
            rows[k, number] += 1.0
            off = steps - rows[k, mean]
            rows[k, mean] += off / rows[k, number]
            if not cut:
                rows[k, Column.SQUARED_DEVIATIONS] += off * (steps - rows[k, mean])


def _pack_subspace(
    mean: Float[Array, " D"],
    covariance: Float[Array, "D D"],
    state: kernels.StreamState,
    place: tuple[int, int],
    parameters: kernels.StreamParameters,
) -> None:
    """Into the row of a cluster, the leading directions: first those that explain more than lambda_1."""
    values, U = np.linalg.eigh(covariance)
    values, U = np.maximum(values[::-1], 0.0), U[:, ::-1]
    d = min(int(np.sum(values > parameters.dimension)), parameters.max_dimension)
    r = min(d + parameters.extra_directions, len(mean))
    state.dimensions[place], state.ranks[place] = d, r
    state.means[place], state.variances[place][:r] = mean, values[:r]
    state.bases[place][:, :r] = U[:, :r]
    beyond = values.sum() - np.concatenate([[0.0], np.cumsum(values[:r])])
    state.distances[place][: r + 1] = np.maximum(beyond, 0.0)
