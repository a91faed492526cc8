"""Large sets of demonstrations, which are read in groups: folders of demonstrations and LeRobot data sets.

A group names files and numbers only, so that another process, or a worker on another machine, can read it.
"""

from dataclasses import dataclass
from pathlib import Path

from pilotfish.demonstrations import BuildSettings, Demonstration, build_demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_descriptions import restore_demonstration
from pilotfish.io.demonstration_folder import count_demonstrations, read_demonstrations
from pilotfish.io.paths import path_exists
from pilotfish.io.readers.lerobot import read_episodes
from pilotfish.io.readers.lerobot_metadata import is_data_set, read_lengths, read_metadata
from pilotfish.validation import require_count, require_type, shorten_repr

MAX_GROUP = 10**6  # demonstrations


@shorten_repr
@dataclass(frozen=True, slots=True)
class GroupFiles:
    """Where some consecutive demonstrations of a set are.

    Attributes:
        path: Folder of the set.
        start: Number of the first demonstration, from 0.
        stop: Number after the last one.
        episodes: Number and rows of each episode of a LeRobot data set; empty for other folders.
        settings: How a LeRobot data set of others becomes demonstrations.
    """

    path: str
    start: int
    stop: int
    episodes: tuple[tuple[int, int], ...] = ()
    settings: BuildSettings | None = None


def list_groups(path: str | Path, size: int, settings: BuildSettings | None = None) -> tuple[GroupFiles, ...]:
    """List the groups of a set; only its manifest or metadata is read.

    Args:
        path: Folder of demonstrations, or LeRobot data set.
        size: Number of demonstrations of a group; the last may have fewer.
        settings: Columns of a LeRobot data set that another program wrote.

    Returns:
        The groups, in order.

    Raises:
        InvalidInput: If the manifest or the metadata cannot be used, or lists no demonstrations.
    """
    require_type(path, "path", (str, Path), "give the folder of a set")
    require_count(size, "size", MAX_GROUP, 1)
    episodes: list[tuple[int, int]] = []
    if is_lerobot(path):
        folder = Path(path)
        episodes = sorted(read_lengths(folder, read_metadata(folder)).items())
        count = len(episodes)
    else:
        count = count_demonstrations(path)
    if not count:
        raise InvalidInput(f"{path} lists no demonstrations, expected at least one; check the folder")
    starts = range(0, count, size)
    return tuple(
        GroupFiles(str(path), m, min(m + size, count), tuple(episodes[m : m + size]), settings)
        for m in starts
    )


def is_lerobot(path: str | Path) -> bool:
    """Return whether a folder is a LeRobot data set.

    Args:
        path: Folder.
    """
    return is_data_set(Path(path))


def read_group(files: GroupFiles) -> tuple[Demonstration, ...]:
    """Read the demonstrations of a group.

    Args:
        files: The group.

    Returns:
        The demonstrations, in order.

    Raises:
        InvalidInput: If the folder is missing, or anything in it is wrong; the message names it.
    """
    if not path_exists(files.path):
        raise InvalidInput(f"{files.path} does not exist here, expected the folder at the same path")
    if not files.episodes:
        return read_demonstrations(files.path, range(files.start, files.stop))
    recordings = read_episodes(Path(files.path), dict(files.episodes))
    demonstrations = []
    for recording in recordings:
        if files.settings is not None:
            demo: Demonstration | None = build_demonstration(recording, files.settings)[0]
        else:
            demo = restore_demonstration(recording)
        if demo is None:
            raise InvalidInput(
                f"{files.path}: {recording.name} was not written by pilotfish; name its columns in settings"
            )
        demonstrations.append(demo)
    return tuple(demonstrations)
