"""Random arguments of every kernel, ordinary and degenerate, and mutations of them."""

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
from assistance_arguments import assistance_arguments

from pilotfish.kernels import (
    ArmLimits,
    ArmState,
    Emissions,
    ImpedanceParameters,
    SemiMarkovTables,
    StreamParameters,
    StreamState,
    ToolTarget,
    reference,
)

Generator = np.random.Generator
Arguments = list[Any]


def probabilities(rng: Generator, *shape: int) -> np.ndarray:
    """Return rows that sum to one, with some zeros; sometimes a row is all zeros."""
    rows = rng.dirichlet(np.ones(shape[-1]), size=shape[:-1] or None)
    return rows * (rng.random(shape) >= rng.choice([0.0, 0.3, 0.9]))


def logarithms(rng: Generator, *shape: int) -> np.ndarray:
    """Return log-probabilities, some of them -inf."""
    values = rng.choice([0.0, 1.0, 30.0, 1e3]) * rng.normal(size=shape)
    values[rng.random(shape) < rng.choice([0.0, 0.1, 0.6])] = -np.inf
    return values


def chain(rng: Generator) -> Arguments:
    """Return arguments of forward_backward and viterbi."""
    T, K = int(rng.choice([1, 2, 7, 33])), int(rng.choice([1, 2, 5, 9]))
    return [logarithms(rng, T, K), probabilities(rng, K), probabilities(rng, K, K)]


def tables(rng: Generator, K: int) -> SemiMarkovTables:
    """Return a semi-Markov chain of K states."""
    S = int(rng.choice([1, 3, 12]))
    transitions = probabilities(rng, K, K) * (1.0 - np.eye(K))
    return SemiMarkovTables(
        probabilities(rng, K), transitions, logarithms(rng, 4, S, K), logarithms(rng, 2, K)
    )


def semi_markov(rng: Generator) -> Arguments:
    """Return arguments of the semi-Markov kernels."""
    T, K = int(rng.choice([1, 2, 7, 33])), int(rng.choice([1, 2, 5, 9]))
    return [logarithms(rng, T, K), tables(rng, K)]


def gaussians(rng: Generator, N: int | None = None) -> Arguments:
    """Return arguments of log_emissions."""
    P, K, D = int(rng.integers(1, 3)), int(rng.choice([1, 2, 5])), int(rng.choice([1, 2, 5, 9]))
    N = int(rng.choice([1, 3, 40])) if N is None else N
    orientation_starts = (int(rng.integers(D - 3)),) if D > 4 and rng.random() < 0.5 else ()
    E = D - len(orientation_starts)
    means, x = rng.normal(size=(P, K, D)), rng.normal(size=(P, N, D))
    for start in orientation_starts:
        for points in (means, x):
            points[..., start : start + 4] /= np.linalg.norm(points[..., start : start + 4], axis=-1)[
                ..., None
            ]
    precision_cholesky = np.tril(0.2 * rng.normal(size=(P, K, E, E)), -1) + np.eye(E) * rng.uniform(
        0.5, 2.0, E
    )
    return [x, Emissions(means, precision_cholesky, orientation_starts)]


def e_step(rng: Generator) -> Arguments:
    """Return arguments of e_step."""
    lengths = rng.integers(1, 30, size=rng.integers(1, 4))
    x, emissions = gaussians(rng, int(lengths.sum()))
    K = emissions.means.shape[1]
    return [x, lengths, probabilities(rng, K), probabilities(rng, K, K), emissions, int(rng.integers(3))]


def semi_markov_e_step(rng: Generator) -> Arguments:
    """Return arguments of semi_markov_e_step."""
    x, lengths, initial, _, emissions, threads = e_step(rng)
    return [x, lengths, tables(rng, len(initial)), emissions, threads]


def precision_cholesky(rng: Generator) -> Arguments:
    """Return the argument of precision_cholesky."""
    return [random_covariances(rng, int(rng.integers(1, 5)), int(rng.choice([1, 2, 7, 19])))]


def random_covariances(rng: Generator, K: int, D: int) -> np.ndarray:
    """Return K covariances, sometimes one of them zero."""
    roots = rng.normal(size=(K, D, D))
    return (roots @ roots.swapaxes(1, 2) + 0.1 * np.eye(D)) * (rng.random((K, 1, 1)) < 0.95)


def semi_tied(rng: Generator) -> Arguments:
    """Return arguments of semi_tied_sweeps."""
    K, D = int(rng.integers(1, 9)), int(rng.choice([1, 2, 3, 7]))
    counts = rng.uniform(1.0, 9.0, K) * (rng.random(K) < 0.8)
    return [random_covariances(rng, K, D), counts, np.eye(D), int(rng.integers(4))]


def riccati(rng: Generator) -> Arguments:
    """Return arguments of riccati."""
    T, n, m = int(rng.choice([1, 2, 6])), int(rng.integers(1, 6)), int(rng.integers(1, 4))
    S = 1 if rng.random() < 0.5 else max(T - 1, 1)
    A = np.eye(n) + 0.1 * rng.normal(size=(S, n, n))
    return [A, rng.normal(size=(S, n, m)), random_covariances(rng, T, n), rng.normal(size=(T, n)), np.eye(m)]


def riemannian_product(rng: Generator) -> Arguments:
    """Return arguments of riemannian_product."""
    P, K = int(rng.integers(1, 4)), int(rng.integers(1, 5))
    starts = [(), (0,), (3,), (1, 5)][rng.integers(4)]
    D = int(rng.integers(1, 4)) + (max(starts) + 4 if starts else 0)
    E = D - len(starts)
    means = rng.normal(size=D) + 0.1 * rng.normal(size=(P, K, D))
    for start in starts:
        means[..., start : start + 4] /= np.linalg.norm(means[..., start : start + 4], axis=-1, keepdims=True)
    roots = 0.3 * rng.normal(size=(P, K, E, E))
    covariances = roots @ roots.swapaxes(-1, -2) + 0.01 * np.eye(E)
    W = np.linalg.inv(np.linalg.cholesky(covariances))
    return [Emissions(means, W, starts), covariances]


def arm(rng: Generator) -> Arguments:
    """Return arguments of impedance_torque."""
    n = int(rng.choice([1, 6, 7, 16]))
    numbers = rng.uniform(0.1, 5.0, 7).tolist()
    spring = ImpedanceParameters(rng.uniform(1, 9, 6), rng.uniform(1, 9, 6), rng.normal(size=n), *numbers)
    limits = ArmLimits(np.full(n, -2.0), np.full(n, 2.0), np.full(n, 3.0), rng.uniform(1.0, 50.0, n))
    reading = ArmState(
        rng.normal(size=n),
        rng.normal(size=n),
        rng.normal(size=3),
        rng.normal(size=4),
        rng.normal(size=(6, n)),
        rng.normal(size=n),
    )
    return [spring, limits, reading, ToolTarget(rng.normal(size=3), rng.normal(size=4), rng.normal(size=6))]


def stream(rng: Generator) -> Arguments:
    """Return arguments of observe: a state after some datapoints, and more datapoints."""
    P, D = int(rng.integers(1, 3)), int(rng.choice([1, 2, 5]))
    centres = 9.0 * rng.normal(size=(3, P, D))
    x = np.repeat(centres[rng.integers(3, size=5)], 4, axis=0)
    x = x + rng.normal(size=x.shape)
    weighting = int(rng.integers(3))
    weight = (0.0, 0.99, 5.0)[weighting]
    batch, most = int(rng.choice([1, 4])), int(rng.choice([2, 50]))
    parameters = StreamParameters(
        40.0, 0.5, 0.1, 0.1, 90.0, 2.0, weighting, weight, 0.0, 2, max(D - 1, 0), most, batch
    )
    state, _ = reference.observe(x[:12], StreamState.empty(P, D), parameters)
    return [x[12:], state, parameters]


def stream_of_one(rng: Generator) -> Arguments:
    """Return arguments of observe_one."""
    x, state, parameters = stream(rng)
    return [x[0], state, parameters]


DRAW_ARGUMENTS: dict[str, Callable[[Generator], Arguments]] = {
    "assistance_step": assistance_arguments,
    "e_step": e_step,
    "forward_backward": chain,
    "impedance_torque": arm,
    "log_emissions": gaussians,
    "observe": stream,
    "observe_one": stream_of_one,
    "riccati": riccati,
    "riemannian_product": riemannian_product,
    "semi_markov_forward_backward": semi_markov,
    "semi_markov_e_step": semi_markov_e_step,
    "semi_markov_forward": semi_markov,
    "semi_markov_viterbi": semi_markov,
    "semi_tied_sweeps": semi_tied,
    "viterbi": chain,
    "precision_cholesky": precision_cholesky,
}

# ---------------------------------------------------------------------------- the same numbers in other
# layouts


def unaligned(array: np.ndarray) -> np.ndarray:
    """Return the same numbers at an unaligned address."""
    return np.frombuffer(b"\0" + array.tobytes(), array.dtype, offset=1).reshape(array.shape)


def field(array: np.ndarray) -> np.ndarray:
    """Return the same numbers as the field of a packed record."""
    records = np.zeros(array.shape, np.dtype([("flag", "i1"), ("number", array.dtype)]))
    records["number"] = array
    return records["number"]


def strided(array: np.ndarray) -> np.ndarray:
    """Return the same numbers as every second entry of an array."""
    return np.repeat(array, 2, axis=-1)[..., ::2] if array.ndim else array


LAYOUTS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "unaligned": unaligned,
    "field": field,
    "strided": strided,
    "fortran": np.asfortranarray,
    "reversed": lambda array: np.flip(np.flip(array).copy()),
    "big-endian": lambda array: array.astype(array.dtype.newbyteorder(">")),
    "read-only": lambda array: np.broadcast_to(array, array.shape),
}

# ----------------------------------------------------------------------------------------- other numbers


def change_shape(rng: Generator, array: np.ndarray) -> Any:
    """Return an array of another shape."""
    ways: list[Callable[[], Any]] = [
        lambda: array[None],
        lambda: array.ravel(),
        lambda: np.array(1.0),
        lambda: array[:0],
        lambda: np.zeros((0, *array.shape[1:])),
        lambda: np.concatenate([array, array[:1]]) if array.ndim else array,
        lambda: array[:-1],
        lambda: array[..., :-1],
        lambda: array.T,
        lambda: np.broadcast_to(array.ravel()[:1], array.shape) if array.size else array,
    ]
    return ways[rng.integers(len(ways))]()


def change_type(rng: Generator, array: np.ndarray) -> Any:
    """Return an array of another type."""
    types = [np.float32, np.float16, np.int64, np.int8, np.bool_, np.complex128, object, "U9", np.longdouble]
    with np.errstate(all="ignore"):
        return array.astype(types[rng.integers(len(types))])


NUMBERS = (
    *(np.nan, np.inf, -np.inf, 1e300, -1e300, 1e160, 1e155, 1e100, -1e20, 1e12, 5e-324, 1e-300, 0.0, -0.0),
    *(-1.0, -999.0, 0.5),
)


def change_number(rng: Generator, array: np.ndarray) -> Any:
    """Return an array with one number, or all of them, replaced."""
    numbers = np.array(array, copy=True)
    number = NUMBERS[rng.integers(len(NUMBERS))]
    if not numbers.size or (
        numbers.dtype.kind != "f" and number != int(number if np.isfinite(number) else 0.5)
    ):
        return numbers
    if abs(number) > 2**60 and numbers.dtype.kind != "f":
        return numbers
    if rng.random() < 0.2:
        numbers[...] = number
    else:
        numbers.flat[rng.integers(numbers.size)] = number
    return numbers


WHOLE_NUMBERS = (0, -1, 1, 2, 3, 2**40, 0.5, np.nan, np.inf, 1e155, np.int16(2))
SCALARS = (
    0,
    -1,
    1,
    3,
    2**40,
    10**400,
    0.5,
    1e155,
    1e200,
    np.nan,
    np.inf,
    np.float32(2.5),
    np.int16(2),
    "1",
    None,
)


@dataclass(frozen=True)
class Mutant:
    """Invalid or unusual arguments, and how they were changed."""

    arguments: Arguments
    kind: str  # plain, layout, shape, type, number or scalar
    what: str
    original: Arguments


def draw_mutant(kernel: str, seed: int, number: int) -> Mutant:
    """Return a mutant of a kernel's arguments, the same for the same seed and number."""
    rng = np.random.default_rng([seed, number, len(kernel)])
    arguments = DRAW_ARGUMENTS[kernel](rng)
    kind = str(rng.choice(["plain", "layout", "shape", "type", "number", "scalar"]))
    if kind == "plain":
        return Mutant(arguments, kind, "unchanged", arguments)
    places = [
        place
        for place, value in argument_values(arguments)
        if isinstance(value, np.ndarray) == (kind != "scalar")
    ]
    if not places:
        return Mutant(arguments, "plain", "unchanged", arguments)
    place = places[rng.integers(len(places))]
    value = dict(argument_values(arguments))[place]
    match kind:
        case "number" if place[1] == "clusters":  # of a row only what sizes the rest is checked
            changed_value = value.copy()
            if len(value):
                changed_value[rng.integers(len(value)), rng.choice([9, 10])] = NUMBERS[
                    rng.integers(len(NUMBERS))
                ]
            how = "with other sizes"
        case "layout":
            kind_of = str(rng.choice(list(LAYOUTS)))
            changed_value, how = LAYOUTS[kind_of](value), kind_of
        case "scalar":
            numbers = WHOLE_NUMBERS if isinstance(arguments[place[0]], StreamParameters) else SCALARS
            changed_value = numbers[rng.integers(len(numbers))]
            how = repr(changed_value)[:40]
        case _:
            changed_value = {"shape": change_shape, "type": change_type, "number": change_number}[kind](
                rng, value
            )
            how = f"{changed_value.dtype} {changed_value.shape}"
    return Mutant(
        replace_argument(arguments, place, changed_value), kind, f"argument {place} as {how}", arguments
    )


def argument_values(arguments: Arguments) -> list[tuple[tuple[int, str], Any]]:
    """Return every array and number of the arguments, with its place."""
    found: list[tuple[tuple[int, str], Any]] = []
    for index, value in enumerate(arguments):
        if not is_dataclass(value):
            found.append(((index, ""), value))
            continue
        for each in fields(value):
            if each.init and each.name not in NOT_MUTATED:
                found.append(((index, each.name), getattr(value, each.name)))
    return found


# what is no array, or a number that no kernel checks
NOT_MUTATED = {
    *(
        "filter",
        "orientation_starts",
        "frames",
        "width",
        "cluster",
        "dimension",
        "transition",
        "new_transition",
        "bandwidth",
    ),
    *("merge_distance", "weight", "forget_below"),
}


def replace_argument(arguments: Arguments, place: tuple[int, str], value: Any) -> Arguments:
    """Return the arguments with one value replaced."""
    index, name = place
    changed = list(arguments)
    changed[index] = replace(changed[index], **{name: value}) if name else value
    return changed
