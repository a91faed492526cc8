"""Folders of demonstrations: a manifest and one CSV or NPZ file each (docs/folder-format.md)."""

import hashlib
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations.frame_doors import moving_frame
from pilotfish.demonstrations.frames import WORLD, Frame, MovingFrame, is_world
from pilotfish.demonstrations.manifests import (
    LARGEST_MANIFEST,
    NAMES,
    Entry,
    FrameKeys,
    Manifest,
    layout_fields,
    parsed_manifest,
    written_manifest,
)
from pilotfish.demonstrations.recording import Demonstration, demonstration
from pilotfish.demonstrations.tables import (
    LARGEST_ARCHIVE,
    LARGEST_TABLE,
    arrays_of_npz,
    csv_bytes,
    npz_bytes,
    rows_of_csv,
)
from pilotfish.errors import InvalidInput
from pilotfish.files import whole_folder
from pilotfish.types import Array, Float
from pilotfish.validation import (
    is_file,
    is_folder,
    is_link,
    path_exists,
    read_file,
    resolve_path,
    short_list,
    short_repr,
)


def read_folder(path: str | Path) -> tuple[Demonstration, ...]:
    """The demonstrations of a folder, in the order of its manifest.

    Raises: InvalidInput, naming the file, the line or key, and the nearest fix, for whatever is wrong.
    """
    folder = Path(path)
    manifest = _manifest(folder)
    return tuple(_read(folder, entry, manifest) for entry in manifest.entries)


def write_folder(
    demonstrations: Sequence[Demonstration],
    path: str | Path,
    *,
    overwrite: bool = False,
    beside: bool = False,
) -> None:
    """Write a folder that reads back equal, number for number. It appears whole or not at all.

    At every moment, path leads to the old folder or to the new one, also when the process is killed
    (`pilotfish.files.whole_folder`).

    Args:
        demonstrations: At least one; they share layout and period.
        path: The folder to write. A folder that is empty is filled.
        overwrite: Whether a folder of demonstrations may be replaced; nothing else ever is.
        beside: Whether to write to a similar free name if what is there may not be replaced, so that the
            result of long work is kept; the error gives that name.

    Raises:
        InvalidInput: If the demonstrations do not go together, path cannot be written, or what is there may
            not be replaced.
        NameTaken: If what is there may not be replaced, and the result was written to the `path` of the
            error: with beside, or where the folder came into being in the meantime.
    """
    files = _files(demonstrations)
    if not beside:
        require_replaceable(path, overwrite=overwrite)
    place = resolve_path(path)
    with whole_folder(place, partial(_require_demonstrations, place) if overwrite else None) as folder:
        for name, data in files.items():
            (folder / name).write_bytes(data)


def require_replaceable(path: str | Path, *, overwrite: bool) -> None:
    """Return if write_folder may write to path: it is missing, empty, or a folder of demonstrations.

    Args:
        path: The folder to write.
        overwrite: Whether a folder of demonstrations may be replaced.

    Raises:
        InvalidInput: If something else is there, or anything without overwrite.
    """
    place = resolve_path(path)
    if not path_exists(place) and not (is_link(path) and not overwrite):
        return
    if is_folder(place) and not _names_in(place):
        return
    if not overwrite:
        raise InvalidInput(f"{path} exists; choose another place, or say overwrite=True")
    _require_demonstrations(place, place)


def _manifest(folder: Path) -> Manifest:
    if not is_folder(folder):
        raise InvalidInput(f"{folder} is no folder, expected one with demonstrations.toml in it")
    there = [name for name in NAMES if is_file(folder / name)]
    if len(there) != 1:
        found = "both" if there else "neither"
        raise InvalidInput(f"{folder} has {found} of {' and '.join(NAMES)}, expected exactly one")
    return parsed_manifest(_bytes(folder, there[0], "a manifest", LARGEST_MANIFEST), there[0])


def _bytes(folder: Path, name: str, expected: str, largest: int) -> bytes:
    """Return the bytes of a file that lies in the folder, also behind a link that does not leave it."""
    file = folder / name
    if not resolve_path(file).is_relative_to(resolve_path(folder)):
        raise InvalidInput(f"{file} is a link to a file outside the folder; copy that file into the folder")
    return read_file(file, expected, largest)


def _read(folder: Path, entry: Entry, manifest: Manifest) -> Demonstration:
    csv = entry.file.endswith(".csv")
    data = _bytes(folder, entry.file, "a table of rows", LARGEST_TABLE if csv else LARGEST_ARCHIVE)
    if entry.sha256 and entry.sha256 != (now := hashlib.sha256(data).hexdigest()):
        raise InvalidInput(
            f"{entry.file}: changed since pilotfish wrote it (sha256 {now[:12]}..., the manifest says "
            f"{entry.sha256[:12]}...); if the change is meant, delete its sha256 and the manifest's own"
        )
    if csv:
        arrays = {"x": rows_of_csv(data, entry.file, manifest.layout.names)}
    else:
        arrays = arrays_of_npz(data, entry.file)
    _refuse_other_arrays(arrays, entry)
    where = f"{entry.file}{' (row 0 is line 2)' if csv else ''}"
    try:
        frames = [_frame(given, arrays) for given in entry.frames]
        return demonstration(arrays["x"], manifest.period, manifest.layout, frames, entry.name)
    except InvalidInput as error:
        raise InvalidInput(f"{where}: {error}") from error


def _refuse_other_arrays(arrays: dict[str, Float[Array, "..."]], entry: Entry) -> None:
    keys = [key for given in entry.frames if isinstance(given, FrameKeys) for key in (given.A, given.b)]
    expected = {"x", *keys}
    if missing := sorted(expected - arrays.keys()):
        hint = "; moving frames need an NPZ file" if entry.file.endswith(".csv") else ""
        raise InvalidInput(
            f"{entry.file} has no array {missing[0]!r}, it has {short_list(sorted(arrays))}{hint}"
        )
    if extra := sorted(arrays.keys() - expected):
        raise InvalidInput(
            f"{entry.file} has an array {short_repr(extra[0])} that no frame names; name it or remove it"
        )


def _frame(given: Frame | FrameKeys, arrays: dict[str, Float[Array, "..."]]) -> Frame | MovingFrame:
    if isinstance(given, Frame):
        return given
    return moving_frame(given.name, arrays[given.A], arrays[given.b])


def _files(demonstrations: Sequence[Demonstration]) -> dict[str, bytes]:
    """Everything the folder will hold, by name."""
    _refuse_unlike(demonstrations)
    first = demonstrations[0]
    names = [_file_name(m, demo, len(demonstrations)) for m, demo in enumerate(demonstrations)]
    files = {name: _table(demo) for name, demo in zip(names, demonstrations, strict=True)}
    entries = [
        {
            "name": demo.name,
            "file": name,
            "sha256": hashlib.sha256(files[name]).hexdigest(),
            "frames": _frames_fields(demo),
        }
        for name, demo in zip(names, demonstrations, strict=True)
    ]
    content = {"period": first.period, "layout": layout_fields(first.layout), "demonstration": entries}
    return {**files, "demonstrations.json": written_manifest(content)}


def _refuse_unlike(demonstrations: Sequence[Demonstration]) -> None:
    if not demonstrations:
        raise InvalidInput("there are no demonstrations to write, expected at least one")
    first = demonstrations[0]
    for m, demo in enumerate(demonstrations):
        if (demo.layout, demo.period) != (first.layout, first.period):
            raise InvalidInput(
                f"demonstration {m} ({demo.name!r}) differs from the first in layout or period "
                f"({demo.period} s, {first.period} s); a folder has one of each: write two, or resample"
            )


def _moves(demo: Demonstration) -> bool:
    return any(isinstance(given, MovingFrame) for given in demo.frames)


def _file_name(m: int, demo: Demonstration, count: int) -> str:
    words = re.sub(r"[^a-z0-9]+", "-", demo.name.lower()).strip("-")[:40]
    ending = ".npz" if _moves(demo) else ".csv"
    return "-".join([f"{m + 1:0{len(str(count))}d}", *filter(None, [words])]) + ending


def _table(demo: Demonstration) -> bytes:
    if not _moves(demo):
        return csv_bytes(demo.x, demo.layout.names)
    arrays = {"x": demo.x}
    for n, given in enumerate(demo.frames):
        if isinstance(given, MovingFrame):
            arrays |= {f"A{n}": given.A, f"b{n}": given.b}
    return npz_bytes(arrays)


def _frames_fields(demo: Demonstration) -> list[dict[str, Any]]:
    """None for the world's frame alone: that is what a demonstration without frames gets."""
    if len(demo.frames) == 1 and demo.frames[0].name == WORLD and is_world(demo.frames[0]):
        return []
    return [_frame_fields(n, given) for n, given in enumerate(demo.frames)]


def _frame_fields(n: int, given: Frame | MovingFrame) -> dict[str, Any]:
    if isinstance(given, MovingFrame):
        return {"name": given.name, "A": f"A{n}", "b": f"b{n}"}
    return {"name": given.name, "A": np.asarray(given.A).tolist(), "b": np.asarray(given.b).tolist()}


def _require_demonstrations(place: Path, folder: Path) -> None:
    """Raise InvalidInput unless a folder holds demonstrations and nothing else; place is its usual name."""
    try:
        known = {*NAMES, *(entry.file for entry in _manifest(folder).entries)}
        names = _names_in(folder)
    except InvalidInput as error:
        raise InvalidInput(
            f"{place} is not a folder of demonstrations and is not replaced ({error}); choose another place"
        ) from error
    if strange := sorted(name for name in names if name not in known):
        raise InvalidInput(
            f"{place} also holds {short_repr(strange[0])}, which is no demonstration of it; move that away"
        )


def _names_in(folder: Path) -> list[str]:
    try:
        return [file.name for file in folder.iterdir()]
    except OSError as error:
        raise InvalidInput(f"{folder} cannot be listed: {error.strerror}; choose another place") from error
