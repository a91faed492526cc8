"""Strict reading of TOML files that a person writes: every message names the place, the value and the fix."""

import tomllib
from typing import Any

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, pose
from pilotfish.validation import require_count, short_repr

MAX_BYTES = 2**20  # of a file of markers or of a camera
IDENTITY = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))  # position and quaternion


def parse_toml(data: bytes, name: str, file_format: str, version: int) -> dict[str, Any]:
    """Return the content of a TOML file with the keys format and version, which are checked.

    Args:
        data: Content of the file.
        name: Name of the file; messages begin with it.
        file_format: Expected value of the key format.
        version: Newest version that can be read.

    Raises:
        InvalidInput: If it is not TOML, or has another format or version.
    """
    try:
        table = tomllib.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InvalidInput(f"{name}: byte {error.start} is not UTF-8 text; save the file as UTF-8") from error
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"{name}: not TOML that can be read: {error}; correct that line") from error
    if table.get("format") != file_format:
        found = short_repr(table.get("format"))
        raise InvalidInput(f'{name}: format is {found}, expected format = "{file_format}"')
    found_version = require_count(table.get("version"), f"{name}: version", 2**31, 1)
    if found_version > version:
        raise InvalidInput(
            f"{name}: written by a newer version (format {found_version}, this one reads {version}); "
            "upgrade pilotfish"
        )
    return {key: value for key, value in table.items() if key not in ("format", "version")}


def require_list(value: object, label: str) -> list[Any]:
    """Return a list that is not empty.

    Args:
        value: Value to check.
        label: Place in the file; messages begin with it.

    Raises:
        InvalidInput: If it is another type, or empty.
    """
    if not isinstance(value, list) or not value:
        raise InvalidInput(f"{label} is {short_repr(value)}, expected a list with at least one entry")
    return value


def parse_pose(table: dict[str, Any], label: str) -> Pose:
    """Return the pose of the keys position and quaternion; a missing one is that of the identity.

    Args:
        table: Table that may have these keys.
        label: Place in the file; messages begin with it.

    Raises:
        InvalidInput: If one cannot be used.
    """
    try:
        return pose(table.get("position", IDENTITY[0]), table.get("quaternion", IDENTITY[1]))
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error
