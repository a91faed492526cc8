"""Checks and folders that the writers of all formats share."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io.atomic_writes import atomic_folder
from pilotfish.io.paths import is_folder, path_exists
from pilotfish.io.renames import fsync_path
from pilotfish.types import Array, Float
from pilotfish.validation import require_type


def iter_alike(demonstrations: Iterable[Demonstration]) -> Iterator[Demonstration]:
    """Yield demonstrations that share layout and period.

    Args:
        demonstrations: At least one; a generator is read one at a time.

    Raises:
        InvalidInput: If there are none, or one differs from the first in layout or period.
    """
    require_type(demonstrations, "demonstrations", Iterable, "pass a list of demonstrations")
    first: Demonstration | None = None
    for m, demo in enumerate(demonstrations):
        require_type(demo, f"demonstration {m}", Demonstration, "create it with pilotfish.demonstrations")
        first = first or demo
        if (demo.layout, demo.period) != (first.layout, first.period):
            raise InvalidInput(
                f"demonstration {m} ({demo.name!r}) differs from the first in layout or period "
                f"({demo.period} s, {first.period} s); a data set has one of each: write two, or resample"
            )
        yield demo
    if first is None:
        raise InvalidInput("no demonstrations to write, expected at least one")


def next_rows(x: Float[Array, "T D"]) -> Float[Array, "T D"]:
    """Return the row after each row, which policies learn as the action; the last row is repeated.

    Args:
        x: Rows.
    """
    return np.concatenate([x[1:], x[-1:]])


@contextmanager
def export_folder(
    path: str | Path, recognises: Callable[[Path], bool], format_name: str, *, overwrite: bool
) -> Iterator[Path]:
    """Yield a temporary folder to fill, which replaces path at the end; everything in it is synchronised.

    Args:
        path: Folder to write.
        recognises: Function that returns whether a folder has this format; no other folder is replaced.
        format_name: Name of the format, for messages.
        overwrite: Whether a folder of this format may be replaced.

    Raises:
        InvalidInput: If path exists and may not be replaced, or cannot be written.
    """

    def require_replaceable(folder: Path) -> None:
        if not recognises(folder):
            raise InvalidInput(f"{path} has no {format_name} data and is kept; choose another folder")

    if path_exists(path, follow_links=False):
        if not overwrite:
            raise InvalidInput(f"{path} exists; choose another place, or pass overwrite=True")
        if not is_folder(path):
            raise InvalidInput(f"{path} is not a folder; choose another place")
        if any(Path(path).iterdir()):
            require_replaceable(Path(path))
    with atomic_folder(path, require_replaceable if overwrite else None) as folder:
        yield folder
        for file in folder.rglob("*"):
            fsync_path(file)
