"""One argument has one kind: what is of another kind is refused in words that say what to write instead."""

from collections.abc import Sequence
from numbers import Integral, Real

import numpy as np

from pilotfish.control import Feedback, Motion, Reference
from pilotfish.demonstrations import Frame, MovingFrame
from pilotfish.errors import InvalidInput
from pilotfish.models import AdaptedSkill, Fit, FrameRelevance, Skill

# What to write, where the one was given and the other belongs.
CONVERSION_HINTS = {
    (Fit, Skill): "fit.skill is one",
    (Fit, AdaptedSkill): "adapt(fit.skill, frames) makes one",
    (Skill, AdaptedSkill): "adapt(skill, frames) makes one",
    (AdaptedSkill, Skill): "give the skill as it was before adapt",
    (Skill, Fit): "learn makes one",
    (Skill, FrameRelevance): "relevance(skill, demonstrations) makes one",
    (Reference, Motion): "track(system, reference, control_cost).rollout(start) makes one",
    (Feedback, Motion): "feedback.rollout(start) makes one",
    (Reference, Feedback): "track(system, reference, control_cost) makes one",
    (Motion, Feedback): "give what it was rolled out from",
    (MovingFrame, Frame): "frame.at(t) is one",
}


def require_type(what: str, value: object, *types: type) -> None:
    if isinstance(value, types):
        return
    hints = [
        hint
        for (given, expected_type), hint in CONVERSION_HINTS.items()
        if isinstance(value, given) and expected_type in types
    ]
    wanted = " or ".join(_with_article(expected_type.__name__) for expected_type in types)
    raise InvalidInput(
        "; ".join([f"{what} is {_with_article(type(value).__name__)}, expected {wanted}", *hints[:1]])
    )


def require_sequence(what: str, values: object, expected_type: type) -> None:
    """A sequence of one kind; a single one is not taken for a sequence, nor a text for one of letters."""
    if isinstance(values, str):
        raise InvalidInput(f"{what} is the text {values!r}, expected a list of names; write [{values!r}]")
    name = expected_type.__name__
    if isinstance(values, expected_type):
        raise InvalidInput(
            f"{what} is {_with_article(name)}, expected a list of them; write [{name.lower()}]"
        )
    if not isinstance(values, Sequence):
        raise InvalidInput(f"{what} is {_with_article(type(values).__name__)}, expected a list of {name}")
    for n, value in enumerate(values):
        require_type(f"{what}[{n}]", value, expected_type)


def require_column_pairs(what: str, values: object) -> None:
    """A sequence of pairs of names; a single pair is not taken for a sequence."""
    texts = isinstance(values, Sequence) and all(isinstance(value, str) for value in values)
    if texts and values and not isinstance(values, str):
        raise InvalidInput(f"{what} is {values!r}, expected a list of pairs of names; write [{values!r}]")
    if isinstance(values, str) or not isinstance(values, Sequence):
        raise InvalidInput(f"{what} is {values!r}, expected a list of pairs of column names: [(name, name)]")
    for n, pair in enumerate(values):
        if not (isinstance(pair, tuple) and len(pair) == 2 and all(isinstance(name, str) for name in pair)):
            raise InvalidInput(f"{what}[{n}] is {pair!r}, expected a pair of column names: (name, name)")


def require_array(what: str, value: object, axes: str, expected_type: type, fix: str) -> None:
    """An array of so many axes whose entries are of a kind of numpy's, such as np.integer."""
    if not isinstance(value, np.ndarray):
        raise InvalidInput(
            f"{what} is {_with_article(type(value).__name__)}, expected an array {axes}; {fix}"
        )
    if value.ndim != len(axes.split()) or not np.issubdtype(value.dtype, expected_type):
        actual = f"has shape {value.shape} and entries {value.dtype}"
        raise InvalidInput(
            f"{what} {actual}, expected {expected_type.__name__} entries and axes {axes}; {fix}"
        )


def require_integer(what: str, value: object) -> None:
    if isinstance(value, Integral) and not isinstance(value, bool):
        return
    nearest = round(float(value)) if isinstance(value, Real) and np.isfinite(float(value)) else 200
    raise InvalidInput(f"{what} is {value!r}, expected a whole number of steps such as {nearest}")


def require_number(what: str, value: object) -> None:
    if not isinstance(value, Real):
        raise InvalidInput(f"{what} is {value!r}, expected a number")


def _with_article(name: str) -> str:
    return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
