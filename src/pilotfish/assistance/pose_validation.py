"""Check of the pose that an operator commands."""

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, short_list

NORM_TOLERANCE = 1e-3  # of the operator's quaternions, as in demonstrations.demonstration


def validate_pose(layout: Layout, pose: Float[Array, " D"]) -> Float[Array, " D"]:
    """Return a copy of a pose with unit quaternions; raise InvalidInput unless it fits the layout."""
    x = np.array(finite_array(pose, "pose"))
    if x.shape != (layout.width,):
        raise InvalidInput(
            f"pose has shape {x.shape}, expected ({layout.width},), the columns {short_list(layout.names)}"
        )
    for columns in layout.unit_quaternions:
        if not abs((norm := float(np.linalg.norm(x[columns]))) - 1.0) <= NORM_TOLERANCE:
            raise InvalidInput(
                f"pose: the quaternion in columns {columns.start} to {columns.stop - 1} has norm {norm:.6g}, "
                f"expected 1 within {NORM_TOLERANCE:g}; call geometry.normalise"
            )
        x[columns] /= norm
    return x
