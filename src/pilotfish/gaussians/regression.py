"""Regression with Gaussians: some columns given the others, each component speaking for its share."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import precision_cholesky, split_columns
from pilotfish.gaussians.mixture import GaussianMixture
from pilotfish.types import Array, Float, Int

MAX_ARRAY_SIZE = 2**21  # numbers in the largest intermediate array: 16 MiB


@dataclass(frozen=True, slots=True, eq=False)
class GaussianRegression:
    """What is expected of the other columns at each of N inputs.

    jacobians[n] is the exact derivative of means[n] with respect to the n-th input, all else held.
    """

    means: Float[Array, "N O"]
    covariances: Float[Array, "N O O"]
    jacobians: Float[Array, "N O I"]


@dataclass(frozen=True, slots=True, eq=False)
class ConditionalGaussians:
    """What each of K Gaussians says of the other columns, given the input columns x.

    It expects means[k] + slopes[k] (x - centres[k]), with covariances[k] wherever x lies. W = whiteners[k] is
    lower triangular, W^T W the inverse of the inputs' own covariance.
    """

    inputs: Int[Array, " I"]
    outputs: Int[Array, " O"]
    input_means: Float[Array, "K I"]
    precision_cholesky: Float[Array, "K I I"]
    means: Float[Array, "K O"]
    slopes: Float[Array, "K O I"]
    covariances: Float[Array, "K O O"]


def conditional_gaussians(
    means: Float[Array, "K D"], covariances: Float[Array, "K D D"], inputs: Int[Array, " I"]
) -> ConditionalGaussians:
    """Each Gaussian, read as a map from the input columns to the others, which keep their order.

    Raises: InvalidInput, when inputs are no columns or leave none to predict; NotPositiveDefinite, when a
    component is singular in the inputs.
    Source: Bishop 2006, equations 2.81-2.82.
    """
    inputs, outputs = split_columns(inputs, means.shape[1])
    if not len(outputs) or not len(inputs):
        raise InvalidInput(f"inputs {inputs.tolist()} of {means.shape[1]} columns leave nothing to map")
    W = precision_cholesky(covariances[:, inputs[:, None], inputs], "the input covariance of component")
    whitened = covariances[:, outputs[:, None], inputs] @ W.transpose(0, 2, 1)  # S_oi W^T, (K, O, I)
    rest = covariances[:, outputs[:, None], outputs] - whitened @ whitened.transpose(0, 2, 1)
    return ConditionalGaussians(inputs, outputs, means[:, inputs], W, means[:, outputs], whitened @ W, rest)


def log_input_densities(conditionals: ConditionalGaussians, x: Float[Array, "N _"]) -> Float[Array, "N K"]:
    """Log N(x_n | the inputs' own mean and covariance in component k).

    Raises: InvalidInput, when x is not finite, of another width than the inputs, or further from every
    component than a float can hold.
    """
    validate_inputs(conditionals.inputs, x)
    emissions = kernels.Emissions(conditionals.input_means[None], conditionals.precision_cholesky[None])
    with np.errstate(over="ignore", invalid="ignore"):
        log_densities = kernels.log_emissions(np.ascontiguousarray(x, dtype=np.float64)[None], emissions)
    infinite = ~np.isfinite(log_densities.max(axis=1, initial=-np.inf))
    if infinite.any():
        n = int(infinite.argmax())
        raise InvalidInput(
            f"x[{n}] is so far from every component that its density is no number: {x[n].tolist()}; "
            "give it in the units of the demonstrations"
        )
    return log_densities


def validate_inputs(inputs: Int[Array, " I"], x: Float[Array, "N _"]) -> None:
    """Nothing, when every row of x holds a finite number for each input."""
    if x.shape[1] != len(inputs):
        raise InvalidInput(f"x has {x.shape[1]} columns, expected {len(inputs)}: one for each of the inputs")
    if (bad := np.argwhere(~np.isfinite(x))).size:
        n, i = bad[0]
        raise InvalidInput(
            f"x[{n}, {i}] is {x[n, i]}, expected a finite number; leave the row out, or what it lacks "
            "out of the inputs"
        )


def regress(mixture: GaussianMixture, inputs: Int[Array, " I"], x: Float[Array, "N _"]) -> GaussianRegression:
    """Mean, covariance and input derivative of the columns that are not inputs, given that inputs are x.

    The covariance is that of the conditional mixture, the spread between components included. Far from all
    components the likeliest speaks alone. Nothing larger than the result is kept; regress_means spares the
    (N, O, O) covariances, which fill a gigabyte at ten thousand inputs and a hundred columns.
    Raises: InvalidInput, when inputs are no columns or leave none to predict, or x does not fit them;
    NotPositiveDefinite, when a component is singular in the inputs.
    Source: Ghahramani & Jordan 1994; Tanwani 2018, section 6.2 for the use of the derivative.
    """
    conditionals = conditional_gaussians(mixture.means, mixture.covariances, inputs)
    return regress_with_responsibilities(conditionals, x, _responsibilities(mixture, conditionals, x))


def regress_means(
    mixture: GaussianMixture, inputs: Int[Array, " I"], x: Float[Array, "N _"]
) -> Float[Array, "N O"]:
    """The means of regress, and nothing else."""
    conditionals = conditional_gaussians(mixture.means, mixture.covariances, inputs)
    weights = _responsibilities(mixture, conditionals, x)
    parts = [
        np.einsum("nk,nko->no", weights[rows], _predictions(conditionals, x[rows]))
        for rows in _row_blocks(conditionals, x)
    ]
    return np.concatenate([np.empty((0, len(conditionals.outputs))), *parts])


def _responsibilities(
    mixture: GaussianMixture, conditionals: ConditionalGaussians, x: Float[Array, "N _"]
) -> Float[Array, "N K"]:
    """p(component k | input x_n); rows sum to one, however far the input is."""
    log_densities = log_input_densities(conditionals, x)
    with np.errstate(divide="ignore"):
        log_joint = np.log(mixture.weights) + (log_densities - log_densities.max(axis=1, keepdims=True))
    joint = np.exp(log_joint - log_joint.max(axis=1, keepdims=True))
    return np.asarray(joint / joint.sum(axis=1, keepdims=True))


def regress_with_responsibilities(
    conditionals: ConditionalGaussians, x: Float[Array, "N _"], responsibilities: Float[Array, "N K"]
) -> GaussianRegression:
    """Regression in which component k speaks for shares[n, k] = p(k | x_n and whatever else is known).

    The derivative is exact when that else does not depend on x_n: then d log share_k / dx is the component's
    score less the mean score. So it is for a prior, for what a chain saw at other times, and for both.
    Raises: InvalidInput, when x does not fit the inputs.
    """
    validate_inputs(conditionals.inputs, x)
    (N, I), O = x.shape, len(conditionals.outputs)  # noqa: E741 (the paper's letters)
    result = GaussianRegression(np.empty((N, O)), np.empty((N, O, O)), np.empty((N, O, I)))
    for rows in _row_blocks(conditionals, x):
        h, predictions = responsibilities[rows], _predictions(conditionals, x[rows])
        means = np.einsum("nk,nko->no", h, predictions)
        spread = np.sqrt(h)[:, :, None] * (predictions - means[:, None, :])  # (n, K, O)
        scores = _scores(conditionals, x[rows])
        scores = np.sqrt(h)[:, :, None] * (scores - np.einsum("nk,nki->ni", h, scores)[:, None, :])
        result.means[rows] = means
        result.covariances[rows] = _mix(h, conditionals.covariances) + spread.transpose(0, 2, 1) @ spread
        result.jacobians[rows] = _mix(h, conditionals.slopes) + spread.transpose(0, 2, 1) @ scores
    return result


def _mix(h: Float[Array, "N K"], matrices: Float[Array, "K R C"]) -> Float[Array, "N R C"]:
    K, R, C = matrices.shape
    return np.asarray((h @ matrices.reshape(K, R * C)).reshape(-1, R, C))


def _predictions(conditionals: ConditionalGaussians, x: Float[Array, "N I"]) -> Float[Array, "N K O"]:
    """What each component expects of the outputs by itself."""
    slopes = conditionals.slopes.transpose(0, 2, 1)
    return np.asarray((conditionals.means[:, None] + _centred(conditionals, x) @ slopes).transpose(1, 0, 2))


def _scores(conditionals: ConditionalGaussians, x: Float[Array, "N I"]) -> Float[Array, "N K I"]:
    """D log N_k(x) / dx = -S_ii^-1 (x - centre)."""
    W = conditionals.precision_cholesky
    return np.asarray(-(_centred(conditionals, x) @ W.transpose(0, 2, 1) @ W).transpose(1, 0, 2))


def _centred(conditionals: ConditionalGaussians, x: Float[Array, "N I"]) -> Float[Array, "K N I"]:
    return np.asarray(x - conditionals.input_means[:, None])


def _row_blocks(conditionals: ConditionalGaussians, x: Float[Array, "N I"]) -> Iterator[slice]:
    """Rows to work on at a time, so that no intermediate array outgrows ROOM."""
    K, O, I = conditionals.slopes.shape  # noqa: E741 (the paper's letters)
    rows = max(1, MAX_ARRAY_SIZE // (max(K, O) * max(O, I)))
    yield from (slice(n, n + rows) for n in range(0, len(x), rows))
