"""Public functions under hostile arguments.

Functions in STRICT return a sound value or raise SkillError for any argument. The others may also raise what
NumPy and Python raise for invalid arguments. No function crashes, hangs or changes its arguments. A value in
another form (strided, big-endian, unaligned, read-only, a list) gives the same result or is refused.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from random import Random
from typing import Any

import numpy as np

from fuzzing.edits import NUMBERS, STRUCTURES, TEXTS, Token, short_text
from fuzzing.edits_of_arrays import edit_array
from fuzzing.public_examples import EXAMPLES, examples, function_named
from fuzzing.soundness import InvariantViolation, require_sound
from fuzzing.target import Target
from pilotfish.errors import SkillError
from pilotfish.types import Array

# Functions for which only a SkillError is a refusal.
STRICT = {
    "geometry.pose",
    *(f"assistance.{n}" for n in ("learn_virtual_fixture", "add_phase", "virtual_fixture")),
    *(f"assistance.{n}" for n in ("nearest_phase", "start_fixture", "step_fixture")),
    *(f"demonstrations.{n}" for n in ("unwrap_orientations", "demonstration", "frame", "moving_frame")),
    *(f"models.{n}" for n in ("learn", "adapt")),
    *(f"models.online.{n}" for n in ("observe", "observe_stream", "online_model")),
    *(f"control.{n}" for n in ("arm_limits", "impedance", "double_integrator", "discretise", "track", "lqr")),
    *(
        f"planning.{n}"
        for n in ("via_point", "plan", "expected_plan", "plan_through", "planned_states", "chart")
    ),
    *(f"validation.{n}" for n in ("finite_array", "float_array", "require_count", "require_number")),
    *("manipulation.step", "manipulation.reset"),
}
ORDINARY = (
    TypeError,
    ValueError,
    LookupError,
    ArithmeticError,
    AttributeError,
    MemoryError,
    RuntimeWarning,
    np.ma.MAError,
)
NOT_EDITED = ("label", "maximum", "expected")  # arguments of the caller, not of the user
# Without numbers that are large but valid, such as a number of steps.
VALUES = tuple(
    v for v in (*NUMBERS, *TEXTS, *STRUCTURES) if not isinstance(v, Token) and v not in (10**5, 10**6)
)


@dataclass(frozen=True, slots=True, eq=False)
class Call:
    """Name and arguments of a function.

    Attributes:
        name: Name of the function.
        arguments: Arguments by name.
        same: Whether the arguments equal those of the example in another form.
        inside: Whether a value made by another function was edited.
    """

    name: str
    arguments: dict[str, Any]
    same: bool = True
    inside: bool = False


def edit_call(call: Call, rng: Random) -> tuple[Call, str]:
    """Edit one argument, or leave one out."""
    key = rng.choice([key for key in call.arguments if key not in NOT_EDITED])
    value = call.arguments[key]
    if rng.random() < 0.25 and isinstance(value, np.ndarray):
        edited, said = other_form(value, rng)
        return replace(call, arguments={**call.arguments, key: edited}), f"{call.name}({key}): {said}"
    edited, said, inside = _edited(value, rng)
    changed = replace(
        call, arguments={**call.arguments, key: edited}, same=False, inside=call.inside or inside
    )
    return changed, f"{call.name}({key}): {said}"


def _edited(value: Any, rng: Random) -> tuple[Any, str, bool]:
    if isinstance(value, np.ndarray) and rng.random() < 0.85:
        edited, said = edit_array(value, rng) if rng.random() < 0.85 else other_kind(value, rng)
        return edited, said, False
    if is_dataclass(value) and fields(value) and rng.random() < 0.85:
        return *_edited_field(value, rng), True
    if isinstance(value, list | tuple) and value and rng.random() < 0.6:
        n = rng.randrange(len(value))
        edited, said, inside = _edited(value[n], rng)
        return type(value)((*value[:n], edited, *value[n + 1 :])), f"[{n}] {said}", inside
    if isinstance(value, list | tuple) and rng.random() < 0.5:
        other = rng.choice((value[:-1], value + value, value[::-1]))
        return other, f"{len(value)} items -> {len(other)}", False
    if isinstance(value, dict) and value:
        key = rng.choice(list(value))
        edited, said, inside = _edited(value[key], rng)
        return {**value, key: edited}, f"[{key!r}] {said}", inside
    other = rng.choice(VALUES)
    return other, f"{short_text(value)} -> {short_text(other)}", False


def _edited_field(value: Any, rng: Random) -> tuple[Any, str]:
    field = rng.choice(fields(value)).name
    edited, said, _ = _edited(getattr(value, field), rng)
    try:
        return replace(value, **{field: edited}), f".{field} {said}"
    except (SkillError, *ORDINARY) as error:  # the dataclass refuses it
        return value, f".{field} {said}, refused: {str(error)[:60]}"


def other_form(array: Array, rng: Random) -> tuple[Any, str]:
    """Return the same numbers in another form."""
    if array.ndim == 0 or array.dtype.kind not in "fi":
        return array, "as it is"
    spread = np.zeros((*array.shape[:-1], 2 * array.shape[-1]), array.dtype)
    spread[..., ::2] = array
    raw = np.zeros(array.nbytes + 1, np.uint8)
    shifted = raw[1:].view(array.dtype).reshape(array.shape)
    shifted[...] = array
    closed = array.copy()
    closed.setflags(write=False)
    forms = {
        "strided": spread[..., ::2],
        "unaligned": shifted,
        "read-only": closed,
        "Fortran order": np.asfortranarray(array),
        "big-endian": array.astype(array.dtype.newbyteorder(">")),
        "negative strides": array[::-1].copy()[::-1],
        "a list": array.tolist(),
        "a masked array": np.ma.masked_array(array, np.zeros(array.shape, bool)),
        "a broadcast": np.broadcast_to(array, (1, *array.shape))[0],
        "objects": array.astype(object),
    }
    name = rng.choice(list(forms))
    return forms[name], name


def other_kind(array: Array, rng: Random) -> tuple[Any, str]:
    """Return a value that is not an array of numbers."""
    if array.dtype.kind not in "fiu":
        return array.tolist(), "a list"
    kinds: dict[str, Callable[[], Any]] = {
        "masked": lambda: np.ma.masked_array(array, np.ones(array.shape, bool)),
        "ragged": lambda: [*array.tolist(), [1.0]] if array.ndim else [array.tolist(), [1.0, [2.0]]],
        "texts": lambda: array.astype(str),
        "complex": lambda: array + 1j,
        "dates": lambda: np.zeros(array.shape, "M8[s]"),
        "objects with None": lambda: np.full(array.shape, None),
        "booleans": lambda: array > 0,
        "a huge whole number": lambda: np.full(array.shape, 10**400, dtype=object),
        "NaN": lambda: np.full(array.shape, np.nan),
        "empty": lambda: np.zeros((0, *array.shape[1:])),
        "many axes": lambda: array.reshape(*array.shape, *[1] * 20),
    }
    name = rng.choice(list(kinds))
    return kinds[name](), name


def call_function(call: Call) -> Any:
    """Return the call and its result, or raise SkillError if it is refused."""
    function, strict = function_named(call.name), call.name in STRICT and not call.inside
    before = {key: value.copy() for key, value in call.arguments.items() if isinstance(value, np.ndarray)}
    with warnings.catch_warnings():
        warnings.simplefilter("error" if strict else "ignore")
        try:
            result = function(**call.arguments)
            if hasattr(result, "__next__"):
                result = tuple(result)
        except SkillError:
            raise
        except ORDINARY as error:
            if strict:
                raise
            result = error
        finally:
            _require_unchanged(before, call)
    if isinstance(result, ORDINARY):
        raise SkillError("refused as Python and NumPy refuse")
    return call, result


def _require_unchanged(before: dict[str, Array], call: Call) -> None:
    for key, value in before.items():
        if not _equal(value, call.arguments[key]):
            raise InvariantViolation(f"{call.name} changed its argument {key}")


def _equal(a: Array, b: Array) -> bool:
    if a.dtype == object:
        return all(one is other for one, other in zip(a.flat, b.flat, strict=True))
    a, b = np.asarray(a), np.asarray(b)  # masked arrays convert what they fill gaps with, and warn
    return a.shape == b.shape and a.tobytes() == b.tobytes()


def use_result(value: tuple[Call, Any], thorough: bool) -> None:
    """Check that a strict function's result is sound, and equal to the example's for equal arguments."""
    call, result = value
    if call.same:
        require_alike(result, expected(call.name), call.name)
    if call.name in STRICT and not call.inside:
        require_sound(result, call.name)


@cache
def expected(name: str) -> Any:
    """Return the result for the example's arguments."""
    arguments = next(given[name] for package in EXAMPLES if name in (given := examples(package)))
    result = function_named(name)(**_fresh(arguments))
    return tuple(result) if hasattr(result, "__next__") else result


def _fresh(arguments: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments with new random number generators."""
    return {
        key: np.random.default_rng(0) if isinstance(value, np.random.Generator) else value
        for key, value in arguments.items()
    }


def require_alike(a: Any, b: Any, place: str) -> None:
    """Check that results are equal up to rounding: strides may change the order of sums."""
    if isinstance(a, np.ndarray) and a.dtype.kind in "fiub":
        if a.shape != np.shape(b) or not np.allclose(a, b, rtol=1e-7, atol=1e-9, equal_nan=True):
            raise InvariantViolation(f"{place} depends on the form of its arguments")
    elif isinstance(a, float):
        if not np.isclose(a, b, rtol=1e-7, atol=1e-9, equal_nan=True):
            raise InvariantViolation(f"{place} depends on the form of its arguments")
    elif is_dataclass(a) and not isinstance(a, type):
        for field in fields(a):
            require_alike(getattr(a, field.name), getattr(b, field.name), place)
    elif isinstance(a, list | tuple) and isinstance(b, list | tuple):
        if len(a) != len(b):
            raise InvariantViolation(f"{place} depends on the form of its arguments")
        for one, other in zip(a, b, strict=True):
            require_alike(one, other, place)


def _target(package: str) -> Target:
    given = examples(package)
    slow = {"select", "relevance", "select_by_reproduction", "held_out_errors"}
    names = [name for name in given if name.rpartition(".")[2] not in slow or package == "models"]
    bases = [Call(name, given[name]) for name in names]

    def write(call: Call) -> Call:
        return replace(call, arguments=_fresh(call.arguments))

    return Target(bases, edit_call, write, call_function, use_result)


def _maker(package: str) -> Callable[[], Target]:
    return lambda: _target(package)


SHARES = {
    "geometry": 2.0,
    "gaussians": 2.0,
    "models": 0.7,
    "models.online": 1.0,
    "control": 1.5,
    "planning": 1.5,
}
TARGETS: dict[str, tuple[Callable[[], Target], float]] = {
    f"{package}()": (_maker(package), SHARES.get(package, 0.05 if package == "plots" else 0.5))
    for package in EXAMPLES
}
