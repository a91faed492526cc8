"""Columns of a recording by name: "column", "signal:column", or a pattern with * and ?."""

import re
from collections.abc import Sequence

from pilotfish.demonstrations.signals import Recording
from pilotfish.errors import InvalidInput
from pilotfish.validation import nearest_name, require_type, short_list, short_repr


def select_columns(recording: Recording, names: Sequence[str], label: str) -> tuple[int, tuple[int, ...]]:
    """Return the signal and the columns that names select, in the order of the names.

    A name is compared with the names of columns, then with "signal:column". A pattern selects its columns in
    the order of the file.

    Args:
        recording: Recording with at least one signal.
        names: Names or patterns.
        label: What the columns are for; messages begin with it.

    Returns:
        Number of the signal and numbers of its columns, from 0.

    Raises:
        InvalidInput: If a name selects nothing or columns of several signals.
    """
    require_type(recording, "recording", Recording, "read one with io.readers.read_recordings")
    selected = [pair for name in names for pair in _matches(recording, name, label)]
    numbers = sorted({signal for signal, _ in selected})
    if len(numbers) > 1:
        found = [_full_name(recording, *pair) for pair in selected]
        raise InvalidInput(
            f"{label} selects columns of several signals, {short_list(found)}, expected those of one; "
            "write SIGNAL:COLUMN, or make one part of each signal"
        )
    if len(set(selected)) < len(selected):
        raise InvalidInput(f"{label} selects a column twice: {short_list(list(names))}; name each once")
    return numbers[0], tuple(column for _, column in selected)


def column_names(recording: Recording) -> tuple[str, ...]:
    """Return the names by which the columns of a recording can be selected.

    Args:
        recording: Recording.
    """
    return tuple(
        _full_name(recording, s, c)
        for s, signal in enumerate(recording.signals)
        for c in range(len(signal.columns))
    )


def _matches(recording: Recording, name: str, label: str) -> list[tuple[int, int]]:
    pairs = [(s, c) for s, signal in enumerate(recording.signals) for c in range(len(signal.columns))]
    short = {pair: recording.signals[pair[0]].columns[pair[1]] for pair in pairs}
    full = {(s, c): f"{recording.signals[s].name}:{short[s, c]}" for s, c in pairs}
    for names in (short, full):
        if exact := [pair for pair in pairs if names[pair] == name]:
            if len(exact) > 1:
                found = short_list([full[pair] for pair in exact])
                raise InvalidInput(
                    f"{label}: {short_repr(name)} names {len(exact)} columns, {found}, expected one; write "
                    "SIGNAL:COLUMN, or rename the columns of the file"
                )
            return exact
    if "*" in name or "?" in name:
        pattern = re.compile("".join({"*": ".*", "?": "."}.get(letter, re.escape(letter)) for letter in name))
        for names in (short, full):
            if found_pairs := [pair for pair in pairs if pattern.fullmatch(names[pair])]:
                return found_pairs
    known = column_names(recording)
    near = nearest_name(name, known, cutoff=0.4)
    hint = f"did you mean {near!r}?" if near else f"known are {short_list(known)}"
    raise InvalidInput(f"{label}: no column is named {short_repr(name)}; {hint}")


def _full_name(recording: Recording, signal: int, column: int) -> str:
    chosen = recording.signals[signal]
    name = chosen.columns[column]
    return f"{chosen.name}:{name}" if len(recording.signals) > 1 else name
