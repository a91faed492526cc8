"""Folders of demonstrations: a manifest, and a CSV or NPZ file per demonstration (docs/folder-format.md)."""

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
    Layout,
    MovingFrame,
    demonstration,
    moving_frame,
    world_frame,
)
from pilotfish.errors import InvalidInput
from pilotfish.io.atomic_writes import atomic_folder
from pilotfish.io.demonstration_tables import (
    MAX_CSV_BYTES,
    MAX_NPZ_BYTES,
    decode_csv,
    decode_npz,
    encode_csv,
    encode_npz,
)
from pilotfish.io.manifest import (
    MANIFEST_NAMES,
    MAX_MANIFEST_BYTES,
    Frames,
    Manifest,
    layout_to_dicts,
    parse_manifest,
    serialise_manifest,
)
from pilotfish.io.paths import is_file, is_folder, path_exists, read_file, resolve_path
from pilotfish.types import Array, Float
from pilotfish.validation import require_type, short_list, short_repr

MANIFEST_FIX = (
    "convert recordings with io.readers and build_demonstration, or write a template with "
    "io.write_folder_template"
)


def read_demonstrations(path: str | Path, numbers: range | None = None) -> tuple[Demonstration, ...]:
    """Return the demonstrations of a folder, in the order of its manifest.

    Args:
        path: Folder with demonstrations.toml or demonstrations.json.
        numbers: Numbers of the demonstrations to read, from 0; None reads all.

    Raises:
        InvalidInput: If anything is wrong; the message names the file, the line or key, and the nearest fix.

    Example:
        >>> read_demonstrations("my-recordings")  # doctest: +SKIP
    """
    folder = Path(path)
    period, layout, entries = _read_manifest(folder)
    require_type(numbers, "numbers", (range, type(None)), "give a range such as range(0, 10)")
    demonstrations = []
    for m, (file, (name, sha256, frames)) in enumerate(entries.items()):
        if numbers is not None and m not in numbers:
            continue
        arrays = _read_arrays(folder, file, sha256, layout, period)
        _require_expected_arrays(arrays, file, frames)
        try:
            built = [_build_frame(frame_name, given, arrays) for frame_name, given in frames.items()]
            demonstrations.append(demonstration(arrays["x"], period, layout, built, name))
        except InvalidInput as error:
            hint = " (row 0 is line 2)" if file.endswith(".csv") else ""
            raise InvalidInput(f"{file}{hint}: {error}") from error
    return tuple(demonstrations)


def count_demonstrations(path: str | Path) -> int:
    """Return the number of demonstrations that the manifest of a folder lists.

    Args:
        path: Folder with demonstrations.toml or demonstrations.json.

    Raises:
        InvalidInput: If the manifest is missing or damaged.
    """
    return len(_read_manifest(Path(path))[2])


def write_demonstrations(
    demonstrations: Sequence[Demonstration],
    path: str | Path,
    *,
    overwrite: bool = False,
    use_free_name: bool = False,
) -> None:
    """Write a folder from which `read_demonstrations` returns equal demonstrations, number for number.

    The folder is complete or absent at every moment, even if the process is killed.

    Args:
        demonstrations: At least one; all share layout and period.
        path: Folder to write; an empty one is filled.
        overwrite: Whether a folder of demonstrations may be replaced; nothing else ever is.
        use_free_name: Whether to write to a similar free name if the existing folder may not be replaced, so
            that a result is not lost; the error states that name.

    Raises:
        InvalidInput: If the demonstrations differ in layout or period, path cannot be written, or the
            existing folder may not be replaced.
        OutputExists: If the existing folder may not be replaced and the result was written to the `path` of
            the error: with use_free_name, or if the folder appeared in the meantime.
    """
    files = _encode_files(demonstrations)
    if not use_free_name:
        require_replaceable(path, overwrite=overwrite)
    target = resolve_path(path)
    with atomic_folder(target, partial(require_demonstrations, target) if overwrite else None) as folder:
        for name, data in files.items():
            (folder / name).write_bytes(data)


def require_replaceable(path: str | Path, *, overwrite: bool) -> None:
    """Check that path is missing, empty or a folder of demonstrations, which may be replaced.

    Args:
        path: Folder to write.
        overwrite: Whether a folder of demonstrations may be replaced.

    Raises:
        InvalidInput: If path holds anything else, or anything at all without overwrite.
    """
    target = resolve_path(path)
    if not path_exists(target) and (overwrite or not path_exists(path, follow_links=False)):
        return
    if is_folder(target) and not _list_folder(target):
        return
    if not overwrite:
        raise InvalidInput(f"{path} exists; choose another place, or pass overwrite=True")
    require_demonstrations(target, target)


def _read_manifest(folder: Path) -> Manifest:
    if not is_folder(folder):
        fix = f": {MANIFEST_FIX}" if path_exists(folder) else "; check the name"
        raise InvalidInput(f"{folder} is not a folder, expected one with {MANIFEST_NAMES[0]} in it{fix}")
    present = [name for name in MANIFEST_NAMES if is_file(folder / name)]
    if len(present) != 1:
        found, fix = ("both", "remove one") if present else ("neither", MANIFEST_FIX)
        raise InvalidInput(
            f"{folder} has {found} of {' and '.join(MANIFEST_NAMES)}, expected exactly one: {fix}"
        )
    return parse_manifest(_read_inside(folder, present[0], "a manifest", MAX_MANIFEST_BYTES), present[0])


def _read_inside(folder: Path, name: str, expected: str, max_bytes: int) -> bytes:
    """Return the bytes of a file in the folder; a link must not lead out of it."""
    file = folder / name
    if not resolve_path(file).is_relative_to(resolve_path(folder)):
        raise InvalidInput(f"{file} is a link to a file outside the folder; copy that file into the folder")
    return read_file(file, expected, max_bytes)


def _read_arrays(
    folder: Path, file: str, sha256: str, layout: Layout, period: float
) -> dict[str, Float[Array, "..."]]:
    is_csv = file.endswith(".csv")
    data = _read_inside(folder, file, "a table of rows", MAX_CSV_BYTES if is_csv else MAX_NPZ_BYTES)
    if sha256 and sha256 != (actual := hashlib.sha256(data).hexdigest()):
        raise InvalidInput(
            f"{file}: changed after it was written: its sha256 is {actual[:12]}..., the manifest expects "
            f"{sha256[:12]}...; if the change is meant, delete its sha256 and the manifest's own"
        )
    return {"x": decode_csv(data, file, layout.names, period)} if is_csv else decode_npz(data, file)


def _require_expected_arrays(arrays: dict[str, Float[Array, "..."]], file: str, frames: Frames) -> None:
    moving = [key for given in frames.values() if isinstance(given, tuple) for key in given]
    expected = {"x", *moving}
    if missing := sorted(expected - arrays.keys()):
        hint = "; moving frames need an NPZ file" if file.endswith(".csv") else ""
        raise InvalidInput(f"{file} has no array {missing[0]!r}, it has {short_list(sorted(arrays))}{hint}")
    if extra := sorted(arrays.keys() - expected):
        raise InvalidInput(
            f"{file} has an array {short_repr(extra[0])} that no frame names; name it or remove it"
        )


def _build_frame(
    name: str, given: Frame | tuple[str, str], arrays: dict[str, Float[Array, "..."]]
) -> Frame | MovingFrame:
    return given if isinstance(given, Frame) else moving_frame(name, arrays[given[0]], arrays[given[1]])


def _encode_files(demonstrations: Sequence[Demonstration]) -> dict[str, bytes]:
    """Return the content of every file of the folder, by name."""
    _require_same_layout(demonstrations)
    files: dict[str, bytes] = {}
    entries: list[dict[str, Any]] = []
    for m, demo in enumerate(demonstrations):
        file = _table_name(m, demo, len(demonstrations))
        files[file] = _encode_rows(demo)
        sha256 = hashlib.sha256(files[file]).hexdigest()
        entries.append({"name": demo.name, "file": file, "sha256": sha256, "frames": _frames_to_dicts(demo)})
    first = demonstrations[0]
    content = {"period": first.period, "layout": layout_to_dicts(first.layout), "demonstration": entries}
    return {**files, "demonstrations.json": serialise_manifest(content)}


def _require_same_layout(demonstrations: Sequence[Demonstration]) -> None:
    if not demonstrations:
        raise InvalidInput("no demonstrations to write, expected at least one")
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
    suffix = ".npz" if _has_moving_frames(demo) else ".csv"
    return "-".join([f"{m + 1:0{len(str(count))}d}", *filter(None, [words])]) + suffix


def _encode_rows(demo: Demonstration) -> bytes:
    if not _has_moving_frames(demo):
        return encode_csv(demo.x, demo.layout.names)
    arrays = {"x": demo.x}
    for n, given in enumerate(demo.frames):
        if given.is_moving:
            arrays |= {f"A{n}": given.A, f"b{n}": given.b}
    return encode_npz(arrays)


def _frames_to_dicts(demo: Demonstration) -> list[dict[str, Any]]:
    """Return the frames as JSON values; none for the world frame, which `demonstration` adds itself."""
    first = demo.frames[0]
    if len(demo.frames) == 1 and first.is_world and first.name == world_frame(1).name:
        return []
    return [_frame_to_dict(n, given) for n, given in enumerate(demo.frames)]


def _frame_to_dict(n: int, given: Frame | MovingFrame) -> dict[str, Any]:
    if given.is_moving:
        return {"name": given.name, "A": f"A{n}", "b": f"b{n}"}
    return {"name": given.name, "A": np.asarray(given.A).tolist(), "b": np.asarray(given.b).tolist()}


def require_demonstrations(target: Path, folder: Path) -> None:
    """Check that a folder holds demonstrations and nothing else, and may thus be replaced.

    Args:
        target: Usual name of the folder, for messages.
        folder: Folder.

    Raises:
        InvalidInput: If it holds anything else.
    """
    try:
        known = {*MANIFEST_NAMES, *_read_manifest(folder)[2]}
        names = _list_folder(folder)
    except InvalidInput as error:
        raise InvalidInput(
            f"{target} is not a folder of demonstrations and is not replaced ({error}); choose another place"
        ) from error
    if unknown := sorted(name for name in names if name not in known):
        raise InvalidInput(
            f"{target} also holds {short_repr(unknown[0])}, which its manifest does not name; move that away"
        )


def _list_folder(folder: Path) -> list[str]:
    try:
        return [file.name for file in folder.iterdir()]
    except OSError as error:
        raise InvalidInput(f"{folder} cannot be listed: {error.strerror}; choose another place") from error
