"""Files that are there whole or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

from pilotfish.errors import InvalidInput, OutputExists
from pilotfish.io.paths import is_file, path_exists, resolve_path
from pilotfish.io.renaming import fsync_path, rename_exclusive, rename_to_free_name


@contextmanager
def atomic_file(path: str | Path, *, overwrite: bool = True) -> Iterator[Path]:
    """Yield a path to write to, in the folder of path; at the end that file takes the name path in one step.

    An error or an interrupt before that leaves what was at path as it was, and nothing beside it. A process
    that is killed may leave a hidden file, .pilotfish-*, which nothing reads.

    Args:
        path: The file. With overwrite, a link is followed, and the file that it leads to is replaced.
        overwrite: Whether an existing file may be replaced. The check is part of the last step, so that a
            file is kept whenever another process makes it.

    Raises:
        InvalidInput: If path cannot be written, or is no regular file.
        NameTaken: If path exists and may not be replaced; what was written is kept under another name.
    """
    target = _resolve_target(Path(path), overwrite)
    temporary = target.with_name(
        f".pilotfish-{token_hex(8)}{target.suffix[-10:]}"
    )  # writers look at the ending
    try:
        try:
            yield temporary
            fsync_path(temporary)
            _rename_into_place(temporary, target, overwrite)
            fsync_path(target.parent)
        except OSError as error:
            raise InvalidInput(
                f"{path} cannot be written: {error.strerror or error}; choose another folder or make room"
            ) from error
        finally:
            _remove(temporary)
    finally:
        _remove(temporary)  # again: an interrupt may have cut the first attempt short


def _resolve_target(path: Path, overwrite: bool) -> Path:
    target = resolve_path(path) if overwrite else path
    if path_exists(target) and not is_file(target):
        raise InvalidInput(f"{path} is no regular file; give the name of a file, there or not yet there")
    return target


def _rename_into_place(temporary: Path, target: Path, overwrite: bool) -> None:
    if overwrite:
        temporary.replace(target)
        return
    try:
        rename_exclusive(temporary, target)
    except FileExistsError as error:
        kept_path = rename_to_free_name(temporary, target, rename_exclusive)
        raise OutputExists(
            f"{target} exists and is kept; this result is in {kept_path}", kept_path
        ) from error


def _remove(temporary: Path) -> None:
    with suppress(OSError):
        temporary.unlink(missing_ok=True)
