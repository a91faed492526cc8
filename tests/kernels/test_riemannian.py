"""Products of Gaussians with orientations: both implementations against each other and against R^n."""

import numpy as np
import pytest
from kernel_arguments import riemannian_product

from pilotfish.gaussians import Gaussian, product
from pilotfish.kernels import Emissions, reference
from pilotfish.kernels.reference.manifold import deviations, displaced, displacement_jacobian

pytestmark = pytest.mark.usefixtures("unchecked")


def test_compiled_product_equals_reference(compiled, rng):
    for _ in range(60):
        arguments = riemannian_product(rng)
        one, other = (kernels.riemannian_product(*arguments) for kernels in (compiled, reference))
        np.testing.assert_allclose(one.means, other.means, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(one.covariances, other.covariances, rtol=1e-6, atol=1e-9)


def test_product_without_orientations_is_that_of_gaussians(kernels, rng):
    P, K, D = 3, 4, 5
    means, roots = rng.normal(size=(P, K, D)), rng.normal(size=(P, K, D, D))
    covariances = roots @ roots.swapaxes(-1, -2) + 0.1 * np.eye(D)
    W = np.linalg.inv(np.linalg.cholesky(covariances))
    found = kernels.riemannian_product(Emissions(means, W), covariances)
    for k in range(K):
        expected = product([Gaussian(means[p, k], covariances[p, k]) for p in range(P)])
        np.testing.assert_allclose(found.means[k], expected.mean, atol=1e-9)
        np.testing.assert_allclose(found.covariances[k], expected.covariance, atol=1e-9)


def test_mode_of_the_product_has_the_largest_density(kernels, rng):
    """No point nearby has a smaller sum of squared Mahalanobis distances."""
    for _ in range(10):
        emissions, covariances = riemannian_product(rng)
        starts, E = emissions.orientation_starts, covariances.shape[-1]
        found = kernels.riemannian_product(emissions, covariances)

        def cost(k, x, given=emissions):
            v = -deviations(given.means[:, k], x, given.orientation_starts)
            return np.sum(np.einsum("pij,pj->pi", given.precision_cholesky[:, k], v) ** 2)

        for k, mean in enumerate(found.means):
            lowest = cost(k, mean)
            for _ in range(20):
                step = 1e-3 * rng.normal(size=E)
                assert cost(k, displaced(mean, step, starts)) >= lowest - 1e-12 * (1.0 + lowest)


@pytest.mark.parametrize("length", [0.0, 1e-9, 1e-3, 0.0099, 0.0101, 1.0, 3.0])
def test_displacement_jacobian_is_the_derivative(rng, length):
    starts, base = (1,), np.concatenate([[0.3], rng.normal(size=4)])
    base[1:] /= np.linalg.norm(base[1:])
    v = rng.normal(size=4)
    v[1:] *= length / np.linalg.norm(v[1:])
    J, x, h = displacement_jacobian(v, starts), displaced(base, v, starts), 1e-6
    columns = [
        deviations(displaced(base, v + h * e, starts)[None], x, starts)[0]
        - deviations(displaced(base, v - h * e, starts)[None], x, starts)[0]
        for e in np.eye(4)
    ]
    np.testing.assert_allclose(J, np.array(columns).T / (2.0 * h), atol=1e-8)
