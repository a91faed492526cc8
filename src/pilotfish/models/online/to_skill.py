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
from pilotfish.types import Array, Float

DURATION_VARIANCE_REGULARISATION = 1.0  # steps^2, added to variances of durations, as in EMSettings


def to_skill(model: OnlineModel, note: str = "") -> Skill:
    """Return the skill that a model represents: a mixture, or a semi-Markov skill for HDPHSMM and SOSC.

    Covariances are Lambda Lambda^T + sigma^2 I with Lambda = U sqrt(variances) over the first d directions
    (5.24-5.25), in factored form. Means and covariances are in the units of the columns: where the model has
    scales S, covariances are S (Lambda Lambda^T + sigma^2 I) S. Self-transitions are excluded; a state without other transitions is final.
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
    d = model.dimensions[:, p]
    L = max(1, int(d.max()))
    variances = _resize_last_axis(model.state.variances[:, p], L)
    lengths = np.where(np.arange(L) < d[:, None], np.sqrt(variances), 0.0)
    loadings = _resize_last_axis(model.state.bases[:, p], L) * lengths[:, None, :]
    noise = np.full((model.clusters, model.layout.width), model.settings.noise)
    if model.scales is None:
        return LatentCovariances(loadings, noise)
    return LatentCovariances(loadings * model.scales[:, None], noise * model.scales**2)


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
