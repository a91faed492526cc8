"""q and -q are one rotation: choosing the signs so that orientations can be averaged and differenced."""

import numpy as np

from pilotfish.demonstrations.layouts import Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import unwrap_quaternions
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_type, short_list


def unwrap_orientations(x: object, layout: Layout) -> Float[Array, "T D"]:
    """The same recording with no sign flip of an orientation from one row to the next.

    Derivatives of an orientation change sign with it. For the door `demonstration`, which refuses flips.
    """
    require_type(layout, "layout", Layout, "pf.demonstrations.position_layout(3) makes one")
    points = np.array(finite_array(x, "x"))
    if points.ndim != 2 or points.shape[1] != layout.width:
        raise InvalidInput(
            f"x has shape {points.shape}, expected (T, {layout.width}): {short_list(layout.names)}"
        )
    for columns in layout.quaternions:
        q = points[:, columns]
        signs = np.where(np.einsum("td,td->t", q, unwrap_quaternions(q)) < 0, -1.0, 1.0)
        for same in _orientation_columns(layout, columns):
            points[:, same] *= signs[:, None]
    return points


def unwrap_orientation_starts(
    x: Float[Array, "T D"], orientation_starts: tuple[int, ...]
) -> Float[Array, "T D"]:
    """The same recording, each orientation on S^3 told by the quaternion that is nearer to the one before."""
    x = x.copy()
    for start in orientation_starts:
        x[:, start : start + 4] = unwrap_quaternions(x[:, start : start + 4])
    return x


def _orientation_columns(layout: Layout, columns: slice) -> list[slice]:
    """The columns of an orientation and of its derivatives."""
    parts = list(zip(layout.parts, layout.slices, strict=True))
    name = next(part.name for part, here in parts if here == columns)
    return [here for part, here in parts if part.name == name and part.quantity is Quantity.QUATERNION]
