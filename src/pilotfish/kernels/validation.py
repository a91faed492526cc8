"""Validation of the arguments of every kernel, for both implementations.

The `pack_` functions return arrays as the compiled kernels read them: float64 in native byte order,
C-contiguous and aligned. They raise InvalidInput for shapes that do not match and numbers for which no kernel
is defined.

The NumPy references call them for all arguments. The compiled kernels make the same checks in C++, where they
cost nothing. Only if those fail does compiled.py call these functions, either to pack the arguments or to
raise the same message. `KERNELS`, at the end, lists the function of every kernel.
"""

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import fields, replace
from math import inf
from typing import Any, TypeVar

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.kernels.arguments import Emissions, SemiMarkovTables
from pilotfish.kernels.arm_types import ArmLimits, ArmState, ImpedanceParameters, ToolTarget
from pilotfish.kernels.stream_state import INITIAL_COUNTERS, StreamParameters, StreamState, stream_row_length
from pilotfish.types import Array, Float, Int
from pilotfish.validation import numeric_array, require_count, require_number, short_repr

MAX_NUMBER = 1e150  # sums of squares do not overflow
MAX_EXACT_INTEGER = 2**53  # float64 represents every integer up to here
MAX_INT = 2**31 - 1
MAX_JOINTS = 16
MIN_DIAGONAL = float(np.finfo(np.float64).tiny)  # compiled kernels flush smaller numbers to 0

Dataclass = TypeVar(
    "Dataclass", SemiMarkovTables, Emissions, ArmLimits, ArmState, ImpedanceParameters, ToolTarget
)


# An array argument of a kernel: its name, its axes and its domain. Axes are a letter each, equal letters for
# equal sizes, or a digit for a fixed size. Domains: "finite" (at most MAX_NUMBER in magnitude), "probability"
# (at least 0, finite), "logarithm" (below +inf) and "any" (NaN and infinities have a meaning).
ArgumentSpec = tuple[str, str, str]

MARKOV = (
    ("log_emissions", "TK", "logarithm"),
    ("initial", "K", "probability"),
    ("transitions", "KK", "probability"),
)
SEMI_MARKOV = (
    *MARKOV[1:],
    ("log_segment_weights", "4SK", "logarithm"),
    ("log_tail_weights", "2K", "logarithm"),
)
EMISSIONS = (
    ("x", "PND", "finite"),
    ("means", "PKD", "finite"),
    ("precision_cholesky", "PKEE", "finite"),
)
RICCATI = (
    ("A", "Snn", "finite"),
    ("B", "Snm", "finite"),
    ("weights", "Tnn", "finite"),
    ("targets", "Tn", "finite"),
    ("control_cost", "mm", "finite"),
)
SEMI_TIED = (
    ("scatter_matrices", "KDD", "finite"),
    ("counts", "K", "finite"),
    ("transform", "DD", "finite"),
)
COVARIANCES = (("covariances", "KDD", "any"),)
ARM = (
    (
        ("stiffness", "6", "any"),
        ("damping", "6", "any"),
        ("posture", "n", "any"),
    ),
    tuple((name, "n", "any") for name in ("lower", "upper", "torque")),
    (
        *((name, "n", "any") for name in ("q", "velocity")),
        ("position", "3", "any"),
        ("quaternion", "4", "any"),
        ("jacobian", "6n", "any"),
        ("bias", "n", "any"),
    ),
    (
        ("position", "3", "any"),
        ("quaternion", "4", "any"),
        ("twist", "6", "any"),
    ),
)
ARM_SCALARS = tuple(field.name for field in fields(ImpedanceParameters) if field.type in (float, "float"))
EMPTY_AXES = "N"  # axes that may have size 0


def pack_arguments(
    arguments: tuple[ArgumentSpec, ...], values: tuple[object, ...], sizes: dict[str, int]
) -> list[Array]:
    """Return the values packed for the compiled kernels.

    Args:
        arguments: Specification of each value.
        values: Arrays or nested lists of numbers.
        sizes: Known sizes of axes; those of the values are added.

    Raises:
        InvalidInput: If a value is not an array of real numbers, or its shape or domain is wrong.
    """
    arrays = []
    for (name, axes, domain), value in zip(arguments, values, strict=True):
        array = pack_array(value, name)
        if not _shape_matches(axes, array.shape, sizes):
            raise _shape_error(name, axes, array, sizes)
        if domain != "any" and array.size and not _in_domain(domain, array):
            raise _domain_error(name, domain, array)
        arrays.append(array)
    return arrays


def pack_array(value: object, name: str) -> Float[Array, "..."]:
    """Return value itself if the compiled kernels can read it in place, else a packed copy."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        flags = value.flags
        if flags.c_contiguous and flags.aligned and value.dtype.isnative:
            return value
    return numeric_array(value, name)


def _shape_matches(axes: str, shape: tuple[int, ...], sizes: dict[str, int]) -> bool:
    if len(axes) != len(shape):
        return False
    for axis, size in zip(axes, shape, strict=True):
        expected_size = int(axis) if axis.isdigit() else sizes.setdefault(axis, size)
        if size != expected_size or (size == 0 and axis not in EMPTY_AXES):
            return False
    return True


def _shape_error(name: str, axes: str, array: Array, sizes: dict[str, int]) -> InvalidInput:
    known = ", ".join(f"{axis} = {size}" for axis, size in sizes.items() if axis in axes and size)
    expected = f"({', '.join(axes)})" + (f" with {known}" if known else "")
    return InvalidInput(f"{name} has shape {array.shape}, expected {expected}")


def _in_domain(domain: str, array: Array) -> bool:
    match domain:
        case "finite":
            return bool(np.abs(array).max() <= MAX_NUMBER)
        case "probability":
            return bool(array.min() >= 0.0 and array.max() < inf)
        case _:
            return bool(array.max() < inf)  # false for NaN too


def _domain_error(name: str, domain: str, array: Array) -> InvalidInput:
    good, expected = {
        "finite": (np.abs(array) <= MAX_NUMBER, f"finite numbers of at most {MAX_NUMBER:g}"),
        "probability": ((array >= 0.0) & (array < inf), "finite numbers of at least 0"),
        "logarithm": (array < inf, "logarithms: finite numbers or -inf"),
    }[domain]
    index = np.argwhere(~good)[0].tolist()
    return InvalidInput(f"{name}{index} is {array[tuple(index)]}, expected {expected}")


def pack_markov(log_emissions: object, initial: object, transitions: object) -> list[Array]:
    """Return the packed arguments of forward_backward and viterbi."""
    return pack_arguments(MARKOV, (log_emissions, initial, transitions), {})


def pack_semi_markov(log_emissions: object, tables: SemiMarkovTables) -> tuple[Array, SemiMarkovTables]:
    """Return the packed arguments of the semi-Markov kernels."""
    sizes: dict[str, int] = {}
    (packed,) = pack_arguments(MARKOV[:1], (log_emissions,), sizes)
    return packed, _pack_fields(tables, SEMI_MARKOV, sizes)


def pack_emissions(x: object, emissions: Emissions, sizes: dict[str, int]) -> tuple[Array, Emissions]:
    """Return packed datapoints and Gaussians; add P, N, K, D and E to sizes."""
    (points,) = pack_arguments(EMISSIONS[:1], (x,), sizes)
    orientation_starts = _validate_orientation_starts(emissions.orientation_starts, sizes["D"])
    sizes["E"] = sizes["D"] - len(orientation_starts)
    means, precision_cholesky = pack_arguments(
        EMISSIONS[1:], (emissions.means, emissions.precision_cholesky), sizes
    )
    if not (smallest := np.einsum("pkii->pki", precision_cholesky).min()) >= MIN_DIAGONAL:
        raise InvalidInput(
            f"precision_cholesky has {smallest} on a diagonal, expected at least {MIN_DIAGONAL:g}"
        )
    return points, Emissions(means, precision_cholesky, orientation_starts)


def _validate_orientation_starts(orientation_starts: tuple[int, ...], D: int) -> tuple[int, ...]:
    columns = sorted(require_count(start, "orientation_starts", MAX_INT) for start in orientation_starts)
    end = 0
    for start in columns:
        if not end <= start <= D - 4:
            raise InvalidInput(
                f"orientation_starts is {short_repr(orientation_starts)}, expected first columns of "
                f"quaternions of four columns each, which do not overlap, among {D} columns"
            )
        end = start + 4
    return tuple(columns)


def pack_e_step(
    x: object, lengths: object, initial: object, transitions: object, emissions: Emissions, threads: int = 1
) -> tuple[Array, Array, Array, Array, Emissions, int]:
    """Return the packed arguments of e_step."""
    sizes: dict[str, int] = {}
    points, packed = pack_emissions(x, emissions, sizes)
    initial_array, transitions_array = pack_arguments(MARKOV[1:], (initial, transitions), sizes)
    lengths_array = _validate_lengths(lengths, sizes["N"])
    return points, lengths_array, initial_array, transitions_array, packed, _validate_threads(threads)


def pack_semi_markov_e_step(
    x: object, lengths: object, tables: SemiMarkovTables, emissions: Emissions, threads: int = 1
) -> tuple[Array, Array, SemiMarkovTables, Emissions, int]:
    """Return the packed arguments of semi_markov_e_step."""
    sizes: dict[str, int] = {}
    points, packed = pack_emissions(x, emissions, sizes)
    return (
        points,
        _validate_lengths(lengths, sizes["N"]),
        _pack_fields(tables, SEMI_MARKOV, sizes),
        packed,
        _validate_threads(threads),
    )


def _validate_lengths(lengths: object, N: int) -> Int[Array, " M"]:
    array = np.asarray(lengths)
    if array.dtype.kind not in "iu" or array.ndim != 1 or not array.size:
        raise InvalidInput(
            f"lengths is {short_repr(lengths)}, expected one whole number for each demonstration"
        )
    if array.min() < 1 or array.max() > N or (checked := np.array(array, dtype=np.int64)).sum() != N:
        raise InvalidInput(f"lengths is {short_repr(lengths)}, expected numbers of at least 1 with sum {N}")
    return checked


def _validate_threads(threads: object) -> int:
    return require_count(threads, "threads", MAX_INT)


def pack_riccati(A: object, B: object, weights: object, targets: object, control_cost: object) -> list[Array]:
    """Return the packed arguments of riccati."""
    sizes: dict[str, int] = {}
    arrays = pack_arguments(RICCATI, (A, B, weights, targets, control_cost), sizes)
    S, T = sizes["S"], sizes["T"]
    if S not in (1, T - 1):
        raise InvalidInput(f"A and B have {S} matrices, expected 1 or {T - 1}, one less than targets")
    return arrays


def pack_semi_tied(
    scatter_matrices: object, counts: object, transform: object, sweeps: int
) -> tuple[Array, Array, Array, int]:
    """Return the packed arguments of semi_tied_sweeps."""
    S, N, B = pack_arguments(SEMI_TIED, (scatter_matrices, counts, transform), {})
    return S, N, B, require_count(sweeps, "sweeps", MAX_INT)


def pack_covariances(values: object) -> list[Array]:
    """Return the packed argument of precision_cholesky."""
    return pack_arguments(COVARIANCES, (values,), {})


def pack_arm(
    parameters: ImpedanceParameters, limits: ArmLimits, state: ArmState, target: ToolTarget
) -> tuple[ImpedanceParameters, ArmLimits, ArmState, ToolTarget]:
    """Return the packed arguments of impedance_torque.

    Numbers that are not finite are allowed: the torque is defined for them.
    """
    sizes: dict[str, int] = {}
    (q,) = pack_arguments(ARM[2][:1], (state.q,), sizes)
    if len(q) > MAX_JOINTS:
        raise InvalidInput(f"q has {len(q)} entries, expected one for each joint: 1 to {MAX_JOINTS}")
    scalars: dict[str, Any] = {name: _validate_real(getattr(parameters, name), name) for name in ARM_SCALARS}
    return (
        replace(_pack_fields(parameters, ARM[0], sizes), **scalars),
        _pack_fields(limits, ARM[1], sizes),
        _pack_fields(state, ARM[2], sizes),
        _pack_fields(target, ARM[3], sizes),
    )


def _validate_real(value: object, name: str) -> float:
    if isinstance(value, int | float | np.integer | np.floating):
        with suppress(OverflowError):
            return float(value)
    raise InvalidInput(f"{name} is {short_repr(value)}, expected a number within the range of float64")


def _pack_fields(value: Dataclass, arguments: tuple[ArgumentSpec, ...], sizes: dict[str, int]) -> Dataclass:
    names = [name for name, _, _ in arguments]
    originals = [getattr(value, name) for name in names]
    arrays = pack_arguments(arguments, tuple(originals), sizes)
    if all(array is original for array, original in zip(arrays, originals, strict=True)):
        return value
    packed: dict[str, Any] = dict(zip(names, arrays, strict=True))
    return replace(value, **packed)


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


KERNELS: dict[str, Callable[..., Iterable[Any]]] = {
    "e_step": pack_e_step,
    "forward_backward": pack_markov,
    "impedance_torque": pack_arm,
    "log_emissions": lambda x, emissions: pack_emissions(x, emissions, {}),
    "observe": lambda x, state, parameters: (*pack_stream(x, "NPD", state, parameters), parameters),
    "observe_one": lambda x, state, parameters: (*pack_stream(x, "PD", state, parameters), parameters),
    "precision_cholesky": pack_covariances,
    "riccati": pack_riccati,
    "semi_markov_e_step": pack_semi_markov_e_step,
    "semi_markov_forward": pack_semi_markov,
    "semi_markov_forward_backward": pack_semi_markov,
    "semi_markov_viterbi": pack_semi_markov,
    "semi_tied_sweeps": pack_semi_tied,
    "viterbi": pack_markov,
}
