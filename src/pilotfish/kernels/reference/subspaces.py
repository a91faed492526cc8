"""Subspace of a cluster in one frame: distance, rank-one update, truncation and merging.

State. The covariance of the cluster is U diag(variances) U^T about the mean, with r orthonormal directions U
in order of decreasing variance. The first d of them span the subspace; the others are stored because they may
enter it later.

Rank-one update. A datapoint with weight w of the past changes the covariance to

    Sigma' = w / (w + 1) Sigma + w / (w + 1)^2 e e^T,   e = x - mean.

With y = sqrt(w) / (w + 1) e, g = U^T y and the residual p = y - U g, Sigma' lies in the span of U and p. Its
eigenvectors are [U, p / |p|] R, where R are the eigenvectors of w / (w + 1) diag(variances, 0) + h h^T with h
= (g, |p|): a diagonal matrix plus an outer product. Here numpy.linalg.eigh solves it; cpp/rank_one.hpp solves
the secular equation in O(r^2).

Dimension. distances[k] is the running mean of the squared distance to the first k directions (5.22). d
becomes the k that minimises lambda_1 k + distances[k] among those at which the loss of the datapoint does not
rise. The previous d is always one of them, since the leading directions gain what the update adds (Ky Fan
1949).

Invariants. U is orthonormal up to a drift of 1e-8, which `reorthonormalise` removes. Without truncation mean
and covariance are exactly those of the weighted datapoints (Welford 1962).

Keep in step: cpp/subspaces.cpp.
"""

from dataclasses import dataclass, replace

import numpy as np

from pilotfish.kernels.stream_state import StreamState
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

MAX_DRIFT = 1e-8
ROUNDING_TOLERANCE = 8 * np.finfo(np.float64).eps


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Subspace:
    """Subspace of one cluster in one frame, as defined at the head of this file."""

    dimension: int
    mean: Float[Array, " D"]
    U: Float[Array, "D r"]
    variances: Float[Array, " r"]
    distances: Float[Array, " r+1"]


def initial_subspace(x: Float[Array, " D"]) -> Subspace:
    """Return the subspace of one datapoint, of dimension 0."""
    return Subspace(0, x, np.empty((len(x), 0)), np.empty(0), np.zeros(1))


def unpack_subspace(state: StreamState, k: int, p: int) -> Subspace:
    """Return the subspace of cluster k in frame p."""
    r = int(state.ranks[k, p])
    return Subspace(
        int(state.dimensions[k, p]),
        state.means[k, p].copy(),
        state.bases[k, p, :, :r].copy(),
        state.variances[k, p, :r].copy(),
        state.distances[k, p, : r + 1].copy(),
    )


def pack_subspace(subspace: Subspace, arrays: dict[str, Float[Array, "..."]], k: int, p: int) -> None:
    """Write the subspace of cluster k in frame p into the named arrays of a state, which are zero there."""
    r = len(subspace.variances)
    arrays["dimensions"][k, p], arrays["ranks"][k, p] = subspace.dimension, r
    arrays["means"][k, p] = subspace.mean
    arrays["bases"][k, p, :, :r] = subspace.U
    arrays["variances"][k, p, :r] = subspace.variances
    arrays["distances"][k, p, : r + 1] = subspace.distances


def projection_weight(square: float, bandwidth: float) -> float:
    """Return 2 rho - rho^2, by which a squared projection reduces the distance."""
    decay = -np.expm1(-square / bandwidth)  # 1 - rho
    return float((1.0 - decay) * (1.0 + decay))


def squared_distance(x: Float[Array, " D"], subspace: Subspace, bandwidth: float) -> float:
    """Return |e - rho U U^T e|^2 = |e|^2 - (2 rho - rho^2) |U^T e|^2 (5.13)."""
    e = x - subspace.mean
    projection = subspace.U[:, : subspace.dimension].T @ e
    return float(max(e @ e - projection_weight(e @ e, bandwidth) * (projection @ projection), 0.0))


def rank_one_update(
    U: Float[Array, "D r"],
    variances: Float[Array, " r"],
    scale: float,
    y: Float[Array, " D"],
    tolerance: float,
) -> tuple[Float[Array, "D n"], Float[Array, " n"], Float[Array, " n"]]:
    """Return directions and variances of scale U diag(variances) U^T + y y^T, and y in the new directions.

    The residual of y outside U becomes a direction if it is longer than the tolerance (5.18-5.20).
    """
    g = U.T @ y
    p = y - U @ g
    correction = U.T @ p  # second projection: cancellation leaves p not orthogonal (Kahan and Parlett)
    g, p = g + correction, p - U @ correction
    if U.shape[1] < len(y) and (nu := float(np.linalg.norm(p))) > tolerance:
        U, g = np.column_stack([U, p / nu]), np.append(g, nu)
        variances = np.append(variances, 0.0)
    values, R = np.linalg.eigh(scale * np.diag(variances) + np.outer(g, g))
    R = R[:, ::-1]
    return U @ R, np.maximum(values[::-1], 0.0), R.T @ g


def update_subspace(
    x: Float[Array, " D"],
    previous: Subspace,
    weight: float,
    penalty: float,
    bandwidth: float,
    max_dimension: int,
) -> Subspace:
    """Return the subspace after one more datapoint, with all directions; `truncate` drops some.

    Source:
        Tanwani 2018, equations 5.8 and 5.17-5.23, with the mean before the update in the residual (Welford
        1962).
    """
    w, e = weight, x - previous.mean
    tolerance = ROUNDING_TOLERANCE * float(np.linalg.norm(x) + np.linalg.norm(previous.mean))
    fraction = np.sqrt(w) / (w + 1.0)
    U, variances, y = rank_one_update(
        previous.U, previous.variances, w / (w + 1.0), fraction * e, fraction * tolerance
    )
    residual = (w / (w + 1.0)) * e  # x - the mean after the update
    projections = y * np.sqrt(w)  # U^T residual
    square = float(residual @ residual)
    delta = square - projection_weight(square, bandwidth) * np.concatenate([[0.0], np.cumsum(projections**2)])
    delta = np.maximum(delta, 0.0)
    previous_distances = np.append(
        previous.distances, np.full(len(delta) - len(previous.distances), previous.distances[-1])
    )
    distances = (w * previous_distances + delta) / (w + 1.0)
    d = previous.dimension
    loss = penalty * d + squared_distance(x, previous, bandwidth)
    k = np.arange(min(d + 1, len(y), max_dimension) + 1)
    allowed = (penalty * k + delta[k] <= loss) | (k == d)
    chosen = int(np.where(allowed, penalty * k + distances[k], np.inf).argmin())
    return Subspace(chosen, previous.mean + e / (w + 1.0), U, variances, distances)


def reorthonormalise(subspace: Subspace) -> Subspace:
    """Return the subspace with orthonormal directions if they have drifted by more than 1e-8."""
    drift = np.abs(subspace.U.T @ subspace.U - np.eye(subspace.U.shape[1]))
    if not drift.size or drift.max() <= MAX_DRIFT:
        return subspace
    Q, R = np.linalg.qr(subspace.U)
    return replace(subspace, U=Q * np.sign(np.diag(R)))


def point_loss(x: Float[Array, " D"], subspace: Subspace, penalty: float, bandwidth: float) -> float:
    """Return the loss of a datapoint: squared distance plus the penalty of the dimension."""
    return (penalty * subspace.dimension if subspace.dimension else 0.0) + squared_distance(
        x, subspace, bandwidth
    )


def truncate(subspace: Subspace, extra_directions: int) -> Subspace:
    """Return the subspace with at most extra_directions beyond its dimension."""
    r = min(subspace.dimension + extra_directions, len(subspace.variances))
    return replace(
        subspace,
        U=np.ascontiguousarray(subspace.U[:, :r]),
        variances=subspace.variances[:r],
        distances=subspace.distances[: r + 1],
    )


def merge_subspaces(heavier: Subspace, lighter: Subspace, fraction: float) -> Subspace:
    """Return the pooled mean and covariance; lighter has this fraction of the total weight.

    The dimension is that of the heavier one.
    """
    separation = lighter.mean - heavier.mean
    tolerance = ROUNDING_TOLERANCE * float(np.linalg.norm(lighter.mean) + np.linalg.norm(heavier.mean))
    U, variances, scale = heavier.U, heavier.variances, 1.0 - fraction
    for direction, variance in zip(lighter.U.T, lighter.variances, strict=True):
        length = float(np.sqrt(fraction * variance))
        U, variances, _ = rank_one_update(
            U, variances, scale, length * direction, ROUNDING_TOLERANCE * length
        )
        scale = 1.0
    between = fraction * (1.0 - fraction)
    U, variances, y = rank_one_update(
        U, variances, scale, np.sqrt(between) * separation, np.sqrt(between) * tolerance
    )
    lengths = between * float(separation @ separation) - np.concatenate([[0.0], np.cumsum(y**2)])
    heavier_distances, lighter_distances = (
        np.append(d, np.full(len(lengths) - len(d), d[-1])) for d in (heavier.distances, lighter.distances)
    )
    distances = (1.0 - fraction) * heavier_distances + fraction * lighter_distances + np.maximum(lengths, 0.0)
    return Subspace(heavier.dimension, heavier.mean + fraction * separation, U, variances, distances)
