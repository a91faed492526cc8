"""Gaussian mixture regression on R^n x S^3 x ..., called by `regress_with_responsibilities`.

Every component predicts in the tangent space at its own output mean. The predicted mean is the weighted
Karcher mean of the predictions: the point at which their weighted logarithmic maps cancel. Covariances are
moved to the tangent space of that mean by the differentials of the exponential and logarithmic maps. The
derivative by the input follows from the implicit function theorem.
"""

import numpy as np

from pilotfish.gaussians.conditional import ConditionalGaussians
from pilotfish.geometry import exp_map, exp_map_jacobian, log_map, log_map_jacobian
from pilotfish.types import Array, Float

MAX_ITERATIONS, TOLERANCE = 100, 1e-12


def regress_on_manifold(
    conditionals: ConditionalGaussians, x: Float[Array, "N _"], responsibilities: Float[Array, "N K"]
) -> tuple[Float[Array, "N O"], Float[Array, "N Q Q"], Float[Array, "N Q J"]]:
    """Return means, covariances and input derivatives; N K Q (Q + J) numbers are allocated.

    Source:
        Zeestraten et al. 2017, IEEE RA-L 2(3), section III, with differentials where they transport
        covariances in parallel; the derivative is new.
    """
    orientation_starts = conditionals.output_orientation_starts
    v = log_map(
        conditionals.input_means[None], x[:, None, :], conditionals.input_orientation_starts
    )  # (N, K, J)
    u = np.einsum("kqj,nkj->nkq", conditionals.slopes, v)
    predictions = exp_map(conditionals.means[None], u, orientation_starts)  # (N, K, O)
    means = _karcher_means(predictions, responsibilities, orientation_starts)
    w = log_map(means[:, None, :], predictions, orientation_starts)
    # from the tangent space at a component's mean to that at the predicted mean
    to_mean = log_map_jacobian(w, orientation_starts) @ exp_map_jacobian(u, orientation_starts)
    covariances = to_mean @ conditionals.covariances @ to_mean.swapaxes(-1, -2)
    within = np.einsum("nk,nkqr->nqr", responsibilities, covariances)
    between = np.einsum("nk,nkq,nkr->nqr", responsibilities, w, w)
    jacobians = _input_jacobians(conditionals, responsibilities, v, w, to_mean)
    return means, within + between, jacobians


def _input_jacobians(
    conditionals: ConditionalGaussians,
    responsibilities: Float[Array, "N K"],
    v: Float[Array, "N K J"],
    w: Float[Array, "N K Q"],
    to_mean: Float[Array, "N K Q Q"],
) -> Float[Array, "N Q J"]:
    """Differentiate sum_k h_k w_k = 0, which defines the mean, by the mean and by the input."""
    input_jacobian = log_map_jacobian(v, conditionals.input_orientation_starts)
    W = conditionals.precision_cholesky
    scores = -np.einsum("kij,kil,nkl,nkjm->nkm", W, W, v, input_jacobian, optimize=True)  # d log N_k / dx
    scores = scores - np.einsum("nk,nkj->nj", responsibilities, scores)[:, None, :]
    input_sensitivity = np.einsum("nk,nkq,nkj->nqj", responsibilities, w, scores)
    input_sensitivity += np.einsum(
        "nk,nkqj->nqj", responsibilities, to_mean @ conditionals.slopes @ input_jacobian
    )
    mean_sensitivity = np.einsum(  # -dw / d mean
        "nk,nkqr->nqr", responsibilities, log_map_jacobian(-w, conditionals.output_orientation_starts)
    )
    return np.linalg.solve(mean_sensitivity, input_sensitivity)


def _karcher_means(
    points: Float[Array, "N K O"], responsibilities: Float[Array, "N K"], orientation_starts: tuple[int, ...]
) -> Float[Array, "N O"]:
    """Return the weighted Karcher mean of each row of points, starting from the point of largest weight."""
    means = points[np.arange(len(points)), responsibilities.argmax(axis=1)]
    for _ in range(MAX_ITERATIONS):
        step = np.einsum(
            "nk,nkq->nq", responsibilities, log_map(means[:, None, :], points, orientation_starts)
        )
        means = exp_map(means, step, orientation_starts)
        if np.abs(step).max(initial=0.0) < TOLERANCE:
            break
    return np.asarray(means)
