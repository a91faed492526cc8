"""Folders that are there whole or not at all."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from errno import EEXIST, ENOTDIR, ENOTEMPTY
from pathlib import Path
from secrets import token_hex

from pilotfish.errors import InvalidInput, OutputExists
from pilotfish.io.paths import is_folder, is_link, path_exists, resolve_path
from pilotfish.io.renaming import exchange_paths, fsync_path, rename_to_free_name

_EXISTS_ERRORS = {EEXIST, ENOTDIR, ENOTEMPTY}  # what renaming a folder over a file or a filled folder gives


@contextmanager
def atomic_folder(
    path: str | Path, require_replaceable: Callable[[Path], None] | None = None
) -> Iterator[Path]:
    """Yield a folder to fill, beside path; at the end it takes the name path, whole and on the disk.

    What replaces a folder exchanges names with it in one step (renameat2, Linux 3.15), so that path leads to
    the old content or to the new one at every moment. Where the system or the file system lacks that step,
    there are two renames, and only a process that is killed between them leaves path missing; the old content
    is then in .pilotfish-*-old beside it. An error or an interrupt leaves what was at path as it was, and
    nothing beside it.

    Args:
        path: The folder, or a link to one. Missing folders and empty ones are replaced without a question.
        replaceable: Raises InvalidInput if what is in the given folder must stay. It is asked again once the
            old folder is out of reach, so that files which arrive in the meantime are kept too. None
            refuses to replace anything.

    Raises:
        InvalidInput: If path cannot be written.
        NameTaken: If path exists and may not be replaced, or what must stay came into it; what was written
            is kept under another name.
    """
    place = resolve_path(path)
    temporary_folder = place.with_name(f".pilotfish-{token_hex(8)}")
    try:
        try:
            temporary_folder.mkdir()
            yield temporary_folder
            _fsync_folder(temporary_folder)
            _rename_into_place(temporary_folder, place, require_replaceable)
            fsync_path(place.parent)
        except OSError as error:
            raise InvalidInput(
                f"{place} cannot be written: {error.strerror or error}; choose another folder or make room"
            ) from error
        finally:
            shutil.rmtree(temporary_folder, ignore_errors=True)
    finally:
        shutil.rmtree(
            temporary_folder, ignore_errors=True
        )  # again: an interrupt may have cut the first attempt short


def _fsync_folder(folder: Path) -> None:
    for file in folder.iterdir():
        fsync_path(file)
    fsync_path(folder)


def _rename_into_place(
    temporary_folder: Path, place: Path, require_replaceable: Callable[[Path], None] | None
) -> None:
    """Rename built to place; afterwards built is gone, or is what was at place before."""
    try:
        _rename_folder(
            temporary_folder, place
        )  # the system refuses unless place is missing or an empty folder
    except FileExistsError as error:
        if require_replaceable is None or not is_folder(place):
            kept_path = rename_to_free_name(temporary_folder, place, _rename_folder)
            raise OutputExists(
                f"{place} exists and is kept; this result is in {kept_path}", kept_path
            ) from error
        _exchange_and_check(temporary_folder, place, require_replaceable)


def _exchange_and_check(
    temporary_folder: Path, place: Path, require_replaceable: Callable[[Path], None]
) -> None:
    if not exchange_paths(temporary_folder, place):
        _replace_in_two_steps(temporary_folder, place)
    try:
        require_replaceable(temporary_folder)
    except InvalidInput as error:
        if not exchange_paths(temporary_folder, place):
            _replace_in_two_steps(temporary_folder, place)
        kept_path = rename_to_free_name(temporary_folder, place, _rename_folder)
        raise OutputExists(f"{error}; this result is in {kept_path}", kept_path) from error


def _replace_in_two_steps(temporary_folder: Path, place: Path) -> None:
    """Exchange two folders where the system cannot do it in one step; an interrupt puts the old one back."""
    old = temporary_folder.with_name(f"{temporary_folder.name}-old")
    try:
        place.rename(old)
        temporary_folder.rename(place)
    finally:
        if path_exists(old):
            old.rename(temporary_folder if path_exists(place) else place)


def _rename_folder(source: Path, target: Path) -> None:
    """Rename a folder to a name that is free or an empty folder.    Raises: FileExistsError, OSError."""
    try:
        source.rename(target)
    except OSError as error:
        if error.errno in _EXISTS_ERRORS and (path_exists(target) or is_link(target)):
            raise FileExistsError(EEXIST, "File exists", str(target)) from error
        raise
