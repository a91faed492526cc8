"""Columns of a recording in space: points of the first position, and the orientation that belongs to it.

A position in a plane lies at height zero, and one on a line on the x axis.
"""

import numpy as np

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import normalise
from pilotfish.types import Array, Float
from pilotfish.validation import short_list

SPACE = 3  # axes
AXES = "xyz"


def position_part(layout: Layout) -> tuple[Part, slice]:
    """Return the first position of one to three axes, and its columns.

    Args:
        layout: Columns of a recording.

    Raises:
        InvalidInput: If the layout has no such position.
    """
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is Quantity.POSITION and not part.derivative and part.size <= SPACE:
            return part, columns
    raise InvalidInput(
        f"the columns are {short_list(layout.names)}, expected a position of at most three axes to draw; "
        "plot other columns with pilotfish show --plots"
    )


def orientation_part(layout: Layout) -> slice | None:
    """Return the columns of the first orientation; None without one."""
    return next(iter(layout.unit_quaternions), None)


def points_in_space(layout: Layout, x: Float[Array, "T D"]) -> Float[Array, "T 3"]:
    """Return the points of the first position.

    Args:
        layout: Columns of x.
        x: Rows of a recording or of a motion.
    """
    _, columns = position_part(layout)
    return _pad(x[:, columns])


def orientations_in_space(layout: Layout, x: Float[Array, "T D"]) -> Float[Array, "T 4"] | None:
    """Return the unit quaternions w x y z of the first orientation; None without one.

    Args:
        layout: Columns of x.
        x: Rows of a recording or of a motion.
    """
    columns = orientation_part(layout)
    return None if columns is None else normalise(x[:, columns])


def covariances_in_space(layout: Layout, covariances: Float[Array, "K E E"]) -> Float[Array, "K 3 3"]:
    """Return the covariances of the first position; axes that it lacks have variance zero.

    Args:
        layout: Columns of the skill.
        covariances: Covariances of deviations, in the columns of `layout.tangent`.
    """
    part, columns = position_part(layout)
    tangent = layout.tangent.slices[layout.slices.index(columns)]
    blocks = np.zeros((len(covariances), SPACE, SPACE))
    blocks[:, : part.size, : part.size] = covariances[:, tangent, tangent]
    return blocks


def _pad(points: Float[Array, "T d"]) -> Float[Array, "T 3"]:
    """Return points with zeros for the axes that they lack."""
    return np.pad(points, ((0, 0), (0, SPACE - points.shape[1])))
