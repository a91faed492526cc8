"""Writer of robomimic data sets: an HDF5 file with a group `data/demo_N` per demonstration.

Each part of the layout is an observation, `obs/NAME`, and `actions` are the rows of the next step, as a
controller of positions takes them; the last one is repeated. `dones` is 1 in the last row, which is also the
`rewards`. Quaternions stay w x y z. The attributes `columns` and `units` of a data set name its columns, and
the data set `pilotfish` has the description that makes an import exact.
"""

import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import Demonstration, Layout
from pilotfish.errors import InvalidInput
from pilotfish.io.atomic_writes import atomic_file
from pilotfish.io.demonstration_descriptions import KEY, describe_demonstration
from pilotfish.io.optional_libraries import require_library
from pilotfish.io.paths import path_exists
from pilotfish.io.writers.exported_demonstrations import iter_alike, next_rows

MAX_NAME = 200  # characters of the name of a data set


def write(demonstrations: Iterable[Demonstration], path: str | Path, *, overwrite: bool = False) -> None:
    """Write a file that robomimic reads, and from which an import restores each demonstration exactly.

    Args:
        demonstrations: At least one; all share layout and period. A generator is read one at a time.
        path: File to write, usually `.hdf5`.
        overwrite: Whether an existing file may be replaced.

    Raises:
        InvalidInput: If the demonstrations differ in layout or period, path cannot be written or exists, or
            h5py is not installed.
    """
    h5py = require_library("h5py", "robomimic files")
    if not overwrite and path_exists(path, follow_links=False):
        raise InvalidInput(f"{path} exists; choose another name, or pass overwrite=True")
    with atomic_file(path, overwrite=overwrite) as temporary, h5py.File(temporary, "w") as file:
        data, total = file.create_group("data"), 0
        for m, demo in enumerate(iter_alike(demonstrations)):
            if m == 0:
                data.attrs["env_args"] = _environment(demo)
            _write_demonstration(data.create_group(f"demo_{m}"), demo)
            total += len(demo.x)
        data.attrs["total"] = total


def _environment(demo: Demonstration) -> str:
    """Return the description of the environment that robomimic expects; it names none that can be built."""
    rate = 1.0 / demo.period
    kwargs = {"control_freq": round(rate) if abs(rate - round(rate)) < 1e-6 * rate else rate}
    return json.dumps({"env_name": KEY, "type": 1, "env_kwargs": kwargs})


def _write_demonstration(group: Any, demo: Demonstration) -> None:
    group.attrs["num_samples"] = len(demo.x)
    group.attrs["name"] = demo.name
    observations, columns = group.create_group("obs"), list[tuple[str, int]]()
    names, units = demo.layout.names, demo.layout.units
    for name, part in zip(_dataset_names(demo.layout), demo.layout.slices, strict=True):
        dataset = observations.create_dataset(name, data=demo.x[:, part])
        _describe_columns(dataset, names[part], units[part])
        columns += [(f"obs/{name}", n) for n in range(part.stop - part.start)]
    _describe_columns(group.create_dataset("actions", data=next_rows(demo.x)), names, units)
    last = np.zeros(len(demo.x), np.int64)
    last[-1] = 1
    group.create_dataset("dones", data=last)
    group.create_dataset("rewards", data=last.astype(np.float64))
    description = describe_demonstration(demo, columns).encode()
    group.create_dataset(KEY, data=np.frombuffer(description, np.uint8))


def _describe_columns(dataset: Any, names: tuple[str, ...], units: tuple[str, ...]) -> None:
    dataset.attrs["columns"], dataset.attrs["units"] = json.dumps(names), json.dumps(units)


def _dataset_names(layout: Layout) -> list[str]:
    """Return a name per part that HDF5 accepts, all different."""
    names: list[str] = []
    for n, part in enumerate(layout.parts):
        name = re.sub(r"[^\w ]+", "_", part.name)[:MAX_NAME].strip() + "_rate" * part.derivative
        names.append(name if name and name not in names else f"{name}_{n}")
    return names
