"""Initialisation of an online model from a batch fit, and penalties estimated from it.

A batch fit of a few demonstrations gives the states; the stream then continues from them. The penalties are
chosen such that the stream would assign these demonstrations as the fit does.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.models.online.model import OnlineModel, online_model
from pilotfish.models.online.settings import DEFAULT_MAINTENANCE, SOSC, Maintenance, OnlineSettings
from pilotfish.models.sequences import state_segments, validated_views, viterbi
from pilotfish.models.skill import Skill
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_type

# b_m is chosen such that rho is RHO_AT_QUANTILE at this quantile of the squared distances to the states.
DISTANCE_QUANTILE, RHO_AT_QUANTILE = 0.99, 0.6
TRANSITION_PENALTY_RATIO = 0.025 / 3.6  # lambda_2 / lambda and lambda_3 / lambda in the thesis' experiment

LabelledViews = tuple[Float[Array, "P N D"], Int[Array, " M"], Int[Array, " N"]]  # x, lengths, states
Arrays = dict[str, Float[Array, "..."]]


def estimate_penalties(
    skill: Skill,
    demonstrations: Sequence[Demonstration],
    *,
    explained_variance: float = 0.9,
    maintenance: Maintenance = DEFAULT_MAINTENANCE,
) -> SOSC:
    """Estimate the penalties of SOSC under which clusters follow the states of a batch skill.

    - lambda_1: variance threshold above which directions of all states and frames explain the given share.
    - sigma^2: mean variance of the other directions.
    - b_m: rho is 0.6 at the squared distance within which 99 % of the datapoints of a state lie.
    - lambda: largest squared distance of a datapoint to the subspaces of its state, added over frames, so
      that no datapoint would start a cluster.
    - lambda_2, lambda_3: the shares of lambda in the thesis' experiment (section 5.7.1).

    The value 0.6 and the merge distance below were chosen on the streams of reproductions/online_*.py.

    Args:
        skill: Batch fit.
        demonstrations: Demonstrations that it was learned from.
        explained_variance: Share of all variance that subspaces explain, between 0 and 1.
        maintenance: Maintenance of the clusters. If it has no merge distance, half the least distance between
            the means of two states is used, so that these are not merged.

    Returns:
        Settings of a SOSC learner.

    Raises:
        InvalidInput: If the skill and the demonstrations do not belong together, or have no variance.

    Source:
        Tanwani 2018, section 5.6, names this as future work; the estimates are ours.
    """
    if not 0.0 < explained_variance < 1.0:
        raise InvalidInput(
            f"explained_variance is {explained_variance}, expected a share between 0 and 1, say 0.9"
        )
    x, _, states = data = _label_datapoints(skill, demonstrations)
    variances = np.stack([np.linalg.eigvalsh(c.dense)[:, ::-1] for c in skill.covariances])  # (P, K, D)
    shares = np.broadcast_to(
        (np.bincount(states, minlength=skill.states) / len(states))[:, None], variances.shape
    )
    dimension, noise = _subspace_thresholds(variances, shares, explained_variance)
    errors = x - skill.means[:, states]  # (P, N, D)
    squares = np.einsum("pnd,pnd->pn", errors, errors)
    bandwidth = float(np.quantile(squares, DISTANCE_QUANTILE)) / -np.log(RHO_AT_QUANTILE)
    if not bandwidth > 0.0:
        raise InvalidInput("all datapoints of every state are equal, expected states with some variance")
    projection_weights = 1.0 - np.expm1(-squares / bandwidth) ** 2
    inside = projection_weights * _squared_projections(skill, data, errors, dimension)
    costs = (squares - inside).sum(axis=0)  # (N,)
    cluster = max(float(costs.max()) * (1.0 + 1e-9), noise)  # the largest cost is still below the penalty
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
    """Create an online model from a batch fit and its demonstrations.

    Each state becomes a cluster with its means and covariances. Datapoints, transitions and segments are
    those of the most probable state sequences; the last segment of each demonstration is right-censored.
    Weights are the numbers of datapoints, limited to 1 / (1 - discount) under exponential decay. A state
    that no sequence contains is left out.

    Args:
        skill: Batch fit.
        demonstrations: Demonstrations that it was learned from.
        settings: Learner and penalties.

    Returns:
        A model ready for the next datapoint.

    Raises:
        InvalidInput: If the skill and the demonstrations do not belong together.
    """
    data = _label_datapoints(skill, demonstrations)
    model = online_model(settings, skill.layout, skill.period, skill.frame_names)
    parameters, states = model.parameters, data[2]
    capacity = min(parameters.max_dimension + parameters.extra_directions, skill.width)
    arrays = kernels.zero_arrays(skill.states, len(skill.frame_names), skill.width, capacity)
    points = np.bincount(states, minlength=skill.states).astype(np.float64)
    arrays["points"] = points
    arrays["weights"] = np.array([settings.maintenance.initial_weight(n) for n in points.tolist()])
    _count_transitions_and_segments(arrays, data)
    for p, covariances in enumerate(skill.covariances):
        for k, covariance in enumerate(covariances.dense):
            _fill_subspace(arrays, (k, p), skill.means[p, k], covariance, parameters)
    counts = arrays.pop("transition_counts")
    kept = points > 0.0
    arrays = {name: values[kept] for name, values in arrays.items()}
    arrays |= {"transition_counts": counts[kept][:, kept], "cluster_ids": np.arange(kept.sum(), dtype=float)}
    counters = model.state.to_counters() | {"next_cluster_id": int(kept.sum()), "datapoints": len(states)}
    return replace(model, state=kernels.StreamState.from_arrays(arrays, counters))


def _label_datapoints(skill: Skill, demonstrations: Sequence[Demonstration]) -> LabelledViews:
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    if skill.layout.orientation_starts:
        raise InvalidInput(
            "the skill has orientations on S^3, expected quaternions as four numbers; learn it from "
            "demonstrations without on_sphere"
        )
    data = validated_views(skill, demonstrations)
    states = np.concatenate([viterbi(skill, demonstration) for demonstration in demonstrations])
    return data.x, data.lengths, states


def _set_merge_distance(skill: Skill, maintenance: Maintenance) -> Maintenance:
    if maintenance.merge_distance is not None or skill.states == 1:
        return maintenance
    means = skill.means.transpose(1, 0, 2).reshape(skill.states, -1)
    squares = np.sum((means[:, None] - means) ** 2, axis=2)
    least = float(np.min(squares[~np.eye(skill.states, dtype=bool)]))
    return replace(maintenance, merge_distance=0.5 * float(np.sqrt(least)))


def _subspace_thresholds(
    variances: Float[Array, "P K D"], shares: Float[Array, "P K D"], explained_variance: float
) -> tuple[float, float]:
    """Return lambda_1, between the variances that explain the share and the others, and sigma^2."""
    order = np.argsort(variances, axis=None)[::-1]
    values, weights = variances.ravel()[order], shares.ravel()[order]
    explained = np.cumsum(values * weights)
    n = min(int(np.searchsorted(explained, explained_variance * explained[-1])) + 1, len(values) - 1)
    dimension = float(np.sqrt(values[n - 1] * max(values[n], np.finfo(float).tiny)))
    rest = weights[n:].sum()
    noise = float((explained[-1] - explained[n - 1]) / rest) if rest > 0.0 else float(values[n])
    return dimension, max(noise, float(values[-1]), np.finfo(float).tiny)


def _squared_projections(
    skill: Skill, data: LabelledViews, errors: Float[Array, "P N D"], dimension: float
) -> Float[Array, "P N"]:
    """Return the squared length of each error inside the subspace of its state."""
    states, inside = data[2], np.empty(errors.shape[:2])
    for p, covariances in enumerate(skill.covariances):
        values, U = np.linalg.eigh(covariances.dense)
        projections = np.einsum("ndi,nd->ni", U[states], errors[p])
        signal = values > dimension
        signal[:, 0] = False  # of D directions at most D - 1
        inside[p] = (projections**2 * signal[states]).sum(axis=1)
    return inside


def _count_transitions_and_segments(arrays: Arrays, data: LabelledViews) -> None:
    _, lengths, labels = data
    for states in np.split(labels, np.cumsum(lengths)[:-1]):
        np.add.at(arrays["transition_counts"], (states[:-1], states[1:]), 1.0)
        segment_states, durations = (values.tolist() for values in state_segments(states))
        arrays["demonstration_starts"][segment_states[0]] += 1.0
        for k, steps in zip(segment_states[:-1], durations[:-1], strict=True):
            deviation = _update_mean(arrays["segments"], arrays["mean_durations"], k, steps)
            arrays["squared_deviations"][k] += deviation * (steps - arrays["mean_durations"][k])
        _update_mean(arrays["censored"], arrays["mean_censored_durations"], segment_states[-1], durations[-1])


def _update_mean(counts: Float[Array, " K"], means: Float[Array, " K"], k: int, value: int) -> float:
    """Add a value to the running mean of k; return its deviation from the mean before (Welford)."""
    counts[k] += 1.0
    deviation = float(value - means[k])
    means[k] += deviation / counts[k]
    return deviation


def _fill_subspace(
    arrays: Arrays,
    index: tuple[int, int],
    mean: Float[Array, " D"],
    covariance: Float[Array, "D D"],
    parameters: kernels.StreamParameters,
) -> None:
    """Store the leading directions of a covariance; those of variance above lambda_1 are the subspace."""
    values, U = np.linalg.eigh(covariance)
    values, U = np.maximum(values[::-1], 0.0), U[:, ::-1]
    d = min(int(np.sum(values > parameters.dimension)), parameters.max_dimension)
    r = min(d + parameters.extra_directions, len(mean))
    arrays["dimensions"][index], arrays["ranks"][index] = d, r
    arrays["means"][index], arrays["variances"][index][:r] = mean, values[:r]
    arrays["bases"][index][:, :r] = U[:, :r]
    outside = values.sum() - np.concatenate([[0.0], np.cumsum(values[:r])])
    arrays["distances"][index][: r + 1] = np.maximum(outside, 0.0)
