"""Recordings of any known format: the reader is found by the content and suffix of the file.

A folder of files is one recording per file, in natural order (demo2 before demo10). Its files are signals of
common recordings if their names have two parts: each name is EXECUTION_SIGNAL, such as demo1_robot.csv and
demo1_objects.csv, SIGNAL begins with a letter, and every execution has the same two or more signals.

Files with equal columns may also be executions that someone numbered. They are signals unless two names of
signals are single letters or differ only in a number (run1, run2), or the only execution lacks a number at
its end (pick_anna, pick_bob). Otherwise every file is a recording of its own.

A folder of sub-folders without files beside them is one recording per sub-folder, such as demo1/robot.csv and
demo1/objects.csv: every sub-folder has files of the same names, which are its signals.
"""

import importlib
import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pilotfish.demonstrations import Recording, Signal
from pilotfish.errors import InvalidInput
from pilotfish.io.natural_order import natural_key
from pilotfish.io.paths import is_file, is_folder, path_exists
from pilotfish.io.readers.read_options import ReadOptions
from pilotfish.validation import nearest_name, require_type, short_list, short_repr

# Modules of this package with FORMAT, recognises(path) and read(path), or read(path, options). They are
# imported when a path is read, and tried in this order: the first that recognises a path reads it.
READERS = ("demonstration_folders", "lerobot", "robomimic", "ros_bags", "npy_arrays", "matlab", "delimited")
MAX_FILES = 100_000
TEXT_SUFFIXES = {".txt", ".text"}
DOCUMENTS = re.compile(
    r"(readme|licen[cs]e|notes?)([\s._-].*)?", re.IGNORECASE
)  # names of texts, without suffix
IGNORED_SUFFIXES = {
    ".md", ".rst", ".pdf", ".html", ".toml", ".json", ".yaml", ".yml", ".xml", ".urdf", ".png", ".jpg",
    ".jpeg", ".mp4", ".avi", ".py", ".m", ".sh", ".zip",
}  # fmt: skip


def read_recordings(path: str | Path, *, options: ReadOptions | None = None) -> Iterator[Recording]:
    """Read the recordings of a file or folder of any known format, one at a time.

    Args:
        path: File, or folder as at the head of this file. Hidden files, documents, pictures and manifests
            in a folder are ignored.
        options: What the file does not say about itself; None to recognise all of it.

    Yields:
        Each recording, as in the file.

    Raises:
        InvalidInput: If the path is missing, no reader recognises it, a library is missing, or the file is
            damaged.
    """
    chosen = options or ReadOptions()
    require_type(path, "path", (str, Path), "pass the name of a file or folder")
    require_type(chosen, "options", ReadOptions, "pass ReadOptions()")
    file = Path(path)
    if not path_exists(file):
        raise InvalidInput(f"{file} is missing, expected a file or folder of recordings; check the name")
    if (reader := _find_reader(file, chosen)) is not None:
        yield from _read(reader, file, chosen)
    elif is_folder(file):
        yield from _read_folder(file, chosen)
    else:
        raise _unknown_format(file)


def reader_formats() -> tuple[str, ...]:
    """Return the names of all formats, for help texts."""
    return tuple(str(_import_reader(name).FORMAT) for name in READERS)


def _import_reader(name: str) -> Any:
    return importlib.import_module(f"pilotfish.io.readers.{name}")


def _find_reader(path: Path, options: ReadOptions) -> Any:
    """Return the module that reads a path; None if none recognises it."""
    if not options.format:
        return next((r for r in map(_import_reader, READERS) if r.recognises(path)), None)
    if options.format in READERS:
        reader = _import_reader(options.format)
        return reader if is_file(path) or reader.recognises(path) else None
    near = nearest_name(options.format, READERS)
    hint = f"; did you mean {near!r}?" if near else ""
    raise InvalidInput(f"format is {short_repr(options.format)}, expected one of {', '.join(READERS)}{hint}")


def _read(reader: Any, path: Path, options: ReadOptions) -> Iterator[Recording]:
    """Yield the recordings of a path; a missing library is named with the extra that installs it."""
    takes_options = "options" in inspect.signature(reader.read).parameters
    try:
        yield from reader.read(path, options) if takes_options else reader.read(path)
    except ImportError as error:
        raise InvalidInput(
            f"{path}: files of {reader.FORMAT} need {error.name or error}: pip install '.[io]' in the clone"
        ) from error


def _read_folder(folder: Path, options: ReadOptions) -> Iterator[Recording]:
    files = _data_files(folder)
    if not files and (folders := _sub_folders(folder)):
        yield from _read_sub_folders(folders, options)
        return
    if not files:
        raise InvalidInput(f"{folder} has no files of recordings, expected such as demo1.csv and demo2.csv")
    readers = {file: _find_reader(file, options) for file in files}
    if unknown := [file for file, reader in readers.items() if reader is None]:
        raise _unknown_format(unknown[0])
    groups = _group_signals(files)
    if groups and _are_signals(
        groups, [list(_read(readers[f], f, options)) for f in next(iter(groups.values()))]
    ):
        for name, members in groups.items():
            contents = {f: (_signal_name(f), list(_read(readers[f], f, options))) for f in members}
            yield _merge(name, contents, "names")
        return
    for file in files:
        yield from _read(readers[file], file, options)


def _read_sub_folders(folders: Sequence[Path], options: ReadOptions) -> Iterator[Recording]:
    """Yield the recording of each sub-folder; all have files of the same names."""
    if (reader := _find_reader(folders[0], options)) is not None:  # such as the folder of a bag
        for folder in folders:
            yield from _read(reader, folder, options)
        return
    contents = {folder: _data_files(folder) for folder in folders}
    contents = {folder: files for folder, files in contents.items() if files}
    names = {tuple(file.name for file in files) for files in contents.values()}
    if len(names) != 1 or _is_numbering([Path(name).stem for name in next(iter(names))]):
        listed = short_list(
            [f"{f.name}/ ({short_list([m.name for m in ms], 4)})" for f, ms in contents.items()], 4
        )
        raise InvalidInput(
            f"{folders[0].parent} has sub-folders {listed or 'without recordings'}, expected files of equal "
            "names in each, such as robot.csv and objects.csv, which are the signals of one execution; "
            "import each sub-folder, or move the files into one folder"
        )
    for folder, files in contents.items():
        yield _read_members(folder.name, files, options)


def _read_members(name: str, files: Sequence[Path], options: ReadOptions) -> Recording:
    readers = {file: _find_reader(file, options) for file in files}
    if unknown := [file for file, reader in readers.items() if reader is None]:
        raise _unknown_format(unknown[0])
    return _merge(name, {f: (f.stem, list(_read(readers[f], f, options))) for f in files}, "folder")


def _list_folder(folder: Path) -> list[Path]:
    try:
        return [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    except OSError as error:
        raise InvalidInput(f"{folder} cannot be listed: {error.strerror}; check its permissions") from error


def _sub_folders(folder: Path) -> list[Path]:
    folders = [entry for entry in _list_folder(folder) if is_folder(entry)]
    if len(folders) > MAX_FILES:
        raise InvalidInput(f"{folder} has {len(folders)} folders, expected at most {MAX_FILES}; split it")
    return sorted(folders, key=lambda entry: natural_key(entry.name))


def _is_document(file: Path) -> bool:
    """Return whether a file is a text for people by its name, such as README.txt."""
    if file.suffix.lower() in IGNORED_SUFFIXES:
        return True
    is_text = file.suffix.lower() in TEXT_SUFFIXES
    return bool(DOCUMENTS.fullmatch(file.stem if is_text else file.name)) and (is_text or not file.suffix)


def _data_files(folder: Path) -> list[Path]:
    files = [entry for entry in _list_folder(folder) if is_file(entry) and not _is_document(entry)]
    if len(files) > MAX_FILES:
        raise InvalidInput(f"{folder} has {len(files)} files, expected at most {MAX_FILES}; split it")
    return sorted(files, key=lambda file: natural_key(file.name))


def _group_signals(files: Sequence[Path]) -> dict[str, list[Path]]:
    """Return the files of each execution if all names are EXECUTION_SIGNAL as at the head of this file."""
    groups: dict[str, dict[str, Path]] = {}
    for file in files:
        match = re.fullmatch(r"(?P<execution>.+)[_-](?P<signal>[^\W\d_][^_-]*)", file.stem)
        if match is None or match["signal"] in groups.setdefault(match["execution"], {}):
            return {}
        groups[match["execution"]][match["signal"]] = file
    signals = {frozenset(members) for members in groups.values()}
    if len(signals) != 1 or len(next(iter(signals))) < 2:
        return {}
    return {execution: list(members.values()) for execution, members in groups.items()}


def _are_signals(groups: Mapping[str, Sequence[Path]], contents: Sequence[Sequence[Recording]]) -> bool:
    """Return whether the files of each execution are its signals, by the contents of the first execution."""
    if any(len(recordings) != 1 for recordings in contents):
        return False
    columns = [tuple(signal.columns for signal in recordings[0].signals) for recordings in contents]
    if len(set(columns)) == len(columns):
        return True
    execution, members = next(iter(groups.items()))
    return not _is_numbering([_signal_name(f) for f in members]) and (
        len(groups) > 1 or execution[-1].isdigit()
    )


def _is_numbering(signals: Sequence[str]) -> bool:
    """Return whether names are single letters, or some differ only in a number at their end."""
    stems = {signal.rstrip("0123456789") for signal in signals}
    return len(stems) < len(signals) or all(len(signal) == 1 for signal in signals)


def _signal_name(file: Path) -> str:
    return re.split(r"[_-]", file.stem)[-1]


def _merge(name: str, contents: Mapping[Path, tuple[str, Sequence[Recording]]], by: str) -> Recording:
    """Return one recording of the named signals of several files; one that has labels is first."""
    for file, (_, recordings) in contents.items():
        if len(recordings) != 1:
            raise InvalidInput(f"{file} has {len(recordings)} recordings, expected one, as in its neighbours")
    members = [(file, prefix, recordings[0]) for file, (prefix, recordings) in contents.items()]
    members.sort(key=lambda member: not member[2].labels)  # stable
    signals: list[Signal] = []
    for _, prefix, recording in members:
        for signal in recording.signals:
            signals.append(replace(signal, name=f"{prefix} {signal.name}".strip()))
    names = [file.name for file in contents]
    joined = f"files {', '.join(names[:-1])} and {names[-1]} are signals of one execution, by their {by}"
    notes = [joined] if len(names) > 1 else []
    notes += [note for _, _, recording in members for note in recording.notes]
    for file, _, recording in members[1:]:
        if recording.labels:
            left = short_list(list(recording.labels))
            notes.append(f"labels {left} of {file.name} are left out: only those of one file are kept")
    first = members[0][2]
    periods = {recording.period for _, _, recording in members}
    period = periods.pop() if len(periods) == 1 else None
    return Recording(name, tuple(signals), first.labels, period, first.format, notes=tuple(notes))


def _unknown_format(path: Path) -> InvalidInput:
    formats = short_list([str(_import_reader(name).FORMAT) for name in READERS])
    return InvalidInput(
        f"{path} is in no known format, expected one of {formats}; move it away, or name the format"
    )
