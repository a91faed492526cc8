"""Sufficient statistics: merging is exact, whatever the cut and the origin."""

import numpy as np
import pytest

from pilotfish.gaussians import Moments


def same(a, b, scale):
    for name in ("counts", "means", "scatter_matrices"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-7, atol=scale)


@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_add_moments_of_halves_equals_moments_of_whole(rng, offset):
    x, responsibilities = offset + rng.normal(size=(40, 3)), rng.dirichlet(np.ones(4), size=40)
    whole = Moments.from_data(x, responsibilities)
    for cut in (0, 1, int(rng.integers(2, 39)), 40):
        same(
            Moments.from_data(x[:cut], responsibilities[:cut])
            + Moments.from_data(x[cut:], responsibilities[cut:]),
            whole,
            1e-6,
        )


def test_add_any_order_is_equal(rng):
    parts = [
        Moments.from_data(rng.normal(size=(n, 2)), rng.dirichlet(np.ones(3), size=n)) for n in (1, 5, 30)
    ]
    same(parts[0] + parts[1] + parts[2], parts[2] + (parts[0] + parts[1]), 1e-12)


def test_moments_empty_component_is_finite_and_adds_nothing():
    nothing = Moments(np.zeros(1), np.full((1, 2), 9.0), np.zeros((1, 2, 2)))
    something = Moments.from_data(np.array([[1.0, 2.0], [3.0, 4.0]]), np.ones((2, 1)))
    same(nothing + something, something, 0.0)
    same(something + nothing, something, 0.0)


def test_moments_from_sums_any_origin_equals_moments(rng):
    x, responsibilities = rng.normal(size=(30, 3)), rng.dirichlet(np.ones(2), size=30)
    origins = rng.normal(size=(2, 3))
    error = x[:, None, :] - origins
    offsets = np.einsum("nk,nkd->kd", responsibilities, error)
    scatter_matrices = np.einsum("nk,nki,nkj->kij", responsibilities, error, error)
    same(
        Moments.from_sums(origins, responsibilities.sum(axis=0), offsets, scatter_matrices),
        Moments.from_data(x, responsibilities),
        1e-12,
    )
