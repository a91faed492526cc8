"""Folders of demonstrations: a manifest and one CSV or NPZ file each (docs/folder-format.md)."""

import hashlib
import re
import secrets
import shutil
from collections.abc import Sequence
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
from pilotfish.types import Array, Float
from pilotfish.validation import is_file, is_folder, read_file, resolve_path, short_list, short_repr


def read_folder(path: str | Path) -> tuple[Demonstration, ...]:
    """The demonstrations of a folder, in the order of its manifest.

    Raises: InvalidInput, naming the file, the line or key, and the nearest fix, for whatever is wrong.
    """
    folder = Path(path)
    manifest = _manifest(folder)
    return tuple(_read(folder, entry, manifest) for entry in manifest.entries)


def write_folder(
    demonstrations: Sequence[Demonstration], path: str | Path, *, overwrite: bool = False
) -> None:
    """A folder that reads back equal, number for number. It appears whole or not at all.

    It is built beside its place and then renamed. overwrite replaces a folder of demonstrations, and
    nothing else.
    Raises: InvalidInput, when there are none or they differ in layout or period, when the folder exists and
    is not to be replaced, and when the disk refuses.
    """
    files = _files(demonstrations)
    place = Path(path).resolve()
    _refuse_place(place, overwrite)
    beside = place.parent / f".{place.name}-{secrets.token_hex(4)}"
    try:
        beside.mkdir()
        for name, data in files.items():
            (beside / name).write_bytes(data)
        _move(beside, place)
    except OSError as error:
        raise InvalidInput(f"{place} cannot be written: {error.strerror}") from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)


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


def _refuse_place(place: Path, overwrite: bool) -> None:
    if not place.exists() or (place.is_dir() and not any(place.iterdir())):
        return
    if not overwrite:
        raise InvalidInput(f"{place} exists; choose another place, or say overwrite=True")
    try:
        known = {*NAMES, *(entry.file for entry in _manifest(place).entries)}
    except InvalidInput as error:
        raise InvalidInput(
            f"{place} is not a folder of demonstrations and is not replaced ({error}); choose another place"
        ) from error
    if strange := sorted(file.name for file in place.iterdir() if file.name not in known):
        raise InvalidInput(
            f"{place} also holds {strange[0]!r}, which is no demonstration of it; move that away"
        )


def _move(built: Path, place: Path) -> None:
    """Put what was built in its place; what was there is gone only after that."""
    if not place.exists():
        built.rename(place)
        return
    old = built.with_name(f"{built.name}-old")
    place.rename(old)
    try:
        built.rename(place)
    finally:  # an interrupt too puts back what was there
        if not place.exists():
            old.rename(place)
    shutil.rmtree(old)
