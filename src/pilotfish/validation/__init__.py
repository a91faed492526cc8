"""Checks of what comes from outside: bounded numbers, printable text and guarded paths. Every reader of
files, messages and users' arrays uses them.
"""

from pilotfish.validation.numbers import (
    LARGEST_FLOAT,
    LARGEST_MAGNITUDE,
    finite_array,
    float_array,
    numeric_array,
    refuse_huge,
    require_count,
    require_number,
    require_shapes_agree,
)
from pilotfish.validation.paths import (
    LARGEST_FILE,
    is_file,
    is_folder,
    is_link,
    open_regular_file,
    path_exists,
    read_file,
    resolve_path,
)
from pilotfish.validation.text import (
    LONGEST_NAME,
    escape,
    first_repeated,
    nearest_name,
    require_printable,
    short_list,
    short_repr,
)

__all__ = [
    "LARGEST_FILE",
    "LARGEST_FLOAT",
    "LARGEST_MAGNITUDE",
    "LONGEST_NAME",
    "escape",
    "finite_array",
    "first_repeated",
    "float_array",
    "is_file",
    "is_folder",
    "is_link",
    "nearest_name",
    "numeric_array",
    "open_regular_file",
    "path_exists",
    "read_file",
    "refuse_huge",
    "require_count",
    "require_number",
    "require_printable",
    "require_shapes_agree",
    "resolve_path",
    "short_list",
    "short_repr",
]
