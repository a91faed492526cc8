"""Every public value has a repr of one line that fits a terminal, whatever it holds."""

import importlib
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from types import UnionType
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.demonstrations import pose_layout
from pilotfish.models import adapt, learn
from pilotfish.planning import reproduce
from pilotfish.validation import shorten_repr

MAX_LENGTH = 300


class Colour(Enum):
    RED = 1


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    means: Any
    number: Any = 1.0 / 3.0


@shorten_repr
class Pair(NamedTuple):
    left: Any
    right: Any


def public_values() -> Iterator[type]:
    """Yield each dataclass and named tuple that a public package exports."""
    seen: set[type] = set()
    for module in pkgutil.walk_packages(pf.__path__, "pilotfish."):
        if not module.ispkg or module.name.startswith("pilotfish.cli"):
            continue
        package = importlib.import_module(module.name)
        for name in getattr(package, "__all__", ()):
            kind = getattr(package, name)
            if (
                isinstance(kind, type)
                and (is_dataclass(kind) or hasattr(kind, "_fields"))
                and kind not in seen
            ):
                seen.add(kind)
                yield kind


PUBLIC_VALUES = sorted(public_values(), key=lambda kind: (kind.__module__, kind.__qualname__))


def field_names(kind: type) -> list[str]:
    return [field.name for field in fields(kind)] if is_dataclass(kind) else list(kind._fields)


def large_content(hint: Any, depth: int = 2) -> object:
    """Return a large value of the type of a field, an array where the type is not known."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint in (float, int):
        return hint(1e17 / 3.0)
    if hint in (str, bool):
        return hint("demonstration of a task " * 3)
    if origin in (Union, UnionType):
        return large_content(arguments[0], depth)
    if origin is Literal:
        return arguments[0]
    if origin is tuple:
        return tuple(large_content(item, depth) for item in arguments[:1] * 3 if item is not ...)
    if origin in (dict, Mapping):
        return {f"name {n}": large_content(arguments[1], depth) for n in range(4)}
    if origin in (type, Callable) or hint is Callable:
        return large_content
    if isinstance(hint, type) and issubclass(hint, Enum):
        return next(iter(hint))
    if isinstance(hint, type) and is_dataclass(hint) and depth:  # a value may hold values of its own type
        return filled(hint, depth - 1)
    return np.random.default_rng(0).normal(size=(3, 40, 16))


def filled(kind: type, depth: int = 2) -> object:
    """Return a value with large contents, which need not be valid."""
    hints = get_type_hints(kind)
    contents = [large_content(hints[name], depth) for name in field_names(kind)]
    if not is_dataclass(kind):
        return kind(*contents)
    value = object.__new__(kind)
    for name, content in zip(field_names(kind), contents, strict=True):
        object.__setattr__(value, name, content)
    return value


def test_public_values_are_found():
    names = {kind.__name__ for kind in PUBLIC_VALUES}
    assert {"Fit", "Skill", "AdaptedSkill", "Reproduction", "Reference", "Motion", "Feedback"} <= names
    assert {"Demonstration", "Frame", "MovingFrame", "GaussianMixture", "DenseCovariances"} <= names
    assert {"MarkovChain", "SemiMarkovChain", "NegativeBinomial", "OnlineModel", "EStep"} <= names
    assert len(names) > 60


@pytest.mark.parametrize("kind", PUBLIC_VALUES, ids=lambda kind: kind.__name__)
def test_public_value_repr_is_one_short_line(kind: type):
    text = repr(filled(kind))
    assert text.startswith(kind.__name__)
    assert "\n" not in text
    assert len(text) <= MAX_LENGTH, text


def test_learned_values_repr_states_shapes():
    demonstrations = pf.io.synthetic_valve(np.random.default_rng(0))[:2]
    fit = learn(demonstrations, states=3, rng=np.random.default_rng(0))
    skill, columns = fit.skill, fit.skill.width
    P = len(skill.frame_names)
    for value in (
        fit,
        skill,
        fit.convergence,
        demonstrations[0],
        demonstrations[0].frames[0],
        skill.dynamics,
    ):
        assert len(repr(value)) <= 200
        assert "\n" not in repr(value)
    assert f"means=array({P} x 3 x {columns})" in repr(skill)
    assert "dynamics=SemiMarkovChain(...)" in repr(skill)
    assert f"period={skill.period:g}" in repr(skill)
    assert (
        repr(fit)
        == "Fit(skill=Skill(...), markov_skill=Skill(...), convergence=Convergence(...), active_bounds=[])"
    )


def test_reproduction_repr_is_short():
    demonstrations = pf.io.synthetic_valve(np.random.default_rng(0))[:2]
    skill = learn(demonstrations, states=3, rng=np.random.default_rng(0)).skill
    assert repr(adapt(skill, demonstrations[0].frames)).startswith(
        "AdaptedSkill(dynamics=SemiMarkovChain(...)"
    )
    result = reproduce(skill, demonstrations[0].frames, horizon=10)
    for value in (result, result.motion, result.reference, result.feedback, result.feedback.system):
        assert len(repr(value)) <= 200


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (np.array([1.0, 2.5]), "[1, 2.5]"),
        (np.zeros(8), "array(8)"),
        (np.zeros((2, 3)), "array(2 x 3)"),
        (None, "None"),
        (12, "12"),
        ("grip", "'grip'"),
        (Colour.RED, "RED"),
        (("a", "b"), "['a', 'b']"),
        ((np.zeros(2),) * 3, "[3 x ndarray]"),
        ({"a": 1}, "{1 entries}"),
        (pose_layout().parts, "[position, orientation]"),
        (Sample(np.zeros(2)), "Sample(...)"),
        (Sample(1, "a"), "Sample(means=1, number='a')"),
        (len, "len"),
        (dict, "dict"),
    ],
)
def test_shorten_repr_describes_content(content: object, text: str):
    assert repr(Sample(content)) == f"Sample(means={text}, number=0.333333)"
    assert repr(Pair(content, 1)) == f"Pair(left={text}, right=1)"


def test_shorten_repr_describes_a_masked_array():
    masked = np.ma.masked_array(np.zeros(2), [True, False])
    assert repr(Sample(masked)) == "Sample(means=array(2), number=0.333333)"


def test_shorten_repr_marks_fields_left_out():
    long = tuple("x" * 10 for _ in range(4))
    kind = shorten_repr(NamedTuple("Long", [(f"field_{n}", Any) for n in range(10)]))
    text = repr(kind(*[long] * 10))
    assert len(text) <= 200
    assert text.startswith("Long(field_0=[")
    assert text.endswith(", ...)")
