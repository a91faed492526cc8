"""Covariances of deviations as those of the columns that a picture has for axes."""

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.geometry import left_multiplication_matrix, tangent_slices
from pilotfish.types import Array, Float


def ambient_covariances(
    means: Float[Array, "K D"], covariances: Float[Array, "K E E"], layout: Layout
) -> Float[Array, "K D D"]:
    """The covariances of the columns themselves: the same, where no orientation is on S^3.

    Turning by a rotation vector v in body axes takes the unit quaternion q to q + q (0, v / 2), to first
    order; along q itself its columns do not spread.
    """
    K, D = means.shape
    J = np.zeros((K, D, covariances.shape[-1]))
    for columns, tangent_columns, is_orientation in tangent_slices(D, layout.orientation_starts):
        if is_orientation:
            J[:, columns, tangent_columns] = 0.5 * left_multiplication_matrix(means[:, columns])[:, :, 1:]
        else:
            J[:, columns, tangent_columns] = np.eye(columns.stop - columns.start)
    return J @ covariances @ J.transpose(0, 2, 1) if layout.orientation_starts else covariances
