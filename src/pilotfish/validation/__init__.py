"""Checks of what comes from outside: bounded numbers, printable text and guarded paths. Every reader of
files, messages and users' arrays uses them.
"""

from pilotfish.validation.numbers import (
    LARGEST_MAGNITUDE,
    finite_array,
    numeric_array,
    require_count,
    require_number,
)
from pilotfish.validation.paths import (
    LARGEST_FILE,
    is_file,
    is_folder,
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
    "LARGEST_MAGNITUDE",
    "LONGEST_NAME",
    "escape",
    "finite_array",
    "first_repeated",
    "is_file",
    "is_folder",
    "nearest_name",
    "numeric_array",
    "open_regular_file",
    "path_exists",
    "read_file",
    "require_count",
    "require_number",
    "require_printable",
    "resolve_path",
    "short_list",
    "short_repr",
]
