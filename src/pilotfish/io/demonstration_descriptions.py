"""Description of a demonstration as JSON, which exports carry so that an import is exact.

Formats of other projects have no place for a layout, for frames or for a period that is not a whole rate. The
description has these, the name, and the signal and column where each column of the layout is stored. Numbers
are restored bit by bit: JSON has the shortest digits of a float64, and moving frames are base64 of
little-endian float64, all A and then all b.
"""

import base64
import binascii
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    Layout,
    MovingFrame,
    Recording,
    demonstration,
    frame,
    moving_frame,
)
from pilotfish.errors import InvalidInput
from pilotfish.io.skill_fields import decode_layout, encode_layout, pop_field, pop_list, reject_unknown_fields
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_period, require_printable, short_repr

KEY = "pilotfish"  # of the attribute, data set or file that has the description
VERSION = 1
MAX_DESCRIPTION_BYTES = 2**28
MAX_STEPS = 2**24
Columns = Sequence[tuple[str, int]]


def describe_demonstration(demo: Demonstration, columns: Columns) -> str:
    """Return the description of a demonstration.

    Args:
        demo: Demonstration that is exported.
        columns: Name of the signal, and number of the column in it, where each column of x is stored.

    Raises:
        InvalidInput: If its moving frames are too large to be read again.
    """
    description = {
        "version": VERSION,
        "name": demo.name,
        "period": demo.period,
        "layout": encode_layout(demo.layout),
        "columns": [list(column) for column in columns],
        "frames": [_encode_frame(given) for given in demo.frames],
    }
    text = json.dumps(description, separators=(",", ":"), allow_nan=False)
    if len(text) > MAX_DESCRIPTION_BYTES:
        raise InvalidInput(
            f"demonstration {demo.name!r}: its frames take {len(text)} bytes, expected at most "
            f"{MAX_DESCRIPTION_BYTES}; split it"
        )
    return text


def restore_demonstration(recording: Recording) -> Demonstration | None:
    """Return the demonstration that a recording was exported from, equal number for number.

    Args:
        recording: Recording that a reader returned, with all its signals.

    Returns:
        The demonstration, or None if the file was not written by this project.

    Raises:
        InvalidInput: If the description is damaged or contradicts the signals.
    """
    if (text := recording.attributes.get(KEY)) is None:
        return None
    try:
        description = json.loads(text)
        version = pop_field(description, "version", "it")
        if version != VERSION or isinstance(version, bool):
            raise InvalidInput(f"its version is {short_repr(version)}, expected {VERSION}; upgrade pilotfish")
        return _build(description, recording)
    except InvalidInput as error:
        raise _unusable(recording, error) from error
    except (ValueError, RecursionError) as error:
        raise _unusable(recording, error) from error


def _unusable(recording: Recording, error: Exception) -> InvalidInput:
    return InvalidInput(
        f"recording {recording.name!r}: the description in {KEY!r} cannot be used: {error}; export it again, "
        f"or remove {KEY!r} from the file"
    )


def _build(description: dict[str, Any], recording: Recording) -> Demonstration:
    layout = decode_layout(pop_list(description, "layout"))
    x = _collect_columns(pop_list(description, "columns"), layout, recording)
    name = require_printable(pop_field(description, "name", "it"), "the name")
    period = require_period(pop_field(description, "period", "it"), "the period")
    frames = [_decode_frame(given) for given in pop_list(description, "frames")]
    reject_unknown_fields(description, "it")
    return demonstration(x, period, layout, frames, name)


def _collect_columns(columns: list[Any], layout: Layout, recording: Recording) -> Float[Array, "T D"]:
    signals: Mapping[str, Float[Array, "T D"]] = {signal.name: signal.values for signal in recording.signals}
    if len(columns) != layout.width:
        raise InvalidInput(f"it names {len(columns)} columns, expected {layout.width} as in the layout")
    collected = []
    for column in columns:
        if not isinstance(column, list) or len(column) != 2 or not isinstance(column[0], str):
            raise InvalidInput(f"a column is {short_repr(column)}, expected [signal, number]")
        name, number = column
        if name not in signals:
            raise InvalidInput(f"it names signal {short_repr(name)}, which the recording does not have")
        values = signals[name]
        collected.append(values[:, require_count(number, f"a column of {name!r}", values.shape[1] - 1)])
    if len({len(column) for column in collected}) != 1:
        raise InvalidInput("its signals have different numbers of rows, expected the same number")
    return np.column_stack(collected)


def _encode_frame(given: Frame | MovingFrame) -> dict[str, Any]:
    if not given.is_moving:
        return {"name": given.name, "A": np.asarray(given.A).tolist(), "b": np.asarray(given.b).tolist()}
    numbers = np.concatenate([np.ravel(given.A), np.ravel(given.b)])
    encoded = base64.b64encode(numbers.astype("<f8").tobytes()).decode("ascii")
    return {"name": given.name, "steps": len(given.b), "numbers": encoded}


def _decode_frame(given: Any) -> Frame | MovingFrame:
    name = pop_field(given, "name", "a frame")
    if "steps" not in given:
        A, b = pop_list(given, "A"), pop_list(given, "b")
        reject_unknown_fields(given, "a frame")
        return frame(name, A, b)
    steps = require_count(pop_field(given, "steps", "a frame"), "the steps of a frame", MAX_STEPS, minimum=1)
    encoded = pop_field(given, "numbers", "a frame")
    reject_unknown_fields(given, "a frame")
    try:
        numbers = np.frombuffer(base64.b64decode(encoded, validate=True), dtype="<f8").astype(np.float64)
    except (binascii.Error, TypeError, ValueError) as error:
        raise InvalidInput(f"the numbers of a frame are not base64 of float64: {error}") from error
    width = _width_of_frame(numbers.size, steps)
    matrices, offsets = np.split(numbers, [steps * width * width])
    return moving_frame(name, matrices.reshape(steps, width, width), offsets.reshape(steps, width))


def _width_of_frame(numbers: int, steps: int) -> int:
    """Return D for which a frame has steps * (D * D + D) numbers."""
    width = int(np.sqrt(numbers / steps))
    if width < 1 or steps * (width * width + width) != numbers:
        raise InvalidInput(f"a frame of {steps} steps has {numbers} numbers, expected A and b of each step")
    return width
