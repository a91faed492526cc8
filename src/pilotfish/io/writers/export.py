"""Writers of demonstrations for other programs, one module for each format.

A new format is one module with `write(demonstrations, path, *, overwrite=False)`, and its name in `WRITERS`.
"""

import importlib
from collections.abc import Iterable
from pathlib import Path

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.validation import nearest_name, short_repr

# Module of each format, imported when it is used.
WRITERS = {
    "lerobot": "lerobot_dataset",
    "robomimic": "robomimic_file",
    "mcap": "ros_mcap",
    "csv": "csv_tables",
}


def export_demonstrations(
    demonstrations: Iterable[Demonstration], path: str | Path, name: str, *, overwrite: bool = False
) -> None:
    """Write demonstrations in a format of other programs; an import restores all but "csv" exactly.

    Args:
        demonstrations: At least one; all share layout and period. A generator is read one at a time.
        path: Folder of a LeRobot data set, of MCAP bags or of CSV tables, or file of robomimic.
        name: Format: "lerobot" (version 3), "robomimic", "mcap" (ROS 2 bags) or "csv".
        overwrite: Whether an existing output of the same format may be replaced.

    Raises:
        InvalidInput: If the format is unknown, the demonstrations differ, path cannot be written, or the
            library of the format is not installed.
    """
    if name not in WRITERS:
        near = nearest_name(name, WRITERS)
        hint = f"; did you mean {near!r}?" if near else ""
        raise InvalidInput(f"the format is {short_repr(name)}, expected one of {', '.join(WRITERS)}{hint}")
    module = importlib.import_module(f"pilotfish.io.writers.{WRITERS[name]}")
    module.write(demonstrations, path, overwrite=overwrite)
