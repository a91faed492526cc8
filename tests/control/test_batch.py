"""Covariances of the least-squares solution."""

import numpy as np
import pytest

from pilotfish.control import Reference, solve_batch, track


@pytest.mark.parametrize("varying", [False, True])
@pytest.mark.parametrize(("n", "m", "T"), [(1, 1, 2), (2, 1, 5), (3, 2, 6), (2, 3, 4)])
def test_solve_batch_covariances_equal_inverse_hessian_of_half_cost(random_problem, n, m, T, varying):
    """The Hessian comes from second differences of the cost, which are exact; the states from simulation."""
    p = random_problem(n, m, T, varying=varying)
    shape, U = (T - 1, m), (T - 1) * m
    inputs = np.eye(U).reshape(U, *shape)
    zero, single = p.cost(np.zeros(shape)), np.array([p.cost(u) for u in inputs])
    pairs = np.array([[p.cost(a + b) for a in inputs] for b in inputs])
    hessian = 0.5 * (pairs - single[:, None] - single[None, :] + zero)
    responses = np.array([p.simulate(u) - p.simulate(np.zeros(shape)) for u in inputs])  # (U, T, n)
    expected = np.einsum("uti,uv,vtj->tij", responses, np.linalg.inv(hessian), responses)
    _, found = solve_batch(p.system, p.reference, p.control_cost, p.start)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(expected).max())
    np.testing.assert_array_equal(found[0], 0)


def test_solve_batch_covariances_equal_those_of_sampled_motions(random_problem):
    """Targets drawn with precision weights and inputs with precision R give this sample covariance."""
    p, draws = random_problem(2, 1, 5), 500
    rng = np.random.default_rng(11)
    weights = p.reference.weights + np.eye(2)  # a free step has no precision to draw with
    precise = Reference(p.reference.targets, weights)
    root = np.linalg.inv(np.linalg.cholesky(weights))  # root^T root is the covariance of a target
    motions = []
    for _ in range(draws):
        prior = rng.normal(size=(4, 1)) / np.sqrt(p.control_cost)
        response = p.simulate(prior) - p.simulate(np.zeros((4, 1)))
        noisy = p.reference.targets + np.einsum("tji,tj->ti", root, rng.normal(size=(5, 2)))
        tracked = track(p.system, Reference(noisy - response, weights), p.control_cost).rollout(p.start)
        motions.append(
            response + tracked.x
        )  # the inputs are the prior ones plus a correction, which alone has a cost
    mean, covariances = solve_batch(p.system, precise, p.control_cost, p.start)
    error = np.array(motions) - mean.x
    deviations = np.sqrt(np.einsum("tii->ti", covariances))
    scale = deviations[:, :, None] * deviations[:, None, :]
    sampled = np.einsum("sti,stj->tij", error, error) / draws
    assert np.all(np.abs(error.mean(axis=0)) <= 5 * deviations / np.sqrt(draws) + 1e-12)
    assert np.all(np.abs(sampled - covariances) <= 5 * np.sqrt(2 / draws) * scale + 1e-12)


def test_solve_batch_larger_costs_reduce_covariances(random_problem):
    """Every cost is a precision: a larger one reduces the covariance in every direction."""
    p = random_problem(3, 2, 8)
    _, wide = solve_batch(p.system, p.reference, p.control_cost, p.start)
    heavier = Reference(p.reference.targets, p.reference.weights + np.eye(3))
    for _, narrow in (
        solve_batch(p.system, p.reference, 2 * p.control_cost, p.start),
        solve_batch(p.system, heavier, p.control_cost, p.start),
    ):
        assert np.linalg.eigvalsh(wide - narrow).min() > -1e-9 * np.abs(wide).max()
        assert np.trace(narrow[-1]) < np.trace(wide[-1])
