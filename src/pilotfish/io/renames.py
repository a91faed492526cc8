"""Renames of files and folders in one step, and synchronisation with the disk.

`renameat2` (Linux 3.15) renames without replacing and exchanges two names, each atomically. File systems
without it fall back: a hard link, or an empty file, takes a free name; a folder is exchanged in two renames
(see `atomic_writes`).
"""

import ctypes
import os
from collections.abc import Callable
from errno import EACCES, EINVAL, ENOSYS, ENOTSUP, EPERM
from functools import cache
from itertools import count
from pathlib import Path

from pilotfish.errors import InvalidInput

_NOREPLACE, _EXCHANGE = 1, 2  # flags of renameat2, see linux/fs.h
_AT_FDCWD = -100
_UNSUPPORTED = {EINVAL, ENOSYS, ENOTSUP}


def rename_exclusive(source: Path, target: Path) -> None:
    """Rename a file to a free name in one step, so that no other process can take the name in between.

    Without renameat2 a hard link takes the name. Without hard links an empty file takes it, and source then
    replaces that file.

    Args:
        source: File to rename.
        target: Name that must be free.

    Raises:
        FileExistsError: If anything has that name, a link without a target included.
        OSError: If the file system refuses.
    """
    if _renameat2(source, target, _NOREPLACE):
        return
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError as error:
        if error.errno not in {*_UNSUPPORTED, EPERM}:
            raise
        _rename_over_empty_file(source, target)
    else:
        source.unlink()


def exchange_paths(first: Path, second: Path) -> bool:
    """Exchange the names of two files or folders in one step.

    Args:
        first: File or folder.
        second: File or folder that takes the name of the first.

    Returns:
        False if the system or the file system does not support it; nothing has changed then.

    Raises:
        OSError: If the file system refuses.
    """
    return _renameat2(first, second, _EXCHANGE)


def rename_to_free_name(source: Path, target: Path, rename: Callable[[Path, Path], None]) -> Path:
    """Rename source to a free name similar to target, in the folder of target.

    Args:
        source: File or folder to rename.
        target: Name that is taken.
        rename: Function that renames to a free name and raises FileExistsError for a taken one.

    Returns:
        The new path of source.

    Raises:
        OSError: If the file system refuses.
    """
    for n in count(1):
        free = target.with_name(f"{target.stem[:40]}-{n}{target.suffix[-10:]}")  # a name has up to 255 bytes
        try:
            rename(source, free)
        except FileExistsError:
            continue
        return free
    raise AssertionError("count() does not end")


def fsync_path(path: Path) -> None:
    """Wait until the content of a file, or the names in a folder, are on the disk.

    Args:
        path: File or folder.

    Raises:
        OSError: If the file system refuses.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        if error.errno == EACCES and path.is_dir():  # a folder that may be written to, but not listed
            return
        raise
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _UNSUPPORTED:  # some file systems cannot synchronise folders
            raise
    finally:
        os.close(descriptor)


def make_folder(path: Path, fix: str = "choose another folder") -> None:
    """Make a folder and its parents if they do not exist.

    Args:
        path: Folder to make.
        fix: What the user should do if that fails; the message ends with it.

    Raises:
        InvalidInput: If the folder cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or error
        raise InvalidInput(f"{path} cannot be made: {reason}; {fix}") from error


def _rename_over_empty_file(source: Path, target: Path) -> None:
    os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC))
    try:
        source.replace(target)
    except OSError:
        target.unlink()
        raise


def _renameat2(source: Path, target: Path, flag: int) -> bool:
    """Return False if the system or the file system lacks the flag."""
    if (call := _libc_renameat2()) is None:
        return False
    if call(_AT_FDCWD, os.fsencode(source), _AT_FDCWD, os.fsencode(target), flag) == 0:
        return True
    if (number := ctypes.get_errno()) in _UNSUPPORTED:
        return False
    raise OSError(number, os.strerror(number), str(source), None, str(target))


@cache
def _libc_renameat2() -> Callable[..., int] | None:
    call = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if call is not None:
        call.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_uint]
    return call
