"""Log-linear pooling of Gaussians with fitted weights.

Each of P frames gives a Gaussian of the same variable, with precision L_p and information vector
h_p = L_p m_p. Their pool with weights v_p >= 0 is the normalised product of powers, again a Gaussian:

    L = sum of v_p L_p        h = sum of v_p h_p        mean L^-1 h        covariance L^-1

With v_p = 1 it is the product of frame Gaussians of a task-parameterised model (TP-GMM). The weights are
fitted to segments that were held out. Let u be the points of one segment relative to its own mean, s_p the
mean of u' L_p u, and let m_p be relative to the same mean. The mean log-probability of the points, up to a
constant, is

    (log |L| - sum of v_p s_p - h' L^-1 h) / 2

It is concave in v, so a local optimiser finds the best weights. A frame can be excluded; `ablation_cost`
says what that costs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.types import Array, Bool, Float
from pilotfish.validation import shorten_repr

MIN_POOL_WEIGHT = 1e-9  # of an included frame; with all weights zero the pool would be flat
HeldOutSegment = tuple[Float[Array, "P E"], Float[Array, "P E E"], Float[Array, "P E E"]]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class FrameOpinions:
    """Gaussians of P frames in world coordinates, for M held-out segments, each relative to its own mean.

    Attributes:
        precisions: L_p for each segment and frame.
        information_vectors: h_p = L_p m_p.
        mean_squares: s_p, mean of u' L_p u over the points u of the segment.
    """

    precisions: Float[Array, "M P E E"]
    information_vectors: Float[Array, "M P E"]
    mean_squares: Float[Array, "M P"]

    @classmethod
    def from_frames(
        cls, frame_from_world: Sequence[Float[Array, "P E E"]], segments: Sequence[HeldOutSegment]
    ) -> "FrameOpinions":
        """Transform Gaussians from frames to world coordinates.

        Args:
            frame_from_world: For each segment, the matrix that maps deviations from the world to each frame.
            segments: For each segment and in each frame: mean of the Gaussian minus mean of the segment,
                Cholesky factor W of its precision (W' W), and covariance of the points of the segment.
        """
        precisions, information_vectors, mean_squares = [], [], []
        for B, (offsets, W, scatter) in zip(frame_from_world, segments, strict=True):
            world_W = W @ B
            precisions.append(world_W.transpose(0, 2, 1) @ world_W)
            whitened = np.einsum("pij,pj->pi", W, offsets)
            information_vectors.append(np.einsum("pij,pi->pj", world_W, whitened))
            mean_squares.append(np.trace(W @ scatter @ W.transpose(0, 2, 1), axis1=1, axis2=2))
        return cls(np.stack(precisions), np.stack(information_vectors), np.stack(mean_squares))

    @property
    def frames(self) -> int:
        """Number of frames P."""
        return int(self.mean_squares.shape[1])

    def subset(self, included: Bool[Array, " P"]) -> "FrameOpinions":
        """Return the Gaussians of some of the frames."""
        return FrameOpinions(
            self.precisions[:, included],
            self.information_vectors[:, included],
            self.mean_squares[:, included],
        )

    def pool(
        self, weights: Float[Array, " P"]
    ) -> tuple[Float[Array, "M E E"], Float[Array, "M E"], Float[Array, "M E"]]:
        """Return precision L, information vector h and mean of the pool for each segment."""
        L = np.einsum("p,mpij->mij", weights, self.precisions)
        h = np.einsum("p,mpi->mi", weights, self.information_vectors)
        return L, h, np.linalg.solve(L, h[..., None])[..., 0]


def held_out_log_probs(opinions: FrameOpinions, weights: Float[Array, " P"]) -> Float[Array, " M"]:
    """Return the mean log-probability of each segment under the pool, up to a constant [nats]."""
    L, h, means = opinions.pool(weights)
    log_determinants = np.linalg.slogdet(L)[1]
    return np.asarray(0.5 * (log_determinants - opinions.mean_squares @ weights - np.sum(h * means, axis=1)))


def log_prob_gradient(opinions: FrameOpinions, weights: Float[Array, " P"]) -> Float[Array, " P"]:
    """Return the gradient of the mean of `held_out_log_probs` with respect to the weights."""
    L, _, means = opinions.pool(weights)
    expected = np.einsum("mij,mpji->mp", np.linalg.inv(L), opinions.precisions)  # tr(L^-1 L_p)
    quadratic = np.einsum("mi,mpij,mj->mp", means, opinions.precisions, means)
    linear = np.einsum("mpi,mi->mp", opinions.information_vectors, means)
    return np.asarray((0.5 * (expected - opinions.mean_squares + quadratic) - linear).mean(axis=0))


def fit_pool_weights(opinions: FrameOpinions, included: Bool[Array, " P"]) -> Float[Array, " P"]:
    """Fit the weights of the included frames by maximum held-out log-probability; the others have zero.

    The optimisation starts from equal weights. Where several weights are optimal (identical frames), the
    result is the optimum next to that start.

    Source:
        Heskes 1998, Selecting weighting factors in logarithmic opinion pools.
    """
    from scipy.optimize import minimize  # here: SciPy doubles the time of importing pilotfish

    subset = opinions.subset(included)

    def loss(weights: Float[Array, " P"]) -> tuple[float, Float[Array, " P"]]:
        return -float(held_out_log_probs(subset, weights).mean()), -log_prob_gradient(subset, weights)

    start, bounds = np.full(subset.frames, 1.0 / subset.frames), [(MIN_POOL_WEIGHT, None)] * subset.frames
    weights = np.zeros(opinions.frames)
    weights[included] = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x
    return weights


def eliminate_frames(
    opinions: FrameOpinions, min_evidence: float
) -> tuple[Float[Array, " P"], Float[Array, " P"]]:
    """Exclude frames by backward elimination while that costs at most min_evidence and a standard error.

    Args:
        opinions: Gaussians of the frames.
        min_evidence: Largest cost of excluding a frame [nats].

    Returns:
        Weights relative to the largest, and the cost of excluding each frame alone [nats].
    """
    included = np.ones(opinions.frames, dtype=bool)
    costs = np.array([ablation_cost(opinions, included, p)[0] for p in range(opinions.frames)])
    while included.sum() > 1:
        ablations = {p: ablation_cost(opinions, included, p) for p in np.flatnonzero(included).tolist()}
        cheapest = min(ablations, key=lambda p: ablations[p][0])
        cost, standard_error = ablations[cheapest]
        if cost > min_evidence + standard_error:
            break
        included = _exclude(included, cheapest)
    weights = fit_pool_weights(opinions, included)
    return weights / weights.max(), costs


def ablation_cost(opinions: FrameOpinions, included: Bool[Array, " P"], p: int) -> tuple[float, float]:
    """Return the loss of held-out log-probability without frame p, and its standard error [nats]."""
    rest = _exclude(included, p)
    if not rest.any():
        return np.inf, 0.0
    with_p = held_out_log_probs(opinions, fit_pool_weights(opinions, included))
    losses = with_p - held_out_log_probs(opinions, fit_pool_weights(opinions, rest))
    return float(losses.sum()), float(np.sqrt(len(losses)) * losses.std(ddof=1))


def _exclude(included: Bool[Array, " P"], p: int) -> Bool[Array, " P"]:
    rest = included.copy()
    rest[p] = False
    return rest
