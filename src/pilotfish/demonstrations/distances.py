"""Distances between points, part by part: in the unit of the part, orientations in degrees."""

import numpy as np

from pilotfish.demonstrations.layouts import Layout, Quantity
from pilotfish.geometry import angle
from pilotfish.types import Array, Float


def distances(
    layout: Layout, columns: slice, x: Float[Array, "T D"], y: Float[Array, "*#T D"]
) -> Float[Array, " T"]:
    """Return the distance between points in the columns of one part.

    Args:
        layout: Columns of the points.
        columns: Columns of one part.
        x: Points.
        y: Points, or one point.

    Returns:
        Distances in the unit of the part; angles [deg] if the part is an orientation.
    """
    if is_orientation(layout, columns):
        return np.asarray(np.degrees(angle(x[:, columns], y[..., columns])))
    return np.asarray(np.linalg.norm(x[:, columns] - y[..., columns], axis=1))


def is_orientation(layout: Layout, columns: slice) -> bool:
    """Return whether columns are an orientation, on S^3 or as four numbers."""
    parts = zip(layout.parts, layout.slices, strict=True)
    kinds = (Quantity.QUATERNION, Quantity.ORIENTATION)
    return any(p.quantity in kinds and not p.derivative and here == columns for p, here in parts)


def distance_unit(layout: Layout, columns: slice) -> str:
    """Return the unit of `distances`: deg if the columns are an orientation."""
    return "deg" if is_orientation(layout, columns) else layout.units[columns.start]
