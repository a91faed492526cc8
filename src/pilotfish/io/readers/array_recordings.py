"""Recordings from named arrays, as NPZ and MATLAB files have them.

A matrix (T, D) is a signal, and a vector (T,) a signal of one column. Its times are the vector "NAME_time",
or one that is named as times and has as many entries. Texts with one entry per row are labels. Whole numbers
are labels under a name such as "labels" or "phase". Texts named "columns" with D entries are the names of the
columns. A number named "period", "dt", "fps" or "rate" states the period.

Points (T, J, 3) beside a matrix or times of T rows are a signal. Homogeneous matrices (T, 4, 4) are one pose
per row, with the columns x, y, z and r11 to r33. Several recordings are stacked arrays (N, T, D), or
arrays whose names end with the number of the recording.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from pilotfish.demonstrations import Recording, Signal
from pilotfish.errors import InvalidInput
from pilotfish.io.readers.column_headers import SECOND_NAMES, is_time_name, split_unit, to_seconds
from pilotfish.io.readers.read_options import ReadOptions
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array, require_number, require_printable, short_list, short_repr

PERIODS = {"period", "dt", "ts", "sampling_period", "timestep", "time_step"}
RATES = {"fps", "rate", "frequency", "fs", "hz", "sampling_rate"}
LABELS = {"label", "labels", "phase", "phases", "segment", "segments", "subtask", "subtasks"}
COLUMN_NAMES = {"columns", "names", "column_names", "fields"}
POSE_COLUMNS = ("x", "y", "z", *(f"r{row}{column}" for row in "123" for column in "123"))
LAST_ROW_TOLERANCE = 1e-6
MAX_COLUMNS = 10_000
MAX_RECORDINGS = 1_000_000
Arrays = Mapping[str, np.ndarray]


def recordings_from_arrays(
    arrays: Arrays, name: str, format_name: str, options: ReadOptions, file: str, *, numbered: bool = True
) -> Iterator[Recording]:
    """Yield the recordings of named arrays as at the head of this file.

    Args:
        arrays: Numbers, whole numbers, booleans and texts.
        name: Name of the recording; several are numbered.
        format_name: Name of the format.
        options: Name and unit of the times, if they are stated.
        file: Name of the file, for messages.
        numbered: Whether numbers at the ends of names, and the first axis of (N, T, D), may be those of
            recordings. If not, matrices are the signals of one recording.

    Raises:
        InvalidInput: If matrices and vectors of numbers are missing, or sizes contradict one another.
    """
    poses = {key for key, array in arrays.items() if is_pose_stack(array)}
    arrays = {key: _pose_rows(array) if key in poses else array for key, array in arrays.items()}
    names = {key: _pose_names(key) for key in poses}
    arrays = {key: _rows_of_points(array, arrays) for key, array in arrays.items()}
    stacked = {key: array for key, array in arrays.items() if _is_numeric(array) and array.ndim == 3}
    if stacked and not numbered and len(stacked) < len(arrays):  # matrices of a structure are its signals
        stacked = {}
    if stacked:
        yield from _split_stacked(arrays, stacked, name, format_name, options, file)
        return
    groups = _numbered_groups(arrays) if numbered else {}
    if not groups:
        yield _one_recording(arrays, name, format_name, options, file, names=names)
    for key, own in groups.items():
        matrices = {
            stem: _pose_names(stem) for stem, array in own.items() if any(array is arrays[k] for k in poses)
        }
        yield _one_recording(own, key, format_name, options, file, names=matrices)


def is_pose_stack(array: np.ndarray) -> bool:
    """Return whether an array is homogeneous matrices of shape (T, 4, 4), whose last rows are 0 0 0 1.

    Args:
        array: Any array.
    """
    if array.dtype.kind not in "fiu" or array.ndim != 3 or array.shape[1:] != (4, 4) or not len(array):
        return False
    return bool((np.abs(array[:, 3] - np.array([0.0, 0.0, 0.0, 1.0])) < LAST_ROW_TOLERANCE).all())


def _pose_rows(array: np.ndarray) -> np.ndarray:
    return np.hstack([array[:, :3, 3], array[:, :3, :3].reshape(len(array), 9)])


def _pose_names(key: str) -> np.ndarray:
    return np.array([f"{split_unit(key)[0]} {name}" for name in POSE_COLUMNS])


def _rows_of_points(array: np.ndarray, arrays: Arrays) -> np.ndarray:
    """Return points (T, J, 3) as rows (T, 3 J) if a matrix or times have T rows; other arrays unchanged."""
    matrices = [other for other in arrays.values() if _is_numeric(other) and other.ndim == 2]
    times = [
        a for k, a in arrays.items() if _is_numeric(a) and a.ndim == 1 and is_time_name(split_unit(k)[0])
    ]
    if array.ndim != 3 or not (
        any(len(m) == len(array) and m.shape != array.shape[:2] for m in matrices)
        or any(len(array) == len(t) != array.shape[1] for t in times)
    ):
        return array
    return array.reshape(len(array), -1)


def _split_stacked(
    arrays: Arrays, stacked: Arrays, name: str, format_name: str, options: ReadOptions, file: str
) -> Iterator[Recording]:
    counts = {len(array) for array in stacked.values()}
    if len(counts) > 1:
        shapes = short_list([f"{key} {array.shape}" for key, array in stacked.items()])
        raise InvalidInput(f"{file}: {shapes} have different lengths, expected (N, T, D) with one N")
    count = counts.pop()
    if count > MAX_RECORDINGS:
        raise InvalidInput(f"{file} has {count} recordings, expected at most {MAX_RECORDINGS}")
    T = next(iter(stacked.values())).shape[1]
    for n in range(count):
        own = {
            key: array[n] if array.ndim >= 2 and (array.ndim == 3 or array.shape == (count, T)) else array
            for key, array in arrays.items()
        }
        alone = next(iter(stacked)) if len(stacked) == 1 else ""
        yield _one_recording(own, f"{name} {n + 1}", format_name, options, file, alone=alone)


def _numbered_groups(arrays: Arrays) -> dict[str, Arrays]:
    """Return the arrays of each recording if all matrices end with a number; empty if they do not.

    Matrices with equal number are signals of one recording if all numbers have the same matrices, which are
    equally long. Otherwise each matrix is a recording. Arrays without a number belong to every recording.
    """
    matches = {key: re.fullmatch(r"(.*?)[\s_.\-]*(\d{1,18})", key) for key in arrays}
    numbered = {key: (match[1], int(match[2])) for key, match in matches.items() if match}
    matrices = [key for key, array in arrays.items() if _is_numeric(array) and array.ndim == 2]
    if len(matrices) < 2 or any(key not in numbered for key in matrices):
        return {}
    shared = {key: array for key, array in arrays.items() if key not in numbered}
    stems: dict[int, dict[str, np.ndarray]] = {}
    for key, (stem, number) in numbered.items():
        stems.setdefault(number, {})[stem] = arrays[key]
    names = {number: [s for s in own if own[s].ndim == 2] for number, own in stems.items()}
    lengths_agree = all(len({len(stems[n][s]) for s in own}) == 1 for n, own in names.items())
    if lengths_agree and len({tuple(sorted(own)) for own in names.values()}) == 1 and len(stems) > 1:
        return {_key(numbered, number): {**stems[number], **shared} for number in sorted(stems)}
    if len({arrays[key].shape[1] for key in matrices}) > 1:
        return {}
    ordered = sorted(matrices, key=lambda key: numbered[key])
    return {key: {"x": arrays[key], **shared} for key in ordered}


def _key(numbered: Mapping[str, tuple[str, int]], number: int) -> str:
    return next(key for key, (_, other) in numbered.items() if other == number)


def _one_recording(
    arrays: Arrays,
    name: str,
    format_name: str,
    options: ReadOptions,
    file: str,
    alone: str = "",
    names: Arrays | None = None,
) -> Recording:
    arrays = {key: array for key, array in arrays.items() if array.size} or arrays
    texts = {key: array for key, array in arrays.items() if array.dtype.kind in "US" and array.ndim == 1}
    numeric = {key: array for key, array in arrays.items() if _is_numeric(array) and array.ndim in (1, 2)}
    times = {key: array for key, array in numeric.items() if _is_time(key, array, options)}
    labels = {
        k: a for k, a in numeric.items() if k.lower() in LABELS and a.ndim == 1 and a.dtype.kind in "iub"
    }
    values = {key: array for key, array in numeric.items() if key not in times and key not in labels}
    if not values:
        raise InvalidInput(
            f"{file} has the arrays {short_list(list(arrays))}, expected a matrix of numbers of shape (T, D) "
            "or (N, T, D); write one with numpy.savez(path, x=x)"
        )
    columns = next((array for key, array in texts.items() if key.lower() in COLUMN_NAMES), None)
    seconds = {key: _seconds(key, array, options, file) for key, array in times.items()}
    signals = []
    for key, array in values.items():
        label, headers = "" if len(values) == 1 or key == alone else key, (names or {}).get(key, columns)
        signals.append(_signal(key, array, label, _times_of(key, array, seconds), headers, file))
    label_arrays = _label_arrays(texts, labels, max(len(array) for array in values.values()))
    ordered = _labelled_first(signals, label_arrays, file)
    return Recording(
        require_printable(name, f"{file}: the name of a recording"),
        tuple(ordered),
        {key: tuple(_text(entry, file) for entry in array.tolist()) for key, array in label_arrays.items()},
        _stated_period(arrays, file),
        format_name,
        notes=_notes(arrays, {*values, *times}, label_arrays),
    )


def _label_arrays(texts: Arrays, labels: Arrays, rows: int) -> Arrays:
    """Return the arrays that label rows: numbers, and texts of one per row; other texts describe the set."""
    kept = {key: array for key, array in texts.items() if len(array) == rows or key.lower() in LABELS}
    return {**{key: array for key, array in kept.items() if key.lower() not in COLUMN_NAMES}, **labels}


def _notes(arrays: Arrays, used: Collection[str], labels: Arrays) -> tuple[str, ...]:
    """Return a sentence for each array that became labels, or that has several numbers and was left out."""
    notes = []
    for key, array in labels.items():
        entries = short_list([_text(entry, key) for entry in dict.fromkeys(array.tolist())], 4)
        notes.append(f"array {short_repr(key)} has labels ({entries}): kept as a label of each row")
    for key, array in arrays.items():
        is_settled = key in used or key in labels or key.lower() in COLUMN_NAMES or array.size <= 1
        if not is_settled:
            notes.append(f"array {short_repr(key)} of shape {array.shape} is left out: not a row per sample")
    return tuple(notes)


def _signal(
    key: str,
    array: np.ndarray,
    name: str,
    times: Float[Array, " T"] | None,
    columns: np.ndarray | None,
    file: str,
) -> Signal:
    rows = array[:, None] if array.ndim == 1 else array
    if not 1 <= rows.shape[1] <= MAX_COLUMNS or not len(rows):
        raise InvalidInput(
            f"{file}: {short_repr(key)} has shape {array.shape}, expected (T, D) with 1 to {MAX_COLUMNS} "
            "columns and at least one row"
        )
    stem, unit = split_unit(require_printable(key, f"{file}: the name of an array"))
    if array.ndim == 1:
        headers = [stem]
    elif columns is not None and len(columns) == rows.shape[1]:
        headers = [
            require_printable(_text(c, file), f"{file}: the name of a column") for c in columns.tolist()
        ]
    else:
        headers = [f"column {n + 1}" for n in range(rows.shape[1])]
    split = [split_unit(header) for header in headers]
    values = numeric_array(rows.astype(np.float64) if rows.dtype.kind == "b" else rows, f"{file}: {key}")
    return Signal(name, values, tuple(n for n, _ in split), tuple(u or unit for _, u in split), times)


def _is_numeric(array: np.ndarray) -> bool:
    return array.dtype.kind in "fiub"


def _is_label(key: str, array: np.ndarray) -> bool:
    """Return whether whole numbers, which MATLAB stores as floats, are labels."""
    if key.lower() not in LABELS or array.ndim != 1:
        return False
    return array.dtype.kind != "f" or bool((np.isfinite(array) & (array == np.round(array))).all())


def _is_time(key: str, array: np.ndarray, options: ReadOptions) -> bool:
    is_vector = array.ndim == 1 or (array.ndim == 2 and 1 in array.shape and array.size > 1)
    if options.time_column:
        return key == options.time_column
    return is_vector and (is_time_name(split_unit(key)[0]) or key.lower() in SECOND_NAMES)


def _seconds(key: str, array: np.ndarray, options: ReadOptions, file: str) -> Float[Array, " T"]:
    label = f"{file}: {key}"
    return to_seconds(numeric_array(array.reshape(-1), label), split_unit(key)[1], options, label)


def _times_of(
    key: str, array: np.ndarray, times: Mapping[str, Float[Array, " _"]]
) -> Float[Array, " _"] | None:
    """Return the times of a signal: those under its own name, or others with as many entries."""
    fitting = {name: own for name, own in times.items() if len(own) == len(array)}
    own = [name for name in fitting if name.lower().startswith(key.lower())]
    names = [*own, *(name for name in fitting if name not in own)]
    return fitting[names[0]] if names else None


def _labelled_first(signals: Sequence[Signal], labels: Arrays, file: str) -> list[Signal]:
    """Return the signals with one first that has as many rows as there are labels."""
    lengths = {len(array) for array in labels.values()}
    if not lengths:
        return list(signals)
    fitting = [signal for signal in signals if lengths == {len(signal.values)}]
    if not fitting:
        names = short_list([f"{key} ({len(array)})" for key, array in labels.items()])
        rows = short_list([str(len(signal.values)) for signal in signals])
        raise InvalidInput(
            f"{file}: labels {names} do not have one entry per row ({rows}), expected a label for each row"
        )
    return [fitting[0], *(signal for signal in signals if signal is not fitting[0])]


def _stated_period(arrays: Arrays, file: str) -> float | None:
    for key, array in arrays.items():
        if array.size == 1 and _is_numeric(array):
            if key.lower() in PERIODS:
                return require_number(float(array.reshape(-1)[0]), f"{file}: {key}", 1e-9, 1e9)
            if key.lower() in RATES:
                return 1.0 / require_number(float(array.reshape(-1)[0]), f"{file}: {key}", 1e-9, 1e9)
    return None


def _text(entry: object, file: str) -> str:
    text = entry.decode("utf-8", "replace") if isinstance(entry, bytes) else str(entry)
    return require_printable(text.rstrip(), f"{file}: a label")
