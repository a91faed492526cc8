"""Checks of data from outside: bounded numbers, printable text and types, and short representations.

Every reader of files and messages, and every public function that takes a user's array, uses these checks.
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
    require_period,
    require_shapes_agree,
)
from pilotfish.validation.representation import shorten_repr
from pilotfish.validation.tables import require_table
from pilotfish.validation.text import (
    MAX_NAME_LENGTH,
    first_duplicate,
    nearest_name,
    require_name,
    require_printable,
    short_list,
    short_repr,
)
from pilotfish.validation.types import require_type

__all__ = [
    "MAX_FLOAT",
    "MAX_MAGNITUDE",
    "MAX_NAME_LENGTH",
    "finite_array",
    "first_duplicate",
    "float_array",
    "nearest_name",
    "numeric_array",
    "require_bounded",
    "require_count",
    "require_name",
    "require_number",
    "require_period",
    "require_printable",
    "require_shapes_agree",
    "require_table",
    "require_type",
    "short_list",
    "short_repr",
    "shorten_repr",
]
