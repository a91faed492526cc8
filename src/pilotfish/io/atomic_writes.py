"""Atomic writes: a file or folder is either complete or absent.

The caller writes to a temporary name beside the target, `.pilotfish-*`. At the end the content is
synchronised with the disk, the temporary name is renamed to the target in one step, and the folder is
synchronised. Invariants:

- at every moment the target is the old content, the new content, or absent if it did not exist;
- after an exception or an interrupt the target is unchanged and no temporary file is left;
- a killed process may leave a hidden `.pilotfish-*`, which nothing reads;
- a result whose name another process took is kept under a free name, which `OutputExists` states.

Folders that replace others are exchanged with them in one step (`exchange_paths`). Without that system call
there are two renames: only a process killed between them leaves the target absent. The old content is then in
`.pilotfish-*-old` beside it.
"""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from errno import EEXIST, ENOTDIR, ENOTEMPTY
from pathlib import Path
from secrets import token_hex

from pilotfish.errors import InvalidInput, OutputExists
from pilotfish.io.paths import is_file, is_folder, is_link, path_exists, resolve_path
from pilotfish.io.renames import exchange_paths, fsync_path, rename_exclusive, rename_to_free_name

_EXISTS_ERRORS = {EEXIST, ENOTDIR, ENOTEMPTY}  # errors of a folder renamed over a file or a non-empty folder


@contextmanager
def atomic_file(path: str | Path, *, overwrite: bool = True) -> Iterator[Path]:
    """Yield a temporary path to write a file to; at the end it is renamed to path.

    Args:
        path: File to write. With overwrite a link is followed, and its target is replaced.
        overwrite: Whether an existing file may be replaced. The check is part of the rename, so a file that
            another process makes in the meantime is kept.

    Yields:
        Path in the same folder, with the same suffix.

    Raises:
        InvalidInput: If path cannot be written, or is not a regular file.
        OutputExists: If path exists and overwrite is False; the result is kept under another name.
    """
    target = resolve_path(path) if overwrite else Path(path)
    if path_exists(target) and not is_file(target):
        raise InvalidInput(f"{path} is not a regular file; give the name of a file, existing or new")
    temporary = target.with_name(f".pilotfish-{token_hex(8)}{target.suffix[-10:]}")  # writers read the suffix
    try:
        try:
            yield temporary
            fsync_path(temporary)
            _rename_file(temporary, target, overwrite)
            fsync_path(target.parent)
        except OSError as error:
            raise _write_error(path, error) from error
        finally:
            _remove_file(temporary)
    finally:
        _remove_file(temporary)  # again: an interrupt may have cut the first attempt short


@contextmanager
def atomic_folder(
    path: str | Path, require_replaceable: Callable[[Path], None] | None = None
) -> Iterator[Path]:
    """Yield a temporary folder to fill; at the end it is renamed to path.

    Args:
        path: Folder to write, or a link to one. A missing or empty folder is replaced without a check.
        require_replaceable: Function that raises InvalidInput if the content of a folder must be kept. It is
            called again after the old folder was renamed, so files that arrive in the meantime are kept too.
            None refuses to replace anything.

    Yields:
        Empty folder beside path.

    Raises:
        InvalidInput: If path cannot be written.
        OutputExists: If path exists and may not be replaced; the result is kept under another name.
    """
    target = resolve_path(path)
    temporary = target.with_name(f".pilotfish-{token_hex(8)}")
    try:
        try:
            temporary.mkdir()
            yield temporary
            for file in temporary.iterdir():
                fsync_path(file)
            fsync_path(temporary)
            _replace_folder(temporary, target, require_replaceable)
            fsync_path(target.parent)
        except OSError as error:
            raise _write_error(target, error) from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)  # again: see atomic_file


def _write_error(path: str | Path, error: OSError) -> InvalidInput:
    reason = error.strerror or error
    return InvalidInput(f"{path} cannot be written: {reason}; choose another folder or free some space")


def _remove_file(path: Path) -> None:
    with suppress(OSError):
        path.unlink(missing_ok=True)


def _rename_file(temporary: Path, target: Path, overwrite: bool) -> None:
    if overwrite:
        temporary.replace(target)
        return
    try:
        rename_exclusive(temporary, target)
    except FileExistsError as error:
        raise _keep_result(temporary, target, rename_exclusive, f"{target} exists and is kept") from error


def _replace_folder(
    temporary: Path, target: Path, require_replaceable: Callable[[Path], None] | None
) -> None:
    """Rename temporary to target; what was at target is at temporary afterwards, and is removed there."""
    try:
        _rename_folder(temporary, target)  # succeeds only if target is missing or an empty folder
    except FileExistsError as error:
        if require_replaceable is None or not is_folder(target):
            raise _keep_result(temporary, target, _rename_folder, f"{target} exists and is kept") from error
        _exchange_folders(temporary, target)
        try:
            require_replaceable(temporary)
        except InvalidInput as refusal:
            _exchange_folders(temporary, target)
            raise _keep_result(temporary, target, _rename_folder, str(refusal)) from refusal


def _keep_result(
    temporary: Path, target: Path, rename: Callable[[Path, Path], None], reason: str
) -> OutputExists:
    """Rename the result to a free name and return the error that states it."""
    kept_path = rename_to_free_name(temporary, target, rename)
    return OutputExists(f"{reason}; this result is in {kept_path}", kept_path)


def _exchange_folders(temporary: Path, target: Path) -> None:
    """Exchange two folders, in two renames if one step is unsupported; an interrupt restores the old one."""
    if exchange_paths(temporary, target):
        return
    old = temporary.with_name(f"{temporary.name}-old")
    try:
        target.rename(old)
        temporary.rename(target)
    finally:
        if path_exists(old):
            old.rename(temporary if path_exists(target) else target)


def _rename_folder(source: Path, target: Path) -> None:
    """Rename a folder to a free name or over an empty folder; raise FileExistsError otherwise."""
    try:
        source.rename(target)
    except OSError as error:
        if error.errno in _EXISTS_ERRORS and (path_exists(target) or is_link(target)):
            raise FileExistsError(EEXIST, "File exists", str(target)) from error
        raise
