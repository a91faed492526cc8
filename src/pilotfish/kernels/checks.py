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
from pilotfish.kernels.arms import ArmLimits, ArmReading, Impedance, ToolTarget
from pilotfish.kernels.streams import StreamHead, StreamRules, StreamState, stream_row_length
from pilotfish.types import Array, Float, Int
from pilotfish.validation import numeric_array, require_count, require_number, short_repr

LARGEST_NUMBER = 1e150  # sums of squares do not overflow
LARGEST_COUNT = 2**53  # up to here float64 counts one by one
LARGEST_INT = 2**31 - 1
MOST_JOINTS = 16
SMALLEST = float(np.finfo(np.float64).tiny)  # compiled kernels take smaller numbers for 0

Frozen = TypeVar("Frozen", SemiMarkovTables, Emissions, ArmLimits, ArmReading, Impedance, ToolTarget)


class Argument(NamedTuple):
    """An array argument of a kernel.

    axes holds a letter for each axis, equal letters for equal sizes, or a digit for a fixed size.
    kind is "finite" (at most LARGEST_NUMBER), "probability" (at least 0, finite), "logarithm" (below +inf)
    or "any" (NaN and infinities have a meaning).
    """

    name: str
    axes: str
    kind: str = "finite"


CHAIN = (
    Argument("log_emissions", "TK", "logarithm"),
    Argument("initial", "K", "probability"),
    Argument("transitions", "KK", "probability"),
)
TABLES = (*CHAIN[1:], Argument("log_visits", "4SK", "logarithm"), Argument("log_beyond", "2K", "logarithm"))
DATA = (Argument("x", "PND"), Argument("means", "PKD"), Argument("whiteners", "PKEE"))
TRACKING = (
    Argument("A", "Snn"),
    Argument("B", "Snm"),
    Argument("weights", "Tnn"),
    Argument("targets", "Tn"),
    Argument("effort", "mm"),
)
SEMI_TIED = (Argument("scatters", "KDD"), Argument("mass", "K"), Argument("transform", "DD"))
COVARIANCES = (Argument("covariances", "KDD", "any"),)
ARM = (
    (Argument("stiffness", "6", "any"), Argument("damping", "6", "any"), Argument("posture", "n", "any")),
    tuple(Argument(name, "n", "any") for name in ("lower", "upper", "torque")),
    (
        *(Argument(name, "n", "any") for name in ("q", "velocity")),
        Argument("position", "3", "any"),
        Argument("quaternion", "4", "any"),
        Argument("jacobian", "6n", "any"),
        Argument("bias", "n", "any"),
    ),
    (Argument("position", "3", "any"), Argument("quaternion", "4", "any"), Argument("twist", "6", "any")),
)
ARM_NUMBERS = tuple(field.name for field in fields(Impedance) if field.type in (float, "float"))
MAY_BE_EMPTY = "N"  # axes


def fit(arguments: tuple[Argument, ...], values: tuple[object, ...], sizes: dict[str, int]) -> list[Array]:
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
        array = pack(value, argument.name)
        if not _fits(argument.axes, array.shape, sizes):
            raise _wrong_shape(argument, array, sizes)
        if argument.kind != "any" and array.size and not _defined(argument.kind, array):
            raise _undefined(argument, array)
        arrays.append(array)
    return arrays


def pack(value: object, name: str) -> Float[Array, "..."]:
    """Return value itself if the compiled kernels can read it where it is, a packed copy otherwise."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        flags = value.flags
        if flags.c_contiguous and flags.aligned and value.dtype.isnative:
            return value
    return numeric_array(value, name)


def _fits(axes: str, shape: tuple[int, ...], sizes: dict[str, int]) -> bool:
    if len(axes) != len(shape):
        return False
    for axis, size in zip(axes, shape, strict=True):
        wanted = int(axis) if axis.isdigit() else sizes.setdefault(axis, size)
        if size != wanted or (size == 0 and axis not in MAY_BE_EMPTY):
            return False
    return True


def _wrong_shape(argument: Argument, array: Array, sizes: dict[str, int]) -> InvalidInput:
    known = ", ".join(f"{axis} = {size}" for axis, size in sizes.items() if axis in argument.axes and size)
    expected = f"({', '.join(argument.axes)})" + (f" with {known}" if known else "")
    return InvalidInput(f"{argument.name} has shape {array.shape}, expected {expected}")


def _defined(kind: str, array: Array) -> bool:
    match kind:
        case "finite":
            return bool(np.abs(array).max() <= LARGEST_NUMBER)
        case "probability":
            return bool(array.min() >= 0.0 and array.max() < inf)
        case _:
            return bool(array.max() < inf)  # false for NaN too


def _undefined(argument: Argument, array: Array) -> InvalidInput:
    good, expected = {
        "finite": (np.abs(array) <= LARGEST_NUMBER, f"finite numbers of at most {LARGEST_NUMBER:g}"),
        "probability": ((array >= 0.0) & (array < inf), "finite numbers of at least 0"),
        "logarithm": (array < inf, "logarithms: finite numbers or -inf"),
    }[argument.kind]
    index = np.argwhere(~good)[0].tolist()
    return InvalidInput(f"{argument.name}{index} is {array[tuple(index)]}, expected {expected}")


def markov(log_emissions: object, initial: object, transitions: object) -> list[Array]:
    """Return the arguments of forward_backward and viterbi, packed.    Raises: InvalidInput."""
    return fit(CHAIN, (log_emissions, initial, transitions), {})


def semi_markov(log_emissions: object, tables: SemiMarkovTables) -> tuple[Array, SemiMarkovTables]:
    """Return the arguments of the semi-Markov kernels, packed.    Raises: InvalidInput."""
    sizes: dict[str, int] = {}
    (packed,) = fit(CHAIN[:1], (log_emissions,), sizes)
    return packed, _packed(tables, TABLES, sizes)


def gaussians(x: object, emissions: Emissions, sizes: dict[str, int]) -> tuple[Array, Emissions]:
    """Return datapoints and Gaussians, packed; sizes gains P, N, K, D and E.    Raises: InvalidInput."""
    (points,) = fit(DATA[:1], (x,), sizes)
    turns = _turns(emissions.turns, sizes["D"])
    sizes["E"] = sizes["D"] - len(turns)
    means, whiteners = fit(DATA[1:], (emissions.means, emissions.whiteners), sizes)
    if not (least := np.einsum("pkii->pki", whiteners).min()) >= SMALLEST:
        raise InvalidInput(f"whiteners have {least} on a diagonal, expected at least {SMALLEST:g}")
    return points, Emissions(means, whiteners, turns)


def _turns(turns: tuple[int, ...], D: int) -> tuple[int, ...]:
    columns = sorted(require_count(turn, "turns", LARGEST_INT) for turn in turns)
    free = 0
    for turn in columns:
        if not free <= turn <= D - 4:
            raise InvalidInput(
                f"turns are {short_repr(turns)}, expected first columns of four each, apart, of {D} in all"
            )
        free = turn + 4
    return tuple(columns)


def e_step(
    x: object, lengths: object, initial: object, transitions: object, emissions: Emissions, threads: int = 1
) -> tuple[Array, Array, Array, Array, Emissions, int]:
    """Return the arguments of e_step, packed.    Raises: InvalidInput."""
    sizes: dict[str, int] = {}
    points, packed = gaussians(x, emissions, sizes)
    first, onward = fit(CHAIN[1:], (initial, transitions), sizes)
    return points, _lengths(lengths, sizes["N"]), first, onward, packed, _threads(threads)


def semi_markov_e_step(
    x: object, lengths: object, tables: SemiMarkovTables, emissions: Emissions, threads: int = 1
) -> tuple[Array, Array, SemiMarkovTables, Emissions, int]:
    """Return the arguments of semi_markov_e_step, packed.    Raises: InvalidInput."""
    sizes: dict[str, int] = {}
    points, packed = gaussians(x, emissions, sizes)
    return points, _lengths(lengths, sizes["N"]), _packed(tables, TABLES, sizes), packed, _threads(threads)


def _lengths(lengths: object, N: int) -> Int[Array, " M"]:
    array = np.asarray(lengths)
    if array.dtype.kind not in "iu" or array.ndim != 1 or not array.size:
        raise InvalidInput(
            f"lengths are {short_repr(lengths)}, expected one whole number for each demonstration"
        )
    if array.min() < 1 or array.max() > N or (counted := np.array(array, dtype=np.int64)).sum() != N:
        raise InvalidInput(f"lengths are {short_repr(lengths)}, expected 1 or more each, {N} in all")
    return counted


def _threads(threads: object) -> int:
    return require_count(threads, "threads", LARGEST_INT)


def riccati(A: object, B: object, weights: object, targets: object, effort: object) -> list[Array]:
    """Return the arguments of riccati, packed.    Raises: InvalidInput."""
    sizes: dict[str, int] = {}
    arrays = fit(TRACKING, (A, B, weights, targets, effort), sizes)
    S, T = sizes["S"], sizes["T"]
    if S not in (1, T - 1):
        raise InvalidInput(f"A and B hold {S} matrices, expected 1 or, for {T} targets, {T - 1}")
    return arrays


def semi_tied(
    scatters: object, mass: object, transform: object, sweeps: int
) -> tuple[Array, Array, Array, int]:
    """Return the arguments of semi_tied_sweeps, packed.    Raises: InvalidInput."""
    S, N, B = fit(SEMI_TIED, (scatters, mass, transform), {})
    return S, N, B, require_count(sweeps, "sweeps", LARGEST_INT)


def covariances(values: object) -> list[Array]:
    """Return the argument of whiteners, packed.    Raises: InvalidInput."""
    return fit(COVARIANCES, (values,), {})


def arm(
    impedance: Impedance, limits: ArmLimits, reading: ArmReading, target: ToolTarget
) -> tuple[Impedance, ArmLimits, ArmReading, ToolTarget]:
    """Return the arguments of impedance, packed.    Raises: InvalidInput.

    Numbers that are not finite are allowed: the torque is defined for them.
    """
    sizes: dict[str, int] = {}
    (q,) = fit(ARM[2][:1], (reading.q,), sizes)
    if len(q) > MOST_JOINTS:
        raise InvalidInput(
            f"q has {len(q)} entries, expected as many as an arm has joints: 1 to {MOST_JOINTS}"
        )
    numbers: dict[str, Any] = {name: _real(getattr(impedance, name), name) for name in ARM_NUMBERS}
    return (
        replace(_packed(impedance, ARM[0], sizes), **numbers),
        _packed(limits, ARM[1], sizes),
        _packed(reading, ARM[2], sizes),
        _packed(target, ARM[3], sizes),
    )


def _real(value: object, name: str) -> float:
    if isinstance(value, int | float | np.integer | np.floating):
        with suppress(OverflowError):
            return float(value)
    raise InvalidInput(f"{name} is {short_repr(value)}, expected a number that float64 holds")


def _packed(value: Frozen, arguments: tuple[Argument, ...], sizes: dict[str, int]) -> Frozen:
    names = [argument.name for argument in arguments]
    given = [getattr(value, name) for name in names]
    arrays = fit(arguments, tuple(given), sizes)
    if all(array is one for array, one in zip(arrays, given, strict=True)):
        return value
    packed: dict[str, Any] = dict(zip(names, arrays, strict=True))
    return replace(value, **packed)


def stream(x: object, axes: str, state: StreamState, rules: StreamRules) -> tuple[Array, StreamState]:
    """Return datapoints and a stream's state, packed, if the state and the rules are consistent.

    Args:
        x: Datapoints, whose numbers are checked where they are observed.
        axes: Its axes, "NPD" or "PD".
        state: What the stream has left so far.
        rules: Their counts must be whole numbers.

    Raises:
        InvalidInput: If shapes do not fit or a number that counts something does not.
    """
    _require_rules(rules)
    sizes: dict[str, int] = {}
    (points,) = fit((Argument("x", axes, "any"),), (x,), sizes)
    P, D = sizes["P"], sizes["D"]
    if (state.frames, state.width) != (P, D):
        raise InvalidInput(f"x has {P} frames of {D} columns, expected {state.frames} of {state.width}")
    room = require_count(state.room, "room", (D + 3) // 4 * 4)
    if room % 4:
        raise InvalidInput(f"room is {room}, expected a multiple of 4")
    head, clusters, counts = (pack(getattr(state, name), name) for name in ("head", "clusters", "counts"))
    K = len(clusters) if clusters.ndim else 0
    expected = {"head": (6,), "clusters": (K, stream_row_length(P, D, room)), "counts": (K, K)}
    for name, array in (("head", head), ("clusters", clusters), ("counts", counts)):
        if array.shape != expected[name]:
            raise InvalidInput(f"{name} has shape {array.shape}, expected {expected[name]}")
    _require_head(head, K)
    now = replace(state, head=head, clusters=clusters, counts=counts)
    _require_ranks(now, min(room, D))
    return points, now


def _require_rules(rules: StreamRules) -> None:
    for name, lowest, largest in (
        ("weighting", 0, 2),
        ("spare", 0, LARGEST_INT),
        ("directions", 0, LARGEST_INT),
        ("clusters", 1, LARGEST_COUNT),
        ("batch", 1, LARGEST_COUNT),
    ):
        require_count(getattr(rules, name), name, largest, lowest)


def _require_head(head: Float[Array, " 6"], K: int) -> None:
    for place in StreamHead:
        name, number = place.name.lower(), float(head[place])
        row = place in (StreamHead.CURRENT, StreamHead.BEFORE)
        require_number(
            number, f"head's {name}", -1.0 if row else 0.0, K - 1.0 if row else float(LARGEST_COUNT)
        )
        if number != np.floor(number):
            raise InvalidInput(f"head's {name} is {number}, expected a whole number")


def _require_ranks(state: StreamState, most: int) -> None:
    d, r = state.dimensions, state.ranks
    good = (d >= 0.0) & (d <= r) & (r <= most) & (d == np.floor(d)) & (r == np.floor(r))
    if not good.all():
        k, p = np.argwhere(~good)[0].tolist()
        raise InvalidInput(
            f"cluster {k} has dimension {d[k, p]} and {r[k, p]} directions in frame {p}, expected whole "
            f"numbers 0 <= dimension <= directions <= {most}"
        )
