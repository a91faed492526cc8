"""Laws of the covariance that comes with the least-squares solution."""

import numpy as np
import pytest

from pilotfish.control import Reference, solve_batch, track


@pytest.mark.parametrize("varying", [False, True])
@pytest.mark.parametrize(("n", "m", "T"), [(1, 1, 2), (2, 1, 5), (3, 2, 6), (2, 3, 4)])
def test_covariances_are_the_inverse_hessian_of_half_the_cost(random_problem, n, m, T, varying):
    """The Hessian is found by second differences of the cost, which are exact, the states by simulation."""
    p = random_problem(n, m, T, varying=varying)
    shape, U = (T - 1, m), (T - 1) * m
    pushes = np.eye(U).reshape(U, *shape)
    zero, alone = p.cost(np.zeros(shape)), np.array([p.cost(push) for push in pushes])
    pairs = np.array([[p.cost(a + b) for a in pushes] for b in pushes])
    hessian = 0.5 * (pairs - alone[:, None] - alone[None, :] + zero)
    reach = np.array([p.simulate(push) - p.simulate(np.zeros(shape)) for push in pushes])  # (U, T, n)
    expected = np.einsum("uti,uv,vtj->tij", reach, np.linalg.inv(hessian), reach)
    found = solve_batch(p.system, p.reference, p.control_cost, p.start).covariances
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(expected).max())
    np.testing.assert_array_equal(found[0], 0)


def test_covariances_are_those_of_motions_tracked_to_noisy_targets(random_problem):
    """Targets drawn with precision weights, and inputs wished for with precision effort, spread them so."""
    p, draws = random_problem(2, 1, 5), 500
    rng = np.random.default_rng(11)
    weights = p.reference.weights + np.eye(2)  # a free step has no precision to draw with
    precise = Reference(p.reference.targets, weights)
    root = np.linalg.inv(np.linalg.cholesky(weights))  # root^T root is the covariance of a target
    motions = []
    for _ in range(draws):
        wished = rng.normal(size=(4, 1)) / np.sqrt(p.control_cost)
        led = p.simulate(wished) - p.simulate(np.zeros((4, 1)))
        noisy = p.reference.targets + np.einsum("tji,tj->ti", root, rng.normal(size=(5, 2)))
        tracked = track(p.system, Reference(noisy - led, weights), p.control_cost).rollout(p.start)
        motions.append(
            led + tracked.x
        )  # inputs are the wished ones and a correction, which alone has a price
    solution = solve_batch(p.system, precise, p.control_cost, p.start)
    error = np.array(motions) - solution.motion.x
    deviations = np.sqrt(np.einsum("tii->ti", solution.covariances))
    scale = deviations[:, :, None] * deviations[:, None, :]
    sampled = np.einsum("sti,stj->tij", error, error) / draws
    assert np.all(np.abs(error.mean(axis=0)) <= 5 * deviations / np.sqrt(draws) + 1e-12)
    assert np.all(np.abs(sampled - solution.covariances) <= 5 * np.sqrt(2 / draws) * scale + 1e-12)


def test_a_dearer_effort_and_dearer_targets_narrow_the_spread(random_problem):
    """Every price is a precision: raising any of them leaves less freedom, in every direction."""
    p = random_problem(3, 2, 8)
    wide = solve_batch(p.system, p.reference, p.control_cost, p.start).covariances
    dearer = Reference(p.reference.targets, p.reference.weights + np.eye(3))
    for narrow in (
        solve_batch(p.system, p.reference, 2 * p.control_cost, p.start).covariances,
        solve_batch(p.system, dearer, p.control_cost, p.start).covariances,
    ):
        assert np.linalg.eigvalsh(wide - narrow).min() > -1e-9 * np.abs(wide).max()
        assert np.trace(narrow[-1]) < np.trace(wide[-1])
