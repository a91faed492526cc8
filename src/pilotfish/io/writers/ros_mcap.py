"""Writer of rosbag2 folders with MCAP files, without ROS.

A position of three columns that is followed by an orientation is a PoseStamped, with the quaternion x y z w
as ROS has it. Scalars in rad form one JointState. Every other part is a Float64MultiArray. Each row is a
message whose stamp is its number times the period, from 0, rounded to nanoseconds. The topic
"/pilotfish/description" has the description that makes an import exact, because the messages have float64.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import Demonstration, Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_descriptions import describe_demonstration
from pilotfish.io.optional_libraries import require_library
from pilotfish.io.readers.ros_bags import DESCRIPTION_TOPIC, DESCRIPTION_TYPE, recognises
from pilotfish.io.readers.ros_storage import PURPOSE
from pilotfish.io.writers.exported_demonstrations import export_folder, iter_alike
from pilotfish.types import Array, Float

BAG_VERSION = 9
POSE, JOINTS, NUMBERS = (
    "geometry_msgs/msg/PoseStamped",
    "sensor_msgs/msg/JointState",
    "std_msgs/msg/Float64MultiArray",
)
ORIENTATIONS = (Quantity.QUATERNION, Quantity.ORIENTATION)
MAX_TIME = 2**31 * 10**9  # ns, of the seconds in a stamp


@dataclass(frozen=True, slots=True)
class _Topic:
    """Topic and type of a message, and the columns of a row that it has, in the order of the message."""

    name: str
    kind: str
    columns: tuple[int, ...]


def write(demonstrations: Iterable[Demonstration], path: str | Path, *, overwrite: bool = False) -> None:
    """Write a folder with a bag per demonstration, from which an import restores each exactly.

    Args:
        demonstrations: At least one; all share layout and period. A generator is read one at a time.
        path: Folder to write; the bags are `demo_0` onwards.
        overwrite: Whether a folder of bags may be replaced; no other folder ever is.

    Raises:
        InvalidInput: If the demonstrations differ in layout or period, path cannot be written or exists, or
            rosbags is not installed.
    """
    require_library("rosbags", PURPOSE)
    with export_folder(path, recognises, "rosbag2", overwrite=overwrite) as folder:
        for m, demo in enumerate(iter_alike(demonstrations)):
            _write_bag(demo, folder / f"demo_{m}")


def _write_bag(demo: Demonstration, folder: Path) -> None:
    rosbag2, typesys = (require_library(f"rosbags.{name}", PURPOSE) for name in ("rosbag2", "typesys"))
    if (len(demo.x) - 1) * demo.period * 1e9 >= MAX_TIME:
        raise InvalidInput(
            f"demonstration {demo.name!r} lasts longer than a stamp can state; shorten its period"
        )
    store = typesys.get_typestore(typesys.Stores.LATEST)
    topics = _topics(demo.layout)
    plugin = rosbag2.StoragePlugin.MCAP
    with rosbag2.Writer(folder, version=BAG_VERSION, storage_plugin=plugin) as writer:

        def connect(topic: str, kind: str) -> Any:
            return writer.add_connection(topic, kind, typestore=store)

        def put(connection: Any, time: int, message: Any) -> None:
            writer.write(connection, time, store.serialize_cdr(message, connection.msgtype))

        text = describe_demonstration(demo, _stored_columns(demo.layout, topics))
        put(connect(DESCRIPTION_TOPIC, DESCRIPTION_TYPE), 0, store.types[DESCRIPTION_TYPE](text))
        outputs = [(connect(topic.name, topic.kind), _message(topic, demo.layout, store)) for topic in topics]
        for step, row in enumerate(demo.x):
            time = round(step * demo.period * 1e9)
            for topic, (connection, build) in zip(topics, outputs, strict=True):
                put(connection, time, build(time, row[list(topic.columns)]))


def _topics(layout: Layout) -> list[_Topic]:
    topics, joints = list[_Topic](), list[int]()
    poses = {columns[0]: name for name, columns in _pose_columns(layout)}
    in_pose = {column for _, columns in _pose_columns(layout) for column in columns}
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        numbers = tuple(range(columns.start, columns.stop))
        if columns.start in poses:
            w, x, y, z = range(columns.stop, columns.stop + 4)
            name = _topic_name(poses[columns.start], topics)
            topics.append(_Topic(name, POSE, (*numbers, x, y, z, w)))
        elif columns.start in in_pose:
            continue
        elif part.quantity is Quantity.SCALAR and part.unit == "rad" and not part.derivative:
            joints.extend(numbers)
        else:
            name = _topic_name(part.name + "_rate" * part.derivative, topics)
            topics.append(_Topic(name, NUMBERS, numbers))
    if joints:
        topics.append(_Topic(_topic_name("joint_states", topics), JOINTS, tuple(joints)))
    return topics


def _pose_columns(layout: Layout) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Yield name and columns of each position of three columns that is followed by an orientation."""
    parts = list(zip(layout.parts, layout.slices, strict=True))
    for (first, columns), (second, following) in pairwise(parts):
        is_position = first.quantity is Quantity.POSITION and first.size == 3 and first.unit == "m"
        is_orientation = second.quantity in ORIENTATIONS
        if is_position and is_orientation and not first.derivative and not second.derivative:
            yield f"{first.name.removesuffix('position')}pose", tuple(range(columns.start, following.stop))


def _topic_name(name: str, topics: list[_Topic]) -> str:
    """Return a name that ROS accepts and no other topic has."""
    words = re.sub(r"[^a-zA-Z0-9_]+", "_", name).strip("_")[:100] or "part"
    words = re.sub(r"__+", "_", words if words[0].isalpha() else f"part_{words}")
    used = {topic.name for topic in topics}
    return next(
        candidate
        for n in range(1, len(topics) + 2)
        if (candidate := f"/{words}" if n == 1 else f"/{words}_{n}") not in used
    )


def _stored_columns(layout: Layout, topics: list[_Topic]) -> list[tuple[str, int]]:
    stored = {column: (topic.name, number) for topic in topics for number, column in enumerate(topic.columns)}
    return [stored[column] for column in range(layout.width)]


def _message(topic: _Topic, layout: Layout, store: Any) -> Callable[[int, Float[Array, " D"]], Any]:
    """Return the function that builds a message from time [ns] and numbers."""
    types = store.types
    names = [layout.names[column] for column in topic.columns]

    def header(time: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](*divmod(time, 10**9))
        return types["std_msgs/msg/Header"](stamp, "world")

    def pose(time: int, row: Float[Array, " D"]) -> Any:
        numbers = row.tolist()
        point = types["geometry_msgs/msg/Point"](*numbers[:3])
        quaternion = types["geometry_msgs/msg/Quaternion"](*numbers[3:])
        return types[POSE](header(time), types["geometry_msgs/msg/Pose"](point, quaternion))

    def joints(time: int, row: Float[Array, " D"]) -> Any:
        return types[JOINTS](header(time), names, row, np.zeros(0), np.zeros(0))

    def numbers(time: int, row: Float[Array, " D"]) -> Any:
        dimension = types["std_msgs/msg/MultiArrayDimension"](", ".join(names), len(row), len(row))
        return types[NUMBERS](types["std_msgs/msg/MultiArrayLayout"]([dimension], 0), row)

    return {POSE: pose, JOINTS: joints, NUMBERS: numbers}[topic.kind]
