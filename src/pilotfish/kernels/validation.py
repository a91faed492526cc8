"""What every kernel requires of its arguments, compiled or not.

`fit` packs arrays as the compiled kernels read them: float64 in native byte order, C-contiguous and aligned.
It refuses shapes that do not belong together and numbers that no kernel is defined for. The NumPy references
call the functions below for all arguments. The compiled kernels make the same checks themselves, and call
these functions where they refuse, to pack the arguments or to say in the same words what is wrong with them.
"""

from contextlib import suppress
from dataclasses import fields, replace
from math import inf
from typing import Any, NamedTuple, TypeVar

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.kernels.arguments import Emissions, SemiMarkovTables
from pilotfish.kernels.arm_types import ArmLimits, ArmState, ImpedanceParameters, ToolTarget
from pilotfish.kernels.stream_state import StreamCounter, StreamParameters, StreamState, stream_row_length
from pilotfish.types import Array, Float, Int
from pilotfish.validation import numeric_array, require_count, require_number, short_repr

MAX_NUMBER = 1e150  # sums of squares do not overflow
MAX_COUNT = 2**53  # up to here float64 counts one by one
MAX_INT = 2**31 - 1
MAX_JOINTS = 16
MIN_DIAGONAL = float(np.finfo(np.float64).tiny)  # compiled kernels take smaller numbers for 0

Dataclass = TypeVar(
    "Dataclass", SemiMarkovTables, Emissions, ArmLimits, ArmState, ImpedanceParameters, ToolTarget
)


class ArgumentSpec(NamedTuple):
    """An array argument of a kernel.

    axes holds a letter for each axis, equal letters for equal sizes, or a digit for a fixed size.
    kind is "finite" (at most LARGEST_NUMBER), "probability" (at least 0, finite), "logarithm" (below +inf)
    or "any" (NaN and infinities have a meaning).
    """

    name: str
    axes: str
    domain: str = "finite"


CHAIN = (
    ArgumentSpec("log_emissions", "TK", "logarithm"),
    ArgumentSpec("initial", "K", "probability"),
    ArgumentSpec("transitions", "KK", "probability"),
)
TABLES = (
    *CHAIN[1:],
    ArgumentSpec("log_segments", "4SK", "logarithm"),
    ArgumentSpec("log_tail_weights", "2K", "logarithm"),
)
POINTS = (ArgumentSpec("x", "PND"), ArgumentSpec("means", "PKD"), ArgumentSpec("precision_cholesky", "PKEE"))
TRACKING = (
    ArgumentSpec("A", "Snn"),
    ArgumentSpec("B", "Snm"),
    ArgumentSpec("weights", "Tnn"),
    ArgumentSpec("targets", "Tn"),
    ArgumentSpec("control_cost", "mm"),
)
SEMI_TIED = (
    ArgumentSpec("scatter_matrices", "KDD"),
    ArgumentSpec("transition_counts", "K"),
    ArgumentSpec("transform", "DD"),
)
COVARIANCES = (ArgumentSpec("covariances", "KDD", "any"),)
ARM = (
    (
        ArgumentSpec("stiffness", "6", "any"),
        ArgumentSpec("damping", "6", "any"),
        ArgumentSpec("posture", "n", "any"),
    ),
    tuple(ArgumentSpec(name, "n", "any") for name in ("lower", "upper", "torque")),
    (
        *(ArgumentSpec(name, "n", "any") for name in ("q", "velocity")),
        ArgumentSpec("position", "3", "any"),
        ArgumentSpec("quaternion", "4", "any"),
        ArgumentSpec("jacobian", "6n", "any"),
        ArgumentSpec("bias", "n", "any"),
    ),
    (
        ArgumentSpec("position", "3", "any"),
        ArgumentSpec("quaternion", "4", "any"),
        ArgumentSpec("twist", "6", "any"),
    ),
)
ARM_NUMBERS = tuple(field.name for field in fields(ImpedanceParameters) if field.type in (float, "float"))
EMPTY_AXES = "N"  # axes


def pack_arguments(
    arguments: tuple[ArgumentSpec, ...], values: tuple[object, ...], sizes: dict[str, int]
) -> list[Array]:
    """Return the values packed for the compiled kernels.

    Args:
        arguments: What is expected of each value.
        values: Arrays or nested lists of numbers.
        sizes: Sizes of axes that are known already; those of the values are added.

    Raises:
        InvalidInput: If a value is no array of real numbers, or its shape or numbers are not as expected.
    """
    arrays = []
    for argument, value in zip(arguments, values, strict=True):
        array = pack_array(value, argument.name)
        if not _shape_matches(argument.axes, array.shape, sizes):
            raise _shape_error(argument, array, sizes)
        if argument.domain != "any" and array.size and not _in_domain(argument.domain, array):
            raise _domain_error(argument, array)
        arrays.append(array)
    return arrays


def pack_array(value: object, name: str) -> Float[Array, "..."]:
    """Return value itself if the compiled kernels can read it where it is, a packed copy otherwise."""
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


def _shape_error(argument: ArgumentSpec, array: Array, sizes: dict[str, int]) -> InvalidInput:
    known = ", ".join(f"{axis} = {size}" for axis, size in sizes.items() if axis in argument.axes and size)
    expected = f"({', '.join(argument.axes)})" + (f" with {known}" if known else "")
    return InvalidInput(f"{argument.name} has shape {array.shape}, expected {expected}")


def _in_domain(domain: str, array: Array) -> bool:
    match domain:
        case "finite":
            return bool(np.abs(array).max() <= MAX_NUMBER)
        case "probability":
            return bool(array.min() >= 0.0 and array.max() < inf)
        case _:
            return bool(array.max() < inf)  # false for NaN too


def _domain_error(argument: ArgumentSpec, array: Array) -> InvalidInput:
    good, expected = {
        "finite": (np.abs(array) <= MAX_NUMBER, f"finite numbers of at most {MAX_NUMBER:g}"),
        "probability": ((array >= 0.0) & (array < inf), "finite numbers of at least 0"),
        "logarithm": (array < inf, "logarithms: finite numbers or -inf"),
    }[argument.domain]
    index = np.argwhere(~good)[0].tolist()
    return InvalidInput(f"{argument.name}{index} is {array[tuple(index)]}, expected {expected}")


def pack_markov(log_emissions: object, initial: object, transitions: object) -> list[Array]:
    """Return the arguments of forward_backward and viterbi, packed.    Raises: InvalidInput."""
    return pack_arguments(CHAIN, (log_emissions, initial, transitions), {})


def pack_semi_markov(log_emissions: object, tables: SemiMarkovTables) -> tuple[Array, SemiMarkovTables]:
    """Return the arguments of the semi-Markov kernels, packed.    Raises: InvalidInput."""
    sizes: dict[str, int] = {}
    (packed,) = pack_arguments(CHAIN[:1], (log_emissions,), sizes)
    return packed, _pack_fields(tables, TABLES, sizes)


def pack_gaussians(x: object, emissions: Emissions, sizes: dict[str, int]) -> tuple[Array, Emissions]:
    """Return datapoints and Gaussians, packed; sizes gains P, N, K, D and E.    Raises: InvalidInput."""
    (points,) = pack_arguments(POINTS[:1], (x,), sizes)
    orientation_starts = _validate_orientation_starts(emissions.orientation_starts, sizes["D"])
    sizes["E"] = sizes["D"] - len(orientation_starts)
    means, precision_cholesky = pack_arguments(
        POINTS[1:], (emissions.means, emissions.precision_cholesky), sizes
    )
    if not (least := np.einsum("pkii->pki", precision_cholesky).min()) >= MIN_DIAGONAL:
        raise InvalidInput(
            f"precision_cholesky has {least} on a diagonal, expected at least {MIN_DIAGONAL:g}"
        )
    return points, Emissions(means, precision_cholesky, orientation_starts)


def _validate_orientation_starts(orientation_starts: tuple[int, ...], D: int) -> tuple[int, ...]:
    columns = sorted(require_count(turn, "orientation_starts", MAX_INT) for turn in orientation_starts)
    free = 0
    for turn in columns:
        if not free <= turn <= D - 4:
            raise InvalidInput(
                f"orientation_starts is {short_repr(orientation_starts)}, expected first columns of four each, apart, of {D} in all"
            )
        free = turn + 4
    return tuple(columns)


def pack_e_step(
    x: object, lengths: object, initial: object, transitions: object, emissions: Emissions, threads: int = 1
) -> tuple[Array, Array, Array, Array, Emissions, int]:
    """Return the arguments of e_step, packed.    Raises: InvalidInput."""
    sizes: dict[str, int] = {}
    points, packed = pack_gaussians(x, emissions, sizes)
    first, onward = pack_arguments(CHAIN[1:], (initial, transitions), sizes)
    return points, _validate_lengths(lengths, sizes["N"]), first, onward, packed, _validate_threads(threads)


def pack_semi_markov_e_step(
    x: object, lengths: object, tables: SemiMarkovTables, emissions: Emissions, threads: int = 1
) -> tuple[Array, Array, SemiMarkovTables, Emissions, int]:
    """Return the arguments of semi_markov_e_step, packed.    Raises: InvalidInput."""
    sizes: dict[str, int] = {}
    points, packed = pack_gaussians(x, emissions, sizes)
    return (
        points,
        _validate_lengths(lengths, sizes["N"]),
        _pack_fields(tables, TABLES, sizes),
        packed,
        _validate_threads(threads),
    )


def _validate_lengths(lengths: object, N: int) -> Int[Array, " M"]:
    array = np.asarray(lengths)
    if array.dtype.kind not in "iu" or array.ndim != 1 or not array.size:
        raise InvalidInput(
            f"lengths are {short_repr(lengths)}, expected one whole number for each demonstration"
        )
    if array.min() < 1 or array.max() > N or (counted := np.array(array, dtype=np.int64)).sum() != N:
        raise InvalidInput(f"lengths are {short_repr(lengths)}, expected 1 or more each, {N} in all")
    return counted


def _validate_threads(threads: object) -> int:
    return require_count(threads, "threads", MAX_INT)


def pack_riccati(A: object, B: object, weights: object, targets: object, control_cost: object) -> list[Array]:
    """Return the arguments of riccati, packed.    Raises: InvalidInput."""
    sizes: dict[str, int] = {}
    arrays = pack_arguments(TRACKING, (A, B, weights, targets, control_cost), sizes)
    S, T = sizes["S"], sizes["T"]
    if S not in (1, T - 1):
        raise InvalidInput(f"A and B hold {S} matrices, expected 1 or, for {T} targets, {T - 1}")
    return arrays


def pack_semi_tied(
    scatter_matrices: object, counts: object, transform: object, sweeps: int
) -> tuple[Array, Array, Array, int]:
    """Return the arguments of semi_tied_sweeps, packed.    Raises: InvalidInput."""
    S, N, B = pack_arguments(SEMI_TIED, (scatter_matrices, counts, transform), {})
    return S, N, B, require_count(sweeps, "sweeps", MAX_INT)


def pack_covariances(values: object) -> list[Array]:
    """Return the argument of whiteners, packed.    Raises: InvalidInput."""
    return pack_arguments(COVARIANCES, (values,), {})


def pack_arm(
    impedance: ImpedanceParameters, limits: ArmLimits, state: ArmState, target: ToolTarget
) -> tuple[ImpedanceParameters, ArmLimits, ArmState, ToolTarget]:
    """Return the arguments of impedance, packed.    Raises: InvalidInput.

    Numbers that are not finite are allowed: the torque is defined for them.
    """
    sizes: dict[str, int] = {}
    (q,) = pack_arguments(ARM[2][:1], (state.q,), sizes)
    if len(q) > MAX_JOINTS:
        raise InvalidInput(
            f"q has {len(q)} entries, expected as many as an arm has joints: 1 to {MAX_JOINTS}"
        )
    numbers: dict[str, Any] = {name: _validate_real(getattr(impedance, name), name) for name in ARM_NUMBERS}
    return (
        replace(_pack_fields(impedance, ARM[0], sizes), **numbers),
        _pack_fields(limits, ARM[1], sizes),
        _pack_fields(state, ARM[2], sizes),
        _pack_fields(target, ARM[3], sizes),
    )


def _validate_real(value: object, name: str) -> float:
    if isinstance(value, int | float | np.integer | np.floating):
        with suppress(OverflowError):
            return float(value)
    raise InvalidInput(f"{name} is {short_repr(value)}, expected a number that float64 holds")


def _pack_fields(value: Dataclass, arguments: tuple[ArgumentSpec, ...], sizes: dict[str, int]) -> Dataclass:
    names = [argument.name for argument in arguments]
    given = [getattr(value, name) for name in names]
    arrays = pack_arguments(arguments, tuple(given), sizes)
    if all(array is one for array, one in zip(arrays, given, strict=True)):
        return value
    packed: dict[str, Any] = dict(zip(names, arrays, strict=True))
    return replace(value, **packed)


def pack_stream(
    x: object, axes: str, state: StreamState, parameters: StreamParameters
) -> tuple[Array, StreamState]:
    """Return datapoints and a stream's state, packed, if the state and the rules are consistent.

    Args:
        x: Datapoints, whose numbers are checked where they are observed.
        axes: Its axes, "NPD" or "PD".
        state: What the stream has left so far.
        rules: Their counts must be whole numbers.

    Raises:
        InvalidInput: If shapes do not fit or a number that counts something does not.
    """
    _validate_parameters(parameters)
    sizes: dict[str, int] = {}
    (points,) = pack_arguments((ArgumentSpec("x", axes, "any"),), (x,), sizes)
    P, D = sizes["P"], sizes["D"]
    if (state.frames, state.width) != (P, D):
        raise InvalidInput(f"x has {P} frames of {D} columns, expected {state.frames} of {state.width}")
    capacity = require_count(state.capacity, "capacity", (D + 3) // 4 * 4)
    if capacity % 4:
        raise InvalidInput(f"room is {capacity}, expected a multiple of 4")
    head, clusters, transition_counts = (
        pack_array(getattr(state, name), name) for name in ("head", "clusters", "transition_counts")
    )
    K = len(clusters) if clusters.ndim else 0
    expected = {"head": (6,), "clusters": (K, stream_row_length(P, D, capacity)), "transition_counts": (K, K)}
    for name, array in (("head", head), ("clusters", clusters), ("transition_counts", transition_counts)):
        if array.shape != expected[name]:
            raise InvalidInput(f"{name} has shape {array.shape}, expected {expected[name]}")
    _validate_head(head, K)
    now = replace(state, head=head, clusters=clusters, transition_counts=transition_counts)
    _validate_ranks(now, min(capacity, D))
    return points, now


def _validate_parameters(parameters: StreamParameters) -> None:
    for name, lowest, largest in (
        ("weighting", 0, 2),
        ("extra_directions", 0, MAX_INT),
        ("directions", 0, MAX_INT),
        ("clusters", 1, MAX_COUNT),
        ("batch", 1, MAX_COUNT),
    ):
        require_count(getattr(parameters, name), name, largest, lowest)


def _validate_head(head: Float[Array, " 6"], K: int) -> None:
    for place in StreamCounter:
        name, number = place.name.lower(), float(head[place])
        row = place in (StreamCounter.CURRENT, StreamCounter.PREVIOUS)
        require_number(number, f"head's {name}", -1.0 if row else 0.0, K - 1.0 if row else float(MAX_COUNT))
        if number != np.floor(number):
            raise InvalidInput(f"head's {name} is {number}, expected a whole number")


def _validate_ranks(state: StreamState, most: int) -> None:
    d, r = state.dimensions, state.ranks
    good = (d >= 0.0) & (d <= r) & (r <= most) & (d == np.floor(d)) & (r == np.floor(r))
    if not good.all():
        k, p = np.argwhere(~good)[0].tolist()
        raise InvalidInput(
            f"cluster {k} has dimension {d[k, p]} and {r[k, p]} directions in frame {p}, expected whole "
            f"numbers 0 <= dimension <= directions <= {most}"
        )
