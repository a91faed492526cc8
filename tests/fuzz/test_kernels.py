"""Compiled kernels and their NumPy references agree on hostile arguments: equal results or the same error.

PILOTFISH_FUZZ is the total number of mutants. To repeat a failure, call `draw_mutant(kernel, 0, number)`.
"""

import os
import warnings
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from kernel_arguments import DRAW_ARGUMENTS, Mutant, draw_mutant

from pilotfish.errors import NotPositiveDefinite, SkillError
from pilotfish.kernels import Emissions, SemiMarkovTables, reference
from pilotfish.kernels.stream_state import STATISTICS

MUTANTS = int(os.environ.get("PILOTFISH_FUZZ", "4200")) // len(DRAW_ARGUMENTS)
ERRORS = (TypeError, ValueError, ArithmeticError, LookupError, AttributeError, RuntimeError, MemoryError)
EPS = np.finfo(float).eps
# Here a hostile number makes the problem ill-conditioned: one factorisation succeeds and the other does not.
ILL_CONDITIONED = {
    "assistance_step",
    "riccati",
    "riemannian_product",
    "semi_tied_sweeps",
    "precision_cholesky",
    "impedance_torque",
    "observe",
    "observe_one",
}


@pytest.fixture(scope="module")
def compiled() -> ModuleType:
    """Return the compiled kernels, or skip where they could not be built."""
    return pytest.importorskip("pilotfish.kernels.compiled", exc_type=ImportError)


def outcome(kernels: ModuleType, kernel: str, arguments: list[Any]) -> Any:
    """Return the result of a kernel, or the SkillError that it raises."""
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return getattr(kernels, kernel)(*arguments)
        except SkillError as refusal:
            return refusal
        except np.linalg.LinAlgError as error:  # NumPy's eigenvalues, where hostile numbers overflow
            return NotPositiveDefinite(str(error))


def numbers(value: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Return every array of a result with its name."""
    if is_dataclass(value):
        for each in fields(value):
            yield from numbers(getattr(value, each.name), each.name)
    elif isinstance(value, tuple):
        names = getattr(value, "_fields", [f"{name}[{index}]" for index in range(len(value))])
        for field_name, each in zip(names, value, strict=True):
            yield from numbers(each, field_name)
    else:
        yield name, np.asarray(value)


def rounding(arguments: list[Any]) -> float:
    """Return the error of a log-probability that rounding its largest sums may cause.

    It is an eps for each operation on numbers as large as all steps' largest log-probabilities together.
    """
    largest = 1.0
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for value in arguments:
            if isinstance(value, Emissions):
                points = value.means if arguments[0] is value else arguments[0]
                x = np.asarray(points, dtype=float)
                reach = np.abs(x).max() + np.abs(np.asarray(value.means, dtype=float)).max()
                precision_cholesky = np.asarray(value.precision_cholesky, dtype=float)
                largest += (
                    x.size
                    * precision_cholesky.shape[-1] ** 2
                    * (reach * np.abs(precision_cholesky).max()) ** 2
                    + x.size
                )
            elif isinstance(value, SemiMarkovTables):
                logarithms = [
                    np.asarray(each, dtype=float)
                    for each in (value.log_segment_weights, value.log_tail_weights)
                ]
                largest += 40 * sum(np.abs(each[np.isfinite(each)]).max(initial=0.0) for each in logarithms)
            elif isinstance(value, np.ndarray) and value is arguments[0]:
                array = np.asarray(value, dtype=float)
                largest += array.shape[0] * np.abs(array[np.isfinite(array)]).max(initial=0.0)
    return float(min(64.0 * EPS * largest, 1e300))


def difference(mutated: Mutant, kernel: str, one: Any, other: Any) -> str:
    """Return the difference between two outcomes as text; empty if they agree."""
    ill_conditioned = kernel in ILL_CONDITIONED and mutated.kind not in ("plain", "layout")
    if isinstance(one, Exception) or isinstance(other, Exception):
        if type(one) is type(other) and str(one) == str(other):
            return ""
        if ill_conditioned and NotPositiveDefinite in (type(one), type(other)):
            return ""
        return f"{one!r:.200} and {other!r:.200}"
    if ill_conditioned:
        return ""
    tolerance = min(rounding(mutated.arguments), 1e100)
    for (name, a), (_, b) in zip(numbers(one), numbers(other), strict=True):
        if name == "capacity" or (
            kernel.endswith("viterbi") and name == "[0]"
        ):  # of paths that rounding makes equal, either is right
            continue
        logarithm = name.startswith("log_") or kernel.endswith(("viterbi", "semi_markov_forward"))
        if tolerance > 0.01 and not logarithm:  # posteriors that rounding decides
            continue
        if name == "rows":  # directions beyond these columns are the same but for their signs
            a, b = a[:, : len(STATISTICS)], b[:, : len(STATISTICS)]
        if a.shape != b.shape:
            return f"{name} has shapes {a.shape} and {b.shape}"
        size = min(np.abs(a[np.isfinite(a)]).max(initial=1.0), 1e200)
        if not np.allclose(a, b, rtol=1e-7, atol=(1e-9 + tolerance) * size, equal_nan=True):
            return f"{name} is {a.ravel()[:4]} and {b.ravel()[:4]}, tolerance {tolerance:.1e}"
    return ""


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("kernel", DRAW_ARGUMENTS)
def test_kernel_hostile_arguments_equal_reference(kernel, compiled):
    """Invalid shapes, types, layouts and numbers raise SkillError only."""
    for number in range(MUTANTS):
        mutated = draw_mutant(kernel, 0, number)
        where = f"mutant {number} of {kernel}, {mutated.kind}: {mutated.what}"
        try:
            found = [outcome(kernels, kernel, mutated.arguments) for kernels in (compiled, reference)]
        except ERRORS as error:
            pytest.fail(f"{where}: {error!r}")
        assert not (wrong := difference(mutated, kernel, *found)), f"{where}: {wrong}"
        if mutated.kind == "layout":  # the same numbers elsewhere: the same bits
            plain = outcome(compiled, kernel, mutated.original)
            for (name, a), (_, b) in zip(numbers(found[0]), numbers(plain), strict=True):
                assert a.tobytes() == b.tobytes() or isinstance(plain, SkillError), f"{where}: {name}"
