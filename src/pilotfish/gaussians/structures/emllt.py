"""Extended maximum likelihood linear transform: precisions over more shared directions than columns."""

from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.gaussian import cholesky
from pilotfish.gaussians.structures.dense import MAX_COUNT, Covariances
from pilotfish.types import Array, Float
from pilotfish.validation import require_count

INITIAL_SWEEPS = 10  # of the semi-tied transform that a fit begins with
MAX_HALVINGS = 20


@dataclass(frozen=True, slots=True, eq=False)
class ExpandedPrecisions:
    """Sigma_k^-1 = sum over r of weights[k, r] a_r a_r^T, a_r the rows of directions.

    Weights may be negative while the sum is positive definite.
    """

    directions: Float[Array, "R D"]
    weights: Float[Array, "K R"]

    @property
    def dense(self) -> Float[Array, "K D D"]:
        inverse = np.linalg.inv(self.precisions)
        return np.asarray(0.5 * (inverse + inverse.transpose(0, 2, 1)))

    @property
    def precisions(self) -> Float[Array, "K D D"]:
        """The inverses of the covariances."""
        A = self.directions
        return np.asarray((A.T * self.weights[:, None, :]) @ A)

    def precision_cholesky(self, name: str) -> Float[Array, "K D D"]:
        """Lower triangular W with W^T W = covariance^-1: the precision's Cholesky factor, last column first.

        Raises: NotPositiveDefinite, naming the first that has none.
        """
        backwards = cholesky(self.precisions[:, ::-1, ::-1], f"the precision that belongs to {name}")
        return np.ascontiguousarray(backwards[:, ::-1, ::-1].transpose(0, 2, 1))


@dataclass(frozen=True, slots=True)
class EMLLT:
    """Precisions of all states share directions, at least as many as there are columns.

    vectors  how many directions; D of them are semi-tied covariances, D (D + 1) / 2 can be full ones
    sweeps   passes over the directions and weights in every M-step; none lowers the likelihood
    Simplified: one weight or direction at a time is improved, weights in closed form and directions by a step
    uphill that is halved until it gains, where the source runs a general optimiser over all of them.
    Source: Olsen & Gopinath 2004, Modeling inverse covariance matrices by basis expansion.
    """

    vectors: int
    sweeps: int = 2

    def __post_init__(self) -> None:
        for name in ("vectors", "sweeps"):
            require_count(getattr(self, name), name, MAX_COUNT, 1)

    @property
    def label(self) -> str:
        return f"EMLLT({self.vectors})"

    def estimate(
        self,
        counts: Float[Array, " K"],
        sample_covariances: Float[Array, "K D D"],
        previous: Covariances | None,
    ) -> ExpandedPrecisions:
        D = sample_covariances.shape[1]
        self._validate_vectors(D)
        if isinstance(previous, ExpandedPrecisions) and previous.directions.shape == (self.vectors, D):
            expanded = previous
        else:
            expanded = add_directions(
                _fit_semi_tied(counts, sample_covariances), counts, sample_covariances, self.vectors
            )
        for _ in range(self.sweeps):
            expanded = update_directions(
                update_weights(expanded, sample_covariances), counts, sample_covariances
            )
        return update_weights(expanded, sample_covariances)

    def parameter_count(self, states: int, width: int) -> int:
        """R D + K R."""
        return self.vectors * (width + states)

    def degrees_of_freedom(self, states: int, width: int) -> int:
        """R fewer than parameters, since weights make up for the length of directions; no more than full.

        Rarely one too many: 5 states of 4 columns and 6 vectors move in 47 dimensions, not 48.
        """
        return min(self.vectors * (width + states - 1), states * width * (width + 1) // 2)

    def _validate_vectors(self, width: int) -> None:
        max_vectors = width * (width + 1) // 2
        if not width <= self.vectors <= max_vectors:
            raise InvalidInput(
                f"{self.label} has {self.vectors} vectors for {width} columns, expected from {width} "
                f"(semi-tied) to {max_vectors} (full)"
            )


def update_weights(expanded: ExpandedPrecisions, S: Float[Array, "K D D"]) -> ExpandedPrecisions:
    """The same directions, each weight in turn the likeliest there is while the others stay.

    With q = a^T Sigma a and s = a^T S a, changing a weight by c gains log(1 + c q) - c s for each datapoint
    (twice its log-likelihood), most at c = 1/s - 1/q, where 1 + c q = q/s > 0 keeps the precision positive
    definite.
    """
    weights, Sigma = expanded.weights.copy(), expanded.dense
    for r, a in enumerate(expanded.directions):
        image = Sigma @ a  # (K, D)
        q, s = image @ a, (S @ a) @ a
        _validate_variance(s, r)
        change = 1.0 / s - 1.0 / q
        weights[:, r] += change
        Sigma -= ((change * s / q)[:, None] * image)[:, :, None] * image[
            :, None, :
        ]  # Sherman & Morrison 1950
    return ExpandedPrecisions(expanded.directions, weights)


def _validate_variance(s: Float[Array, " K"], r: int) -> None:
    if (degenerate := np.flatnonzero(~(s > 0.0))).size:
        raise NotPositiveDefinite(
            f"the covariance of state {degenerate[0]} has no variance along direction {r}; raise the regularisation"
        )


def update_directions(
    expanded: ExpandedPrecisions, counts: Float[Array, " K"], S: Float[Array, "K D D"]
) -> ExpandedPrecisions:
    """The same weights, each direction in turn moved uphill, or left where no step is found that gains.

    The gradient sum N_k w_k (Sigma_k - S_k) a is preconditioned by sum N_k |w_k| S_k: with as many directions
    as columns the whole step then leads to a multiple of the semi-tied row.
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
    """The step, halved until the likelihood gains by it; zeros when it never does."""
    pair = np.stack([a, step])
    q, s = (pair @ M @ pair.T for M in (Sigma, S))  # (K, 2, 2)
    for halving in range(MAX_HALVINGS):
        t = 0.5**halving
        quadratic_forms = (
            q[:, 0, 0] + 2.0 * t * q[:, 0, 1] + t * t * q[:, 1, 1]
        )  # (a + t step)^T Sigma (a + t step)
        cross = q[:, 0, 0] + t * q[:, 0, 1]
        determinants = (1.0 + w * quadratic_forms) * (1.0 - w * q[:, 0, 0]) + (w * cross) ** 2
        if determinants.min() > 0.0:  # one eigenvalue at most fell, so the precisions stay positive definite
            trace_increase = w * (2.0 * t * s[:, 0, 1] + t * t * s[:, 1, 1])
            if counts @ (np.log(determinants) - trace_increase) > 0.0:
                return t * step
    return np.zeros_like(step)


def _update_covariances(
    Sigma: Float[Array, "K D D"], w: Float[Array, " K"], old: Float[Array, " D"], new: Float[Array, " D"]
) -> Float[Array, "K D D"]:
    """Sigma after w old old^T in its inverse became w new new^T (Woodbury, 2 x 2)."""
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
    expanded: ExpandedPrecisions, counts: Float[Array, " K"], S: Float[Array, "K D D"], vectors: int
) -> ExpandedPrecisions:
    """More directions, of weight zero at first, where single states are told worst by those there are.

    Along a generalised eigenvector of S and Sigma with eigenvalue g the right weight gains g - 1 - log g, so
    every state proposes its best, again after each round of states.
    """
    while (missing := vectors - len(expanded.directions)) > 0:
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
