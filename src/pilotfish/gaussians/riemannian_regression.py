"""Regression with Gaussians on R^n x S^3 x ...: some columns given the others, orientations whole."""

from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.gaussian import split_columns
from pilotfish.gaussians.regression import ConditionalGaussians, conditional_gaussians, validate_inputs
from pilotfish.geometry import exp_map, exp_map_jacobian, log_map, log_map_jacobian
from pilotfish.types import Array, Float, Int

MAX_ITERATIONS, TOLERANCE = 100, 1e-12


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
    orientation_starts: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class RiemannianConditionalGaussians:
    """What each of K Gaussians says of the other columns, given input columns.

    Component k expects exp_at(means[k], slopes[k] log_at(centres[k], x)): flat holds slopes, whiteners and
    conditional covariances of deviations. input_turns and output_turns say where quaternions begin in each.
    """

    tangent: ConditionalGaussians
    input_means: Float[Array, "K I"]
    means: Float[Array, "K O"]
    input_orientation_starts: tuple[int, ...]
    output_orientation_starts: tuple[int, ...]


def riemannian_conditional_gaussians(
    means: Float[Array, "K D"],
    covariances: Float[Array, "K E E"],
    inputs: Int[Array, " I"],
    orientation_starts: tuple[int, ...],
) -> RiemannianConditionalGaussians:
    """Each Gaussian, read as a map from the input columns to the others, which keep their order.

    Raises: InvalidInput, when inputs are no columns, leave none to predict or tear a quaternion apart;
    NotPositiveDefinite, when a component is singular in the inputs.
    """
    inputs, outputs = split_columns(inputs, means.shape[1])
    tangent_inputs, input_orientation_starts = _tangent_columns(inputs, orientation_starts)
    _, output_orientation_starts = _tangent_columns(outputs, orientation_starts)
    tangent = conditional_gaussians(np.zeros(covariances.shape[:2]), covariances, tangent_inputs)
    return RiemannianConditionalGaussians(
        tangent, means[:, inputs], means[:, outputs], input_orientation_starts, output_orientation_starts
    )


def _tangent_columns(
    columns: Int[Array, " I"], orientation_starts: tuple[int, ...]
) -> tuple[Int[Array, " J"], tuple[int, ...]]:
    """The columns of deviations that belong to columns of points, and where quaternions begin among these."""
    inside = {start + n: start for start in orientation_starts for n in range(4)}
    found: list[int] = []
    orientation_places: list[int] = []
    place = 0
    while place < len(columns):
        column = int(columns[place])
        start, before = inside.get(column), sum(turn < column for turn in orientation_starts)
        if start is None:
            found.append(column - before)
            place += 1
        elif columns[place : place + 4].tolist() == list(range(start, start + 4)):
            found += range(start - before, start - before + 3)
            orientation_places.append(place)
            place += 4
        else:
            raise InvalidInput(
                f"columns {columns.tolist()} hold a part of the orientation in columns {start} to "
                f"{start + 3}, expected all four in their order, or none"
            )
    return np.array(found, dtype=np.int64), tuple(orientation_places)


def riemannian_log_input_densities(
    conditionals: RiemannianConditionalGaussians, x: Float[Array, "N _"]
) -> Float[Array, "N K"]:
    """Log density of the inputs alone in each component.

    Raises: InvalidInput, when x is not finite or of another width than the inputs.
    """
    validate_inputs(np.arange(conditionals.input_means.shape[1]), x)
    emissions = kernels.Emissions(
        conditionals.input_means[None],
        conditionals.tangent.precision_cholesky[None],
        conditionals.input_orientation_starts,
    )
    return kernels.log_emissions(np.ascontiguousarray(x)[None], emissions)


def riemannian_regress_with_responsibilities(
    conditionals: RiemannianConditionalGaussians,
    x: Float[Array, "N _"],
    responsibilities: Float[Array, "N K"],
) -> RiemannianRegression:
    """Regression in which component k speaks for shares[n, k] = p(k | x_n and whatever else is known).

    Every component predicts in the tangent space at its mean; means are the Karcher means of what they say.
    Covariances are brought there by differentials, the spread between components included. The derivative is
    exact when what else is known does not depend on x_n. Cost in memory: N K Q (Q + J).
    Source: Zeestraten et al. 2017, IEEE RA-L 2(3), section III, with differentials where they transport
    covariances; the derivative is ours, by the implicit function theorem.
    """
    tangent, orientation_starts = conditionals.tangent, conditionals.output_orientation_starts
    v = log_map(
        conditionals.input_means[None], x[:, None, :], conditionals.input_orientation_starts
    )  # (N, K, J)
    u = np.einsum("kqj,nkj->nkq", tangent.slopes, v)
    predictions = exp_map(conditionals.means[None], u, orientation_starts)  # (N, K, O)
    means = _karcher_means(predictions, responsibilities, orientation_starts)
    w = log_map(means[:, None, :], predictions, orientation_starts)
    to_mean = log_map_jacobian(w, orientation_starts) @ exp_map_jacobian(
        u, orientation_starts
    )  # from a component's space to the mean's
    within = np.einsum(
        "nk,nkqr->nqr", responsibilities, to_mean @ tangent.covariances @ to_mean.swapaxes(-1, -2)
    )
    between = np.einsum("nk,nkq,nkr->nqr", responsibilities, w, w)
    input_jacobian = log_map_jacobian(v, conditionals.input_orientation_starts)
    W = tangent.precision_cholesky
    scores = -np.einsum("kij,kil,nkl,nkjm->nkm", W, W, v, input_jacobian, optimize=True)  # d log N_k / dx
    scores = scores - np.einsum("nk,nkj->nj", responsibilities, scores)[:, None, :]
    input_sensitivity = np.einsum("nk,nkq,nkj->nqj", responsibilities, w, scores)
    input_sensitivity += np.einsum(
        "nk,nkqj->nqj", responsibilities, to_mean @ tangent.slopes @ input_jacobian
    )
    mean_sensitivity = np.einsum(
        "nk,nkqr->nqr", responsibilities, log_map_jacobian(-w, orientation_starts)
    )  # -dw / d mean
    return RiemannianRegression(
        means, within + between, np.linalg.solve(mean_sensitivity, input_sensitivity), orientation_starts
    )


def _karcher_means(
    points: Float[Array, "N K O"], responsibilities: Float[Array, "N K"], orientation_starts: tuple[int, ...]
) -> Float[Array, "N O"]:
    """For every n the point at which its K tangent vectors, weighed by shares, cancel; near the heaviest."""
    means = points[np.arange(len(points)), responsibilities.argmax(axis=1)]
    for _ in range(MAX_ITERATIONS):
        step = np.einsum(
            "nk,nkq->nq", responsibilities, log_map(means[:, None, :], points, orientation_starts)
        )
        means = exp_map(means, step, orientation_starts)
        if np.abs(step).max(initial=0.0) < TOLERANCE:
            break
    return np.asarray(means)
