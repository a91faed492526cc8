"""Distances between points, part by part."""

import numpy as np

from pilotfish.demonstrations.layouts import Layout
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
    if columns in layout.unit_quaternions:
        return np.asarray(np.degrees(angle(x[:, columns], y[..., columns])))
    return np.asarray(np.linalg.norm(x[:, columns] - y[..., columns], axis=1))


def distance_unit(layout: Layout, columns: slice) -> str:
    """Return the unit of `distances`: deg if the columns are an orientation.

    Args:
        layout: Columns of the points.
        columns: Columns of one part.
    """
    return "deg" if columns in layout.unit_quaternions else layout.units[columns.start]
