"""Covariances of deviations on S^3 as covariances of the columns of points."""

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.geometry import left_multiplication_matrix, tangent_slices
from pilotfish.types import Array, Float


def ambient_covariances(
    means: Float[Array, "K D"], covariances: Float[Array, "K E E"], layout: Layout
) -> Float[Array, "K D D"]:
    """Return covariances in the columns of points; unchanged if no orientation is on S^3.

    To first order, a rotation vector v in body axes changes the unit quaternion q by q (0, v / 2). Along q
    itself the variance is zero.
    """
    K, D = means.shape
    J = np.zeros((K, D, covariances.shape[-1]))
    for columns, tangent_columns, is_orientation in tangent_slices(D, layout.orientation_starts):
        if is_orientation:
            J[:, columns, tangent_columns] = 0.5 * left_multiplication_matrix(means[:, columns])[:, :, 1:]
        else:
            J[:, columns, tangent_columns] = np.eye(columns.stop - columns.start)
    return J @ covariances @ J.transpose(0, 2, 1) if layout.orientation_starts else covariances
