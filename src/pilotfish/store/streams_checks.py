"""What a model that grows with a stream must be, before it is written and after it was read."""

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.kernels import StreamColumn, StreamHead, in_fours
from pilotfish.models import online
from pilotfish.store.skills_fields import require_finite
from pilotfish.types import Array, Bool, Float

MOST = 2**31 - 1  # of what is counted in a header
COUNTABLE = 2.0**53  # up to here float64 counts one by one
LARGEST, LARGEST_SQUARE = 1e101, 1e210  # datapoints have at most 1e100, in many columns
SKEW = 1e-6  # what products of directions may miss one or zero by
WHOLE = tuple(
    StreamColumn[name] for name in ("IDENTITY", "POINTS", "BEGUN", "VISITS", "CUT")
)  # numbers of a row that count


def require_sound_stream(model: online.OnlineModel) -> None:
    """The numbers of a model are such as a stream could have left.    Raises: InvalidInput."""
    state = model.state
    for name in ("head", "clusters", "counts"):
        require_finite(getattr(state, name), name)
    _require_head(model)
    _require_numbers(model)
    _require("counts", state.counts, _counts_something(state.counts), "whole numbers of datapoints")
    _require_subspaces(model)


def _require_head(model: online.OnlineModel) -> None:
    head, clusters = model.state.head, model.state.clusters
    current, steps, following, points, before, lasted = (float(head[place]) for place in StreamHead)
    for name, row in (("current row", current), ("row before", before)):
        if row not in range(-1, len(clusters)):
            raise InvalidInput(f"the {name} is {row:g}, expected -1 to {len(clusters) - 1}")
    whole = _counts_something(np.array([steps, following, points, lasted])).all()
    if not whole or (current >= 0 and steps < 1) or (before >= 0 and lasted < 1):
        raise InvalidInput(
            f"head is {head.tolist()}, expected the current row, then whole numbers: how long it has lasted, "
            "the next identity, all datapoints, and of the visit before its row and how long it lasted"
        )
    if before >= 0 and clusters[int(before), StreamColumn.VISITS] < 1:
        raise InvalidInput(f"the row before is {before:g}, and that cluster has no complete visit")
    identities = clusters[:, StreamColumn.IDENTITY]
    if (np.diff(identities) <= 0.0).any() or (identities >= following).any():
        raise InvalidInput(
            f"identities are {identities.tolist()}, expected them to rise, below the next one, {following:g}"
        )
    if (held := clusters[:, StreamColumn.POINTS].sum()) > points:
        raise InvalidInput(f"clusters hold {held:g} datapoints, expected at most {points:g}, as head says")


def _require_numbers(model: online.OnlineModel) -> None:
    rows, C = model.state.clusters, StreamColumn
    for column in WHOLE:
        _require(_named(column), rows[:, column], _counts_something(rows[:, column]), "whole numbers")
    points, weights = rows[:, C.POINTS], rows[:, C.WEIGHT]
    _require(_named(C.POINTS), points, points >= 1.0, "at least one datapoint in each cluster")
    # a trace that nothing visits again wears off, in the end to 0
    least_is_zero = isinstance(model.settings.upkeep.weighting, online.Trace)
    _require(_named(C.WEIGHT), weights, weights >= 0.0 if least_is_zero else weights > 0.0, "more than 0")
    for column in (C.DURATION, C.SQUARES, C.CUT_DURATION):
        _require(_named(column), rows[:, column], rows[:, column] >= 0.0, "at least 0")
    if len(rows) > model.rules.clusters:
        raise InvalidInput(f"there are {len(rows)} clusters, expected at most {model.rules.clusters}")


def _require_subspaces(model: online.OnlineModel) -> None:
    """d <= r, so many orthonormal directions, variances and distances, and nothing beyond them."""
    rules, room, blocks, D = model.rules, model.state.room, model.state.blocks(), model.layout.width
    most = in_fours(min(rules.directions + rules.spare, D))
    if room != in_fours(room) or room > most:
        raise InvalidInput(f"there is room for {room} directions, expected a multiple of four up to {most}")
    d, r = blocks[:, :, 0], blocks[:, :, 1]
    _require("dimension", d, _counts_something(d) & (d <= rules.directions), f"0 to {rules.directions}")
    fits = _counts_something(r) & (d <= r) & (r <= np.minimum(d + rules.spare, min(D, room)))
    _require("number of directions", r, fits, f"its dimension and up to {rules.spare} more, {D} at most")
    _require("mean", model.means, np.abs(model.means) <= LARGEST, f"at most {LARGEST:g}")
    known = np.arange(room + 1) <= r[:, :, None]  # (K, P, C + 1)
    _require_squares("distance", model.distances, known)
    _require_squares("variance", model.variances, known[..., 1:])
    _require_directions(model.bases, known[..., 1:])


def _require_squares(name: str, values: Float[Array, "..."], known: Bool[Array, "..."]) -> None:
    positive = (values >= 0.0) & (values <= LARGEST_SQUARE)
    _require(name, values, np.where(known, positive, values == 0.0), "0 or more, and 0 where no direction is")


def _require_directions(bases: Float[Array, "K P D C"], known: Bool[Array, "K P C"]) -> None:
    unit = np.where(known[:, :, None], np.abs(bases) <= 1.0 + SKEW, bases == 0.0)
    _require("direction", bases, unit, "unit vectors, and 0 beyond them")
    products = bases.swapaxes(-1, -2) @ bases
    right = np.abs(products - np.eye(bases.shape[-1]) * known[..., None, :]) <= SKEW
    _require("product of directions", products, right, "orthonormal directions")


def _counts_something(values: Float[Array, "..."]) -> Bool[Array, "..."]:
    return np.asarray((values >= 0.0) & (values <= COUNTABLE) & (values == np.floor(values)))


def _require(name: str, values: Float[Array, "..."], good: Bool[Array, "..."], expected: str) -> None:
    if (bad := np.argwhere(~good)).size:
        index = bad[0].tolist()
        raise InvalidInput(f"{name}{index} is {values[tuple(index)]:g}, expected {expected}")


def _named(column: StreamColumn) -> str:
    return f"the {column.name.lower().replace('_', ' ')} of cluster "
