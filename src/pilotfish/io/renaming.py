"""Renames that refuse to replace, or that exchange two names, each in one step; and what reaches the disk."""

import ctypes
import os
from collections.abc import Callable, Iterator
from errno import EACCES, EINVAL, ENOSYS, ENOTSUP, EPERM
from functools import cache
from pathlib import Path

from pilotfish.errors import InvalidInput

_NOREPLACE, _EXCHANGE = 1, 2  # flags of renameat2, see linux/fs.h
_AT_FDCWD = -100
_UNSUPPORTED = {EINVAL, ENOSYS, ENOTSUP}


def rename_exclusive(source: Path, target: Path) -> None:
    """Rename a file to a name that is free; in one step, so no other process can take the name in between.

    Without renameat2 (Linux 3.15, and a file system that knows its flags) a hard link takes the name. Without
    hard links an empty file does, and source then replaces it.

    Raises:
        FileExistsError: If anything has that name, a link without a target included.
        OSError: If the disk refuses.
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


def exchange_paths(one: Path, other: Path) -> bool:
    """Exchange two files or folders in one step; return False where that is unsupported.

    Raises:
        OSError: If the disk refuses.
    """
    return _renameat2(one, other, _EXCHANGE)


def rename_to_free_name(source: Path, target: Path, rename: Callable[[Path, Path], None]) -> Path:
    """Give source a free name that resembles target, in the same folder, and return it.

    Args:
        source: The file or folder to rename.
        target: The name that was taken.
        rename: Renames to a name that is free, and raises FileExistsError for another.

    Raises:
        OSError: If the disk refuses.
    """
    for name in _free_names(target):
        try:
            rename(source, target.with_name(name))
        except FileExistsError:
            continue
        return target.with_name(name)
    raise AssertionError("there is always another name")


def fsync_path(path: Path) -> None:
    """Wait until a file, or the names in a folder, lie on the disk.

    Raises:
        OSError: If the disk refuses.
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
    """Make a folder and those above it, where they do not exist.

    Args:
        path: The folder.
        fix: What to do if that is impossible, for the message.

    Raises:
        InvalidInput: If that is impossible.
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
    """Rename with a flag; False where the system or the file system lacks it."""
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


def _free_names(target: Path) -> Iterator[str]:
    n = 0
    while True:
        n += 1
        yield f"{target.stem[:40]}-{n}{target.suffix[-10:]}"  # 255 bytes are the longest name
