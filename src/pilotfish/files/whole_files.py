"""Files that are there whole or not at all."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex

from pilotfish.errors import InvalidInput, NameTaken
from pilotfish.files.renaming import rename_beside, rename_new, synchronise
from pilotfish.validation import is_file, path_exists, resolve_path


@contextmanager
def whole_file(path: str | Path, *, overwrite: bool = True) -> Iterator[Path]:
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
    target = _target(Path(path), overwrite)
    part = target.with_name(f".pilotfish-{token_hex(8)}{target.suffix[-10:]}")  # writers look at the ending
    try:
        try:
            yield part
            synchronise(part)
            _take_name(part, target, overwrite)
            synchronise(target.parent)
        except OSError as error:
            raise InvalidInput(
                f"{path} cannot be written: {error.strerror or error}; choose another folder or make room"
            ) from error
        finally:
            _remove(part)
    finally:
        _remove(part)  # again: an interrupt may have cut the first attempt short


def _target(path: Path, overwrite: bool) -> Path:
    target = resolve_path(path) if overwrite else path
    if path_exists(target) and not is_file(target):
        raise InvalidInput(f"{path} is no regular file; give the name of a file, there or not yet there")
    return target


def _take_name(part: Path, target: Path, overwrite: bool) -> None:
    if overwrite:
        part.replace(target)
        return
    try:
        rename_new(part, target)
    except FileExistsError as error:
        kept = rename_beside(part, target, rename_new)
        raise NameTaken(f"{target} exists and is kept; this result is in {kept}", kept) from error


def _remove(part: Path) -> None:
    with suppress(OSError):
        part.unlink(missing_ok=True)
