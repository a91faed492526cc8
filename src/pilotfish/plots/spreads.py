"""Covariances of deviations as those of the columns that a picture has for axes."""

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.geometry import left_matrix, tangent_slices
from pilotfish.types import Array, Float


def in_columns(
    means: Float[Array, "K D"], covariances: Float[Array, "K E E"], layout: Layout
) -> Float[Array, "K D D"]:
    """The covariances of the columns themselves: the same, where no orientation is on S^3.

    Turning by a rotation vector v in body axes takes the unit quaternion q to q + q (0, v / 2), to first
    order; along q itself its columns do not spread.
    """
    K, D = means.shape
    J = np.zeros((K, D, covariances.shape[-1]))
    for here, there, turn in tangent_slices(D, layout.turns):
        if turn:
            J[:, here, there] = 0.5 * left_matrix(means[:, here])[:, :, 1:]
        else:
            J[:, here, there] = np.eye(here.stop - here.start)
    return J @ covariances @ J.transpose(0, 2, 1) if layout.turns else covariances
