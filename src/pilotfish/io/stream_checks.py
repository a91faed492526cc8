"""Validation of an online model before it is written and after it was read."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Moments
from pilotfish.io.skill_fields import validate_finite
from pilotfish.models import online
from pilotfish.types import Array, Bool, Float

MAX_INTEGER = 2**31 - 1  # of the integers in a header
MAX_EXACT_INTEGER = 2.0**53  # float64 represents every integer up to here
MAX_VALUE, MAX_SQUARED_DISTANCE = 1e101, 1e210  # datapoints have at most 1e100, in many columns
ORTHONORMALITY_TOLERANCE = 1e-6  # of products of directions
COUNTS = ("cluster_ids", "points", "demonstration_starts", "segments", "censored", "transition_counts")


def validate_online_model(model: online.OnlineModel) -> None:
    """Raise InvalidInput unless the state of a model is one that a stream can lead to."""
    for name, values in model.state.to_arrays().items():
        validate_finite(values, name)
    for name in COUNTS:
        values = getattr(model.state, name)
        _require_all(name, values, _is_count(values), "whole numbers of 0 or more")
    _validate_counters(model)
    _validate_cluster_statistics(model)
    _validate_subspaces(model)
    for moments in model.ends:
        _validate_ends(moments)


def _validate_ends(moments: Moments) -> None:
    """Require one or more demonstrations, and means and scatter of datapoints of at most 1e100."""
    counts, means, scatter = moments.counts, moments.means, moments.scatter_matrices
    for name, values in (("end_counts", counts), ("end_means", means), ("end_scatter_matrices", scatter)):
        validate_finite(values, name)
    _require_all("end_counts", counts, _is_count(counts) & (counts >= 1.0), "whole numbers of 1 or more")
    _require_all("end_means", means, np.abs(means) <= MAX_VALUE, f"at most {MAX_VALUE:g}")
    squares = np.diagonal(scatter, axis1=1, axis2=2)
    valid = (squares >= 0.0) & (squares <= MAX_SQUARED_DISTANCE)
    _require_all("diagonals of end_scatter_matrices", squares, valid, "0 or more")


def _validate_counters(model: online.OnlineModel) -> None:
    state = model.state
    for name in ("current_cluster", "previous_cluster"):
        if (index := getattr(state, name)) not in range(-1, state.clusters):
            raise InvalidInput(f"{name} is {index}, expected -1 to {state.clusters - 1}")
    for name, index in (("steps_in_cluster", "current_cluster"), ("previous_steps", "previous_cluster")):
        least = 1 if getattr(state, index) >= 0 else 0
        if (steps := getattr(state, name)) < least:
            raise InvalidInput(f"{name} is {steps}, expected {least} or more")
    if (k := state.previous_cluster) >= 0 and state.segments[k] < 1:
        raise InvalidInput(f"previous_cluster is {k}, and that cluster has no completed segment")
    if (np.diff(state.cluster_ids) <= 0.0).any() or (state.cluster_ids >= state.next_cluster_id).any():
        raise InvalidInput(
            f"cluster_ids are {state.cluster_ids.tolist()}, expected increasing identifiers below "
            f"next_cluster_id, {state.next_cluster_id}"
        )
    if (assigned := state.points.sum()) > state.datapoints:
        raise InvalidInput(
            f"clusters have {assigned:g} datapoints, expected at most {state.datapoints} as in counters"
        )


def _validate_cluster_statistics(model: online.OnlineModel) -> None:
    state = model.state
    _require_all("points", state.points, state.points >= 1.0, "at least one datapoint in each cluster")
    # without datapoints a weight that decays underflows to 0 in the end
    decays = model.settings.maintenance.discount is not None
    positive = state.weights >= 0.0 if decays else state.weights > 0.0
    _require_all("weights", state.weights, positive, "more than 0")
    for name in ("mean_durations", "squared_deviations", "mean_censored_durations"):
        values = getattr(state, name)
        largest = MAX_SQUARED_DISTANCE if name == "squared_deviations" else MAX_EXACT_INTEGER
        _require_all(name, values, (values >= 0.0) & (values <= largest), f"from 0 to {largest:g}")
    if state.clusters > model.parameters.max_clusters:
        raise InvalidInput(
            f"there are {state.clusters} clusters, expected at most {model.parameters.max_clusters}"
        )


def _validate_subspaces(model: online.OnlineModel) -> None:
    """Require d <= r, r orthonormal directions with their variances and distances, and zeros beyond them."""
    parameters, state, D = model.parameters, model.state, model.layout.width
    extra, most = parameters.extra_directions, min(parameters.max_dimension + parameters.extra_directions, D)
    if state.capacity >= most + 4:
        raise InvalidInput(
            f"bases have {state.capacity} directions, expected at most {most}, rounded up to four"
        )
    d, r = state.dimensions, state.ranks
    _require_all(
        "dimensions", d, _is_count(d) & (d <= parameters.max_dimension), f"0 to {parameters.max_dimension}"
    )
    valid = _is_count(r) & (d <= r) & (r <= np.minimum(d + extra, min(D, state.capacity)))
    _require_all("ranks", r, valid, f"the dimension and up to {extra} more, at most {D}")
    _require_all("means", state.means, np.abs(state.means) <= MAX_VALUE, f"at most {MAX_VALUE:g}")
    stored = np.arange(state.capacity + 1) <= r[:, :, None]  # (K, P, C + 1)
    _validate_squares("distances", state.distances, stored)
    _validate_squares("variances", state.variances, stored[..., 1:])
    _validate_bases(state.bases, stored[..., 1:])


def _validate_squares(name: str, values: Float[Array, "..."], stored: Bool[Array, "..."]) -> None:
    valid = (values >= 0.0) & (values <= MAX_SQUARED_DISTANCE)
    _require_all(
        name, values, np.where(stored, valid, values == 0.0), "0 or more, and 0 beyond the stored directions"
    )


def _validate_bases(bases: Float[Array, "K P D C"], stored: Bool[Array, "K P C"]) -> None:
    unit = np.where(stored[:, :, None], np.abs(bases) <= 1.0 + ORTHONORMALITY_TOLERANCE, bases == 0.0)
    _require_all("bases", bases, unit, "unit vectors, and 0 beyond them")
    products = bases.swapaxes(-1, -2) @ bases
    expected = np.eye(bases.shape[-1]) * stored[..., None, :]
    valid = np.abs(products - expected) <= ORTHONORMALITY_TOLERANCE
    _require_all("products of bases", products, valid, "orthonormal directions")


def _is_count(values: Float[Array, "..."]) -> Bool[Array, "..."]:
    return np.asarray((values >= 0.0) & (values <= MAX_EXACT_INTEGER) & (values == np.floor(values)))


def _require_all(name: str, values: Float[Array, "..."], valid: Bool[Array, "..."], expected: str) -> None:
    if (bad := np.argwhere(~valid)).size:
        index = bad[0].tolist()
        raise InvalidInput(f"{name}{index} is {values[tuple(index)]:g}, expected {expected}")
