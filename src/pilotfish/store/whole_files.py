"""Files that are there whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from pilotfish.errors import InvalidInput


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A place beside path to write to; it takes path's name once everything lies on the disk.

    Whatever goes wrong before, an interrupt too, leaves what stood at path as it was and nothing beside it.
    Raises: InvalidInput, when path cannot be written or is something other than a file.
    """
    path = Path(path)
    if path.exists() and not path.is_file():
        raise InvalidInput(f"{path} is no regular file; give the name of a file, there or not yet there")
    part = path.with_name(f".{uuid4().hex}{path.suffix[-10:]}")  # writers look at the ending
    try:
        yield part
        _to_disk(part)
        part.replace(path)
        _to_disk(path.parent)  # the new name too
    except OSError as error:
        raise InvalidInput(
            f"{path} cannot be written: {error.strerror or error}; choose another folder or make room"
        ) from error
    finally:
        _forget(part)


def _to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _forget(part: Path) -> None:
    with suppress(OSError):  # there never was one: its folder is no folder
        part.unlink(missing_ok=True)
