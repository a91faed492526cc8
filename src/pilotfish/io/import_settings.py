"""Settings of an import as a commented TOML file, which a person edits and `data import --settings` reads."""

import json
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pilotfish.demonstrations import BuildSettings, FrameSource, PartSource, Quantity, Recording
from pilotfish.errors import InvalidInput
from pilotfish.io.paths import read_file
from pilotfish.validation import require_table, require_type, short_repr

MAX_SETTINGS_BYTES = 2**20
SETTINGS_ATTRIBUTE = "pilotfish import settings"  # of a recording
PART_KEYS = ("name", "quantity", "columns", "unit", "representation")
FRAME_KEYS = ("name", "position", "orientation", "representation", "unit", "angle_unit", "moving")
LIMIT_KEYS = ("unwrap", "thin", "max_gap", "still_distance", "still_angle")
HEAD = """# How recordings become demonstrations. Edit it, then: pilotfish data import SOURCE --settings THIS
# A column is named as in the file, or SIGNAL:COLUMN where two signals have such a column; * and ? match any.
# Units: m cm mm in, rad deg, s ms us ns, N; "" for the unit that the file states, or SI.
# Representations of an orientation: wxyz, xyzw (quaternions), rpy, yaw, matrix (by rows), rotation vector.
# Quantities: position, quaternion, vector (a force), scalar (a joint, a gripper).
"""


def format_import_settings(settings: BuildSettings, questions: Sequence[str] = ()) -> str:
    """Return the text of a settings file, with comments.

    Args:
        settings: Settings of `build_demonstration`.
        questions: What the user must decide; they become comments.
    """
    lines = [HEAD]
    lines += [f"# To decide: {question}" for question in questions]
    if settings.period is None:
        lines.append("# period = 0.01  # time between two rows [s]; without it, that of the recordings")
    else:
        lines.append(f"period = {settings.period!r}  # time between two rows [s]")
    if settings.unwrap is not None:
        names = json.dumps(list(settings.unwrap), ensure_ascii=False)
        lines.append(f"unwrap = {names}  # parts from which jumps of 2 pi are removed")
    if not settings.thin:
        lines.append("thin = false  # keep rows that repeat the row before")
    lines.append(f"# max_gap = {settings.max_gap!r}  # longest gap that is interpolated, in periods")
    for part in settings.parts:
        values = {**{key: getattr(part, key) for key in PART_KEYS}, "quantity": part.quantity.value}
        lines += ["", "[[part]]  # columns of a demonstration, in order", *_format_table(values)]
    for frame in settings.frames:
        values = {key: getattr(frame, key) for key in FRAME_KEYS}
        lines += ["", "[[frame]]  # pose of an object", *_format_table(values)]
    return "\n".join(lines) + "\n"


def read_import_settings(path: Path) -> BuildSettings:
    """Return the settings of an import from a file.

    Args:
        path: TOML file, as `format_import_settings` writes it.

    Raises:
        InvalidInput: If the file cannot be used; the message names the key and the nearest fix.
    """
    return _parse_settings(
        read_file(path, "a TOML file with the settings of an import", MAX_SETTINGS_BYTES), str(path)
    )


def stated_import_settings(recording: Recording) -> BuildSettings | None:
    """Return the settings that a recording states itself, as one from a folder of demonstrations does.

    Args:
        recording: Recording.

    Raises:
        InvalidInput: If it states settings that cannot be used.
    """
    require_type(recording, "recording", Recording, "read one with io.readers.read_recordings")
    text = recording.attributes.get(SETTINGS_ATTRIBUTE)
    return None if text is None else _parse_settings(text.encode(), f"recording {recording.name!r}")


def _parse_settings(data: bytes, path: str) -> BuildSettings:
    try:
        content = tomllib.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:  # TOML and UTF-8 errors are ValueErrors
        raise InvalidInput(f"{path}: not TOML that can be read: {error}") from error
    require_table(content, path, (), ("period", "part", "frame", *LIMIT_KEYS))
    parts = [
        _parse_part(item, f"{path}: part {n}")
        for n, item in enumerate(_require_list(content.get("part", []), f"{path}: part"))
    ]
    frames = [
        FrameSource(**_read_table(item, FRAME_KEYS, ("name", "position"), f"{path}: frame {n}"))
        for n, item in enumerate(_require_list(content.get("frame", []), f"{path}: frame"))
    ]
    limits = {key: content[key] for key in LIMIT_KEYS if key in content}
    if isinstance(limits.get("unwrap"), list):
        limits["unwrap"] = tuple(limits["unwrap"])
    if not parts:
        raise InvalidInput(f"{path} has no parts, expected [[part]] with name, quantity and columns")
    return BuildSettings(tuple(parts), tuple(frames), content.get("period"), **limits)


def _format_table(values: dict[str, Any]) -> list[str]:
    """Return the lines of a table; empty values are left out."""
    items = {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}
    return [
        f"{key} = {json.dumps(value, ensure_ascii=False)}"
        for key, value in items.items()
        if value not in ("", [])
    ]


def _parse_part(item: object, label: str) -> PartSource:
    table = _read_table(item, PART_KEYS, ("name", "quantity", "columns"), label)
    known = {quantity.value: quantity for quantity in Quantity}
    if table["quantity"] not in list(known):
        raise InvalidInput(
            f"{label}: quantity is {short_repr(table['quantity'])}, expected one of {', '.join(known)}"
        )
    return PartSource(**{**table, "quantity": known[table["quantity"]]})


def _read_table(item: object, known: Sequence[str], needed: Sequence[str], label: str) -> dict[str, Any]:
    """Return a table with tuples in place of lists."""
    table = require_table(item, label, needed, known)
    return {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}


def _require_list(value: object, label: str) -> list[Any]:
    if not isinstance(value, list):
        raise InvalidInput(f"{label} is {short_repr(value)}, expected tables such as [[part]]")
    return value
