"""Columns of a part or frame in SI units."""

from collections.abc import Sequence

import numpy as np

from pilotfish.demonstrations.build_settings import PartSource, require_dimension
from pilotfish.demonstrations.layouts import Quantity
from pilotfish.demonstrations.signals import Signal
from pilotfish.demonstrations.units import NUMBER, Unit, is_unit, parse_unit
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int
from pilotfish.validation import float_array


def columns_in_si(
    source: PartSource, signal: Signal, columns: Sequence[int], rows: Int[Array, " K"], names: tuple[str, str]
) -> tuple[Float[Array, "K d"], str, list[str]]:
    """Return rows of columns in SI units, their unit, and what was converted, in words.

    The unit is that of the source, that of the file, or the SI unit of the quantity. An unknown unit of a
    scalar is kept.

    Args:
        source: Part or pose.
        signal: Signal of the columns.
        columns: Numbers of the columns, from 0.
        rows: Rows of the signal.
        names: What messages begin with, and what reports begin with.

    Raises:
        InvalidInput: If a unit is unknown or of another quantity, the source and the file state different
            units, or the columns of a part have several SI units.
    """
    label, name = names
    stated = [signal.units[column].strip() for column in columns]
    texts = [_column_unit(source, unit, f"{label}: unit") for unit in stated]
    units = [_parse(source, text, f"{label}: unit") for text in texts]
    if len({unit.si for unit in units}) > 1:
        raise InvalidInput(
            f"{label} has columns in {' and '.join(sorted({unit.si for unit in units}))}, expected one SI "
            "unit; make a part of each"
        )
    values = float_array(signal.values[rows][:, list(columns)], label)
    factors = np.array([unit.factor for unit in units])
    if not (factors == 1.0).all():
        values = values * factors
    changed = {t: unit.si for t, unit in zip(texts, units, strict=True) if unit.factor != 1.0}
    return values, units[0].si, [f"{name}: {text} converted to {si}" for text, si in changed.items()]


def _column_unit(source: PartSource, stated: str, label: str) -> str:
    """Return the unit of a column: that of the source, the stated one, or the SI unit of the quantity."""
    if not source.unit:
        return stated if stated or source.expected_dimension in ("", NUMBER) else source.expected_dimension
    if stated and stated != source.unit and is_unit(stated) and is_unit(source.unit):
        given, file = parse_unit(source.unit, label), parse_unit(stated, label)
        if file != given:
            raise InvalidInput(
                f"{label} is {source.unit!r}, but the file states {stated!r}; leave the unit out, or correct "
                "the file"
            )
    return source.unit


def _parse(source: PartSource, text: str, label: str) -> Unit:
    if source.quantity is Quantity.SCALAR and not is_unit(text):
        return Unit(1.0, text)
    require_dimension(text, source.expected_dimension, label)
    return parse_unit(text, label)
