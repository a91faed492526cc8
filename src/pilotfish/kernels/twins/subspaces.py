"""One cluster's subspace in one frame, and what a datapoint or another cluster changes in it."""

from dataclasses import dataclass, replace

import numpy as np

from pilotfish.kernels.streams import StreamState
from pilotfish.types import Array, Float

DRIFT = 1e-8
ROUNDING = 8 * np.finfo(np.float64).eps


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


def born(x: Float[Array, " D"]) -> Subspace:
    return Subspace(0, x, np.empty((len(x), 0)), np.empty(0), np.zeros(1))


def taken(state: StreamState, k: int, p: int) -> Subspace:
    """Cluster k in frame p, out of its row."""
    r = int(state.ranks[k, p])
    return Subspace(
        int(state.dimensions[k, p]),
        state.means[k, p].copy(),
        state.bases[k, p, :, :r].copy(),
        state.variances[k, p, :r].copy(),
        state.distances[k, p, : r + 1].copy(),
    )


def put(seen: Subspace, state: StreamState, k: int, p: int) -> None:
    """Into the row of cluster k, whose block of frame p is zero."""
    r = len(seen.variances)
    state.dimensions[k, p], state.ranks[k, p] = seen.dimension, r
    state.means[k, p] = seen.mean
    state.bases[k, p, :, :r] = seen.U
    state.variances[k, p, :r] = seen.variances
    state.distances[k, p, : r + 1] = seen.distances


def nearness(square: float, bandwidth: float) -> float:
    """2 rho - rho^2: how much of what lies in the subspace does not count as distance."""
    far = -np.expm1(-square / bandwidth)  # 1 - rho
    return float((1.0 - far) * (1.0 + far))


def squared_distance(x: Float[Array, " D"], seen: Subspace, bandwidth: float) -> float:
    """|e - rho U U^T e|^2 = |e|^2 - (2 rho - rho^2) |U^T e|^2 (5.13)."""
    e = x - seen.mean
    inside = seen.U[:, : seen.dimension].T @ e
    return float(max(e @ e - nearness(e @ e, bandwidth) * (inside @ inside), 0.0))


def absorbed(
    U: Float[Array, "D r"], variances: Float[Array, " r"], scale: float, y: Float[Array, " D"], zero: float
) -> tuple[Float[Array, "D n"], Float[Array, " n"], Float[Array, " n"]]:
    """Directions and variances of scale U diag(variances) U^T + y y^T, and y along them; n is r or r + 1.

    What is left of y outside U is a direction of its own where it is longer than zero (5.18-5.20).
    """
    g = U.T @ y
    p = y - U @ g
    again = U.T @ p  # once more: what cancelled is not orthogonal yet (Kahan and Parlett)
    g, p = g + again, p - U @ again
    if U.shape[1] < len(y) and (nu := float(np.linalg.norm(p))) > zero:
        U, g = np.column_stack([U, p / nu]), np.append(g, nu)
        variances = np.append(variances, 0.0)
    values, R = np.linalg.eigh(scale * np.diag(variances) + np.outer(g, g))
    R = R[:, ::-1]
    return U @ R, np.maximum(values[::-1], 0.0), R.T @ g


def learned(
    x: Float[Array, " D"], before: Subspace, weight: float, penalty: float, bandwidth: float, most: int
) -> Subspace:
    """The subspace after one more datapoint; all directions are kept, see shortened.

    The dimension is that of least mean loss among those at which the loss of this datapoint does not rise.
    That of before always is one of these: the leading directions gain what the update adds (Ky Fan 1949).
    Source: Tanwani 2018, equations 5.8 and 5.17-5.23, with the mean before the update in the residual
    (Welford 1962).
    """
    w, e = weight, x - before.mean
    zero = ROUNDING * float(np.linalg.norm(x) + np.linalg.norm(before.mean))
    share = np.sqrt(w) / (w + 1.0)
    U, variances, y = absorbed(before.U, before.variances, w / (w + 1.0), share * e, share * zero)
    left = (w / (w + 1.0)) * e  # x - the mean after the update
    along = y * np.sqrt(w)  # U^T left
    square = float(left @ left)
    delta = square - nearness(square, bandwidth) * np.concatenate([[0.0], np.cumsum(along**2)])
    delta = np.maximum(delta, 0.0)
    known = np.append(before.distances, np.full(len(delta) - len(before.distances), before.distances[-1]))
    distances = (w * known + delta) / (w + 1.0)
    d = before.dimension
    loss = penalty * d + squared_distance(x, before, bandwidth)
    k = np.arange(min(d + 1, len(y), most) + 1)
    allowed = (penalty * k + delta[k] <= loss) | (k == d)
    chosen = int(np.where(allowed, penalty * k + distances[k], np.inf).argmin())
    return Subspace(chosen, before.mean + e / (w + 1.0), U, variances, distances)


def straightened(seen: Subspace) -> Subspace:
    """With orthonormal directions again, where they have drifted apart by more than 1e-8."""
    drift = np.abs(seen.U.T @ seen.U - np.eye(seen.U.shape[1]))
    if not drift.size or drift.max() <= DRIFT:
        return seen
    Q, R = np.linalg.qr(seen.U)
    return replace(seen, U=Q * np.sign(np.diag(R)))


def loss_of(x: Float[Array, " D"], seen: Subspace, penalty: float, bandwidth: float) -> float:
    return (penalty * seen.dimension if seen.dimension else 0.0) + squared_distance(x, seen, bandwidth)


def shortened(seen: Subspace, spare: int) -> Subspace:
    """With only so many directions beyond its dimension."""
    r = min(seen.dimension + spare, len(seen.variances))
    return replace(
        seen,
        U=np.ascontiguousarray(seen.U[:, :r]),
        variances=seen.variances[:r],
        distances=seen.distances[: r + 1],
    )


def merged(heavy: Subspace, light: Subspace, share: float) -> Subspace:
    """Both as one, the light one having that share of the weight: the pooled mean and covariance.

    The dimension is the heavy one's.
    """
    apart = light.mean - heavy.mean
    zero = ROUNDING * float(np.linalg.norm(light.mean) + np.linalg.norm(heavy.mean))
    U, variances, scale = heavy.U, heavy.variances, 1.0 - share
    for direction, variance in zip(light.U.T, light.variances, strict=True):
        length = float(np.sqrt(share * variance))
        U, variances, _ = absorbed(U, variances, scale, length * direction, ROUNDING * length)
        scale = 1.0
    between = share * (1.0 - share)
    U, variances, y = absorbed(U, variances, scale, np.sqrt(between) * apart, np.sqrt(between) * zero)
    lengths = between * float(apart @ apart) - np.concatenate([[0.0], np.cumsum(y**2)])
    own, other = (
        np.append(d, np.full(len(lengths) - len(d), d[-1])) for d in (heavy.distances, light.distances)
    )
    distances = (1.0 - share) * own + share * other + np.maximum(lengths, 0.0)
    return Subspace(heavy.dimension, heavy.mean + share * apart, U, variances, distances)
