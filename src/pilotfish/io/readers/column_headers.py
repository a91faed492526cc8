"""Names of columns and arrays in files: units in brackets or after an underscore, and names of times."""

import re
from collections.abc import Sequence

import numpy as np

from pilotfish.demonstrations import is_unit, parse_unit, time_unit
from pilotfish.errors import InvalidInput
from pilotfish.io.readers.read_options import ReadOptions
from pilotfish.types import Array, Float

TIME_WORDS = {
    "time", "times", "timestamp", "timestamps", "stamp", "t", "rosbagtimestamp", "datetime",
    "zeit", "zeitstempel", "tiempo",
}  # fmt: skip
TIME_NAMES = {"sec", "secs", "second", "seconds", "temps", "tempo"}  # alone, and if no other name is of times
SECOND_NAMES = {"sec", "secs", "second", "seconds"}  # also the unit after an underscore, as in "time_seconds"
SECONDS, NANOSECONDS = {"sec", "secs"}, {"nsec", "nsecs", "nanosec", "nanosecs"}
UNIT_ENDINGS = {"mm", "cm", "deg", "rad", "ms", "us", "ns", "sec"}  # after an underscore, as in "x_mm"
_BRACKETS = re.compile(r"(?P<name>.*\S)(?P<blank>\s*)(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))")


def split_unit(header: str) -> tuple[str, str]:
    """Return the name and the unit of a header: "x [mm]", "x (mm)" or "x_mm" is x in mm.

    Square brackets contain a unit unless they contain a number, as in "joint[0]"; " [1]" after a blank is the
    unit of plain numbers. Round brackets and endings after an underscore do if it is a known unit. The
    names "secs" and "time_s" state seconds.

    Args:
        header: Name as in the file.
    """
    if match := _BRACKETS.fullmatch(header.strip()):
        square, inner = match["square"], match["square"] or match["round"] or ""
        unit = inner.strip()
        is_index = unit.isdigit() and not (unit == "1" and match["blank"])
        if unit and not is_index and (square is not None or is_unit(unit)):
            return match["name"].strip(), unit
    name, _, ending = header.strip().rpartition("_")
    if header.strip().lower() in SECOND_NAMES:
        return ending, "s"
    if ending.lower() in SECOND_NAMES | {"s"} and is_time_name(name):
        return name, "s"
    if name and ending.lower() in UNIT_ENDINGS:
        return name, ending.lower()
    return header.strip(), ""


def is_time_name(name: str) -> bool:
    """Return whether a name without its unit is that of times.

    Args:
        name: Name of a column or array.
    """
    words = [word for word in re.split(r"[\s._/%:\-]+", name.lower()) if word]
    return bool(words) and words[-1] in TIME_WORDS


def seconds_pair(names: Sequence[str]) -> tuple[int, int] | None:
    """Return the columns of seconds and nanoseconds that ROS writes for a time; None if they are missing.

    Args:
        names: Names of the columns.
    """
    last = [re.split(r"[\s._/:]+", name.lower())[-1] for name in names]
    seconds = [n for n, word in enumerate(last) if word in SECONDS]
    nanoseconds = [n for n, word in enumerate(last) if word in NANOSECONDS]
    return (seconds[0], nanoseconds[0]) if seconds and nanoseconds else None


def find_time_column(names: Sequence[str], options: ReadOptions, file: str) -> int | None:
    """Return the number of the column of times, None if the file has none.

    Args:
        names: Names of the columns without units.
        options: Name of the column, if it is stated.
        file: Name of the file, for messages.

    Raises:
        InvalidInput: If the stated column is missing.
    """
    if options.time_column:
        if options.time_column in names:
            return names.index(options.time_column)
        raise InvalidInput(
            f"{file} has no column {options.time_column!r} for the times, expected one of "
            f"{', '.join(names[:10])}"
        )
    found = [n for n, name in enumerate(names) if is_time_name(name)]
    found += [n for n, name in enumerate(names) if name.lower() in TIME_NAMES]
    return found[0] if found else None


def to_seconds(times: Float[Array, " T"], unit: str, options: ReadOptions, label: str) -> Float[Array, " T"]:
    """Return times in seconds.

    Args:
        times: Times in the unit of the file.
        unit: Unit that the file states; may be empty.
        options: Unit of the times, if it is stated.
        label: Name of the column; messages begin with it.

    Raises:
        InvalidInput: If the unit is not one of time or cannot be recognised; see `demonstrations.time_unit`.
    """
    factor = parse_unit(time_unit(times, options.time_unit or unit, label), label).factor
    return times if factor == 1.0 else np.asarray(times * factor)
