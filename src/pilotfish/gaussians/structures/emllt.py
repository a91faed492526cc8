"""Extended maximum likelihood linear transform (EMLLT): precisions over shared directions.

Model. Sigma_k^-1 = sum over r of w_kr a_r a_r^T with R >= D directions a_r that all states share. R = D gives
semi-tied covariances, R = D (D + 1) / 2 can give full ones. The M-step maximises
sum_k N_k (log |Sigma_k^-1| - tr(S_k Sigma_k^-1)) by coordinate ascent: each weight in closed form, each
direction by one preconditioned gradient step with backtracking. No step lowers the likelihood.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.gaussian import cholesky
from pilotfish.gaussians.structures.structure import MAX_COUNT, Covariances, CovarianceStructure
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, shorten_repr

INITIAL_SWEEPS = 10  # of the initial semi-tied transform
MAX_HALVINGS = 20


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ExpandedPrecisions(Covariances):
    """Covariances with Sigma_k^-1 = sum over r of weights[k, r] a_r a_r^T.

    Attributes:
        directions: Directions a_r as rows, shared by all states.
        weights: Weight of each direction in each state. Weights may be negative if the sum is positive
            definite.
    """

    kind: ClassVar[str] = "expanded"
    directions: Float[Array, "R D"]
    weights: Float[Array, "K R"]

    @property
    def dense(self) -> Float[Array, "K D D"]:
        inverse = np.linalg.inv(self.precisions)
        return np.asarray(0.5 * (inverse + inverse.transpose(0, 2, 1)))

    @property
    def precisions(self) -> Float[Array, "K D D"]:
        """Return the inverses of the covariances."""
        A = self.directions
        return np.asarray((A.T * self.weights[:, None, :]) @ A)

    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        backwards = cholesky(self.precisions[:, ::-1, ::-1], f"the precision that belongs to {name}")
        return np.ascontiguousarray(backwards[:, ::-1, ::-1].transpose(0, 2, 1))


@dataclass(frozen=True, slots=True)
class EMLLT(CovarianceStructure):
    """Structure in which the precisions of all states are weighted sums over shared directions.

    Attributes:
        directions: Number of directions R, from D (semi-tied) to D (D + 1) / 2 (can be full).
        sweeps: Passes over the directions and weights in every M-step; none lowers the likelihood.

    Source:
        Olsen & Gopinath 2004, Modeling inverse covariance matrices by basis expansion. Simplified: one
        weight or direction at a time, where the source runs a general optimiser over all of them.
    """

    name: ClassVar[str] = "emllt"
    covariances: ClassVar[type[Covariances]] = ExpandedPrecisions
    directions: int
    sweeps: int = 2

    def __post_init__(self) -> None:
        for name in ("directions", "sweeps"):
            require_count(getattr(self, name), name, MAX_COUNT, 1)

    @property
    def label(self) -> str:
        return f"EMLLT({self.directions})"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> ExpandedPrecisions:
        D = sample_covariances.shape[1]
        self._validate_directions(D)
        if isinstance(previous, ExpandedPrecisions) and previous.directions.shape == (self.directions, D):
            expanded = previous
        else:
            expanded = add_directions(
                _fit_semi_tied(counts, sample_covariances), counts, sample_covariances, self.directions
            )
        for _ in range(self.sweeps):
            expanded = update_directions(
                update_weights(expanded, sample_covariances), counts, sample_covariances
            )
        return update_weights(expanded, sample_covariances)

    def parameter_count(self, states: int, width: int) -> int:
        """Return R D + K R.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        return self.directions * (width + states)

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """Return R less than the parameters, at most those of full covariances.

        The weights absorb the lengths of the directions. The number is rarely one too large: 5 states of 4
        columns with 6 directions have 47 degrees of freedom, not 48.

        Args:
            states: Number of states, K.
            width: Number of columns, D.
        """
        return min(self.directions * (width + states - 1), states * width * (width + 1) // 2)

    def _validate_directions(self, width: int) -> None:
        maximum = width * (width + 1) // 2
        if not width <= self.directions <= maximum:
            raise InvalidInput(
                f"{self.label} has {self.directions} directions for {width} columns, expected from {width} "
                f"(semi-tied) to {maximum} (full)"
            )


def update_weights(expanded: ExpandedPrecisions, S: Float[Array, "K D D"]) -> ExpandedPrecisions:
    """Return precisions in which each weight in turn was set to its most likely value.

    With q = a^T Sigma a and s = a^T S a, changing a weight by c gains log(1 + c q) - c s for each datapoint
    (twice its log-likelihood). The maximum is at c = 1/s - 1/q, where 1 + c q = q/s > 0 keeps the precision
    positive definite.
    """
    weights, Sigma = expanded.weights.copy(), expanded.dense
    for r, a in enumerate(expanded.directions):
        image = Sigma @ a  # (K, D)
        q, s = image @ a, (S @ a) @ a
        _validate_variance(s, r)
        change = 1.0 / s - 1.0 / q
        weights[:, r] += change
        # Sherman & Morrison 1950
        Sigma -= ((change * s / q)[:, None] * image)[:, :, None] * image[:, None, :]
    return ExpandedPrecisions(expanded.directions, weights)


def _validate_variance(s: Float[Array, " K"], r: int) -> None:
    if (degenerate := np.flatnonzero(~(s > 0.0))).size:
        raise NotPositiveDefinite(
            f"the covariance of state {degenerate[0]} has no variance along direction {r}; "
            "raise the regularisation"
        )


def update_directions(
    expanded: ExpandedPrecisions, counts: Float[Array, " K"], S: Float[Array, "K D D"]
) -> ExpandedPrecisions:
    """Return precisions in which each direction in turn was moved along the gradient, if that gains.

    The gradient sum_k N_k w_k (Sigma_k - S_k) a is preconditioned by sum_k N_k |w_k| S_k. With R = D the full
    step then leads to a multiple of the semi-tied row.
    """
    A, Sigma = expanded.directions.copy(), expanded.dense
    for r in range(len(A)):
        w = expanded.weights[:, r]
        if not w.any():
            continue
        gradient = (counts * w) @ (Sigma @ A[r] - S @ A[r])
        metric = np.tensordot(counts * np.abs(w), S, axes=1)
        step = backtracking_step(np.linalg.solve(metric, gradient), A[r], w, counts, Sigma, S)
        Sigma = _update_covariances(Sigma, w, A[r], A[r] + step)
        A[r] += step
    return ExpandedPrecisions(A, expanded.weights)


def backtracking_step(
    step: Float[Array, " D"],
    a: Float[Array, " D"],
    w: Float[Array, " K"],
    counts: Float[Array, " K"],
    Sigma: Float[Array, "K D D"],
    S: Float[Array, "K D D"],
) -> Float[Array, " D"]:
    """Return the step, halved until the likelihood increases; zeros if it never does."""
    pair = np.stack([a, step])
    q, s = (pair @ M @ pair.T for M in (Sigma, S))  # (K, 2, 2)
    for halving in range(MAX_HALVINGS):
        t = 0.5**halving
        # (a + t step)^T Sigma (a + t step)
        quadratic_forms = q[:, 0, 0] + 2.0 * t * q[:, 0, 1] + t * t * q[:, 1, 1]
        cross = q[:, 0, 0] + t * q[:, 0, 1]
        determinants = (1.0 + w * quadratic_forms) * (1.0 - w * q[:, 0, 0]) + (w * cross) ** 2
        if determinants.min() > 0.0:  # at most one eigenvalue decreased, so precisions stay positive definite
            trace_increase = w * (2.0 * t * s[:, 0, 1] + t * t * s[:, 1, 1])
            if counts @ (np.log(determinants) - trace_increase) > 0.0:
                return t * step
    return np.zeros_like(step)


def _update_covariances(
    Sigma: Float[Array, "K D D"], w: Float[Array, " K"], old: Float[Array, " D"], new: Float[Array, " D"]
) -> Float[Array, "K D D"]:
    """Return the covariances after w old old^T in the precision became w new new^T (Woodbury, 2 x 2)."""
    pair = np.stack([new, old])
    images = pair @ Sigma  # (K, 2, D)
    change = w[:, None] * np.array([1.0, -1.0])  # (K, 2)
    small = np.eye(2) + change[:, :, None] * (images @ pair.T)
    middle = np.linalg.solve(small, change[:, :, None] * np.eye(2))
    middle = 0.5 * (middle + middle.transpose(0, 2, 1))
    return np.asarray(Sigma - images.transpose(0, 2, 1) @ (middle @ images))


def _fit_semi_tied(counts: Float[Array, " K"], S: Float[Array, "K D D"]) -> ExpandedPrecisions:
    B = kernels.semi_tied_sweeps(S, counts, np.eye(S.shape[1]), INITIAL_SWEEPS)
    variances = np.einsum("di,kij,dj->kd", B, S, B, optimize=True)
    return ExpandedPrecisions(B, 1.0 / variances)


def add_directions(
    expanded: ExpandedPrecisions, counts: Float[Array, " K"], S: Float[Array, "K D D"], count: int
) -> ExpandedPrecisions:
    """Return precisions with more directions, which improve the worst-fitted states.

    Along a generalised eigenvector of S and Sigma with eigenvalue g, the best weight gains g - 1 - log g.
    Every state proposes its best eigenvector; the proposals that gain most are added with weight zero, then
    the weights are updated. This repeats until there are enough directions.
    """
    while (missing := count - len(expanded.directions)) > 0:
        W = expanded.precision_cholesky("the covariance of state")
        values, eigenvectors = np.linalg.eigh(W @ S @ W.transpose(0, 2, 1))
        gains = values - 1.0 - np.log(np.maximum(values, np.finfo(float).tiny))
        best = gains.argmax(axis=1)
        states = np.argsort(-counts * gains.max(axis=1))[:missing]
        new_directions = np.stack([W[k].T @ eigenvectors[k, :, best[k]] for k in states])
        weights = np.hstack([expanded.weights, np.zeros((len(S), len(new_directions)))])
        expanded = update_weights(
            ExpandedPrecisions(np.vstack([expanded.directions, new_directions]), weights), S
        )
    return expanded
