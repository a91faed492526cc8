"""Riccati recursion against one large least-squares problem, and against the reference."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from pilotfish.errors import NotPositiveDefinite
from pilotfish.kernels import reference


def tracking(rng, T, n, m, varying):
    S = T - 1 if varying else 1
    A = np.eye(n) + 0.1 * rng.normal(size=(S, n, n))
    roots = rng.normal(size=(T, n, n))
    weights = roots @ roots.swapaxes(1, 2) + 0.01 * np.eye(n)
    control_cost = 0.1 * np.eye(m) + 0.02 * np.ones((m, m))
    return A, rng.normal(size=(S, n, m)), weights, rng.normal(size=(T, n)), control_cost


def rollout(problem, solution, start):
    """Return states, controls and cost under the feedback."""
    A, B, weights, targets, control_cost = problem
    gains, feedforwards, *_ = solution
    x, u, T = [start], [], len(targets)
    for t in range(T - 1):
        u.append(feedforwards[t] - gains[t] @ (x[t] - targets[t]))
        now = t if len(A) > 1 else 0
        x.append(A[now] @ x[t] + B[now] @ u[t])
    error = np.stack(x) - targets
    cost = np.einsum("ti,tij,tj", error, weights, error) + sum(ut @ control_cost @ ut for ut in u)
    return np.stack(x), np.stack(u), cost


@pytest.mark.parametrize("varying", [False, True])
def test_riccati_equals_least_squares(kernels, rng, varying):
    """Controls of the rollout solve the stacked normal equations."""
    T, n, m = 9, 4, 2
    problem = tracking(rng, T, n, m, varying)
    A, B, weights, targets, control_cost = problem
    A, B = np.broadcast_to(A, (T - 1, n, n)), np.broadcast_to(B, (T - 1, n, m))
    start = rng.normal(size=n)
    drift, push = [np.eye(n)], [np.zeros((n, (T - 1) * m))]
    for t in range(T - 1):
        drift.append(A[t] @ drift[t])
        push.append(A[t] @ push[t])
        push[t + 1][:, t * m : (t + 1) * m] = B[t]
    Sx, Su, Q = np.vstack(drift), np.vstack(push), block_diag(*weights)
    R = block_diag(*[control_cost] * (T - 1))
    expected = np.linalg.solve(Su.T @ Q @ Su + R, Su.T @ Q @ (targets.ravel() - Sx @ start))
    _, u, _ = rollout(problem, kernels.riccati(*problem), start)
    np.testing.assert_allclose(u.ravel(), expected, rtol=1e-9, atol=1e-9)


def test_riccati_values_and_gradients_give_cost_to_go(kernels, rng):
    """The difference in cost between two starts is e^T P e + 2 d^T e, e = start - target."""
    problem = tracking(rng, 12, 3, 2, varying=True)
    solution = kernels.riccati(*problem)
    targets, values, gradients = problem[3], *solution[2:]

    def predicted(start):
        e = start - targets[0]
        return e @ values[0] @ e + 2 * gradients[0] @ e

    start, other_start = rng.normal(size=(2, 3))
    difference = rollout(problem, solution, start)[2] - rollout(problem, solution, other_start)[2]
    np.testing.assert_allclose(difference, predicted(start) - predicted(other_start), rtol=1e-9)


@pytest.mark.parametrize(("T", "n", "m"), [(1, 3, 2), (2, 1, 1), (50, 2, 3), (200, 14, 7), (30, 15, 1)])
@pytest.mark.parametrize("varying", [False, True])
def test_riccati_compiled_equals_reference(compiled, rng, T, n, m, varying):
    """Any shape, with one system for all steps or one for each."""
    problem = tracking(rng, T, n, m, varying and T > 1)
    result, reference_result = compiled.riccati(*problem), reference.riccati(*problem)
    for found, expected in zip(result, reference_result, strict=True):
        scale = np.abs(expected).max(initial=0.0)
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-10 * scale)
    np.testing.assert_array_equal(result[2], result[2].swapaxes(1, 2))


def test_riccati_singular_control_hessian_raises_with_step(kernels, rng):
    A, B, weights, targets, control_cost = tracking(rng, 5, 3, 2, varying=False)
    weights[3] = -100.0 * np.eye(3)
    with pytest.raises(NotPositiveDefinite, match=r"at step 2, .*make control_cost positive definite"):
        kernels.riccati(A, B, weights, targets, control_cost)
    with pytest.raises(NotPositiveDefinite, match="at step 3"):
        kernels.riccati(A, B, np.zeros_like(weights), targets, -control_cost)
