"""Conversion of an online model to a skill, for adaptation, planning and tracking."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import LatentCovariances
from pilotfish.models.durations import Gaussian
from pilotfish.models.dynamics import MixtureWeights
from pilotfish.models.learning_problem import library_version
from pilotfish.models.online.model import OnlineModel
from pilotfish.models.semi_markov import Dynamics, SemiMarkovChain
from pilotfish.models.skill import Provenance, Skill
from pilotfish.types import Array, Float, Int

DURATION_VARIANCE_REGULARISATION = 1.0  # steps^2, added to variances of durations, as in EMSettings


def to_skill(model: OnlineModel, note: str = "") -> Skill:
    """Return the skill that a model represents: a mixture, or a semi-Markov skill for HDPHSMM and SOSC.

    Covariances are Lambda Lambda^T + sigma^2 I with Lambda = U sqrt(variances) over the first d directions
    (5.24-5.25), in factored form. With scales S, Lambda has all stored directions of a cluster, its noise
    is the mean variance of its other directions, and covariances are S (Lambda Lambda^T + noise I) S. One
    sigma^2 for all clusters would hide where a task is precise. The noise includes one datapoint of variance
    sigma^2, so that a cluster of few datapoints is not certain.

    Self-transitions are excluded; a state without other transitions is final.
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
    )


def _covariances(model: OnlineModel, p: int) -> LatentCovariances:
    if model.scales is not None:
        return _scaled_covariances(model, p, model.scales[p])
    noise = np.full((model.clusters, model.layout.width), model.settings.noise)
    return LatentCovariances(_loadings(model, p, model.dimensions[:, p]), noise)


def _scaled_covariances(model: OnlineModel, p: int, scales: Float[Array, " D"]) -> LatentCovariances:
    """Return covariances of all stored directions, with the noise of each cluster."""
    state, ranks = model.state, model.state.ranks[:, p].astype(np.int64)
    outside = state.distances[np.arange(model.clusters), p, ranks]  # mean squared distance to the directions
    others = model.layout.width - ranks
    residual = np.where(others > 0, outside / np.maximum(others, 1), 0.0)
    noise = (state.points * residual + model.settings.noise) / (state.points + 1.0)
    return LatentCovariances(_loadings(model, p, ranks) * scales[:, None], noise[:, None] * scales**2)


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
    departures = counts.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(counts, departures, out=np.zeros_like(counts), where=departures > 0.0))


def _durations(model: OnlineModel) -> Gaussian:
    """Return mean and deviation of the completed segments (5.32-5.34), or else of unfinished ones."""
    state, k = model.state, model.current_cluster
    means = np.where(state.segments > 0.0, state.mean_durations, state.mean_censored_durations)
    if k >= 0 and state.segments[k] + state.censored[k] == 0.0:
        means[k] = state.steps_in_cluster
    variances = state.squared_deviations / np.maximum(state.segments - 1.0, 1.0)
    return Gaussian(np.maximum(means, 1.0), np.sqrt(variances + DURATION_VARIANCE_REGULARISATION))
