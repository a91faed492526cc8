"""Regression with Gaussians on R^n x S^3 x ...: some columns given the others, orientations whole."""

from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import split_columns
from pilotfish.gaussians.regression import Conditionals, conditionals, require_inputs
from pilotfish.geometry import differential, exp_at, inverse_differential, log_at
from pilotfish.types import Array, Float, Int

STEPS, ARRIVED = 100, 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class RiemannianRegression:
    """What is expected of the other columns at each of N inputs: points, and deviations from them.

    covariances[n] are of deviations from means[n]; jacobians[n] is the exact derivative of means[n], as a
    deviation from it, with respect to the n-th input, as a deviation from that. Deviations of orientations
    are rotation vectors [rad] in body axes; turns says where quaternions begin in means.
    """

    means: Float[Array, "N O"]
    covariances: Float[Array, "N Q Q"]
    jacobians: Float[Array, "N Q J"]
    turns: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class RiemannianConditionals:
    """What each of K Gaussians says of the other columns, given input columns.

    Component k expects exp_at(means[k], slopes[k] log_at(centres[k], x)): flat holds slopes, whiteners and
    conditional covariances of deviations. input_turns and output_turns say where quaternions begin in each.
    """

    flat: Conditionals
    centres: Float[Array, "K I"]
    means: Float[Array, "K O"]
    input_turns: tuple[int, ...]
    output_turns: tuple[int, ...]


def riemannian_conditionals(
    means: Float[Array, "K D"],
    covariances: Float[Array, "K E E"],
    inputs: Int[Array, " I"],
    turns: tuple[int, ...],
) -> RiemannianConditionals:
    """Each Gaussian, read as a map from the input columns to the others, which keep their order.

    Raises: InvalidInput, when inputs are no columns, leave none to predict or tear a quaternion apart;
    NotPositiveDefinite, when a component is singular in the inputs.
    """
    inputs, outputs = split_columns(inputs, means.shape[1])
    tangents, input_turns = _deviations_of(inputs, turns)
    _, output_turns = _deviations_of(outputs, turns)
    flat = conditionals(np.zeros(covariances.shape[:2]), covariances, tangents)
    return RiemannianConditionals(flat, means[:, inputs], means[:, outputs], input_turns, output_turns)


def _deviations_of(
    columns: Int[Array, " I"], turns: tuple[int, ...]
) -> tuple[Int[Array, " J"], tuple[int, ...]]:
    """The columns of deviations that belong to columns of points, and where quaternions begin among these."""
    inside = {start + n: start for start in turns for n in range(4)}
    found: list[int] = []
    begins: list[int] = []
    place = 0
    while place < len(columns):
        column = int(columns[place])
        start, before = inside.get(column), sum(turn < column for turn in turns)
        if start is None:
            found.append(column - before)
            place += 1
        elif columns[place : place + 4].tolist() == list(range(start, start + 4)):
            found += range(start - before, start - before + 3)
            begins.append(place)
            place += 4
        else:
            raise InvalidInput(
                f"columns {columns.tolist()} hold a part of the orientation in columns {start} to "
                f"{start + 3}, expected all four in their order, or none"
            )
    return np.array(found, dtype=np.int64), tuple(begins)


def riemannian_log_input_densities(
    given: RiemannianConditionals, x: Float[Array, "N _"]
) -> Float[Array, "N K"]:
    """log density of the inputs alone in each component.

    Raises: InvalidInput, when x is not finite or of another width than the inputs.
    """
    require_inputs(np.arange(given.centres.shape[1]), x)
    emissions = kernels.Emissions(given.centres[None], given.flat.whiteners[None], given.input_turns)
    return kernels.log_emissions(np.ascontiguousarray(x)[None], emissions)


def riemannian_regress_shared(
    given: RiemannianConditionals, x: Float[Array, "N _"], shares: Float[Array, "N K"]
) -> RiemannianRegression:
    """Regression in which component k speaks for shares[n, k] = p(k | x_n and whatever else is known).

    Every component predicts in the tangent space at its mean; means are the Karcher means of what they say.
    Covariances are brought there by differentials, the spread between components included. The derivative is
    exact when what else is known does not depend on x_n. Cost in memory: N K Q (Q + J).
    Source: Zeestraten et al. 2017, IEEE RA-L 2(3), section III, with differentials where they transport
    covariances; the derivative is ours, by the implicit function theorem.
    """
    flat, turns = given.flat, given.output_turns
    v = log_at(given.centres[None], x[:, None, :], given.input_turns)  # (N, K, J)
    u = np.einsum("kqj,nkj->nkq", flat.slopes, v)
    guesses = exp_at(given.means[None], u, turns)  # (N, K, O)
    means = _karcher_means(guesses, shares, turns)
    w = log_at(means[:, None, :], guesses, turns)
    back = inverse_differential(w, turns) @ differential(u, turns)  # from a component's space to the mean's
    within = np.einsum("nk,nkqr->nqr", shares, back @ flat.covariances @ back.swapaxes(-1, -2))
    between = np.einsum("nk,nkq,nkr->nqr", shares, w, w)
    inward = inverse_differential(v, given.input_turns)
    W = flat.whiteners
    scores = -np.einsum("kij,kil,nkl,nkjm->nkm", W, W, v, inward, optimize=True)  # d log N_k / dx
    scores = scores - np.einsum("nk,nkj->nj", shares, scores)[:, None, :]
    pull = np.einsum("nk,nkq,nkj->nqj", shares, w, scores)
    pull += np.einsum("nk,nkqj->nqj", shares, back @ flat.slopes @ inward)
    give = np.einsum("nk,nkqr->nqr", shares, inverse_differential(-w, turns))  # -dw / d mean
    return RiemannianRegression(means, within + between, np.linalg.solve(give, pull), turns)


def _karcher_means(
    points: Float[Array, "N K O"], shares: Float[Array, "N K"], turns: tuple[int, ...]
) -> Float[Array, "N O"]:
    """For every n the point at which its K tangent vectors, weighed by shares, cancel; near the heaviest."""
    means = points[np.arange(len(points)), shares.argmax(axis=1)]
    for _ in range(STEPS):
        step = np.einsum("nk,nkq->nq", shares, log_at(means[:, None, :], points, turns))
        means = exp_at(means, step, turns)
        if np.abs(step).max(initial=0.0) < ARRIVED:
            break
    return np.asarray(means)
