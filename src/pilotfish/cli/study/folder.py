"""Folder of a study: settings, skills, and one line of JSON for each finished run.

    settings.json      seed, and whether it is the quick study
    skills/NAME.bytes  skills, learned once
    runs.jsonl         finished runs, in the order in which they finished

A line is written and flushed when its run has finished. If the program is killed while it writes, the last
line has no line break. Such a line is removed when the study continues. One process at a time works in the
folder.
"""

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pilotfish.errors import InvalidInput
from pilotfish.io import atomic_file, make_folder, path_exists, read_file

FORMAT, VERSION = "pilotfish-study", 1
SETTINGS, RUNS, SKILLS = "settings.json", "runs.jsonl", "skills"
MAX_SETTINGS, MAX_RUNS, MAX_SKILL = 2**12, 2**26, 2**26  # bytes
OPTIONS = {"seed": "--seed", "quick": "--quick"}

Run = dict[str, Any]
"""Measures of a finished run, as `perform_study_run` returns them."""


def open_folder(folder: Path, *, seed: int, quick: bool) -> None:
    """Make the folder of a study, or check that its settings are the same.

    Args:
        folder: Folder, which may exist.
        seed: Seed of the study.
        quick: Whether it is the quick study.

    Raises:
        InvalidInput: If the folder cannot be used, or belongs to a study with other settings.
    """
    make_folder(folder / SKILLS)
    file = folder / SETTINGS
    given = {"format": FORMAT, "version": VERSION, "seed": seed, "quick": quick}
    if path_exists(file):
        _require_equal_settings(folder, _read_settings(file), given)
        return
    if path_exists(folder / RUNS):
        raise InvalidInput(f"{folder} has {RUNS} without {SETTINGS}; choose another folder for --out")
    with atomic_file(file, overwrite=False) as part:
        part.write_text(json.dumps(given) + "\n", encoding="utf-8")


def _read_settings(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(read_file(file, "settings of a study", MAX_SETTINGS))
    except ValueError:
        found = None
    if not isinstance(found, dict) or found.get("format") != FORMAT or found.get("version") != VERSION:
        raise InvalidInput(f"{file} has no settings of a study; choose another folder for --out")
    return found


def _require_equal_settings(folder: Path, found: Mapping[str, Any], given: Mapping[str, Any]) -> None:
    for key, option in OPTIONS.items():
        if found.get(key) != given[key]:
            was = f"with {option}" if found.get(key) is True else f"without {option}"
            was = f"with {option} {found.get(key)}" if key == "seed" else was
            raise InvalidInput(
                f"{folder} has a study {was}; give the same options to continue, or another folder for --out"
            )


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Keep other processes from working in the folder.

    Args:
        folder: Folder of a study.

    Raises:
        InvalidInput: If another process works in it.
    """
    descriptor = os.open(folder / SETTINGS, os.O_RDONLY | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as error:
        raise InvalidInput(
            f"another process works in {folder}; wait for it, or choose another folder for --out"
        ) from error
    finally:
        os.close(descriptor)


def read_runs(folder: Path) -> dict[str, Run]:
    """Return the finished runs by their keys; a last line without a line break is ignored.

    Args:
        folder: Folder of a study.

    Raises:
        InvalidInput: If another line is not a run.
    """
    file = folder / RUNS
    if not path_exists(file):
        return {}
    runs: dict[str, Run] = {}
    complete, _, _ = read_file(file, "runs of a study", MAX_RUNS).rpartition(b"\n")
    for number, line in enumerate(complete.split(b"\n") if complete else (), start=1):
        try:
            run = json.loads(line)
            runs.setdefault(run["run"], run)
        except (ValueError, TypeError, KeyError) as error:
            raise InvalidInput(
                f"line {number} of {file} is not a run; delete the line, and the run is repeated"
            ) from error
    return runs


class RunLog:
    """Appends finished runs to the folder; a torn last line is removed first."""

    def __init__(self, folder: Path) -> None:
        self._file = (folder / RUNS).open("ab+")
        self._file.seek(0)
        complete, line_break, _ = self._file.read().rpartition(b"\n")
        self._file.truncate(len(complete) + len(line_break))

    def append(self, run: Run) -> None:
        """Write a run and flush.

        Args:
            run: Finished run.

        Raises:
            InvalidInput: If it cannot be written.
        """
        try:
            self._file.write(json.dumps(run, allow_nan=False).encode() + b"\n")
            self._file.flush()
        except OSError as error:
            raise InvalidInput(
                f"{self._file.name} cannot be written: {error.strerror}; free some space, and give the same "
                "command to continue"
            ) from error

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_skill(folder: Path, name: str) -> bytes | None:
    """Return the bytes of a skill of the study; None if it was not learned yet.

    Args:
        folder: Folder of a study.
        name: Name of the skill.
    """
    file = folder / SKILLS / f"{name}.bytes"
    return read_file(file, "a skill", MAX_SKILL) if path_exists(file) else None


def write_skill(folder: Path, name: str, skill: bytes) -> None:
    """Write the bytes of a skill.

    Args:
        folder: Folder of a study.
        name: Name of the skill.
        skill: Its bytes.
    """
    with atomic_file(folder / SKILLS / f"{name}.bytes") as part:
        part.write_bytes(skill)
