"""Numbers of ROS messages: which fields become columns, and which signal a message belongs to.

A message gives samples: the part of the signal's name that follows the topic, the columns, and a row. Columns
have the names of the message's fields without the outer ones, such as "position.x" of a PoseStamped. Units
follow REP 103 where the type of the message implies them. Quaternions are x y z w, as in the message.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, NamedTuple

MAX_ROW = 10_000  # numbers in one row

_POINT = ("x", "y", "z")
_QUATERNION = ("x", "y", "z", "w")


class Sample(NamedTuple):
    """One row of a signal.

    Attributes:
        suffix: What follows the topic in the name of the signal; "" for most messages.
        columns: Name of each number.
        units: Unit of each number; "" if the type implies none.
        row: Numbers.
        stamp: Time in the header [ns]; 0 if there is none.
        parent: Frame that a pose, point or transform is relative to; "" if the message states none.
    """

    suffix: str
    columns: tuple[str, ...]
    units: tuple[str, ...]
    row: tuple[float, ...]
    stamp: int
    parent: str = ""


Extract = Callable[[Any], Iterator[Sample]]


@dataclass(frozen=True, slots=True)
class _Fields:
    """Extracts fixed fields of a message."""

    columns: tuple[str, ...]
    units: tuple[str, ...]
    get: Callable[[Any], tuple[float, ...]]

    def __call__(self, message: Any) -> Iterator[Sample]:
        parent = _frame_id(message) if "m" in self.units else ""  # that of a twist or wrench is not a pose's
        yield Sample("", self.columns, self.units, self.get(message), _stamp(message), parent)


def _fields(*groups: tuple[str, tuple[str, ...], str], prefix: str = "", qualify: str = "") -> _Fields:
    """Return the extractor of groups (field, axes, unit) below a prefix; qualify begins the column names."""
    names = [".".join(filter(None, (field, axis))) for field, axes, _ in groups for axis in axes]
    units = tuple(unit for _, axes, unit in groups for _ in axes)
    paths = [f"{prefix}{name}" for name in names]
    return _Fields(tuple(f"{qualify}{name}" for name in names), units, attrgetter(*paths))


def _merge(*parts: _Fields) -> _Fields:
    def get(message: Any) -> tuple[float, ...]:
        return tuple(number for part in parts for number in part.get(message))

    columns = tuple(name for part in parts for name in part.columns)
    return _Fields(columns, tuple(unit for part in parts for unit in part.units), get)


def _pose(prefix: str = "", qualify: str = "") -> _Fields:
    groups = (("position", _POINT, "m"), ("orientation", _QUATERNION, "1"))
    return _fields(*groups, prefix=prefix, qualify=qualify)


def _twist(prefix: str = "", qualify: str = "", linear: str = "m/s", angular: str = "rad/s") -> _Fields:
    groups = (("linear", _POINT, linear), ("angular", _POINT, angular))
    return _fields(*groups, prefix=prefix, qualify=qualify)


def _wrench(prefix: str = "") -> _Fields:
    return _fields(("force", _POINT, "N"), ("torque", _POINT, "N m"), prefix=prefix)


_TRANSFORM = _fields(("translation", _POINT, "m"), ("rotation", _QUATERNION, "1"), prefix="transform.")


def _stamp(message: Any) -> int:
    """Return the time in the header [ns]; 0 without a header."""
    header = getattr(message, "header", None)
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec) if header is not None else 0


def _frame_id(message: Any) -> str:
    """Return the frame in the header, without the slash of ROS 1; "" without a header."""
    header = getattr(message, "header", None)
    return str(header.frame_id).lstrip("/") if header is not None else ""


def _transform(message: Any) -> Iterator[Sample]:
    suffix, parent = f"/{message.child_frame_id.lstrip('/')}", _frame_id(message)
    yield Sample(
        suffix, _TRANSFORM.columns, _TRANSFORM.units, _TRANSFORM.get(message), _stamp(message), parent
    )


def _transforms(message: Any) -> Iterator[Sample]:
    for item in message.transforms:
        yield from _transform(item)


def _joint_state(message: Any) -> Iterator[Sample]:
    """Yield positions, velocities and efforts that are present, by the names of the joints."""
    columns, row = list[str](), list[float]()
    for field in ("position", "velocity", "effort"):
        values = getattr(message, field)
        if len(values) == len(message.name) and len(values):
            columns.extend(f"{field}.{joint}" for joint in message.name)
            row.extend(values.tolist())
    yield Sample("", tuple(columns), ("",) * len(columns), tuple(row), _stamp(message))


def _number(message: Any) -> Iterator[Sample]:
    yield Sample("", ("data",), ("",), (float(message.data),), 0)


def _numbers(message: Any) -> Iterator[Sample]:
    row = tuple(message.data.tolist())
    yield Sample("", tuple(f"data.{n}" for n in range(len(row))), ("",) * len(row), row, 0)


_INTEGERS = [f"{unsigned}Int{bits}" for unsigned in ("", "U") for bits in (8, 16, 32, 64)]
_GEOMETRY: dict[str, Extract] = {
    "Pose": _pose(),
    "PoseStamped": _pose("pose."),
    "PoseWithCovariance": _pose("pose."),
    "PoseWithCovarianceStamped": _pose("pose.pose."),
    "Point": _fields(("", _POINT, "m")),
    "PointStamped": _fields(("point", _POINT, "m")),
    "Vector3": _fields(("", _POINT, "")),
    "Vector3Stamped": _fields(("vector", _POINT, "")),
    "Quaternion": _fields(("", _QUATERNION, "1")),
    "QuaternionStamped": _fields(("quaternion", _QUATERNION, "1")),
    "Transform": _fields(("translation", _POINT, "m"), ("rotation", _QUATERNION, "1")),
    "TransformStamped": _transform,
    "Twist": _twist(),
    "TwistStamped": _twist("twist."),
    "Accel": _twist(linear="m/s^2", angular="rad/s^2"),
    "AccelStamped": _twist("accel.", linear="m/s^2", angular="rad/s^2"),
    "Wrench": _wrench(),
    "WrenchStamped": _wrench("wrench."),
}
_IMU = (
    ("orientation", _QUATERNION, "1"),
    ("angular_velocity", _POINT, "rad/s"),
    ("linear_acceleration", _POINT, "m/s^2"),
)
EXTRACTORS: dict[str, Extract] = {
    **{f"geometry_msgs/msg/{name}": extract for name, extract in _GEOMETRY.items()},
    "tf2_msgs/msg/TFMessage": _transforms,
    "tf/msg/tfMessage": _transforms,
    "nav_msgs/msg/Odometry": _merge(_pose("pose.pose.", "pose."), _twist("twist.twist.", "twist.")),
    "sensor_msgs/msg/JointState": _joint_state,
    "sensor_msgs/msg/Imu": _fields(*_IMU),
    **{f"std_msgs/msg/{name}": _number for name in ("Bool", "Float32", "Float64", *_INTEGERS)},
    **{f"std_msgs/msg/{name}MultiArray": _numbers for name in ("Float32", "Float64", *_INTEGERS)},
}

# Of ROS 1, where the library's own definitions lack them; they have the same fields.
TF_DEFINITIONS = {
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "tf/msg/tfMessage": "geometry_msgs/TransformStamped[] transforms\n",
}
