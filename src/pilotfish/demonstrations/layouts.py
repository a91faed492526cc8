"""What the columns of a recording mean."""

from dataclasses import dataclass, replace
from enum import Enum
from itertools import accumulate

from pilotfish.errors import InvalidInput
from pilotfish.validation import (
    first_duplicate,
    nearest_name,
    require_count,
    require_printable,
    require_type,
    short_list,
)

QUATERNION_SIZE, ROTATION_VECTOR_SIZE = 4, 3
MAX_COLUMNS = 10_000
MAX_DERIVATIVE = 9


class Quantity(Enum):
    """How a part changes when the frame it is seen from moves."""

    POSITION = "position"  # turns and moves
    QUATERNION = "quaternion"  # w x y z, multiplied from the left; four numbers like any others
    ORIENTATION = "orientation"  # the same, as a point of the sphere S^3: differences are rotation vectors
    VECTOR = "vector"  # turns, does not move: a force
    SCALAR = "scalar"  # untouched: time, a joint, a gripper


@dataclass(frozen=True, slots=True)
class Part:
    """Columns that belong together. derivative counts how often they were differentiated by time.

    Raises: InvalidInput, when the parts are not such that they could be the columns of something.
    """

    name: str
    quantity: Quantity
    size: int
    unit: str
    derivative: int = 0

    def __post_init__(self) -> None:
        require_name(self.name, "a part")
        require_type(self.quantity, "quantity", Quantity, "say Quantity.SCALAR")
        require_count(self.size, f"the size of part {self.name!r}", MAX_COLUMNS, 1)
        require_count(self.derivative, f"the derivative of part {self.name!r}", MAX_DERIVATIVE)
        require_printable(self.unit, f"the unit of part {self.name!r}")
        if self.quantity in (Quantity.QUATERNION, Quantity.ORIENTATION) and self.size != QUATERNION_SIZE:
            raise InvalidInput(
                f"part {self.name!r} is a quaternion of size {self.size}, expected 4 (w x y z)"
            )
        if self.quantity is Quantity.ORIENTATION and self.derivative:
            raise InvalidInput(
                f"part {self.name!r} is a derivative of an orientation, which is no point of S^3; give the "
                "angular velocity in body axes, a scalar part of size 3 [rad/s]"
            )


@dataclass(frozen=True, slots=True)
class Layout:
    """The parts of a row in order. Two parts may share a name when they differ in derivative."""

    parts: tuple[Part, ...]

    def __post_init__(self) -> None:
        if not self.parts:
            raise InvalidInput("the layout has no parts, expected at least one")
        if duplicate := first_duplicate((part.name, part.derivative) for part in self.parts):
            raise InvalidInput(f"the layout has {duplicate} (name, derivative) more than once; rename one")
        require_count(self.width, "the number of columns of the layout", MAX_COLUMNS)

    @property
    def width(self) -> int:
        return sum(part.size for part in self.parts)

    @property
    def slices(self) -> tuple[slice, ...]:
        """The columns of each part."""
        ends = list(accumulate(part.size for part in self.parts))
        return tuple(slice(end - part.size, end) for part, end in zip(self.parts, ends, strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """One name per column: "position x", "orientation w", "position x'" for its first derivative."""
        return tuple(name for part in self.parts for name in _column_names(part))

    @property
    def units(self) -> tuple[str, ...]:
        """One unit per column."""
        return tuple(part.unit for part in self.parts for _ in range(part.size))

    @property
    def quaternions(self) -> tuple[slice, ...]:
        """The columns of each orientation (not of its derivatives)."""
        return tuple(
            columns
            for part, columns in zip(self.parts, self.slices, strict=True)
            if part.quantity is Quantity.QUATERNION and part.derivative == 0
        )

    @property
    def orientation_starts(self) -> tuple[int, ...]:
        """The first column of each part that lives on S^3; its four columns have three tangents."""
        return tuple(
            columns.start
            for part, columns in zip(self.parts, self.slices, strict=True)
            if part.quantity is Quantity.ORIENTATION
        )

    def columns(self, name: str, derivative: int = 0) -> slice:
        """Raises: InvalidInput, when no part has that name and derivative."""
        for part, columns in zip(self.parts, self.slices, strict=True):
            if (part.name, part.derivative) == (name, derivative):
                return columns
        known = [f"{part.name!r} (derivative {part.derivative})" for part in self.parts]
        near = nearest_name(name, (part.name for part in self.parts), cutoff=0.4)
        hint = f"; did you mean {near!r}?" if near and near != name else ""
        raise InvalidInput(
            f"no part {name!r} with derivative {derivative}; there is {short_list(known)}{hint}"
        )

    def differentiate(self) -> "Layout":
        """The same parts, then their first derivatives [unit/s].

        That of an orientation on S^3 is an angular velocity [rad/s] in the axes of the turning body, which
        no frame changes.
        Raises: InvalidInput, when there are derivatives already.
        """
        if derived := [part.name for part in self.parts if part.derivative]:
            raise InvalidInput(f"the layout has a derivative of {derived[0]!r} already, expected none")
        moving = tuple(replace(part, unit=f"{part.unit}/s", derivative=1) for part in self.tangent.parts)
        return Layout(self.parts + moving)

    @property
    def tangent(self) -> "Layout":
        """The columns of deviations: a rotation vector [rad] in body axes for each orientation on S^3."""
        return Layout(tuple(_tangent_part(part) for part in self.parts))


def require_name(name: object, what: str) -> str:
    """Return the name of a part or frame if it is printable, not empty, and has no blank ends.

    Raises:
        InvalidInput: If it is not; the message begins with what is named.
    """
    label = f"the name of {what}"
    if not (text := require_printable(name, label)) or text != text.strip():
        raise InvalidInput(f"{label} is {text!r}, expected text on one line, without blank ends")
    return text


def pose_layout() -> Layout:
    """Columns "position" [m] and "orientation", a unit quaternion w x y z: seven columns."""
    position = Part("position", Quantity.POSITION, 3, "m")
    return Layout((position, Part("orientation", Quantity.QUATERNION, QUATERNION_SIZE, "1")))


def position_layout(axes: int = 3, unit: str = "m") -> Layout:
    """Columns "position" alone, in a space of so many axes."""
    return Layout((Part("position", Quantity.POSITION, axes, unit),))


def _tangent_part(part: Part) -> Part:
    if part.quantity is not Quantity.ORIENTATION:
        return part
    return replace(part, quantity=Quantity.SCALAR, size=ROTATION_VECTOR_SIZE, unit="rad")


def _column_names(part: Part) -> list[str]:
    return [f"{part.name}{axis}{chr(39) * part.derivative}" for axis in _axes(part)]


def _axes(part: Part) -> list[str]:
    if part.size == 1 and part.quantity is not Quantity.POSITION:
        return [""]
    if part.quantity in (Quantity.QUATERNION, Quantity.ORIENTATION):
        return [" w", " x", " y", " z"]
    if part.quantity is not Quantity.SCALAR and part.size <= len("xyz"):
        return [f" {axis}" for axis in "xyz"[: part.size]]
    return [f" {n + 1}" for n in range(part.size)]
