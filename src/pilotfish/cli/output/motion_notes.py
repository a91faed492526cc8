"""Notes about a motion that only the command line gives, and the options that notes name."""

import re

import numpy as np

from pilotfish.models import AdaptedSkill


def final_states(model: AdaptedSkill) -> list[int]:
    """Return the states without transitions to other states; a cyclic skill has none."""
    return np.flatnonzero(model.dynamics.final_states()).tolist()


def reaches_final_state(model: AdaptedSkill, last: int) -> bool | None:
    """Return whether a plan that ends in state last ends in a final state; None if the skill has none."""
    finals = final_states(model)
    return last in finals if finals else None


def end_notes(model: AdaptedSkill, last: int) -> list[str]:
    """Return a note if a plan that ends in state last ends before the skill does."""
    if reaches_final_state(model, last) is not False:
        return []
    names = " or ".join(map(str, final_states(model)))
    return [f"the motion ends in state {last}, before the final state {names}; pass a longer --horizon"]


def option_name(argument: str) -> str:
    """Return the option of `reproduce` and `perform` for an argument in Python."""
    return f"--{argument.replace('_', '-')}"


def name_options(note: str) -> str:
    """Return a note of a fit in which arguments in Python are replaced by options of `learn`."""
    return re.sub(r"\bregularisation\b(?= is |,)", "--regularisation", note)
