"""Validation of the arguments of the streaming kernels: datapoints, packed state and parameters."""

from dataclasses import replace

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.kernels.packing import MAX_EXACT_INTEGER, MAX_INT, pack_arguments, pack_array
from pilotfish.kernels.stream_state import INITIAL_COUNTERS, StreamParameters, StreamState, stream_row_length
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number


def pack_stream(
    x: object, axes: str, state: StreamState, parameters: StreamParameters
) -> tuple[Array, StreamState]:
    """Return packed datapoints and the packed state of a stream, after checking state and parameters.

    Args:
        x: Datapoints; their numbers are checked by the kernels.
        axes: Axes of x, "NPD" or "PD".
        state: State before the datapoints.
        parameters: Penalties and limits; counts must be whole numbers.

    Raises:
        InvalidInput: If shapes do not match, or a counter or size is not a valid whole number.
    """
    _validate_parameters(parameters)
    sizes: dict[str, int] = {}
    (points,) = pack_arguments((("x", axes, "any"),), (x,), sizes)
    P, D = sizes["P"], sizes["D"]
    if (state.frames, state.width) != (P, D):
        raise InvalidInput(f"x has {P} frames of {D} columns, expected {state.frames} of {state.width}")
    capacity = require_count(state.capacity, "capacity", (D + 3) // 4 * 4)
    if capacity % 4:
        raise InvalidInput(f"capacity is {capacity}, expected a multiple of 4")
    counters, rows, transition_counts = (
        pack_array(getattr(state, name), name) for name in ("counters", "rows", "transition_counts")
    )
    K = len(rows) if rows.ndim else 0
    expected = {"counters": (6,), "rows": (K, stream_row_length(P, D, capacity)), "transition_counts": (K, K)}
    for name, array in (("counters", counters), ("rows", rows), ("transition_counts", transition_counts)):
        if array.shape != expected[name]:
            raise InvalidInput(f"{name} has shape {array.shape}, expected {expected[name]}")
    _validate_counters(counters, K)
    packed = replace(state, counters=counters, rows=rows, transition_counts=transition_counts)
    _validate_ranks(packed, min(capacity, D))
    _validate_cluster_ids(packed)
    return points, packed


def _validate_parameters(parameters: StreamParameters) -> None:
    for name, lowest, largest in (
        ("weighting", 0, 2),
        ("extra_directions", 0, MAX_INT),
        ("max_dimension", 0, MAX_INT),
        ("max_clusters", 1, MAX_EXACT_INTEGER),
        ("batch", 1, MAX_EXACT_INTEGER),
    ):
        require_count(getattr(parameters, name), name, largest, lowest)


def _validate_counters(counters: Float[Array, " 6"], K: int) -> None:
    for name, value in zip(INITIAL_COUNTERS, counters.tolist(), strict=True):
        is_index = name in ("current_cluster", "previous_cluster")
        require_number(
            value, name, -1.0 if is_index else 0.0, K - 1.0 if is_index else float(MAX_EXACT_INTEGER)
        )
        if value != np.floor(value):
            raise InvalidInput(f"{name} is {value}, expected a whole number")


def _validate_ranks(state: StreamState, max_rank: int) -> None:
    d, r = state.dimensions, state.ranks
    good = (d >= 0.0) & (d <= r) & (r <= max_rank) & (d == np.floor(d)) & (r == np.floor(r))
    if not good.all():
        k, p = np.argwhere(~good)[0].tolist()
        raise InvalidInput(
            f"cluster {k} has dimension {d[k, p]} and {r[k, p]} directions in frame {p}, expected whole "
            f"numbers 0 <= dimension <= directions <= {max_rank}"
        )


def _validate_cluster_ids(state: StreamState) -> None:
    ids = state.cluster_ids
    good = (np.abs(ids) <= MAX_EXACT_INTEGER) & (ids == np.floor(ids))
    if not good.all():
        k = int(np.flatnonzero(~good)[0])
        raise InvalidInput(f"cluster {k} has the identifier {ids[k]}, expected a whole number up to 2^53")
