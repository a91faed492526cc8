"""Validation of the arguments of every kernel, for both implementations.

The `pack_` functions return arrays as the compiled kernels read them: float64 in native byte order,
C-contiguous and aligned. They raise InvalidInput for shapes that do not match and numbers for which no kernel
is defined.

The NumPy references call them for all arguments. The compiled kernels make the same checks in C++, where they
cost nothing. Only if those fail does compiled.py call these functions, either to pack the arguments or to
raise the same message. `KERNELS`, at the end, lists the function of every kernel.
"""

from collections.abc import Callable, Iterable
from dataclasses import fields, replace
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.kernels.arguments import Emissions, SemiMarkovTables
from pilotfish.kernels.arm_types import ArmLimits, ArmState, ImpedanceParameters, ToolTarget
from pilotfish.kernels.assistance_validation import pack_assistance
from pilotfish.kernels.packing import MAX_INT, pack_arguments, pack_fields, require_real
from pilotfish.kernels.stream_validation import pack_stream
from pilotfish.types import Array, Int
from pilotfish.validation import require_count, short_repr

MAX_JOINTS = 16
MIN_DIAGONAL = float(np.finfo(np.float64).tiny)  # compiled kernels flush smaller numbers to 0

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


def pack_markov(log_emissions: object, initial: object, transitions: object) -> list[Array]:
    """Return the packed arguments of forward_backward and viterbi."""
    return pack_arguments(MARKOV, (log_emissions, initial, transitions), {})


def pack_semi_markov(log_emissions: object, tables: SemiMarkovTables) -> tuple[Array, SemiMarkovTables]:
    """Return the packed arguments of the semi-Markov kernels."""
    sizes: dict[str, int] = {}
    (packed,) = pack_arguments(MARKOV[:1], (log_emissions,), sizes)
    return packed, pack_fields(tables, SEMI_MARKOV, sizes)


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
    x: object,
    lengths: object,
    initial: object,
    transitions: object,
    emissions: Emissions,
    threads: int = 1,
    final: object = None,
) -> tuple[Array, Array, Array, Array, Emissions, int, Array]:
    """Return the packed arguments of e_step."""
    sizes: dict[str, int] = {}
    points, packed = pack_emissions(x, emissions, sizes)
    initial_array, transitions_array = pack_arguments(MARKOV[1:], (initial, transitions), sizes)
    lengths_array = _validate_lengths(lengths, sizes["N"])
    given = np.ones(sizes["K"]) if final is None else final
    (final_array,) = pack_arguments((("final", "K", "probability"),), (given,), sizes)
    threads = _validate_threads(threads)
    return points, lengths_array, initial_array, transitions_array, packed, threads, final_array


def pack_semi_markov_e_step(
    x: object, lengths: object, tables: SemiMarkovTables, emissions: Emissions, threads: int = 1
) -> tuple[Array, Array, SemiMarkovTables, Emissions, int]:
    """Return the packed arguments of semi_markov_e_step."""
    sizes: dict[str, int] = {}
    points, packed = pack_emissions(x, emissions, sizes)
    return (
        points,
        _validate_lengths(lengths, sizes["N"]),
        pack_fields(tables, SEMI_MARKOV, sizes),
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


def pack_product(emissions: Emissions, covariances: object) -> tuple[Emissions, Array]:
    """Return the packed arguments of riemannian_product."""
    sizes: dict[str, int] = {}
    (means,) = pack_arguments(EMISSIONS[1:2], (emissions.means,), sizes)
    starts = _validate_orientation_starts(emissions.orientation_starts, sizes["D"])
    sizes["E"] = sizes["D"] - len(starts)
    given = (("precision_cholesky", "PKEE", "finite"), ("covariances", "PKEE", "finite"))
    precision_cholesky, packed = pack_arguments(given, (emissions.precision_cholesky, covariances), sizes)
    return Emissions(means, precision_cholesky, starts), packed


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
    scalars: dict[str, Any] = {name: require_real(getattr(parameters, name), name) for name in ARM_SCALARS}
    return (
        replace(pack_fields(parameters, ARM[0], sizes), **scalars),
        pack_fields(limits, ARM[1], sizes),
        pack_fields(state, ARM[2], sizes),
        pack_fields(target, ARM[3], sizes),
    )


KERNELS: dict[str, Callable[..., Iterable[Any]]] = {
    "assistance_step": pack_assistance,
    "e_step": pack_e_step,
    "forward_backward": pack_markov,
    "impedance_torque": pack_arm,
    "log_emissions": lambda x, emissions: pack_emissions(x, emissions, {}),
    "observe": lambda x, state, parameters: (*pack_stream(x, "NPD", state, parameters), parameters),
    "observe_one": lambda x, state, parameters: (*pack_stream(x, "PD", state, parameters), parameters),
    "precision_cholesky": pack_covariances,
    "riccati": pack_riccati,
    "riemannian_product": pack_product,
    "semi_markov_e_step": pack_semi_markov_e_step,
    "semi_markov_forward": pack_semi_markov,
    "semi_markov_forward_backward": pack_semi_markov,
    "semi_markov_viterbi": pack_semi_markov,
    "semi_tied_sweeps": pack_semi_tied,
    "viterbi": pack_markov,
}
