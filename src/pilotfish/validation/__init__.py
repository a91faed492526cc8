"""Checks of what comes from outside: bounded numbers, printable text and guarded paths. Every reader of
files, messages and users' arrays uses them.
"""

from pilotfish.validation.numbers import (
    MAX_FLOAT,
    MAX_MAGNITUDE,
    finite_array,
    float_array,
    numeric_array,
    require_bounded,
    require_count,
    require_number,
    require_shapes_agree,
)
from pilotfish.validation.text import (
    MAX_NAME_LENGTH,
    escape,
    first_duplicate,
    nearest_name,
    require_printable,
    short_list,
    short_repr,
)

__all__ = [
    "MAX_FLOAT",
    "MAX_MAGNITUDE",
    "MAX_NAME_LENGTH",
    "escape",
    "finite_array",
    "first_duplicate",
    "float_array",
    "nearest_name",
    "numeric_array",
    "require_bounded",
    "require_count",
    "require_number",
    "require_printable",
    "require_shapes_agree",
    "short_list",
    "short_repr",
]
