"""Inputs that fuzzing found to be answered with something else than a refusal in one line."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from annotations import annotations_checked
from fuzzing.public_examples import Examples, examples, function_named
from fuzzing.soundness import require_sound_refusal

from pilotfish.errors import SkillError

# A function, one of its arguments, and the value that it is to refuse.
CALLS: list[tuple[str, str, Any]] = [
    ("demonstrations.demonstration", "layout", "pose"),
    ("demonstrations.demonstration", "frames", 3),
    ("demonstrations.continuous_quaternions", "layout", True),
    ("models.online.observe", "model", "a model"),
    ("models.online.observe", "x", np.array(["0.1", "0.2"])),
    ("models.online.observe", "x", np.array([True, False])),
    ("models.online.observe_stream", "model", []),
    ("models.online.observe_stream", "x", np.full((3, 2), 1j)),
    ("models.online.observe_stream", "x", np.ma.masked_array(np.ones((3, 2)), True)),
    ("models.online.observe_demonstration", "model", None),
    ("planning.plan", "start", np.array(["a", "b", "c", "d"])),
    ("planning.planned_states", "start", np.full(4, None)),
    ("planning.chart", "at", np.zeros(13, "M8[s]")),
]


@cache
def _examples(package: str) -> Examples:
    return examples(package)


@pytest.mark.parametrize(("name", "argument", "value"), CALLS)
def test_argument_that_cannot_be_is_refused_in_one_line(name: str, argument: str, value: Any) -> None:
    """With annotations unchecked, as they are outside the tests."""
    given = _examples(name.rpartition(".")[0])[name]
    assert argument in given
    with annotations_checked(False), pytest.raises(SkillError) as refusal:
        function_named(name)(**{**given, argument: value})
    require_sound_refusal(refusal.value)
