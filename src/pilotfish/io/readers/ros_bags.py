"""ROS recordings: ROS 1 bags, rosbag2 folders (SQLite or MCAP) and single .mcap and .db3 files, without ROS.

A bag is a recording, with a signal per topic of numeric messages; transforms have one per child frame, such
as "/tf/tool". Topics of other types, and messages of standard types that another version defines, are left
out and named in the notes. Definitions in a bag are not evaluated.

Times. A signal has the stamps of its headers if all are set and near the times of receipt, otherwise the
times of receipt. All times are counted from the first sample, whose time is the attribute "start_ns".
"""

from array import array
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import Recording, Signal, to_common_reference_frames
from pilotfish.errors import InvalidInput, escape
from pilotfish.io.demonstration_descriptions import KEY, MAX_DESCRIPTION_BYTES
from pilotfish.io.natural_order import natural_key
from pilotfish.io.optional_libraries import require_library
from pilotfish.io.paths import is_file, is_folder, open_regular_file, read_file
from pilotfish.io.readers.ros_messages import EXTRACTORS, MAX_ROW, TF_DEFINITIONS, Sample
from pilotfish.io.readers.ros_storage import (
    FIX,
    MCAP_MAGIC,
    PURPOSE,
    bound_ros1_chunks,
    expand,
    name_errors,
    require_bounded_file,
    require_bounded_mcap,
    require_plain_tables,
)
from pilotfish.validation import nearest_name, require_type, short_list

FORMAT = "ROS"
METADATA_FILE = "metadata.yaml"
MAX_METADATA_BYTES = 2**24
MAX_BAGS, MAX_SIGNALS = 100_000, 10_000
MAX_ENTRIES = 2**27  # numbers of one bag
MAX_STAMP_DIFFERENCE = 3600 * 10**9  # ns, between a header and the receipt
DESCRIPTION_TOPIC, DESCRIPTION_TYPE = f"/{KEY}/description", "std_msgs/msg/String"
_BEGINNINGS = {
    ".bag": b"#ROSBAG V2.0",
    ".db3": b"SQLite format 3\0",
    ".mcap": MCAP_MAGIC,
}
_MCAP_PROFILE = b"\x04\x00\x00\x00ros2"  # after magic, type and length of the first record


def recognises(path: Path) -> bool:
    """Return whether path is a ROS recording, or a folder of them.

    Args:
        path: File or folder; only the beginnings of files are read.
    """
    try:
        return bool(_find_bags(path))
    except InvalidInput:
        return False


def read(path: Path, topics: Collection[str] | None = None) -> Iterator[Recording]:
    """Read the bags at a path, one at a time.

    Args:
        path: ROS 1 bag, rosbag2 folder, .mcap or .db3 file, or a folder of these.
        topics: Topics to read, such as ["/tool_pose"]; None for all that have numbers.

    Returns:
        Iterator of recordings, named after their files or folders. The first bags are in natural order of
        their names.

    Raises:
        InvalidInput: If path is not a ROS recording or rosbags is not installed. The iterator raises it if a
            bag is damaged, has no numeric topic, or lacks a topic of `topics`.
    """
    if isinstance(topics, str):
        topics = [topics]
    if topics is not None:
        require_type(topics, "topics", Collection, "pass a list of topics")
    require_library("rosbags", PURPOSE)
    if not (bags := _find_bags(path)):
        raise InvalidInput(f"{path} is not a ROS recording; expected .bag, .mcap, .db3 or a rosbag2 folder")
    return (_read_bag(bag, None if topics is None else list(topics)) for bag in bags)


@dataclass(slots=True)
class _Rows:
    """Samples of one signal."""

    columns: tuple[str, ...]
    units: tuple[str, ...]
    values: "array[float]" = field(default_factory=lambda: array("d"))
    stamps: "array[int]" = field(default_factory=lambda: array("q"))
    receipts: "array[int]" = field(default_factory=lambda: array("q"))


@dataclass(slots=True)
class _Content:
    """What was read of a bag."""

    rows: dict[str, _Rows] = field(default_factory=dict)
    parents: dict[str, str] = field(default_factory=dict)  # reference frame of each signal
    children: dict[str, str] = field(default_factory=dict)  # frame whose pose a signal of a transform is
    notes: list[str] = field(default_factory=list)
    description: str | None = None
    entries: int = 0

    def add(self, topic: str, receipt: int, sample: Sample) -> None:
        """Append a sample; one with other columns or another parent frame belongs to another signal."""
        name = f"{topic}{sample.suffix}"
        if self.parents.setdefault(name, sample.parent) != sample.parent:
            name = f"{name} in {sample.parent}"
        if (rows := self.rows.get(name)) is None or rows.columns != sample.columns:
            name, rows = self._signal(name, sample)
            self.parents[name] = sample.parent
            if sample.suffix:
                self.children[name] = sample.suffix.lstrip("/")
        rows.values.extend(sample.row)
        rows.stamps.append(sample.stamp)
        rows.receipts.append(receipt)
        self.entries += len(sample.row) + 2
        if self.entries > MAX_ENTRIES:
            raise InvalidInput(f"it has more than {MAX_ENTRIES} numbers; choose topics, or split it")

    def _signal(self, name: str, sample: Sample) -> tuple[str, _Rows]:
        if not 0 < len(sample.columns) <= MAX_ROW:
            raise InvalidInput(
                f"{name!r} has a message of {len(sample.columns)} numbers, expected 1 to {MAX_ROW}"
            )
        number, candidate = 1, name
        while (rows := self.rows.get(candidate)) is not None and rows.columns != sample.columns:
            number += 1
            candidate = f"{name} ({number})"  # a second set of joints, or rows of another length
        if rows is None:
            if len(self.rows) == MAX_SIGNALS:
                raise InvalidInput(f"it has more than {MAX_SIGNALS} signals; choose topics")
            rows = self.rows[candidate] = _Rows(sample.columns, sample.units)
        return candidate, rows


def _find_bags(path: Path) -> list[Path]:
    """Return the bag at path, or the bags in the folder at path, in natural order."""
    if _is_bag(path):
        return [path]
    if not is_folder(path):
        return []
    bags = []
    with suppress(OSError):
        for count, child in enumerate(path.iterdir()):
            if count == MAX_BAGS:
                raise InvalidInput(f"{path} has more than {MAX_BAGS} files; read them in parts")
            if _is_bag(child):
                bags.append(child)
    return sorted(bags, key=lambda bag: natural_key(bag.name))


def _is_bag(path: Path) -> bool:
    if is_folder(path):
        file = path / METADATA_FILE
        with suppress(InvalidInput):
            return is_file(file) and b"rosbag2_bagfile_information" in read_file(
                file, "metadata of a bag", MAX_METADATA_BYTES
            )
        return False
    beginning = _BEGINNINGS.get(path.suffix)
    if beginning is None or not is_file(path):
        return False
    with open_regular_file(path, "a ROS recording") as opened:
        start = opened.read(64)
    return start.startswith(beginning) and (path.suffix != ".mcap" or start[17:25] == _MCAP_PROFILE)


def _read_bag(bag: Path, topics: list[str] | None) -> Recording:
    with name_errors(bag), _open_bag(bag) as reader:
        is_ros1 = bag.suffix == ".bag" and not is_folder(bag)
        content = _Content()
        connections = _select(reader, topics, _typestore(is_ros1), is_ros1, content)
        _collect(reader, connections, is_ros1, content)
        signals, start = _build_signals(content)
    attributes = {"start_ns": str(start)}
    if content.description is not None:
        attributes[KEY] = content.description
    children = {escape(name): escape(child) for name, child in content.children.items()}
    signals, notes = to_common_reference_frames(signals, children)
    content.notes += notes
    content.notes += [
        f"{s.name} is relative to frame {s.reference_frame!r}" for s in signals if s.reference_frame
    ]
    name = bag.name if is_folder(bag) else bag.stem
    kind = "ROS 1" if is_ros1 else "ROS 2"
    notes = tuple(escape(note) for note in content.notes)
    return Recording(escape(name), signals, format=kind, attributes=attributes, notes=notes)


@contextmanager
def _open_bag(bag: Path) -> Iterator[Any]:
    """Open a bag after its bounds are checked; messages compressed one by one stay compressed."""
    folder = is_folder(bag)
    files = list(bag.iterdir()) if folder else [bag]
    for file in files:
        if not is_file(file):
            raise InvalidInput(f"{file} is not a regular file; remove it from the bag")
        if file.suffix == ".mcap":
            require_bounded_mcap(file)
        elif file.suffix == ".db3":
            require_plain_tables(file)
        elif file.suffix in (".zstd", ".zst"):
            require_bounded_file(file)
    version = 1 if bag.suffix == ".bag" and not folder else 2
    with require_library(f"rosbags.rosbag{version}", PURPOSE).Reader(bag) as reader:
        if version == 1:
            bound_ros1_chunks(reader)
        yield reader


def _typestore(is_ros1: bool) -> Any:
    typesys = require_library("rosbags.typesys", PURPOSE)
    if not is_ros1:
        return typesys.get_typestore(typesys.Stores.LATEST)
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    for name, definition in TF_DEFINITIONS.items():
        if name not in store.fielddefs:
            store.register(typesys.get_types_from_msg(definition, name))
    return store


def _select(
    reader: Any, topics: list[str] | None, store: Any, is_ros1: bool, content: _Content
) -> dict[int, tuple[Any, Any]]:
    """Return connection and function that decodes its messages, by the identity of the connection."""
    present = {connection.topic for connection in reader.connections}
    for topic in topics or ():
        if topic not in present:
            near = nearest_name(topic, present)
            hint = f"; did you mean {near!r}?" if near else ""
            raise InvalidInput(f"it has no topic {topic!r}, only {short_list(sorted(present))}{hint}")
    deserialise = store.deserialize_ros1 if is_ros1 else store.deserialize_cdr
    selected: dict[int, tuple[Any, Any]] = {}
    for connection in reader.connections:
        kind, topic = connection.msgtype, connection.topic
        is_description = (topic, kind) == (DESCRIPTION_TOPIC, DESCRIPTION_TYPE)
        if topics is not None and topic not in topics and not is_description:
            continue
        if kind not in EXTRACTORS and not is_description:
            content.notes.append(f"{topic} is left out: {kind}")
        elif not _has_same_definition(connection, store, is_ros1):
            content.notes.append(f"{topic} is left out: its definition of {kind} is not the standard one")
        else:
            selected[connection.id] = (connection, deserialise)
    if not any(connection.topic != DESCRIPTION_TOPIC for connection, _ in selected.values()):
        found = short_list(
            [f"{connection.topic} ({connection.msgtype})" for connection in reader.connections]
        )
        raise InvalidInput(
            f"it has no topic with numbers to read, only {found}; expected poses or joint states"
        )
    return selected


def _has_same_definition(connection: Any, store: Any, is_ros1: bool) -> bool:
    """Return whether the checksum of a message's definition, if the bag has one, is the standard one."""
    if not connection.digest:
        return True
    name = connection.msgtype
    expected = store.generate_msgdef(name)[1] if is_ros1 else store.hash_rihs01(name)
    return bool(expected == connection.digest)


def _collect(reader: Any, connections: dict[int, tuple[Any, Any]], is_ros1: bool, content: _Content) -> None:
    is_compressed = False
    if not is_ros1 and reader.compression_mode == "message":
        is_compressed = True  # rosbags would expand messages without a limit
        reader.storage.metadata = reader.storage.metadata._replace(compression_mode=None)
    for connection, receipt, data in reader.messages([item for item, _ in connections.values()]):
        data = expand(data, "zstd") if is_compressed else data
        message = connections[connection.id][1](data, connection.msgtype)
        if connection.msgtype == DESCRIPTION_TYPE:
            if len(message.data) > MAX_DESCRIPTION_BYTES:
                raise InvalidInput(f"its description has {len(message.data)} characters; {FIX}")
            content.description = message.data
            continue
        for sample in EXTRACTORS[connection.msgtype](message):
            if sample.columns:  # a JointState may be empty
                content.add(connection.topic, receipt, sample)


def _build_signals(content: _Content) -> tuple[tuple[Signal, ...], int]:
    """Return the signals, with times from the first sample [s], and the time of that sample [ns]."""
    if not content.rows:
        raise InvalidInput("its topics have no messages with numbers; choose other topics")
    times = {name: _choose_times(name, rows, content.notes) for name, rows in content.rows.items()}
    start = min(int(ns.min()) for ns in times.values())
    signals = []
    for name, rows in content.rows.items():
        values = np.frombuffer(rows.values, np.float64).reshape(-1, len(rows.columns))
        columns = tuple(escape(column) for column in rows.columns)
        own, parent = (times[name] - start) / 1e9, escape(content.parents[name])
        signals.append(Signal(escape(name), values, columns, rows.units, own, parent))
    return tuple(signals), start


def _choose_times(name: str, rows: _Rows, notes: list[str]) -> Any:
    """Return the times of a signal [ns]: those in the headers, or those of receipt."""
    stamps, receipts = np.frombuffer(rows.stamps, np.int64), np.frombuffer(rows.receipts, np.int64)
    if not stamps.all():
        return receipts
    difference = np.abs(stamps.astype(float) - receipts.astype(float))
    if (worst := float(difference.max())) > MAX_STAMP_DIFFERENCE:
        notes.append(
            f"{name}: its stamps differ by up to {worst / 1e9:g} s from the times of receipt, which are used"
        )
        return receipts
    return stamps
