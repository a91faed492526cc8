"""Scales, ranges and switching columns of demonstrations."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Layout,
    Part,
    Quantity,
    demonstration,
    pose_layout,
    position_layout,
)
from pilotfish.geometry import from_rotation_vector, multiply
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import default_regularisation, demonstration_statistics, part_scales

MOVING = position_layout(2).differentiate()
GRIPPER = Layout((Part("gripper", Quantity.SCALAR, 1, "1"),))


def scales_of(x, layout, duration=2.0):
    return part_scales(x, np.ones(len(x)), layout, duration)


def test_part_scales_equal_root_mean_squares_by_hand(rng):
    """Coordinates deviate from their mean, derivatives from zero; both columns of a part have one scale."""
    x = rng.normal(size=(40, 4)) + np.array([3.0, -2.0, 1.0, 0.5])
    deviations = x[:, :2] - x[:, :2].mean(axis=0)
    spread = np.sqrt((deviations**2).sum(axis=1).mean())
    rate = np.sqrt((x[:, 2:] ** 2).sum(axis=1).mean())
    np.testing.assert_allclose(scales_of(x, MOVING), [spread, spread, rate, rate], rtol=1e-12)


def test_part_scales_weights_equal_repeated_rows(rng):
    x, counts = rng.normal(size=(6, 4)), np.array([1, 3, 2, 1, 5, 2])
    found = part_scales(x, counts.astype(float), MOVING, 2.0)
    np.testing.assert_allclose(found, scales_of(np.repeat(x, counts, axis=0), MOVING), rtol=1e-12)


def test_part_scales_rotation_and_translation_keep_them(rng):
    x, angle = rng.normal(size=(30, 4)), rng.uniform(0.0, np.pi)
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = np.hstack([x[:, :2] @ R.T + rng.normal(size=2), x[:, 2:] @ R.T])
    np.testing.assert_allclose(scales_of(turned, MOVING), scales_of(x, MOVING), rtol=1e-12)


@pytest.mark.parametrize("unit", [1e-3, 39.37, 1e3])
def test_part_scales_are_in_the_unit_of_their_part(rng, unit):
    x = rng.normal(size=(30, 4))
    np.testing.assert_allclose(scales_of(unit * x, MOVING), unit * scales_of(x, MOVING), rtol=1e-12)


def test_part_scales_orientation_is_angle_from_mean(rng):
    """Half of the rows are turned by +0.3 rad about one axis and half by -0.3, with random signs."""
    layout = Layout((Part("orientation", Quantity.ORIENTATION, 4, "1"),))
    base = from_rotation_vector(rng.normal(size=3))
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    turns = from_rotation_vector(np.repeat([0.3, -0.3], 10)[:, None] * axis)
    x = multiply(base, turns) * rng.choice([-1.0, 1.0], size=(20, 1))
    np.testing.assert_allclose(scales_of(x, layout), np.full(3, 0.3), rtol=1e-9)


def test_part_scales_constant_part_is_magnitude_and_rate_is_magnitude_over_duration():
    x = np.tile([0.3, -0.5, 0.0, 0.0], (20, 1))
    np.testing.assert_allclose(scales_of(x, MOVING, duration=4.0), [0.5, 0.5, 0.125, 0.125], rtol=1e-12)
    np.testing.assert_array_equal(scales_of(np.zeros((20, 4)), MOVING, duration=4.0), [1.0, 1.0, 0.25, 0.25])


def test_part_scales_rounding_of_constant_part_has_no_effect(rng):
    x = np.tile([0.3, -0.5, 0.0, 0.0], (20, 1))
    noisy = x + 1e-14 * rng.normal(size=x.shape)
    np.testing.assert_allclose(scales_of(noisy, MOVING), scales_of(x, MOVING), rtol=1e-9)


def test_default_regularisation_is_square_of_fractions_of_scales():
    scales = np.array([2.0, 2.0, 5.0, 5.0])
    np.testing.assert_allclose(default_regularisation(scales, MOVING), [1e-4, 1e-4, 1.0, 1.0], rtol=1e-12)


def test_default_regularisation_sphere_has_tangent_columns():
    """A rotation vector has three numbers."""
    parts = pose_layout().parts
    layout = Layout((parts[0], Part("orientation", Quantity.ORIENTATION, 4, "1"))).differentiate()
    assert default_regularisation(np.ones(12), layout).tolist() == pytest.approx([2.5e-5] * 6 + [0.04] * 6)


def test_demonstration_statistics_signs_of_quaternions_have_no_effect():
    """A recording with -q is equivalent, and its derivatives too."""
    demos = synthetic_valve(np.random.default_rng(0))[:3]
    turned = np.repeat([1.0, -1.0, 1.0, -1.0], [3, 4, 3, 4])
    expected = demonstration_statistics(demos)
    found = demonstration_statistics([demos[0], replace(demos[1], x=demos[1].x * turned), demos[2]])
    np.testing.assert_allclose(found.scales, expected.scales, rtol=1e-12)
    np.testing.assert_allclose(found.lowest, expected.lowest, rtol=1e-12)


def gripper_demonstration(values):
    return demonstration(np.array(values, dtype=float)[:, None], 0.1, GRIPPER, (), "grasp")


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-1.0, 1.0), (0.0, 100.0), (0.01, 0.08)])
def test_demonstration_statistics_two_values_switch(low, high):
    demos = [gripper_demonstration([low] * 30 + [high] * 20), gripper_demonstration([high] * 5 + [low] * 9)]
    statistics = demonstration_statistics(demos)
    assert statistics.switches == ("gripper",)
    assert (statistics.lowest.tolist(), statistics.highest.tolist()) == ([low], [high])


@pytest.mark.parametrize(
    "values",
    [
        np.linspace(0.0, 1.0, 50),
        [0.0] * 40 + [0.5] * 3 + [1.0] * 40,
        [0.4] * 50,
        [0.0] * 50,
        [0.3 + 1e-13 * (-1) ** n for n in range(50)],
    ],
    ids=["ramp", "three between", "constant", "zero", "rounding"],
)
def test_demonstration_statistics_other_values_do_not_switch(values):
    assert demonstration_statistics([gripper_demonstration(values)]).switches == ()


def test_demonstration_statistics_rare_value_between_switches():
    """One of a hundred rows is in between, as of a gripper that closes within one period."""
    values = [0.0] * 60 + [0.5] + [1.0] * 39
    assert demonstration_statistics([gripper_demonstration(values)]).switches == ("gripper",)


def test_demonstration_statistics_positions_never_switch():
    layout = position_layout(1)
    demo = demonstration(np.repeat([[0.0], [1.0]], 20, axis=0), 0.1, layout, (), "jump")
    assert demonstration_statistics([demo]).switches == ()
