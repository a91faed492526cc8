"""One cluster's subspace in one frame, and what a datapoint or another cluster changes in it."""

from dataclasses import dataclass, replace

import numpy as np

from pilotfish.kernels.stream_state import StreamState
from pilotfish.types import Array, Float

MAX_DRIFT = 1e-8
ROUNDING_TOLERANCE = 8 * np.finfo(np.float64).eps


@dataclass(frozen=True, slots=True, eq=False)
class Subspace:
    """Sigma = U diag(variances) U^T about the mean, the first d directions of U being the subspace.

    distances[k] is the running mean of the squared distance to the first k directions (5.22).
    """

    dimension: int
    mean: Float[Array, " D"]
    U: Float[Array, "D r"]
    variances: Float[Array, " r"]
    distances: Float[Array, " r+1"]


def initial_subspace(x: Float[Array, " D"]) -> Subspace:
    return Subspace(0, x, np.empty((len(x), 0)), np.empty(0), np.zeros(1))


def unpack_subspace(state: StreamState, k: int, p: int) -> Subspace:
    """Cluster k in frame p, out of its row."""
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
    """2 rho - rho^2: how much of what lies in the subspace does not count as distance."""
    far = -np.expm1(-square / bandwidth)  # 1 - rho
    return float((1.0 - far) * (1.0 + far))


def squared_distance(x: Float[Array, " D"], subspace: Subspace, bandwidth: float) -> float:
    """|e - rho U U^T e|^2 = |e|^2 - (2 rho - rho^2) |U^T e|^2 (5.13)."""
    e = x - subspace.mean
    inside = subspace.U[:, : subspace.dimension].T @ e
    return float(max(e @ e - projection_weight(e @ e, bandwidth) * (inside @ inside), 0.0))


def rank_one_update(
    U: Float[Array, "D r"],
    variances: Float[Array, " r"],
    scale: float,
    y: Float[Array, " D"],
    tolerance: float,
) -> tuple[Float[Array, "D n"], Float[Array, " n"], Float[Array, " n"]]:
    """Directions and variances of scale U diag(variances) U^T + y y^T, and y along them; n is r or r + 1.

    What is left of y outside U is a direction of its own where it is longer than zero (5.18-5.20).
    """
    g = U.T @ y
    p = y - U @ g
    correction = U.T @ p  # once more: what cancelled is not orthogonal yet (Kahan and Parlett)
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
    """The subspace after one more datapoint; all directions are kept, see shortened.

    The dimension is that of least mean loss among those at which the loss of this datapoint does not rise.
    That of before always is one of these: the leading directions gain what the update adds (Ky Fan 1949).
    Source: Tanwani 2018, equations 5.8 and 5.17-5.23, with the mean before the update in the residual
    (Welford 1962).
    """
    w, e = weight, x - previous.mean
    tolerance = ROUNDING_TOLERANCE * float(np.linalg.norm(x) + np.linalg.norm(previous.mean))
    share = np.sqrt(w) / (w + 1.0)
    U, variances, y = rank_one_update(
        previous.U, previous.variances, w / (w + 1.0), share * e, share * tolerance
    )
    residual = (w / (w + 1.0)) * e  # x - the mean after the update
    projections = y * np.sqrt(w)  # U^T left
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
    """With orthonormal directions again, where they have drifted apart by more than 1e-8."""
    drift = np.abs(subspace.U.T @ subspace.U - np.eye(subspace.U.shape[1]))
    if not drift.size or drift.max() <= MAX_DRIFT:
        return subspace
    Q, R = np.linalg.qr(subspace.U)
    return replace(subspace, U=Q * np.sign(np.diag(R)))


def point_loss(x: Float[Array, " D"], subspace: Subspace, penalty: float, bandwidth: float) -> float:
    return (penalty * subspace.dimension if subspace.dimension else 0.0) + squared_distance(
        x, subspace, bandwidth
    )


def truncate(subspace: Subspace, extra_directions: int) -> Subspace:
    """With only so many directions beyond its dimension."""
    r = min(subspace.dimension + extra_directions, len(subspace.variances))
    return replace(
        subspace,
        U=np.ascontiguousarray(subspace.U[:, :r]),
        variances=subspace.variances[:r],
        distances=subspace.distances[: r + 1],
    )


def merge_subspaces(heavier: Subspace, lighter: Subspace, share: float) -> Subspace:
    """Both as one, the light one having that share of the weight: the pooled mean and covariance.

    The dimension is the heavy one's.
    """
    separation = lighter.mean - heavier.mean
    tolerance = ROUNDING_TOLERANCE * float(np.linalg.norm(lighter.mean) + np.linalg.norm(heavier.mean))
    U, variances, scale = heavier.U, heavier.variances, 1.0 - share
    for direction, variance in zip(lighter.U.T, lighter.variances, strict=True):
        length = float(np.sqrt(share * variance))
        U, variances, _ = rank_one_update(
            U, variances, scale, length * direction, ROUNDING_TOLERANCE * length
        )
        scale = 1.0
    between = share * (1.0 - share)
    U, variances, y = rank_one_update(
        U, variances, scale, np.sqrt(between) * separation, np.sqrt(between) * tolerance
    )
    lengths = between * float(separation @ separation) - np.concatenate([[0.0], np.cumsum(y**2)])
    own, other = (
        np.append(d, np.full(len(lengths) - len(d), d[-1])) for d in (heavier.distances, lighter.distances)
    )
    distances = (1.0 - share) * own + share * other + np.maximum(lengths, 0.0)
    return Subspace(heavier.dimension, heavier.mean + share * separation, U, variances, distances)
