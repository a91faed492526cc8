"""Conversion of an online model to a skill, for adaptation, planning and tracking.

Without scales the skill is the published one: covariances have one sigma^2, transitions are the counts. With
scales it differs where hard assignments and a single sigma^2 hide what the datapoints say:

Precision. A cluster has its own covariance. sigma^2 is the variance of datapoints over all clusters, so that
it fills in for datapoints only where a cluster has too few for a covariance in D columns: of n < D + 1
datapoints, D + 1 - n have the variance sigma^2. Every covariance then has the regularisation of a batch fit.

Shortcuts. A datapoint belongs to one cluster. A demonstration that passes beside a cluster, or enters the
next one early, therefore skips it, and the time of the cluster goes to a neighbour, whose durations then
spread. The most probable sequence of a plan prefers such a shortcut, as every segment costs the density of
its duration. A transition i -> j is therefore left out if a detour i -> k -> ... -> j is more probable. The
most probable successor of a state always remains, and every state that could be reached.

Ends. A batch fit knows that demonstrations are whole. A state is final if more than half of its visits end a
demonstration, and first and last datapoints are the endpoints of the skill.
"""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import LatentCovariances
from pilotfish.models.demonstration_statistics import default_regularisation
from pilotfish.models.durations import Gaussian
from pilotfish.models.dynamics import MixtureWeights
from pilotfish.models.learning_problem import library_version
from pilotfish.models.online.model import OnlineModel
from pilotfish.models.semi_markov import Dynamics, SemiMarkovChain
from pilotfish.models.skill import Endpoints, Provenance, Skill
from pilotfish.types import Array, Bool, Float, Int

DURATION_VARIANCE_REGULARISATION = 1.0  # steps^2, added to variances of durations, as in EMSettings
TIE = 1e-12  # relative difference of two probabilities that are equal up to rounding


def to_skill(model: OnlineModel, note: str = "") -> Skill:
    """Return the skill that a model represents: a mixture, or a semi-Markov skill for HDPHSMM and SOSC.

    Covariances are Lambda Lambda^T + sigma^2 I with Lambda = U sqrt(variances) over the first d directions
    (5.24-5.25), in factored form. Self-transitions are excluded; a state without other transitions is final.
    With scales, covariances are those of all stored directions with the noise of each cluster, shortcuts are
    left out, and the skill has endpoints and final states, as defined at the head of this file.

    Durations are Gaussian, fitted to completed segments, or to right-censored segments where none is
    complete.

    Args:
        model: Model after at least one datapoint.
        note: Text for the provenance of the skill; by default the number of datapoints.

    Returns:
        A skill with one state per cluster.

    Raises:
        InvalidInput: If the model has observed no datapoint.
    """
    if not model.clusters:
        raise InvalidInput("the model has observed no datapoint, expected at least one; call observe first")
    provenance = Provenance(
        demonstrations=(),
        datapoints=model.datapoints,
        data="",
        structure=model.settings.label,
        log_likelihood=np.nan,
        iterations=0,
        converged=True,
        library=library_version(),
        note=note or f"learned from a stream of {model.datapoints} datapoints, which was not kept",
    )
    return Skill(
        _dynamics(model),
        np.ascontiguousarray(model.means.transpose(1, 0, 2)),
        tuple(_covariances(model, p) for p in range(len(model.frame_names))),
        model.layout,
        model.period,
        model.frame_names,
        provenance,
        regularisation=_regularisation(model),
        endpoints=_endpoints(model),
    )


def _covariances(model: OnlineModel, p: int) -> LatentCovariances:
    if model.scales is not None:
        return _scaled_covariances(model, p, model.scales[p])
    noise = np.full((model.clusters, model.layout.width), model.settings.noise)
    return LatentCovariances(_loadings(model, p, model.dimensions[:, p]), noise)


def _scaled_covariances(model: OnlineModel, p: int, scales: Float[Array, " D"]) -> LatentCovariances:
    """Return covariances of all stored directions, with the noise of each cluster."""
    state, ranks, D = model.state, model.state.ranks[:, p].astype(np.int64), model.layout.width
    outside = state.distances[np.arange(model.clusters), p, ranks]  # mean squared distance to the directions
    residual = np.where(ranks < D, outside / np.maximum(D - ranks, 1), 0.0)
    missing = np.maximum(D + 1.0 - state.points, 0.0)  # datapoints that a covariance in D columns needs
    noise = (state.points * residual + missing * model.settings.noise) / (state.points + missing)
    added = noise[:, None] * scales**2 + _regularisation(model)
    return LatentCovariances(_loadings(model, p, ranks) * scales[:, None], added)


def _regularisation(model: OnlineModel) -> Float[Array, " D"] | None:
    """Return the variance that a batch fit of columns with these scales adds; None without scales."""
    if model.scales is None:
        return None
    sizes = [part.size for part in model.layout.parts]
    part_scales = model.scales[0] * np.sqrt(np.repeat(sizes, sizes))  # of all columns of a part together
    return default_regularisation(part_scales, model.layout)


def _endpoints(model: OnlineModel) -> Endpoints | None:
    """Return start and end as `fit_endpoints` does; None without scales, or without demonstrations."""
    if not model.ends or (added := _regularisation(model)) is None:
        return None
    variances = [
        np.diagonal(ends.scatter_matrices, axis1=1, axis2=2) / ends.counts[:, None] for ends in model.ends
    ]
    return Endpoints(np.stack([ends.means for ends in model.ends]), np.stack(variances) + added)


def _loadings(model: OnlineModel, p: int, d: Int[Array, " K"]) -> Float[Array, "K D L"]:
    """Return U sqrt(variances) over the first d directions of each cluster."""
    L = max(1, int(d.max()))
    variances = _resize_last_axis(model.state.variances[:, p], L)
    lengths = np.where(np.arange(L) < d[:, None], np.sqrt(variances), 0.0)
    return _resize_last_axis(model.state.bases[:, p], L) * lengths[:, None, :]


def _resize_last_axis(values: Float[Array, "... C"], L: int) -> Float[Array, "... L"]:
    """Return the first L entries of the last axis, padded with zeros."""
    missing = max(0, L - values.shape[-1])
    return np.pad(values[..., :L], [(0, 0)] * (values.ndim - 1) + [(0, missing)])


def _dynamics(model: OnlineModel) -> Dynamics:
    if not model.settings.has_dynamics:
        return MixtureWeights(model.priors)
    starts = model.state.demonstration_starts
    initial = starts / starts.sum() if starts.any() else model.priors  # all first clusters were removed
    return SemiMarkovChain(initial, _transitions(model), _durations(model))


def _transitions(model: OnlineModel) -> Float[Array, "K K"]:
    counts = model.transition_counts * (1.0 - np.eye(model.clusters))
    if model.scales is None:
        return _normalise_rows(counts)
    counts[_final_states(model)] = 0.0
    return _normalise_rows(np.where(_select_shortcuts(_normalise_rows(counts)), 0.0, counts))


def _normalise_rows(counts: Float[Array, "K K"]) -> Float[Array, "K K"]:
    totals = counts.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(counts, totals, out=np.zeros_like(counts), where=totals > 0.0))


def _final_states(model: OnlineModel) -> Bool[Array, " K"]:
    """Return the states of which more than half of the visits end a demonstration."""
    ends = model.state.censored.copy()
    if model.current_cluster >= 0:
        ends[model.current_cluster] += 1.0
    return np.asarray(ends > model.state.segments)


def _select_shortcuts(transitions: Float[Array, "K K"]) -> Bool[Array, "K K"]:
    """Return the transitions that are less probable than a detour over other states, in O(K^3)."""
    best = transitions.copy()
    for k in range(len(best)):  # paths over the states up to k (Floyd-Warshall)
        best = np.maximum(best, best[:, [k]] * best[k])
    return np.asarray(transitions < (1.0 - TIE) * best)


def _durations(model: OnlineModel) -> Gaussian:
    """Return mean and deviation of the completed segments (5.32-5.34), or else of unfinished ones."""
    state, k = model.state, model.current_cluster
    means = np.where(state.segments > 0.0, state.mean_durations, state.mean_censored_durations)
    if k >= 0 and state.segments[k] + state.censored[k] == 0.0:
        means[k] = state.steps_in_cluster
    variances = state.squared_deviations / np.maximum(state.segments - 1.0, 1.0)
    return Gaussian(np.maximum(means, 1.0), np.sqrt(variances + DURATION_VARIANCE_REGULARISATION))
