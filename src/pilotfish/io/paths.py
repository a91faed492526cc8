"""Paths and files from outside, without surprises.

`Path.exists` and similar functions raise OSError or RuntimeError for a name that is too long, a link to
itself or a folder without permission. Opening a FIFO waits for a writer, and reading a device may never end.
The functions in this module raise InvalidInput instead, and read regular files of bounded size only.
"""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EACCES, ENAMETOOLONG, ENOENT, ENOTDIR
from pathlib import Path
from typing import IO

from pilotfish.errors import InvalidInput, escape

MAX_FILE_BYTES = 2**30
CHUNK_BYTES = 2**20  # bytes per read

_MISSING = {ENOENT, ENOTDIR}


def path_exists(path: str | Path, *, follow_links: bool = True) -> bool:
    """Return whether a file, folder or link exists at path.

    Args:
        path: Path to look up.
        follow_links: Whether the target of a link must exist too. With False, a link without a target exists.

    Raises:
        InvalidInput: If the system cannot tell: the name is too long, a folder denies permission, or a link
            leads to itself.
    """
    return _stat(path, follow_links) is not None


def is_folder(path: str | Path) -> bool:
    """Return whether path is a folder, or a link to one.

    Args:
        path: Path to look up.

    Raises:
        InvalidInput: As `path_exists`.
    """
    return (status := _stat(path)) is not None and stat.S_ISDIR(status.st_mode)


def is_file(path: str | Path) -> bool:
    """Return whether path is a regular file, or a link to one.

    Args:
        path: Path to look up.

    Raises:
        InvalidInput: As `path_exists`.
    """
    return (status := _stat(path)) is not None and stat.S_ISREG(status.st_mode)


def is_link(path: str | Path) -> bool:
    """Return whether path is a link, whether or not its target exists.

    Args:
        path: Path to look up.

    Raises:
        InvalidInput: As `path_exists`.
    """
    return (status := _stat(path, follow_links=False)) is not None and stat.S_ISLNK(status.st_mode)


def resolve_path(path: str | Path) -> Path:
    """Return the absolute path without links.

    Args:
        path: Path to resolve; it need not exist.

    Raises:
        InvalidInput: As `path_exists`.
    """
    try:
        return Path(path).resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise _unusable_error(path, error, "choose another name") from error


@contextmanager
def open_regular_file(path: str | Path, expected: str) -> Iterator[IO[bytes]]:
    """Open a regular file for reading, without waiting for a writer.

    Args:
        path: File to open; a link to a regular file is followed.
        expected: What the file should be; the message ends with it, as in "expected a skill file".

    Yields:
        The open file, at its first byte.

    Raises:
        InvalidInput: If the file cannot be opened, or is a folder, a FIFO, a socket or a device.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except (OSError, ValueError) as error:
        raise _unreadable_error(path, error, expected) from error
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise InvalidInput(f"{_quote_path(path)} is not a regular file; expected {expected}")
    with os.fdopen(descriptor, "rb") as file:
        yield file


def read_file(path: str | Path, expected: str, max_bytes: int = MAX_FILE_BYTES) -> bytes:
    """Return the bytes of a regular file of bounded size.

    Args:
        path: File to read; a link to a regular file is followed.
        expected: What the file should be; the message ends with it, as in "expected a skill file".
        max_bytes: Largest size; a file that grows beyond it while it is read is refused too.

    Raises:
        InvalidInput: If the file cannot be opened or read, is not a regular file, or is larger.
    """
    with open_regular_file(path, expected) as file:
        try:
            data = _read_bounded(file, max_bytes) if os.fstat(file.fileno()).st_size <= max_bytes else None
        except OSError as error:
            raise _unreadable_error(path, error, expected) from error
    if data is None:
        raise InvalidInput(
            f"{_quote_path(path)} has more than {max_bytes} bytes; expected {expected} of at most that"
        )
    return data


def _read_bounded(file: IO[bytes], max_bytes: int) -> bytes | None:
    """Return all bytes, or None if there are more; `file.read(max_bytes)` would allocate that much first."""
    parts, size = [], 0
    while part := file.read(CHUNK_BYTES):
        parts.append(part)
        if (size := size + len(part)) > max_bytes:
            return None
    return b"".join(parts)


def _stat(path: str | Path, follow_links: bool = True) -> os.stat_result | None:
    try:
        return Path(path).stat(follow_symlinks=follow_links)
    except OSError as error:
        if error.errno in _MISSING:
            return None
        hint = {ENAMETOOLONG: "choose a shorter name", EACCES: "ask for permission or choose another place"}
        fix = hint.get(error.errno or 0, "choose another name")
        raise _unusable_error(path, error, fix) from error
    except ValueError as error:  # a null byte or a lone surrogate
        raise _unusable_error(path, error, "choose another name") from error


def _unusable_error(path: str | Path, error: Exception, fix: str) -> InvalidInput:
    return InvalidInput(f"{_quote_path(path)} cannot be used: {_error_reason(error)}; {fix}")


def _unreadable_error(path: str | Path, error: Exception, expected: str) -> InvalidInput:
    return InvalidInput(f"{_quote_path(path)} cannot be read: {_error_reason(error)}; expected {expected}")


def _error_reason(error: Exception) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def _quote_path(path: str | Path) -> str:
    text = escape(os.fspath(path))
    return text if len(text) <= 200 else f"{text[:100]}...{text[-90:]}"
