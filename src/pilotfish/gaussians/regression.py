"""Regression with Gaussians: some columns given the others, each component speaking for its share."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import split_columns, whiteners
from pilotfish.gaussians.mixture import Mixture
from pilotfish.types import Array, Float, Int

ROOM = 2**21  # numbers in the largest intermediate array: 16 MiB


@dataclass(frozen=True, slots=True, eq=False)
class Regression:
    """What is expected of the other columns at each of N inputs.

    jacobians[n] is the exact derivative of means[n] with respect to the n-th input, all else held.
    """

    means: Float[Array, "N O"]
    covariances: Float[Array, "N O O"]
    jacobians: Float[Array, "N O I"]


@dataclass(frozen=True, slots=True, eq=False)
class Conditionals:
    """What each of K Gaussians says of the other columns, given the input columns x.

    It expects means[k] + slopes[k] (x - centres[k]), with covariances[k] wherever x lies. W = whiteners[k] is
    lower triangular, W^T W the inverse of the inputs' own covariance.
    """

    inputs: Int[Array, " I"]
    outputs: Int[Array, " O"]
    centres: Float[Array, "K I"]
    whiteners: Float[Array, "K I I"]
    means: Float[Array, "K O"]
    slopes: Float[Array, "K O I"]
    covariances: Float[Array, "K O O"]


def conditionals(
    means: Float[Array, "K D"], covariances: Float[Array, "K D D"], inputs: Int[Array, " I"]
) -> Conditionals:
    """Each Gaussian, read as a map from the input columns to the others, which keep their order.

    Raises: InvalidInput, when inputs are no columns or leave none to predict; NotPositiveDefinite, when a
    component is singular in the inputs.
    Source: Bishop 2006, equations 2.81-2.82.
    """
    inputs, outputs = split_columns(inputs, means.shape[1])
    if not len(outputs) or not len(inputs):
        raise InvalidInput(f"inputs {inputs.tolist()} of {means.shape[1]} columns leave nothing to map")
    W = whiteners(covariances[:, inputs[:, None], inputs], "the input covariance of component")
    white = covariances[:, outputs[:, None], inputs] @ W.transpose(0, 2, 1)  # S_oi W^T, (K, O, I)
    rest = covariances[:, outputs[:, None], outputs] - white @ white.transpose(0, 2, 1)
    return Conditionals(inputs, outputs, means[:, inputs], W, means[:, outputs], white @ W, rest)


def log_input_densities(given: Conditionals, x: Float[Array, "N _"]) -> Float[Array, "N K"]:
    """log N(x_n | the inputs' own mean and covariance in component k).

    Raises: InvalidInput, when x is not finite, of another width than the inputs, or further from every
    component than a float can hold.
    """
    require_inputs(given.inputs, x)
    emissions = kernels.Emissions(given.centres[None], given.whiteners[None])
    with np.errstate(over="ignore", invalid="ignore"):
        log_densities = kernels.log_emissions(np.ascontiguousarray(x, dtype=np.float64)[None], emissions)
    lost = ~np.isfinite(log_densities.max(axis=1, initial=-np.inf))
    if lost.any():
        n = int(lost.argmax())
        raise InvalidInput(
            f"x[{n}] is so far from every component that its density is no number: {x[n].tolist()}; "
            "give it in the units of the demonstrations"
        )
    return log_densities


def require_inputs(inputs: Int[Array, " I"], x: Float[Array, "N _"]) -> None:
    """Nothing, when every row of x holds a finite number for each input."""
    if x.shape[1] != len(inputs):
        raise InvalidInput(f"x has {x.shape[1]} columns, expected {len(inputs)}: one for each of the inputs")
    if (bad := np.argwhere(~np.isfinite(x))).size:
        n, i = bad[0]
        raise InvalidInput(
            f"x[{n}, {i}] is {x[n, i]}, expected a finite number; leave the row out, or what it lacks "
            "out of the inputs"
        )


def regress(mixture: Mixture, inputs: Int[Array, " I"], x: Float[Array, "N _"]) -> Regression:
    """Mean, covariance and input derivative of the columns that are not inputs, given that inputs are x.

    The covariance is that of the conditional mixture, the spread between components included. Far from all
    components the likeliest speaks alone. Nothing larger than the result is kept; regress_means spares the
    (N, O, O) covariances, which fill a gigabyte at ten thousand inputs and a hundred columns.
    Raises: InvalidInput, when inputs are no columns or leave none to predict, or x does not fit them;
    NotPositiveDefinite, when a component is singular in the inputs.
    Source: Ghahramani & Jordan 1994; Tanwani 2018, section 6.2 for the use of the derivative.
    """
    given = conditionals(mixture.means, mixture.covariances, inputs)
    return regress_shared(given, x, _shares(mixture, given, x))


def regress_means(mixture: Mixture, inputs: Int[Array, " I"], x: Float[Array, "N _"]) -> Float[Array, "N O"]:
    """The means of regress, and nothing else."""
    given = conditionals(mixture.means, mixture.covariances, inputs)
    weights = _shares(mixture, given, x)
    parts = [np.einsum("nk,nko->no", weights[rows], _guesses(given, x[rows])) for rows in _blocks(given, x)]
    return np.concatenate([np.empty((0, len(given.outputs))), *parts])


def _shares(mixture: Mixture, given: Conditionals, x: Float[Array, "N _"]) -> Float[Array, "N K"]:
    """p(component k | input x_n); rows sum to one, however far the input is."""
    log_densities = log_input_densities(given, x)
    with np.errstate(divide="ignore"):
        log_joint = np.log(mixture.weights) + (log_densities - log_densities.max(axis=1, keepdims=True))
    joint = np.exp(log_joint - log_joint.max(axis=1, keepdims=True))
    return np.asarray(joint / joint.sum(axis=1, keepdims=True))


def regress_shared(given: Conditionals, x: Float[Array, "N _"], shares: Float[Array, "N K"]) -> Regression:
    """Regression in which component k speaks for shares[n, k] = p(k | x_n and whatever else is known).

    The derivative is exact when that else does not depend on x_n: then d log share_k / dx is the component's
    score less the mean score. So it is for a prior, for what a chain saw at other times, and for both.
    Raises: InvalidInput, when x does not fit the inputs.
    """
    require_inputs(given.inputs, x)
    (N, I), O = x.shape, len(given.outputs)  # noqa: E741 (the paper's letters)
    result = Regression(np.empty((N, O)), np.empty((N, O, O)), np.empty((N, O, I)))
    for rows in _blocks(given, x):
        h, guesses = shares[rows], _guesses(given, x[rows])
        means = np.einsum("nk,nko->no", h, guesses)
        spread = np.sqrt(h)[:, :, None] * (guesses - means[:, None, :])  # (n, K, O)
        scores = _scores(given, x[rows])
        scores = np.sqrt(h)[:, :, None] * (scores - np.einsum("nk,nki->ni", h, scores)[:, None, :])
        result.means[rows] = means
        result.covariances[rows] = _mixed(h, given.covariances) + spread.transpose(0, 2, 1) @ spread
        result.jacobians[rows] = _mixed(h, given.slopes) + spread.transpose(0, 2, 1) @ scores
    return result


def _mixed(h: Float[Array, "N K"], matrices: Float[Array, "K R C"]) -> Float[Array, "N R C"]:
    K, R, C = matrices.shape
    return np.asarray((h @ matrices.reshape(K, R * C)).reshape(-1, R, C))


def _guesses(given: Conditionals, x: Float[Array, "N I"]) -> Float[Array, "N K O"]:
    """What each component expects of the outputs by itself."""
    slopes = given.slopes.transpose(0, 2, 1)
    return np.asarray((given.means[:, None] + _centred(given, x) @ slopes).transpose(1, 0, 2))


def _scores(given: Conditionals, x: Float[Array, "N I"]) -> Float[Array, "N K I"]:
    """d log N_k(x) / dx = -S_ii^-1 (x - centre)."""
    W = given.whiteners
    return np.asarray(-(_centred(given, x) @ W.transpose(0, 2, 1) @ W).transpose(1, 0, 2))


def _centred(given: Conditionals, x: Float[Array, "N I"]) -> Float[Array, "K N I"]:
    return np.asarray(x - given.centres[:, None])


def _blocks(given: Conditionals, x: Float[Array, "N I"]) -> Iterator[slice]:
    """Rows to work on at a time, so that no intermediate array outgrows ROOM."""
    K, O, I = given.slopes.shape  # noqa: E741 (the paper's letters)
    rows = max(1, ROOM // (max(K, O) * max(O, I)))
    yield from (slice(n, n + rows) for n in range(0, len(x), rows))
