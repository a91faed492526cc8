"""Start and end of the demonstrations, as a Gaussian in every frame.

A state covers a stretch of the movement, so that its mean is neither where the demonstrations begin nor where
they end. Their first and last datapoints are therefore kept as two more Gaussians per frame. A reproduction
without a given start begins at the first, and every plan ends at the second: where all demonstrations end at
an object, the product of the frames is precise there and the motion ends at the object.

Variances are those of the datapoints, one per column, raised by the regularisation of the skill: a handful of
demonstrations supports no correlations.
"""

from dataclasses import replace

import numpy as np

from pilotfish.demonstrations import Views
from pilotfish.gaussians import Moments, TangentMoments
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.models.dynamics import MixtureWeights
from pilotfish.models.partitions import Partitions, as_partitions
from pilotfish.models.skill import Endpoints, Skill
from pilotfish.types import Array, Float


def fit_endpoints(data: Views | Partitions[Views], regularisation: Float[Array, " E"]) -> Endpoints:
    """Compute mean and variances of the first and of the last datapoints in every frame.

    Args:
        data: Demonstrations as every frame sees them, in parts or together.
        regularisation: Variance added to each tangent column.
    """
    ends = list(as_partitions(data).map(_ends))
    starts = ends[0].orientation_starts
    rows = np.concatenate([part.x for part in ends], axis=1)
    moments = [[_moments(x[row::2], starts) for x in rows] for row in (0, 1)]
    means = np.array([[mean for mean, _ in row] for row in moments]).swapaxes(0, 1)
    variances = np.array([[variance for _, variance in row] for row in moments]).swapaxes(0, 1)
    return Endpoints(means, variances + regularisation)


def _ends(data: Views) -> Views:
    """Return first and last row of each demonstration."""
    last = np.cumsum(data.lengths) - 1
    rows = np.stack([last - data.lengths + 1, last], axis=1).ravel()
    return Views(data.x[:, rows], np.full(len(data.lengths), 2), data.orientation_starts)


def _moments(
    x: Float[Array, "M D"], orientation_starts: tuple[int, ...]
) -> tuple[Float[Array, " D"], Float[Array, " E"]]:
    weights = np.ones((len(x), 1))
    if orientation_starts:
        tangent = TangentMoments.from_data(x, weights, orientation_starts)
        return tangent.means[0], np.diagonal(tangent.scatter_matrices[0]) / len(x)
    moments = Moments.from_data(x, weights)
    return moments.means[0], np.diagonal(moments.scatter_matrices[0]) / len(x)


def endpoint_skill(skill: Skill, endpoints: Endpoints) -> Skill:
    """Return a skill of two states, the start and the end.

    Args:
        skill: Skill with the columns and frames of the endpoints.
        endpoints: Its start and end.
    """
    covariances = tuple(
        DenseCovariances(variances[:, None] * np.eye(variances.shape[-1]))
        for variances in endpoints.variances
    )
    weights = MixtureWeights(np.array([0.5, 0.5]))
    return replace(skill, dynamics=weights, means=endpoints.means, covariances=covariances, endpoints=None)
