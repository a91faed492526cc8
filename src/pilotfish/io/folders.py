"""Folders of demonstrations: a manifest and one CSV or NPZ file each (docs/folder-format.md)."""

import hashlib
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    MovingFrame,
    demonstration,
    moving_frame,
    world_frame,
)
from pilotfish.errors import InvalidInput
from pilotfish.io.atomic_folders import atomic_folder
from pilotfish.io.manifests import (
    MANIFEST_NAMES,
    MAX_MANIFEST_BYTES,
    DemonstrationEntry,
    Manifest,
    MovingFrameKeys,
    layout_to_dicts,
    parse_manifest,
    serialise_manifest,
)
from pilotfish.io.paths import is_file, is_folder, is_link, path_exists, read_file, resolve_path
from pilotfish.io.tables import (
    MAX_CSV_BYTES,
    MAX_NPZ_BYTES,
    decode_csv,
    decode_npz,
    encode_csv,
    encode_npz,
)
from pilotfish.types import Array, Float
from pilotfish.validation import short_list, short_repr


def read_demonstrations(path: str | Path) -> tuple[Demonstration, ...]:
    """The demonstrations of a folder, in the order of its manifest.

    Raises: InvalidInput, naming the file, the line or key, and the nearest fix, for whatever is wrong.
    """
    folder = Path(path)
    manifest = _manifest(folder)
    return tuple(_read_one(folder, entry, manifest) for entry in manifest.entries)


def write_demonstrations(
    demonstrations: Sequence[Demonstration],
    path: str | Path,
    *,
    overwrite: bool = False,
    use_free_name: bool = False,
) -> None:
    """Write a folder that reads back equal, number for number. It appears whole or not at all.

    At every moment, path leads to the old folder or to the new one, also when the process is killed
    (`pilotfish.io.whole_folder`).

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
    files = _encode_files(demonstrations)
    if not use_free_name:
        require_replaceable(path, overwrite=overwrite)
    place = resolve_path(path)
    with atomic_folder(place, partial(_require_demonstrations, place) if overwrite else None) as folder:
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
    if is_folder(place) and not _list_folder(place):
        return
    if not overwrite:
        raise InvalidInput(f"{path} exists; choose another place, or say overwrite=True")
    _require_demonstrations(place, place)


def _manifest(folder: Path) -> Manifest:
    if not is_folder(folder):
        raise InvalidInput(f"{folder} is no folder, expected one with demonstrations.toml in it")
    there = [name for name in MANIFEST_NAMES if is_file(folder / name)]
    if len(there) != 1:
        found = "both" if there else "neither"
        raise InvalidInput(f"{folder} has {found} of {' and '.join(MANIFEST_NAMES)}, expected exactly one")
    return parse_manifest(_read_inside(folder, there[0], "a manifest", MAX_MANIFEST_BYTES), there[0])


def _read_inside(folder: Path, name: str, expected: str, max_bytes: int) -> bytes:
    """Return the bytes of a file that lies in the folder, also behind a link that does not leave it."""
    file = folder / name
    if not resolve_path(file).is_relative_to(resolve_path(folder)):
        raise InvalidInput(f"{file} is a link to a file outside the folder; copy that file into the folder")
    return read_file(file, expected, max_bytes)


def _read_one(folder: Path, entry: DemonstrationEntry, manifest: Manifest) -> Demonstration:
    csv = entry.file.endswith(".csv")
    data = _read_inside(folder, entry.file, "a table of rows", MAX_CSV_BYTES if csv else MAX_NPZ_BYTES)
    if entry.sha256 and entry.sha256 != (now := hashlib.sha256(data).hexdigest()):
        raise InvalidInput(
            f"{entry.file}: changed since pilotfish wrote it (sha256 {now[:12]}..., the manifest says "
            f"{entry.sha256[:12]}...); if the change is meant, delete its sha256 and the manifest's own"
        )
    if csv:
        arrays = {"x": decode_csv(data, entry.file, manifest.layout.names)}
    else:
        arrays = decode_npz(data, entry.file)
    _require_expected_arrays(arrays, entry)
    where = f"{entry.file}{' (row 0 is line 2)' if csv else ''}"
    try:
        frames = [_frame(given, arrays) for given in entry.frames]
        return demonstration(arrays["x"], manifest.period, manifest.layout, frames, entry.name)
    except InvalidInput as error:
        raise InvalidInput(f"{where}: {error}") from error


def _require_expected_arrays(arrays: dict[str, Float[Array, "..."]], entry: DemonstrationEntry) -> None:
    keys = [key for given in entry.frames if isinstance(given, MovingFrameKeys) for key in (given.A, given.b)]
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


def _frame(given: Frame | MovingFrameKeys, arrays: dict[str, Float[Array, "..."]]) -> Frame | MovingFrame:
    if isinstance(given, Frame):
        return given
    return moving_frame(given.name, arrays[given.A], arrays[given.b])


def _encode_files(demonstrations: Sequence[Demonstration]) -> dict[str, bytes]:
    """Everything the folder will hold, by name."""
    _require_same_layout(demonstrations)
    first = demonstrations[0]
    names = [_table_name(m, demo, len(demonstrations)) for m, demo in enumerate(demonstrations)]
    files = {name: _encode_rows(demo) for name, demo in zip(names, demonstrations, strict=True)}
    entries = [
        {
            "name": demo.name,
            "file": name,
            "sha256": hashlib.sha256(files[name]).hexdigest(),
            "frames": _frames_to_dicts(demo),
        }
        for name, demo in zip(names, demonstrations, strict=True)
    ]
    content = {"period": first.period, "layout": layout_to_dicts(first.layout), "demonstration": entries}
    return {**files, "demonstrations.json": serialise_manifest(content)}


def _require_same_layout(demonstrations: Sequence[Demonstration]) -> None:
    if not demonstrations:
        raise InvalidInput("there are no demonstrations to write, expected at least one")
    first = demonstrations[0]
    for m, demo in enumerate(demonstrations):
        if (demo.layout, demo.period) != (first.layout, first.period):
            raise InvalidInput(
                f"demonstration {m} ({demo.name!r}) differs from the first in layout or period "
                f"({demo.period} s, {first.period} s); a folder has one of each: write two, or resample"
            )


def _has_moving_frames(demo: Demonstration) -> bool:
    return any(given.is_moving for given in demo.frames)


def _table_name(m: int, demo: Demonstration, count: int) -> str:
    words = re.sub(r"[^a-z0-9]+", "-", demo.name.lower()).strip("-")[:40]
    ending = ".npz" if _has_moving_frames(demo) else ".csv"
    return "-".join([f"{m + 1:0{len(str(count))}d}", *filter(None, [words])]) + ending


def _encode_rows(demo: Demonstration) -> bytes:
    if not _has_moving_frames(demo):
        return encode_csv(demo.x, demo.layout.names)
    arrays = {"x": demo.x}
    for n, given in enumerate(demo.frames):
        if given.is_moving:
            arrays |= {f"A{n}": given.A, f"b{n}": given.b}
    return encode_npz(arrays)


def _frames_to_dicts(demo: Demonstration) -> list[dict[str, Any]]:
    """None for the world's frame alone: that is what a demonstration without frames gets."""
    if len(demo.frames) == 1 and demo.frames[0].name == world_frame(1).name and demo.frames[0].is_world:
        return []
    return [_frame_to_dict(n, given) for n, given in enumerate(demo.frames)]


def _frame_to_dict(n: int, given: Frame | MovingFrame) -> dict[str, Any]:
    if given.is_moving:
        return {"name": given.name, "A": f"A{n}", "b": f"b{n}"}
    return {"name": given.name, "A": np.asarray(given.A).tolist(), "b": np.asarray(given.b).tolist()}


def _require_demonstrations(place: Path, folder: Path) -> None:
    """Raise InvalidInput unless a folder holds demonstrations and nothing else; place is its usual name."""
    try:
        known = {*MANIFEST_NAMES, *(entry.file for entry in _manifest(folder).entries)}
        names = _list_folder(folder)
    except InvalidInput as error:
        raise InvalidInput(
            f"{place} is not a folder of demonstrations and is not replaced ({error}); choose another place"
        ) from error
    if strange := sorted(name for name in names if name not in known):
        raise InvalidInput(
            f"{place} also holds {short_repr(strange[0])}, which is no demonstration of it; move that away"
        )


def _list_folder(folder: Path) -> list[str]:
    try:
        return [file.name for file in folder.iterdir()]
    except OSError as error:
        raise InvalidInput(f"{folder} cannot be listed: {error.strerror}; choose another place") from error
