"""What a stream has taught, as a skill: adapting, planning and tracking know no difference."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import LatentCovariances
from pilotfish.models.durations import Gaussian
from pilotfish.models.dynamics import MixtureWeights
from pilotfish.models.learn import library_version
from pilotfish.models.online.model import Column, Head, OnlineModel
from pilotfish.models.online.settings import DPGMM, DPMPPCA
from pilotfish.models.semi_markov import Dynamics, SemiMarkovChain
from pilotfish.models.skill import Provenance, Skill
from pilotfish.types import Array, Float

DURATION_VARIANCE_REGULARISATION = 1.0  # steps^2, added to variances of durations, as in EMSettings


def to_skill(model: OnlineModel, note: str = "") -> Skill:
    """The skill that the model is now: a mixture for DPGMM and DPMPPCA, semi-Markov for HDPHSMM and SOSC.

    Covariances are Lambda Lambda^T + sigma^2 I with Lambda = U sqrt(variances) over the first d directions
    (5.24-5.25), kept factored. Transitions leave self-transitions out; a state that was never left is
    final. Durations are normal, of the complete visits; of a state without one, of those that the ends of
    demonstrations cut off.
    Raises: InvalidInput, before the first datapoint.
    """
    if not model.clusters:
        raise InvalidInput("the model has observed no datapoint, expected at least one; observe some first")
    provenance = Provenance(
        demonstrations=(),
        datapoints=model.datapoints,
        data="",
        structure=model.settings.label,
        regularisation=0.0,
        log_likelihood=np.nan,
        iterations=0,
        converged=True,
        library=library_version(),
        note=note or f"learned from a stream of {model.datapoints} datapoints, which was not kept",
    )
    P = len(model.frame_names)
    return Skill(
        _dynamics(model),
        np.ascontiguousarray(model.means.transpose(1, 0, 2)),
        tuple(covariances(model, p) for p in range(P)),
        model.layout,
        model.period,
        model.frame_names,
        provenance,
    )


def covariances(model: OnlineModel, p: int) -> LatentCovariances:
    """Those of every cluster as frame p sees them."""
    d = model.dimensions[:, p]
    L = max(1, int(d.max()))
    lengths = np.where(np.arange(L) < d[:, None], np.sqrt(_resize_last_axis(model.variances[:, p], L)), 0.0)
    loadings = _resize_last_axis(model.bases[:, p], L) * lengths[:, None, :]
    return LatentCovariances(loadings, np.full((model.clusters, model.layout.width), model.settings.noise))


def _resize_last_axis(values: Float[Array, "... C"], L: int) -> Float[Array, "... L"]:
    """The first L of the last axis, zeros where there are not so many."""
    missing = max(0, L - values.shape[-1])
    return np.pad(values[..., :L], [(0, 0)] * (values.ndim - 1) + [(0, missing)])


def _dynamics(model: OnlineModel) -> Dynamics:
    if isinstance(model.settings, DPGMM | DPMPPCA):
        return MixtureWeights(model.priors)
    begun = model.state.clusters[:, Column.DEMONSTRATION_STARTS]
    # where every first cluster was forgotten, any may be first
    initial = begun / begun.sum() if begun.any() else model.priors
    return SemiMarkovChain(initial, transitions(model), durations(model))


def transitions(model: OnlineModel) -> Float[Array, "K K"]:
    leaving = model.transition_counts * (1.0 - np.eye(model.clusters))
    departures = leaving.sum(axis=1, keepdims=True)
    return np.asarray(np.divide(leaving, departures, out=np.zeros_like(leaving), where=departures > 0.0))


def durations(model: OnlineModel) -> Gaussian:
    """Mean and deviation of the complete visits (5.32-5.34); the visit that goes on stands in for none."""
    rows = model.state.clusters
    visits, cut = rows[:, Column.SEGMENTS], rows[:, Column.CENSORED]
    means = np.where(visits > 0.0, rows[:, Column.MEAN_DURATION], rows[:, Column.MEAN_CENSORED_DURATION])
    if model.current_cluster >= 0 and visits[model.current_cluster] + cut[model.current_cluster] == 0.0:
        means[model.current_cluster] = model.state.head[Head.STEPS]
    variances = rows[:, Column.SQUARED_DEVIATIONS] / np.maximum(visits - 1.0, 1.0)
    return Gaussian(np.maximum(means, 1.0), np.sqrt(variances + DURATION_VARIANCE_REGULARISATION))
