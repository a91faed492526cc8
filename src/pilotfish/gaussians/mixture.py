"""Weighted Gaussians, and regression with them."""

from dataclasses import dataclass

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import LOG_2_PI, split_columns, whiteners
from pilotfish.types import Array, Float, Int


@dataclass(frozen=True, slots=True, eq=False)
class Mixture:
    """K Gaussians and how often each speaks; the weights sum to one."""

    weights: Float[Array, " K"]
    means: Float[Array, "K D"]
    covariances: Float[Array, "K D D"]


@dataclass(frozen=True, slots=True, eq=False)
class Regression:
    """What a mixture expects of the other columns at each of N inputs.

    jacobians[n] is the exact derivative of means[n] with respect to the input.
    """

    means: Float[Array, "N O"]
    covariances: Float[Array, "N O O"]
    jacobians: Float[Array, "N O I"]


def regress(mixture: Mixture, inputs: Int[Array, " I"], x: Float[Array, "N I"]) -> Regression:
    """Mean, covariance and input derivative of the columns that are not inputs, given that inputs are x.

    The covariance is that of the conditional mixture, the spread between components included.
    Raises: InvalidInput, when inputs leave no column to predict; NotPositiveDefinite, when a component is
    singular in the inputs.
    Source: Ghahramani & Jordan 1994; Tanwani 2018, section 6.2 for the use of the derivative.
    """
    inputs, outputs = split_columns(inputs, mixture.means.shape[1])
    if not len(outputs) or not len(inputs):
        raise InvalidInput(
            f"inputs {inputs.tolist()} of {mixture.means.shape[1]} columns leave nothing to map"
        )
    centred = x[:, None, :] - mixture.means[:, inputs]  # (N, K, I)
    shares, gradients = _responsibilities(mixture, inputs, centred)
    slopes, conditional = _conditionals(mixture, inputs, outputs)
    local = mixture.means[:, outputs] + np.einsum("koi,nki->nko", slopes, centred)  # each component's guess
    means = np.einsum("nk,nko->no", shares, local)
    spread = local - means[:, None, :]
    covariances = np.einsum("nk,kop->nop", shares, conditional) + np.einsum(
        "nk,nko,nkp->nop", shares, spread, spread
    )
    jacobians = np.einsum("nk,koi->noi", shares, slopes) + np.einsum("nki,nko->noi", gradients, local)
    return Regression(means, covariances, jacobians)


def _conditionals(
    mixture: Mixture, inputs: Int[Array, " I"], outputs: Int[Array, " O"]
) -> tuple[Float[Array, "K O I"], Float[Array, "K O O"]]:
    """Slope S_oi S_ii^-1 and conditional covariance of every component."""
    known = mixture.covariances[:, inputs[:, None], inputs]
    cross = mixture.covariances[:, inputs[:, None], outputs]  # (K, I, O)
    slopes = np.linalg.solve(known, cross).transpose(0, 2, 1)
    return slopes, mixture.covariances[:, outputs[:, None], outputs] - slopes @ cross


def _responsibilities(
    mixture: Mixture, inputs: Int[Array, " I"], centred: Float[Array, "N K I"]
) -> tuple[Float[Array, "N K"], Float[Array, "N K I"]]:
    """h_nk = p(component k | x_n), and its derivative with respect to x_n."""
    W = whiteners(mixture.covariances[:, inputs[:, None], inputs], "the input covariance of component")
    white = np.einsum("kij,nkj->nki", W, centred)
    log_determinants = np.log(np.diagonal(W, axis1=1, axis2=2)).sum(axis=1)
    with np.errstate(divide="ignore"):
        log_joint = np.log(mixture.weights) + log_determinants - 0.5 * (white**2).sum(axis=2)
    log_joint = log_joint - 0.5 * len(inputs) * LOG_2_PI
    shares = np.exp(log_joint - np.logaddexp.reduce(log_joint, axis=1)[:, None])
    scores = -np.einsum("kji,nkj->nki", W, white)  # d log N_k / dx, (N, K, I)
    average = np.einsum("nk,nki->ni", shares, scores)
    return shares, shares[:, :, None] * (scores - average[:, None, :])
