"""Tangent spaces of R^n x S^3 against the sphere's embedding in R^4 and against finite differences."""

import numpy as np
import pytest

from pilotfish.geometry import (
    angle,
    exp_map,
    exp_map_jacobian,
    from_rotation_vector,
    inverse_right_jacobian,
    inverse_right_jacobian_derivative,
    karcher_mean,
    log_map,
    log_map_jacobian,
    multiply,
    normalise,
    parallel_transport,
    relative_rotation_vector,
    right_jacobian,
    tangent_slices,
)

LAYOUTS = [(4, (0,)), (7, (3,)), (10, (0, 6)), (3, ()), (8, (0, 4))]
LENGTHS = [0.0, 1e-300, 1e-9, 1e-4, 0.29999, 0.30001, 1.0, 3.0, np.pi - 1e-9]


def points(rng, width, orientation_starts, *batch):
    x = rng.normal(size=(*batch, width))
    for start in orientation_starts:
        x[..., start : start + 4] = normalise(x[..., start : start + 4])
    return x


def of_length(rng, length):
    v = rng.normal(size=3)
    return length * v / np.linalg.norm(v)


@pytest.mark.parametrize(("width", "orientation_starts"), LAYOUTS)
def test_tangent_slices_any_width_cover_each_column_once(width, orientation_starts):
    pieces = list(tangent_slices(width, orientation_starts))
    assert [i for columns, _, _ in pieces for i in range(columns.start, columns.stop)] == list(range(width))
    tangents = [i for _, columns, _ in pieces for i in range(columns.start, columns.stop)]
    assert tangents == list(range(width - len(orientation_starts)))
    starts = [columns.start for columns, _, is_orientation in pieces if is_orientation]
    assert starts == sorted(orientation_starts)


@pytest.mark.parametrize(("width", "orientation_starts"), LAYOUTS)
def test_exp_map_of_log_map_returns_point_up_to_sign(rng, width, orientation_starts):
    """One base or many; on each orientation the result is x or -x."""
    base, x = points(rng, width, orientation_starts, 5), points(rng, width, orientation_starts, 5)
    for b in (base, base[0]):
        result = exp_map(b, log_map(b, x, orientation_starts), orientation_starts)
        for columns, _, is_orientation in tangent_slices(width, orientation_starts):
            products = np.sum(result[:, columns] * x[:, columns], axis=1, keepdims=True)
            signs = np.sign(products) if is_orientation else 1.0
            np.testing.assert_allclose(result[:, columns], signs * x[:, columns], atol=1e-14)


@pytest.mark.parametrize("length", LENGTHS)
def test_log_map_of_exp_map_returns_tangent_vector(rng, length):
    """From tiny rotations to almost pi; the angle equals the length of the vector."""
    base, v = points(rng, 7, (3,)), np.concatenate([rng.normal(size=3), of_length(rng, length)])
    x = exp_map(base, v, (3,))
    np.testing.assert_allclose(log_map(base, x, (3,)), v, atol=1e-14)
    np.testing.assert_allclose(angle(base[3:], x[3:]), length, atol=1e-14)
    np.testing.assert_array_equal(log_map(base, np.append(x[:3], -x[3:]), (3,)), log_map(base, x, (3,)))


def test_log_map_rotated_world_is_unchanged(rng):
    world, base, x = points(rng, 4, (0,)), points(rng, 4, (0,), 6), points(rng, 4, (0,), 6)
    turned = log_map(multiply(world, base), multiply(world, x), (0,))
    np.testing.assert_allclose(turned, log_map(base, x, (0,)), atol=1e-13)


@pytest.mark.parametrize("length", LENGTHS)
def test_parallel_transport_equals_formula_on_sphere_in_r4(rng, length):
    """W + (u.w) ((cos s - 1) u - sin s p), along the great circle from p with unit direction u through s."""
    p, d, w = points(rng, 4, (0,)), of_length(rng, length), rng.normal(size=3)

    def embedded(point, body):
        return multiply(point, np.array([0.0, *(0.5 * body)]))

    u = embedded(p, 2.0 * d / length if length else np.zeros(3))
    s, w4 = 0.5 * length, embedded(p, w)
    expected = w4 + (u @ w4) * ((np.cos(s) - 1.0) * u - np.sin(s) * p)
    np.testing.assert_allclose(
        embedded(exp_map(p, d, (0,)), parallel_transport(d, (0,)) @ w), expected, atol=1e-14
    )


@pytest.mark.parametrize("length", [*LENGTHS[:-1], 3.1, 5.0])
def test_exp_map_jacobian_equals_finite_differences(rng, length):
    """Central differences of exp_map(base, v + h), in the tangent space at exp_map(base, v)."""
    base, v = points(rng, 7, (3,)), np.concatenate([rng.normal(size=3), of_length(rng, length)])
    x, step = exp_map(base, v, (3,)), 1e-5

    def moved(h):
        return log_map(x, exp_map(base, v + h, (3,)), (3,))

    numeric = np.stack([(moved(step * e) - moved(-step * e)) / (2 * step) for e in np.eye(6)], axis=1)
    np.testing.assert_allclose(exp_map_jacobian(v, (3,)), numeric, atol=1e-9)
    np.testing.assert_allclose(exp_map_jacobian(v, (3,)) @ v, v, atol=1e-13)
    identity = log_map_jacobian(v, (3,)) @ exp_map_jacobian(v, (3,))
    np.testing.assert_allclose(identity, np.eye(6), atol=1e-12)


@pytest.mark.parametrize("length", [1e-9, 1e-4, 0.29, 0.31, 1.0, 3.0, 5.0])
def test_inverse_right_jacobian_derivative_equals_finite_differences(rng, length):
    v, w, step = of_length(rng, length), rng.normal(size=3), 1e-5
    numeric = np.stack(
        [
            (inverse_right_jacobian(v + step * e) - inverse_right_jacobian(v - step * e)) @ w / (2 * step)
            for e in np.eye(3)
        ],
        axis=1,
    )
    np.testing.assert_allclose(inverse_right_jacobian_derivative(v, w), numeric, atol=2e-9)


@pytest.mark.parametrize("of", [right_jacobian, inverse_right_jacobian])
def test_series_at_its_maximum_angle_equals_quotient(rng, of):
    v = of_length(rng, 1.0)
    np.testing.assert_allclose(of((0.3 - 1e-12) * v), of((0.3 + 1e-12) * v), atol=1e-11)


def test_right_jacobian_times_vector_rate_is_angular_velocity(rng):
    """Along any curve v(t), exp(v(t) / 2) rotates at J dv/dt in body axes."""
    a, b, h = rng.normal(size=3), rng.normal(size=3), 1e-6
    before, after = (from_rotation_vector(a + t * b) for t in (-h, h))
    np.testing.assert_allclose(
        relative_rotation_vector(before, after) / (2 * h), right_jacobian(a) @ b, atol=1e-8
    )


@pytest.mark.parametrize(("width", "orientation_starts"), LAYOUTS)
def test_karcher_mean_weighted_tangent_vectors_sum_to_zero(rng, width, orientation_starts):
    """Independent of the signs of quaternions; off the orientations it is the ordinary mean."""
    spread = 0.4 * rng.normal(size=(40, width - len(orientation_starts)))
    x, weights = (
        exp_map(points(rng, width, orientation_starts), spread, orientation_starts),
        rng.uniform(size=40),
    )
    mean = karcher_mean(x, weights, orientation_starts)
    np.testing.assert_allclose(weights @ log_map(mean, x, orientation_starts), 0.0, atol=1e-10)
    for start in orientation_starts:
        x[:, start : start + 4] *= rng.choice([-1.0, 1.0], size=(40, 1))
    np.testing.assert_allclose(karcher_mean(x, weights, orientation_starts), mean, atol=1e-11)


def test_karcher_mean_of_one_point_is_that_point(rng):
    x = points(rng, 7, (3,), 1)
    x[:, 3:] *= np.sign(x[:, 3:4])
    np.testing.assert_allclose(karcher_mean(x, np.array([0.3]), (3,)), x[0], atol=1e-14)


def test_karcher_mean_zero_weights_has_unit_quaternion(rng):
    """A state without datapoints has a mean with quaternions of unit length."""
    mean = karcher_mean(points(rng, 7, (3,), 4), np.zeros(4), (3,))
    np.testing.assert_allclose(np.linalg.norm(mean[3:]), 1.0)
