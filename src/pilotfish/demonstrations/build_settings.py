"""Settings of `build_demonstration`: which columns of a recording are parts and frames, and in which form."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from pilotfish.demonstrations.layouts import Quantity
from pilotfish.demonstrations.rotation_conversion import ANGULAR, Representation, require_representation
from pilotfish.demonstrations.timestamps import DEFAULT_GAP
from pilotfish.demonstrations.units import ANGLE, LENGTH, NUMBER, is_unit, parse_unit
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import (
    first_duplicate,
    require_name,
    require_number,
    require_period,
    require_printable,
    require_type,
    short_repr,
    shorten_repr,
)

ORIENTATIONS = (Quantity.QUATERNION, Quantity.ORIENTATION)
MIN_GAP, MAX_GAP = 1.0, 1e9  # periods


@shorten_repr
@dataclass(frozen=True, slots=True)
class PartSource:
    """Columns that make a part of the layout.

    Attributes:
        name: Name of the part.
        quantity: Quantity of the part; its value as text, such as "position", is accepted.
        columns: Columns in order, each as "column", "signal:column" or a pattern with * and ?. All are of one
            signal.
        unit: Unit of the columns; empty for the unit that the file states, or the SI unit if it states none.
        representation: Form of an orientation. Roll, pitch and yaw, yaw alone, and rotation vectors are in
            `unit`, rad if it is empty.

    Raises:
        InvalidInput: If a field cannot be used.
    """

    name: str
    quantity: Quantity
    columns: tuple[str, ...]
    unit: str = ""
    representation: Representation = "wxyz"

    def __post_init__(self) -> None:
        label = f"part {require_name(self.name, 'the name of a part')!r}"
        object.__setattr__(self, "quantity", _require_quantity(self.quantity, label))
        object.__setattr__(self, "columns", _require_columns(self.columns, f"{label}: columns"))
        require_printable(self.unit, f"{label}: unit")
        require_representation(self.representation, f"{label}: representation")
        if self.unit and (self.quantity is not Quantity.SCALAR or is_unit(self.unit)):
            require_dimension(self.unit, self.expected_dimension, f"{label}: unit")

    @property
    def expected_dimension(self) -> str:
        """SI unit that the columns must have; empty if any will do."""
        if self.quantity is Quantity.POSITION:
            return LENGTH
        if self.quantity in ORIENTATIONS:
            return ANGLE if self.representation in ANGULAR else NUMBER
        return ""


@shorten_repr
@dataclass(frozen=True, slots=True)
class FrameSource:
    """Columns that contain the pose of an object.

    Attributes:
        name: Name of the frame.
        position: Three columns, as in `PartSource`.
        orientation: Columns of the orientation; empty if the object does not turn.
        representation: Form of the orientation.
        unit: Unit of the position; empty for that of the file, or m.
        angle_unit: Unit of roll, pitch and yaw, or of a rotation vector; empty for that of the file, or rad.
        moving: Whether the frame moves with the object. If not, the frame is the pose at the first row.

    Raises:
        InvalidInput: If a field cannot be used.
    """

    name: str
    position: tuple[str, ...]
    orientation: tuple[str, ...] = ()
    representation: Representation = "wxyz"
    unit: str = ""
    angle_unit: str = ""
    moving: bool = False

    def __post_init__(self) -> None:
        label = f"frame {require_name(self.name, 'the name of a frame')!r}"
        object.__setattr__(self, "position", _require_columns(self.position, f"{label}: position"))
        require_type(self.orientation, f"{label}: orientation", (tuple, list, str), "pass names of columns")
        for unit in ("unit", "angle_unit"):
            require_printable(getattr(self, unit), f"{label}: {unit}")
        if self.orientation:
            columns = _require_columns(self.orientation, f"{label}: orientation")
            object.__setattr__(self, "orientation", columns)
        require_representation(self.representation, f"{label}: representation")
        require_dimension(self.unit or LENGTH, LENGTH, f"{label}: unit")
        require_dimension(self.angle_unit or ANGLE, ANGLE, f"{label}: angle_unit")
        require_type(self.moving, f"{label}: moving", bool, "pass True or False")

    @property
    def sources(self) -> tuple[PartSource, ...]:
        """Position and orientation as parts."""
        position = PartSource("position", Quantity.POSITION, self.position, self.unit)
        if not self.orientation:
            return (position,)
        has_angles = self.representation in ANGULAR
        unit = self.angle_unit if has_angles else ""
        kind = self.representation
        return (position, PartSource("orientation", Quantity.QUATERNION, self.orientation, unit, kind))


@shorten_repr
@dataclass(frozen=True, slots=True)
class BuildSettings:
    """Which columns of a recording make a demonstration, and at which period.

    Attributes:
        parts: Parts of the layout in order, at least one.
        frames: Frames of objects; none for the world frame alone.
        period: Time between two rows [s]; None for the median step of the first part's signal, rounded to
            its rate.
        unwrap: Names of scalar parts from which jumps of 2 pi are removed; None for all parts in rad.
        thin: Whether rows that a slower source left unchanged are removed before interpolation.
        max_gap: Longest gap that is interpolated, in periods of the demonstration or of the signal, whichever
            is longer.
        still_distance: Motion of a frame that does not move above which it is reported [m].
        still_angle: The same for its rotation [rad].

    Raises:
        InvalidInput: If a field cannot be used.
    """

    parts: tuple[PartSource, ...]
    frames: tuple[FrameSource, ...] = ()
    period: float | None = None
    unwrap: tuple[str, ...] | None = None
    thin: bool = True
    max_gap: float = DEFAULT_GAP
    still_distance: float = 0.01
    still_angle: float = 0.1

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", _require_tuple(self.parts, "parts", PartSource))
        object.__setattr__(self, "frames", _require_tuple(self.frames, "frames", FrameSource))
        if not self.parts:
            raise InvalidInput(
                "parts is empty, expected at least one PartSource, such as the tool's position"
            )
        for kind, sources in (("parts", self.parts), ("frames", self.frames)):
            if duplicate := first_duplicate(source.name for source in sources):
                raise InvalidInput(f"two {kind} are named {duplicate!r}, expected different names")
        if self.period is not None:
            require_period(self.period)
        if self.unwrap is not None:
            names = _require_tuple(self.unwrap, "unwrap", str)
            object.__setattr__(self, "unwrap", names)
            scalars = [part.name for part in self.parts if part.quantity is Quantity.SCALAR]
            if unknown := [name for name in names if name not in scalars]:
                raise InvalidInput(f"unwrap names {unknown[0]!r}, expected scalar parts, of {scalars}")
        require_type(self.thin, "thin", bool, "pass True or False")
        require_number(self.max_gap, "max_gap", MIN_GAP, MAX_GAP)
        require_number(self.still_distance, "still_distance", 0.0)
        require_number(self.still_angle, "still_angle", 0.0)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Conversion:
    """What `build_demonstration` converted.

    Attributes:
        lines: Each conversion in words, for a report; empty if nothing was changed.
        labels: Label of each row of the demonstration, by the name of the label.
        times: Time of each row in the recording's own clock [s].
    """

    lines: tuple[str, ...]
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    times: Float[Array, " T"] | None = None


def require_dimension(unit: str, dimension: str, label: str) -> None:
    """Check that a unit is known and has the expected SI unit.

    Args:
        unit: Unit.
        dimension: SI unit, such as "m"; empty for any.
        label: Meaning of the unit; the message begins with it.

    Raises:
        InvalidInput: If it is not.
    """
    found = parse_unit(unit, label).si
    if dimension and found != dimension:
        expected = {LENGTH: "a length such as m or mm", ANGLE: "an angle: rad or deg", NUMBER: "no unit"}
        raise InvalidInput(f"{label} is {unit!r}, expected {expected.get(dimension, dimension)}")


def _require_quantity(value: object, label: str) -> Quantity:
    known = [quantity.value for quantity in Quantity]
    if isinstance(value, Quantity):
        return value
    if isinstance(value, str) and value in known:
        return Quantity(value)
    raise InvalidInput(f"{label}: quantity is {short_repr(value)}, expected one of {', '.join(known)}")


def _require_columns(value: object, label: str) -> tuple[str, ...]:
    columns = (value,) if isinstance(value, str) else value
    if not isinstance(columns, tuple | list) or not columns:
        raise InvalidInput(f"{label} is {short_repr(value)}, expected names of columns")
    return tuple(require_printable(column, label) for column in columns)


def _require_tuple(value: object, label: str, kind: type) -> tuple[object, ...]:
    if not isinstance(value, tuple | list) or not all(isinstance(item, kind) for item in value):
        raise InvalidInput(f"{label} is {short_repr(value)}, expected a tuple of {kind.__name__}")
    return tuple(value)
