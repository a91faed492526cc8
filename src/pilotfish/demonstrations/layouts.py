"""Layout of a recording: the meaning of its columns, part by part."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from enum import Enum
from itertools import accumulate

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle
from pilotfish.types import Array, Float
from pilotfish.validation import (
    first_duplicate,
    nearest_name,
    require_count,
    require_name,
    require_printable,
    require_type,
    short_list,
    shorten_repr,
)

QUATERNION_SIZE, ROTATION_VECTOR_SIZE = 4, 3
MAX_COLUMNS = 10_000
MAX_DERIVATIVE = 9


class Quantity(Enum):
    """Physical kind of a part, which decides how a change of frame transforms it."""

    POSITION = "position"  # rotated and translated
    QUATERNION = "quaternion"  # w x y z, multiplied from the left; treated as four numbers in R^4
    ORIENTATION = "orientation"  # w x y z as a point of S^3: differences are rotation vectors
    VECTOR = "vector"  # rotated, not translated: a force
    SCALAR = "scalar"  # unchanged: time, a joint, a gripper


@dataclass(frozen=True, slots=True)
class Part:
    """Columns that belong together.

    Attributes:
        name: Name of the part, such as "position".
        quantity: How a change of frame transforms the part.
        size: Number of columns.
        unit: Unit of every column.
        derivative: Number of times that the part was differentiated with respect to time.

    Raises:
        InvalidInput: If a field cannot be used, such as a quaternion of another size than 4.
    """

    name: str
    quantity: Quantity
    size: int
    unit: str
    derivative: int = 0

    def __post_init__(self) -> None:
        require_name(self.name, "the name of a part")
        require_type(self.quantity, "quantity", Quantity, "pass Quantity.SCALAR or another member")
        require_count(self.size, f"the size of part {self.name!r}", MAX_COLUMNS, 1)
        require_count(self.derivative, f"the derivative of part {self.name!r}", MAX_DERIVATIVE)
        require_printable(self.unit, f"the unit of part {self.name!r}")
        if self.quantity in (Quantity.QUATERNION, Quantity.ORIENTATION) and self.size != QUATERNION_SIZE:
            raise InvalidInput(
                f"part {self.name!r} is a quaternion of size {self.size}, expected 4 (w x y z)"
            )
        if self.quantity is Quantity.ORIENTATION and self.derivative:
            raise InvalidInput(
                f"part {self.name!r} is a derivative of an orientation, which is not a point of S^3; pass "
                "the angular velocity in body axes, a scalar part of size 3 [rad/s]"
            )


@dataclass(frozen=True, slots=True)
class OrientationColumns:
    """Columns of one orientation on S^3, among points (`Layout`) and among deviations (`Layout.tangent`).

    Attributes:
        quaternion: Unit quaternion, among points.
        rotation_vector: Rotation vector [rad], among deviations.
        angular_velocity: Angular velocity in body axes [rad/s], among points; None if there is none.
        rotation_rate: Deviation of the angular velocity, among deviations; None if there is none.
    """

    quaternion: slice
    rotation_vector: slice
    angular_velocity: slice | None
    rotation_rate: slice | None


@shorten_repr
@dataclass(frozen=True, slots=True)
class Layout:
    """Parts of a row, in order.

    Attributes:
        parts: At least one part; two parts may share a name if they differ in derivative.

    Raises:
        InvalidInput: If parts is empty, has too many columns, or has two equal parts.
    """

    parts: tuple[Part, ...]

    def __post_init__(self) -> None:
        if not self.parts:
            raise InvalidInput("the layout has no parts, expected at least one")
        if duplicate := first_duplicate((part.name, part.derivative) for part in self.parts):
            raise InvalidInput(f"the layout has {duplicate} (name, derivative) more than once; rename one")
        require_count(self.width, "the number of columns of the layout", MAX_COLUMNS)

    @property
    def width(self) -> int:
        """Number of columns."""
        return sum(part.size for part in self.parts)

    @property
    def slices(self) -> tuple[slice, ...]:
        """Columns of each part."""
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
    def coordinates(self) -> tuple[int, ...]:
        """Columns of all parts that are not derivatives."""
        pairs = zip(self.parts, self.slices, strict=True)
        return tuple(c for part, columns in pairs if not part.derivative for c in _range(columns))

    @property
    def quaternions(self) -> tuple[slice, ...]:
        """Columns of each orientation that is treated as four numbers, without its derivatives."""
        return self._columns_of(Quantity.QUATERNION)

    @property
    def unit_quaternions(self) -> tuple[slice, ...]:
        """Columns of each orientation, treated as four numbers or as a point of S^3."""
        return self._columns_of(Quantity.QUATERNION, Quantity.ORIENTATION)

    @property
    def orientation_starts(self) -> tuple[int, ...]:
        """First column of each orientation on S^3, as the functions of `pilotfish.geometry` take them."""
        return tuple(columns.start for columns in self._columns_of(Quantity.ORIENTATION))

    @property
    def orientations(self) -> tuple[OrientationColumns, ...]:
        """Columns of each orientation on S^3 and of its angular velocity."""
        entries = list(zip(self.parts, self.slices, self.tangent.slices, strict=True))
        rates = {
            part.name: (columns, tangent)
            for part, columns, tangent in entries
            if part.derivative == 1 and part.size == ROTATION_VECTOR_SIZE
        }
        return tuple(
            OrientationColumns(columns, tangent, *rates.get(part.name, (None, None)))
            for part, columns, tangent in entries
            if part.quantity is Quantity.ORIENTATION
        )

    def columns(self, name: str, derivative: int = 0) -> slice:
        """Return the columns of a part.

        Args:
            name: Name of the part.
            derivative: Number of times that it was differentiated.

        Raises:
            InvalidInput: If the layout has no such part.
        """
        for part, columns in zip(self.parts, self.slices, strict=True):
            if (part.name, part.derivative) == (name, derivative):
                return columns
        known = [f"{part.name!r} (derivative {part.derivative})" for part in self.parts]
        near = nearest_name(name, (part.name for part in self.parts), cutoff=0.4)
        hint = f"; did you mean {near!r}?" if near and near != name else ""
        raise InvalidInput(
            f"the layout has no part {name!r} with derivative {derivative}, only {short_list(known)}{hint}"
        )

    def rate_column(self, column: int) -> int | None:
        """Return the column of the first derivative of a scalar column, or None if there is none.

        Args:
            column: Number of the column, from 0.

        Raises:
            InvalidInput: If the layout has no such column.
        """
        require_count(column, "column", self.width - 1)
        parts = list(zip(self.parts, self.slices, strict=True))
        part, columns = next(pair for pair in parts if column < pair[1].stop)
        rates = [s for p, s in parts if (p.name, p.derivative) == (part.name, part.derivative + 1)]
        return rates[0].start + column - columns.start if rates else None

    def differentiate(self) -> "Layout":
        """Return the same parts, followed by the first derivative of each [unit/s].

        The derivative of an orientation on S^3 is the angular velocity in body axes [rad/s], which no frame
        changes.

        Raises:
            InvalidInput: If the layout has derivatives already.
        """
        if derived := [part.name for part in self.parts if part.derivative]:
            raise InvalidInput(f"the layout has a derivative of {derived[0]!r} already, expected none")
        rates = tuple(replace(part, unit=f"{part.unit}/s", derivative=1) for part in self.tangent.parts)
        return Layout(self.parts + rates)

    @property
    def tangent(self) -> "Layout":
        """Columns of deviations: a rotation vector in body axes [rad] for each orientation on S^3."""
        return Layout(tuple(_tangent_part(part) for part in self.parts))

    def quaternion_signs(self, negated: Collection[slice]) -> Float[Array, " D"]:
        """Return -1 for the columns of negated quaternions and their derivatives, and 1 elsewhere.

        Args:
            negated: Columns of the quaternions, as in `quaternions`.
        """
        names = {
            part.name for part, columns in zip(self.parts, self.slices, strict=True) if columns in negated
        }
        signs = [
            -1.0 if part.quantity is Quantity.QUATERNION and part.name in names else 1.0
            for part in self.parts
        ]
        return np.repeat(signs, [part.size for part in self.parts])

    def distances(
        self, columns: slice, x: Float[Array, "T D"], y: Float[Array, "*#T D"]
    ) -> Float[Array, " T"]:
        """Return the distance between points in the columns of one part.

        Args:
            columns: Columns of one part.
            x: Points.
            y: Points, or one point.

        Returns:
            Distances in the unit of the part; angles [deg] if the part is an orientation.
        """
        if columns in self.unit_quaternions:
            return np.asarray(np.degrees(angle(x[:, columns], y[..., columns])))
        return np.asarray(np.linalg.norm(x[:, columns] - y[..., columns], axis=1))

    def distance_unit(self, columns: slice) -> str:
        """Return the unit of `distances`: deg if the columns are an orientation.

        Args:
            columns: Columns of one part.
        """
        return "deg" if columns in self.unit_quaternions else self.units[columns.start]

    def _columns_of(self, *quantities: Quantity) -> tuple[slice, ...]:
        pairs = zip(self.parts, self.slices, strict=True)
        return tuple(
            columns for part, columns in pairs if part.quantity in quantities and part.derivative == 0
        )


def pose_layout() -> Layout:
    """Return the layout of a pose: "position" [m] and "orientation", a unit quaternion w x y z."""
    position = Part("position", Quantity.POSITION, 3, "m")
    return Layout((position, Part("orientation", Quantity.QUATERNION, QUATERNION_SIZE, "1")))


def position_layout(axes: int = 3, unit: str = "m") -> Layout:
    """Return the layout of a single part "position".

    Args:
        axes: Number of axes.
        unit: Unit of every axis.
    """
    return Layout((Part("position", Quantity.POSITION, axes, unit),))


def _tangent_part(part: Part) -> Part:
    if part.quantity is not Quantity.ORIENTATION:
        return part
    return replace(part, quantity=Quantity.SCALAR, size=ROTATION_VECTOR_SIZE, unit="rad")


def _column_names(part: Part) -> list[str]:
    return [f"{part.name}{axis}{chr(39) * part.derivative}" for axis in _axis_names(part)]


def _axis_names(part: Part) -> list[str]:
    if part.size == 1 and part.quantity is not Quantity.POSITION:
        return [""]
    if part.quantity in (Quantity.QUATERNION, Quantity.ORIENTATION):
        return [" w", " x", " y", " z"]
    if part.quantity is not Quantity.SCALAR and part.size <= len("xyz"):
        return [f" {axis}" for axis in "xyz"[: part.size]]
    return [f" {n + 1}" for n in range(part.size)]


def _range(columns: slice) -> range:
    return range(columns.start, columns.stop)
