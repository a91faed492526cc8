"""Covariances of orientations on S^3 in plots, via-point markers, and rows of panels."""

from dataclasses import replace

import numpy as np

from pilotfish import plots
from pilotfish.control import Motion
from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import from_rotation_vector, multiply, normalise
from pilotfish.models import AdaptedSkill
from pilotfish.planning import observe_via_points, via_point
from pilotfish.plots.ambient_covariances import ambient_covariances
from pilotfish.plots.style import column_colour, column_dash
from pilotfish.plots.tracked_coordinates import panel_rows

SPHERE_LAYOUT = Layout(
    (
        Part("orientation", Quantity.ORIENTATION, 4, "1"),
        Part("position", Quantity.POSITION, 3, "m"),
    )
)


def random_covariances(rng: np.random.Generator, states: int, width: int) -> np.ndarray:
    roots = rng.normal(size=(states, width, 2 * width))
    return roots @ roots.transpose(0, 2, 1) / width


def test_ambient_covariances_equal_sample_covariance(rng: np.random.Generator):
    """Poses with sampled deviations have the returned covariance, to first order."""
    mean = np.concatenate([normalise(rng.normal(size=4)), rng.normal(size=3)])
    covariance = 1e-4 * random_covariances(rng, 1, 6)
    deviations = rng.multivariate_normal(np.zeros(6), covariance[0], size=200_000)
    rotated = multiply(mean[:4], from_rotation_vector(deviations[:, :3]))
    samples = np.hstack([rotated, mean[4:] + deviations[:, 3:]])
    expected = ambient_covariances(mean[None], covariance, SPHERE_LAYOUT)[0]
    np.testing.assert_allclose(np.cov(samples.T), expected, atol=0.02 * np.abs(expected).max())
    np.testing.assert_allclose(expected[:4, :4] @ mean[:4], 0.0, atol=1e-18)


def test_ambient_covariances_vector_space_is_identity(rng: np.random.Generator):
    """Covariances in R^n are returned unchanged."""
    covariances = random_covariances(rng, 3, 7)
    assert ambient_covariances(rng.normal(size=(3, 7)), covariances, pose_layout()) is covariances


def test_reproduction_orientation_before_position_keeps_ellipses(
    rng: np.random.Generator, make_skill_of_size
):
    """An orientation before the position does not change the ellipses of the position."""
    position_skill = make_skill_of_size(2, ("world",), Layout((Part("position", Quantity.POSITION, 3, "m"),)))
    wide = random_covariances(rng, 2, 6)
    wide[:, 3:, 3:] = position_skill.covariances[0].dense
    q = normalise(rng.normal(size=(2, 4)))
    means = np.concatenate([q, position_skill.means[0]], axis=1)
    sphere_skill = replace(
        position_skill, means=means[None], covariances=(DenseCovariances(wide),), layout=SPHERE_LAYOUT
    )
    contours = []
    for skill in (position_skill, sphere_skill):
        model = AdaptedSkill(
            skill.dynamics, skill.means[0], skill.covariances[0].dense, skill.layout, skill.period
        )
        width = skill.layout.width
        motion = Motion(np.tile(skill.means[0, :1], (5, 1)), np.zeros((4, width)), skill.period)
        figure = plots.reproduction(model, motion, [])
        contours.append([patch.get_xy() for patch in figure.axes[0].patches])
    assert len(contours[0]) == 2
    np.testing.assert_allclose(contours[1], contours[0], rtol=1e-12)


def test_state_deviations_sphere_equal_rotation_vector_deviations(
    rng: np.random.Generator, make_skill_of_size
):
    """An orientation has three lines [rad], the roots of its variances in body axes."""
    plain = make_skill_of_size(2, ("world",), Layout((Part("position", Quantity.POSITION, 3, "m"),)))
    wide = random_covariances(rng, 2, 6)
    means = np.concatenate([normalise(rng.normal(size=(1, 2, 4))), plain.means], axis=2)
    sphere_skill = replace(plain, means=means, covariances=(DenseCovariances(wide),), layout=SPHERE_LAYOUT)
    rotations, positions = plots.state_deviations(sphere_skill).axes
    for panel, first in ((rotations, 0), (positions, 3)):
        for i, line in enumerate(panel.get_lines()):
            np.testing.assert_allclose(line.get_ydata(), np.sqrt(wide[:, first + i, first + i]))
    assert (rotations.get_ylabel(), positions.get_ylabel()) == ("deviation [rad]", "deviation [m]")
    assert len(rotations.get_lines()) == 3


def test_observe_via_points_orientation_has_sign_of_motion(rng: np.random.Generator):
    """The value has the sign of the motion, and the deviation is half the angle."""
    q = normalise(rng.normal(size=4))
    x = np.tile(np.concatenate([q, np.zeros(3)]), (5, 1))
    for sign in (1.0, -1.0):
        (observation,) = observe_via_points(
            [via_point("orientation", sign * q, time=0.2, deviation=0.1)], SPHERE_LAYOUT, x, 0.1
        )
        np.testing.assert_allclose(observation.values, q)
        np.testing.assert_allclose(observation.deviations, 0.05)


def test_reproduction_via_points_are_diamonds_in_complete_panels(rng: np.random.Generator, inputs):
    """A via-point of a position is in every panel, one of a single column in none."""
    points = [
        via_point("position", np.array([0.1, 0.2, 0.3]), time=1.0, deviation=0.1),
        via_point("position z", 0.4, time=1.5, deviation=0.1),
    ]
    figure = plots.reproduction(inputs.adapted, inputs.motion, inputs.frames, points=points)
    found = [[line for line in panel.get_lines() if line.get_marker() == "D"] for panel in figure.axes]
    assert list(map(len, found)) == [1, 1, 1]
    np.testing.assert_allclose(found[0][0].get_xydata(), [[0.1, 0.2]])
    np.testing.assert_allclose(found[1][0].get_xydata(), [[0.1, 0.3]])
    np.testing.assert_allclose(np.ravel(found[2][0].get_data_3d()), [0.1, 0.2, 0.3])


def test_panel_rows_single_columns_share_rows(rng: np.random.Generator):
    """Parts of one column share rows of four; a larger part has a row of its own."""
    joints = [Part(f"joint {n}", Quantity.SCALAR, 1, "rad") for n in range(5)]
    layout = Layout(
        (*joints, Part("position", Quantity.POSITION, 3, "m"), Part("grip", Quantity.SCALAR, 1, "m"))
    )
    assert panel_rows(layout, list(range(9))) == [[0, 1, 2, 3], [4], [5, 6, 7], [8]]
    assert panel_rows(layout, [1, 6, 8]) == [[1], [6], [8]]


def test_column_colour_and_dash_are_unique():
    """Twenty joints in one panel differ by colour and dashes."""
    styles = {(column_colour(f"joint {n}", n), str(column_dash(f"joint {n}", n))) for n in range(20)}
    assert len(styles) == 20
