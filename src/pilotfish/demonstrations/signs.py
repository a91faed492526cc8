"""Signs of quaternions: q and -q are one rotation, so a recording may change between them at any row."""

import numpy as np

from pilotfish.demonstrations.layouts import Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import unwrap_quaternions
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_type, short_list


def unwrap_orientations(x: object, layout: Layout) -> Float[Array, "T D"]:
    """Return a recording in which no quaternion changes sign from one row to the next.

    Derivatives of a quaternion in R^4 change sign with it. `demonstration` refuses recordings with sign
    changes.

    Args:
        x: One row per sample.
        layout: Columns of x.

    Raises:
        InvalidInput: If x is not an array of finite numbers with the columns of the layout.
    """
    require_type(layout, "layout", Layout, "create one with demonstrations.position_layout(3)")
    points = np.array(finite_array(x, "x"))
    if points.ndim != 2 or points.shape[1] != layout.width:
        raise InvalidInput(
            f"x has shape {points.shape}, expected (T, {layout.width}): {short_list(layout.names)}"
        )
    for columns in layout.unit_quaternions:
        q = points[:, columns]
        signs = np.where(np.einsum("td,td->t", q, unwrap_quaternions(q)) < 0, -1.0, 1.0)
        for signed in _columns_with_sign(layout, columns):
            points[:, signed] *= signs[:, None]
    return points


def has_opposite_sign(q: Float[Array, "T 4"], reference: Float[Array, "S 4"]) -> bool:
    """Return whether -q is closer to the reference than q, after resampling to equal length.

    Args:
        q: Quaternions of a recording.
        reference: Quaternions of another recording.
    """
    steps = np.linspace(0, len(reference) - 1, len(q)).round().astype(int)
    return bool(np.einsum("td,td->", q, reference[steps]) < 0)


def _columns_with_sign(layout: Layout, columns: slice) -> list[slice]:
    """Return the columns of a quaternion and of its derivatives in R^4."""
    pairs = list(zip(layout.parts, layout.slices, strict=True))
    name = next(part.name for part, part_columns in pairs if part_columns == columns)
    quantities = (Quantity.QUATERNION, Quantity.ORIENTATION)
    return [part_columns for part, part_columns in pairs if part.name == name and part.quantity in quantities]
