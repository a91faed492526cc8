"""Gaussian mixture regression (GMR): some columns given the others.

With responsibilities h_k(x) and conditional densities N(y | m_k(x), C_k), the prediction has the mean
sum_k h_k m_k and the covariance sum_k h_k (C_k + (m_k - mean)(m_k - mean)^T). Its derivative by x contains
the derivative of the responsibilities, h_k (s_k - sum_j h_j s_j), where s_k = d log N_k(x) / dx is the score.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pilotfish.gaussians.conditional import (
    ConditionalGaussians,
    conditional_gaussians,
    validate_inputs,
)
from pilotfish.gaussians.riemannian_regression import regress_on_manifold
from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr

MAX_ARRAY_SIZE = 2**21  # numbers in the largest intermediate array: 16 MiB


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class GaussianRegression:
    """Predicted density of the outputs at each of N inputs.

    On an orientation, deviations are rotation vectors [rad] in body axes.

    Attributes:
        means: Mean of the outputs.
        covariances: Covariance of the deviations from the mean.
        jacobians: Exact derivative of each mean by its own input, both as deviations.
        orientation_starts: First column of each quaternion in means.
    """

    means: Float[Array, "N O"]
    covariances: Float[Array, "N Q Q"]
    jacobians: Float[Array, "N Q J"]
    orientation_starts: tuple[int, ...] = ()


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class GaussianMixture:
    """Mixture of K Gaussians.

    Attributes:
        weights: Mixture weights, of sum one.
        means: Mean of each component.
        covariances: Covariance of each component.
    """

    weights: Float[Array, " K"]
    means: Float[Array, "K D"]
    covariances: Float[Array, "K D D"]

    def regress(self, inputs: Int[Array, " I"], x: Float[Array, "N _"]) -> GaussianRegression:
        """Return mean, covariance and input derivative of the other columns, given the input columns.

        The covariance is that of the conditional mixture and includes the variation between components. Far
        from all components the most likely one dominates. Memory is that of the result; `regress_means` omits
        the (N, O, O) covariances, which take a gigabyte for ten thousand inputs and a hundred columns.

        Args:
            inputs: Input columns; negative numbers count from the end.
            x: Values of the input columns.

        Raises:
            InvalidInput: If inputs are not columns or leave no output, or x does not match them.
            NotPositiveDefinite: If the inputs of a component have a singular covariance.

        Source:
            Ghahramani & Jordan 1994; Tanwani 2018, section 6.2, for the use of the derivative.
        """
        conditionals = conditional_gaussians(self.means, self.covariances, inputs)
        return regress_with_responsibilities(conditionals, x, _responsibilities(self, conditionals, x))

    def regress_means(self, inputs: Int[Array, " I"], x: Float[Array, "N _"]) -> Float[Array, "N O"]:
        """Return the means of `regress` only, in less memory.

        Args:
            inputs: Input columns; negative numbers count from the end.
            x: Values of the input columns.

        Raises:
            InvalidInput: If inputs are not columns or leave no output, or x does not match them.
            NotPositiveDefinite: If the inputs of a component have a singular covariance.
        """
        conditionals = conditional_gaussians(self.means, self.covariances, inputs)
        weights = _responsibilities(self, conditionals, x)
        parts = [
            np.einsum("nk,nko->no", weights[rows], _predictions(conditionals, x[rows]))
            for rows in _row_blocks(conditionals, x)
        ]
        return np.concatenate([np.empty((0, conditionals.means.shape[1])), *parts])


def _responsibilities(
    mixture: GaussianMixture, conditionals: ConditionalGaussians, x: Float[Array, "N _"]
) -> Float[Array, "N K"]:
    """Return p(component k | input x_n); rows sum to one, however far the input is."""
    log_densities = conditionals.log_input_densities(x)
    with np.errstate(divide="ignore"):
        log_joint = np.log(mixture.weights) + (log_densities - log_densities.max(axis=1, keepdims=True))
    joint = np.exp(log_joint - log_joint.max(axis=1, keepdims=True))
    return np.asarray(joint / joint.sum(axis=1, keepdims=True))


def regress_with_responsibilities(
    conditionals: ConditionalGaussians, x: Float[Array, "N _"], responsibilities: Float[Array, "N K"]
) -> GaussianRegression:
    """Return the regression in which the components have given responsibilities.

    The derivative is exact if the responsibilities depend on x_n only through the input densities, as those
    of a mixture and of a Markov chain do: p(k | x_n, c) is proportional to p(k | c) N_k(x_n).

    Args:
        conditionals: Result of `conditional_gaussians`.
        x: Inputs.
        responsibilities: p(component k | x_n and other observations).

    Raises:
        InvalidInput: If x does not match the inputs.
    """
    validate_inputs(conditionals, x)
    if conditionals.input_orientation_starts or conditionals.output_orientation_starts:
        parts = regress_on_manifold(conditionals, x, responsibilities)
        return GaussianRegression(*parts, conditionals.output_orientation_starts)
    (N, I), O = x.shape, conditionals.means.shape[1]  # noqa: E741 (the paper's letters)
    result = GaussianRegression(np.empty((N, O)), np.empty((N, O, O)), np.empty((N, O, I)))
    for rows in _row_blocks(conditionals, x):
        h, predictions = responsibilities[rows], _predictions(conditionals, x[rows])
        means = np.einsum("nk,nko->no", h, predictions)
        deviations = np.sqrt(h)[:, :, None] * (predictions - means[:, None, :])  # (n, K, O)
        scores = _scores(conditionals, x[rows])
        scores = np.sqrt(h)[:, :, None] * (scores - np.einsum("nk,nki->ni", h, scores)[:, None, :])
        result.means[rows] = means
        between = deviations.transpose(0, 2, 1) @ deviations
        result.covariances[rows] = _mix(h, conditionals.covariances) + between
        result.jacobians[rows] = _mix(h, conditionals.slopes) + deviations.transpose(0, 2, 1) @ scores
    return result


def _mix(h: Float[Array, "N K"], matrices: Float[Array, "K R C"]) -> Float[Array, "N R C"]:
    K, R, C = matrices.shape
    return np.asarray((h @ matrices.reshape(K, R * C)).reshape(-1, R, C))


def _predictions(conditionals: ConditionalGaussians, x: Float[Array, "N I"]) -> Float[Array, "N K O"]:
    """Return the conditional mean of each component."""
    slopes = conditionals.slopes.transpose(0, 2, 1)
    return np.asarray((conditionals.means[:, None] + _centred(conditionals, x) @ slopes).transpose(1, 0, 2))


def _scores(conditionals: ConditionalGaussians, x: Float[Array, "N I"]) -> Float[Array, "N K I"]:
    """Return d log N_k(x) / dx = -S_ii^-1 (x - mean)."""
    W = conditionals.precision_cholesky
    return np.asarray(-(_centred(conditionals, x) @ W.transpose(0, 2, 1) @ W).transpose(1, 0, 2))


def _centred(conditionals: ConditionalGaussians, x: Float[Array, "N I"]) -> Float[Array, "K N I"]:
    return np.asarray(x - conditionals.input_means[:, None])


def _row_blocks(conditionals: ConditionalGaussians, x: Float[Array, "N I"]) -> Iterator[slice]:
    """Yield blocks of rows for which no intermediate array exceeds MAX_ARRAY_SIZE."""
    K, O, I = conditionals.slopes.shape  # noqa: E741 (the paper's letters)
    rows = max(1, MAX_ARRAY_SIZE // (max(K, O) * max(O, I)))
    yield from (slice(n, n + rows) for n in range(0, len(x), rows))
