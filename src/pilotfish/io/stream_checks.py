"""What a model that grows with a stream must be, before it is written and after it was read."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.io.skill_fields import validate_finite
from pilotfish.kernels import ClusterColumn, StreamCounter, round_up_to_four
from pilotfish.models import online
from pilotfish.types import Array, Bool, Float

MAX_INTEGER = 2**31 - 1  # of what is counted in a header
MAX_EXACT_INTEGER = 2.0**53  # up to here float64 counts one by one
MAX_VALUE, MAX_SQUARED_DISTANCE = 1e101, 1e210  # datapoints have at most 1e100, in many columns
ORTHONORMALITY_TOLERANCE = 1e-6  # what products of directions may miss one or zero by
INTEGER_COLUMNS = tuple(
    ClusterColumn[name] for name in ("CLUSTER_ID", "POINTS", "DEMONSTRATION_STARTS", "SEGMENTS", "CENSORED")
)  # numbers of a row that count


def validate_online_model(model: online.OnlineModel) -> None:
    """The numbers of a model are such as a stream could have left.    Raises: InvalidInput."""
    state = model.state
    for name in ("head", "clusters", "transition_counts"):
        validate_finite(getattr(state, name), name)
    _validate_counters(model)
    _validate_cluster_statistics(model)
    _require_all(
        "transition_counts",
        state.transition_counts,
        _is_count(state.transition_counts),
        "whole numbers of datapoints",
    )
    _validate_subspaces(model)


def _validate_counters(model: online.OnlineModel) -> None:
    head, clusters = model.state.head, model.state.clusters
    current, steps, next_cluster_id, points, before, previous_steps = (
        float(head[place]) for place in StreamCounter
    )
    for name, row in (("current row", current), ("row before", before)):
        if row not in range(-1, len(clusters)):
            raise InvalidInput(f"the {name} is {row:g}, expected -1 to {len(clusters) - 1}")
    whole = _is_count(np.array([steps, next_cluster_id, points, previous_steps])).all()
    if not whole or (current >= 0 and steps < 1) or (before >= 0 and previous_steps < 1):
        raise InvalidInput(
            f"head is {head.tolist()}, expected the current row, then whole numbers: how long it has lasted, "
            "the next identity, all datapoints, and of the visit before its row and how long it lasted"
        )
    if before >= 0 and clusters[int(before), ClusterColumn.SEGMENTS] < 1:
        raise InvalidInput(f"the row before is {before:g}, and that cluster has no complete visit")
    cluster_ids = clusters[:, ClusterColumn.CLUSTER_ID]
    if (np.diff(cluster_ids) <= 0.0).any() or (cluster_ids >= next_cluster_id).any():
        raise InvalidInput(
            f"identities are {cluster_ids.tolist()}, expected them to rise, below the next one, {next_cluster_id:g}"
        )
    if (held := clusters[:, ClusterColumn.POINTS].sum()) > points:
        raise InvalidInput(f"clusters hold {held:g} datapoints, expected at most {points:g}, as head says")


def _validate_cluster_statistics(model: online.OnlineModel) -> None:
    rows, C = model.state.clusters, ClusterColumn
    for column in INTEGER_COLUMNS:
        _require_all(_column_label(column), rows[:, column], _is_count(rows[:, column]), "whole numbers")
    points, weights = rows[:, C.POINTS], rows[:, C.WEIGHT]
    _require_all(_column_label(C.POINTS), points, points >= 1.0, "at least one datapoint in each cluster")
    # a trace that nothing visits again wears off, in the end to 0
    least_is_zero = isinstance(model.settings.maintenance.weighting, online.ExponentialDecay)
    _require_all(
        _column_label(C.WEIGHT), weights, weights >= 0.0 if least_is_zero else weights > 0.0, "more than 0"
    )
    for column in (C.MEAN_DURATION, C.SQUARED_DEVIATIONS, C.MEAN_CENSORED_DURATION):
        _require_all(_column_label(column), rows[:, column], rows[:, column] >= 0.0, "at least 0")
    if len(rows) > model.parameters.clusters:
        raise InvalidInput(f"there are {len(rows)} clusters, expected at most {model.parameters.clusters}")


def _validate_subspaces(model: online.OnlineModel) -> None:
    """D <= r, so many orthonormal directions, variances and distances, and nothing beyond them."""
    parameters, capacity, blocks, D = (
        model.parameters,
        model.state.capacity,
        model.state.blocks(),
        model.layout.width,
    )
    most = round_up_to_four(min(parameters.max_dimension + parameters.extra_directions, D))
    if capacity != round_up_to_four(capacity) or capacity > most:
        raise InvalidInput(
            f"there is room for {capacity} directions, expected a multiple of four up to {most}"
        )
    d, r = blocks[:, :, 0], blocks[:, :, 1]
    _require_all(
        "dimension", d, _is_count(d) & (d <= parameters.max_dimension), f"0 to {parameters.max_dimension}"
    )
    fits = _is_count(r) & (d <= r) & (r <= np.minimum(d + parameters.extra_directions, min(D, capacity)))
    _require_all(
        "number of directions",
        r,
        fits,
        f"its dimension and up to {parameters.extra_directions} more, {D} at most",
    )
    _require_all("mean", model.means, np.abs(model.means) <= MAX_VALUE, f"at most {MAX_VALUE:g}")
    known = np.arange(capacity + 1) <= r[:, :, None]  # (K, P, C + 1)
    _validate_squares("distance", model.distances, known)
    _validate_squares("variance", model.variances, known[..., 1:])
    _validate_bases(model.bases, known[..., 1:])


def _validate_squares(name: str, values: Float[Array, "..."], known: Bool[Array, "..."]) -> None:
    positive = (values >= 0.0) & (values <= MAX_SQUARED_DISTANCE)
    _require_all(
        name, values, np.where(known, positive, values == 0.0), "0 or more, and 0 where no direction is"
    )


def _validate_bases(bases: Float[Array, "K P D C"], known: Bool[Array, "K P C"]) -> None:
    unit = np.where(known[:, :, None], np.abs(bases) <= 1.0 + ORTHONORMALITY_TOLERANCE, bases == 0.0)
    _require_all("direction", bases, unit, "unit vectors, and 0 beyond them")
    products = bases.swapaxes(-1, -2) @ bases
    right = np.abs(products - np.eye(bases.shape[-1]) * known[..., None, :]) <= ORTHONORMALITY_TOLERANCE
    _require_all("product of directions", products, right, "orthonormal directions")


def _is_count(values: Float[Array, "..."]) -> Bool[Array, "..."]:
    return np.asarray((values >= 0.0) & (values <= MAX_EXACT_INTEGER) & (values == np.floor(values)))


def _require_all(name: str, values: Float[Array, "..."], good: Bool[Array, "..."], expected: str) -> None:
    if (bad := np.argwhere(~good)).size:
        index = bad[0].tolist()
        raise InvalidInput(f"{name}{index} is {values[tuple(index)]:g}, expected {expected}")


def _column_label(column: ClusterColumn) -> str:
    return f"the {column.name.lower().replace('_', ' ')} of cluster "
