"""robomimic data sets: HDF5 files with a group `data/demo_N` per demonstration.

Each demonstration is a recording. Every data set below its group is a signal, named by its path, such as
"obs/robot0_eef_pos", "actions", "states" or "datagen_info/eef_pose"; matrices per row are flattened. Groups
`next_obs` repeat `obs` and are left out, as are images and texts; notes name them. The period is
1 / control_freq of `env_args`, if it states one.

Column names. The format has none. Following robosuite, three columns of `*_eef_pos` are x y z and four of
`*_eef_quat` are x y z w; other columns are numbered. A file of this project names all columns.

Safety. HDF5 files may refer to other files, and may state more numbers than they have. Links, external
storage and virtual data sets are refused, and sizes are compared with the bytes present before memory is
reserved.
"""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import Recording, Signal
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_descriptions import KEY, MAX_DESCRIPTION_BYTES
from pilotfish.io.optional_libraries import require_library
from pilotfish.io.paths import is_file, open_regular_file
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.io.readers.hdf5_heaps import require_sound_heaps
from pilotfish.types import Array, Float
from pilotfish.validation import require_printable, short_list, short_repr

FORMAT = "robomimic"
MAGIC = b"\x89HDF\r\n\x1a\n"
MAX_DEPTH = 3  # of groups in a demonstration
MAX_ITEMS = 1000  # data sets of one demonstration
MAX_DEMONSTRATIONS = 1_000_000
MAX_ATTRIBUTE_LENGTH = 100_000  # characters; longer ones, such as a model of the scene, are left out
MAX_COLUMNS = 10_000
MAX_SIGNAL_BYTES = 2**30
MAX_RECORDING_BYTES = 2**31
MAX_EXPANSION = 2000  # of compressed bytes; deflate reaches 1032
LEFT_OUT = ("next_obs",)
_FIX = "fetch or write the file again"


def recognises(path: Path) -> bool:
    """Return whether path is an HDF5 file with a group `data`.

    Args:
        path: File; without h5py, its first bytes decide.
    """
    try:
        if not is_file(path):
            return False
        with open_regular_file(path, "an HDF5 file") as file:
            if file.read(len(MAGIC)) != MAGIC:
                return False
        with _open_file(path) as file:
            return "data" in file and bool(_demonstration_names(file))
    except InvalidInput as error:
        return "'.[io]'" in str(error)
    except OSError:
        return False


def read(path: Path) -> Iterator[Recording]:
    """Read the demonstrations of a file, one at a time, in the order of their numbers.

    Args:
        path: HDF5 file.

    Returns:
        Iterator of recordings, named as in the file, such as "demo_2". Only one is in memory.

    Raises:
        InvalidInput: If the file cannot be opened, has no demonstrations, or h5py is not installed. The
            iterator raises it for a demonstration that is damaged or has signals of different lengths.
    """
    with _open_file(path) as file:
        names = _demonstration_names(file)
    require_sound_heaps(path)  # before a text is read
    return _iter_recordings(path, names)


def _iter_recordings(path: Path, names: list[str]) -> Iterator[Recording]:
    for name in names:  # the file is open while a recording is read only
        with _open_file(path) as file:
            recording = _read_demonstration(file["data"], name)
        yield recording
        del recording  # released before the next one is read


@contextmanager
def _open_file(path: Path) -> Iterator[Any]:
    """Open an HDF5 file; every error names it."""
    h5py = require_library("h5py", "robomimic files")
    with open_regular_file(path, "an HDF5 file of robomimic"):
        pass  # h5py would wait for the writer of a FIFO
    try:
        with h5py.File(path, "r", locking=False) as file:
            yield file
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error
    except (*READ_ERRORS, RecursionError, AssertionError) as error:
        raise InvalidInput(f"{path}: damaged, or not a robomimic file: {error}; {_FIX}") from error


def _demonstration_names(file: Any) -> list[str]:
    """Return the names of the groups `data/demo_N`, sorted by their numbers."""
    data = _require_group(file, "data")
    if len(data) > MAX_DEMONSTRATIONS:
        raise InvalidInput(f"group 'data' has {len(data)} entries, expected at most {MAX_DEMONSTRATIONS}")
    names = [name for name in data if re.fullmatch(r"demo_?[0-9]{1,9}", name)]
    if not names:
        raise InvalidInput(
            f"group 'data' has {short_list(list(data)[:20])}, expected groups demo_0, demo_1 ..."
        )
    return sorted(names, key=lambda name: (int(re.sub(r"\D", "", name)), name))


def _require_group(parent: Any, name: str) -> Any:
    h5py = require_library("h5py", "robomimic files")
    _require_hard_link(parent, name)
    if not isinstance(group := parent[name], h5py.Group):
        raise InvalidInput(f"{name!r} is not a group; expected the structure of robomimic")
    return group


def _require_hard_link(parent: Any, name: str) -> None:
    h5py = require_library("h5py", "robomimic files")
    if (link := parent.get(name, getlink=True)) is None:
        raise InvalidInput(
            f"it has no {name!r}, only {short_list(list(parent)[:20])}; expected a robomimic file"
        )
    if not isinstance(link, h5py.HardLink):
        raise InvalidInput(f"{name!r} is a link to another place, which is not followed; copy the content")


def _read_demonstration(data: Any, name: str) -> Recording:
    group = _require_group(data, name)
    signals: list[Signal] = []
    notes: list[str] = []
    total = 0
    for place, dataset in _iter_datasets(group, "", 0):
        if place == KEY:
            continue
        if (problem := _unusable_reason(dataset)) is not None:
            notes.append(f"{place} is left out: {problem}")
            continue
        _require_stored(place, dataset)
        total += dataset.size * 8
        if total > MAX_RECORDING_BYTES:
            raise InvalidInput(f"{name} takes more than {MAX_RECORDING_BYTES} bytes; split it")
        signals.append(_read_signal(place, dataset))
    _require_equal_lengths(name, signals)
    signals.sort(key=lambda signal: not signal.name.startswith("obs/"))  # observations first
    attributes = _read_attributes(data) | _read_attributes(group)
    if KEY in group:
        _require_hard_link(group, KEY)
        attributes[KEY] = _read_description(group[KEY])
    return Recording(
        name=name,
        signals=tuple(signals),
        period=_stated_period(attributes),
        format=FORMAT,
        attributes=attributes,
        notes=tuple(notes),
    )


def _iter_datasets(group: Any, prefix: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield path and data set of everything below a group, but for what repeats other data."""
    h5py = require_library("h5py", "robomimic files")
    if depth > MAX_DEPTH or len(group) > MAX_ITEMS:
        raise InvalidInput(
            f"{prefix!r} has groups in more than {MAX_DEPTH} levels or over {MAX_ITEMS} entries"
        )
    for name in group:
        place = require_printable(f"{prefix}{name}", "the name of a data set")
        if name in LEFT_OUT:
            continue
        _require_hard_link(group, name)
        item = group[name]
        if isinstance(item, h5py.Group):
            yield from _iter_datasets(item, f"{place}/", depth + 1)
        elif isinstance(item, h5py.Dataset):
            yield place, item


def _unusable_reason(dataset: Any) -> str | None:
    """Return why a data set cannot be a signal; None if it can."""
    shape = dataset.shape
    if dataset.dtype.kind not in "fiub" or shape is None or not shape:
        return f"{dataset.dtype} of shape {shape}, expected numbers per row"
    if prod(shape[1:]) > MAX_COLUMNS or (len(shape) == 4 and dataset.dtype == np.uint8):
        return f"images, or {prod(shape[1:])} numbers per row"
    return None if dataset.size else "it is empty"


def _read_signal(place: str, dataset: Any) -> Signal:
    values = np.asarray(dataset[()], np.float64).reshape(len(dataset), -1)
    columns = _stated_texts(dataset, "columns", values) or _conventional_columns(place, dataset.shape)
    units = _stated_texts(dataset, "units", values) or ("",) * values.shape[1]
    return Signal(place, values, columns, units)


def _require_stored(place: str, dataset: Any) -> None:
    """Raise InvalidInput unless the file itself has the bytes of a data set."""
    stated = dataset.size * dataset.dtype.itemsize
    if dataset.external or dataset.is_virtual:
        raise InvalidInput(f"{place!r} is stored in another file, which is not read; copy it into this one")
    if stated > MAX_SIGNAL_BYTES:
        raise InvalidInput(f"{place!r} states {stated} bytes, expected at most {MAX_SIGNAL_BYTES}; split it")
    stored = min(dataset.id.get_storage_size(), dataset.file.id.get_filesize())
    is_complete = stated <= stored
    if dataset.chunks is not None:
        present = dataset.id.get_num_chunks() * prod(dataset.chunks)
        has_filters = dataset.id.get_create_plist().get_nfilters() > 0
        is_complete = present >= dataset.size and stated <= stored * (MAX_EXPANSION if has_filters else 1)
        if prod(dataset.chunks) * dataset.dtype.itemsize > MAX_SIGNAL_BYTES:
            raise InvalidInput(f"{place!r} has chunks of {dataset.chunks}, expected smaller ones; {_FIX}")
    if not is_complete:
        raise InvalidInput(f"{place!r} states {stated} bytes, but the file stores {stored} of it; {_FIX}")


def _require_equal_lengths(name: str, signals: list[Signal]) -> None:
    if not signals:
        raise InvalidInput(f"{name} has no data set of numbers, expected obs/... and actions")
    lengths = {signal.name: len(signal.values) for signal in signals}
    if len(set(lengths.values())) != 1:
        raise InvalidInput(f"{name} has signals of different lengths: {short_repr(lengths, 200)}; {_FIX}")


def _conventional_columns(place: str, shape: tuple[int, ...]) -> tuple[str, ...]:
    width = prod(shape[1:])
    if place.endswith("eef_pos") and width == 3:
        return ("x", "y", "z")
    if place.endswith("eef_quat") and width == 4:
        return ("x", "y", "z", "w")
    if len(shape) == 3:
        return tuple(f"{i},{j}" for i in range(shape[1]) for j in range(shape[2]))
    return tuple(map(str, range(width)))


def _stated_texts(dataset: Any, name: str, values: Float[Array, "T D"]) -> tuple[str, ...] | None:
    """Return the JSON list of texts in an attribute; None if there is none for each column."""
    if (text := _read_attributes(dataset).get(name)) is None:
        return None
    texts = json.loads(text)
    if not isinstance(texts, list) or len(texts) != values.shape[1]:
        return None
    return tuple(require_printable(item, f"an entry of {name}") for item in texts)


def _read_attributes(item: Any) -> dict[str, str]:
    """Return the attributes that are short texts."""
    attributes: dict[str, str] = {}
    for name in list(item.attrs)[:MAX_ITEMS]:
        info = item.attrs.get_id(name)
        is_small = not info.shape and (info.dtype.kind == "O" or info.dtype.itemsize <= MAX_ATTRIBUTE_LENGTH)
        if not is_small or info.dtype.kind not in "OSU":
            continue
        text = item.attrs[name]
        text = text.decode() if isinstance(text, bytes) else text
        if isinstance(text, str) and len(text) <= MAX_ATTRIBUTE_LENGTH:
            attributes[name] = text
    return attributes


def _read_description(dataset: Any) -> str:
    if dataset.dtype != np.uint8 or len(dataset.shape) != 1 or dataset.size > MAX_DESCRIPTION_BYTES:
        raise InvalidInput(f"{KEY!r} is {dataset.dtype} of shape {dataset.shape}, expected bytes; {_FIX}")
    _require_stored(KEY, dataset)
    return bytes(dataset[()]).decode()


def _stated_period(attributes: dict[str, str]) -> float | None:
    """Return 1 / control_freq of `env_args`; None if it states none."""
    try:
        rate = json.loads(attributes.get("env_args", "{}"))["env_kwargs"]["control_freq"]
        return 1.0 / rate if isinstance(rate, int | float) and 1e-6 <= rate <= 1e9 else None
    except (ValueError, LookupError, TypeError, RecursionError):
        return None
