"""Of orientations on S^3, pictures show the spread of the columns that they have for axes."""

from dataclasses import replace

import numpy as np

from pilotfish import plots
from pilotfish.control import Motion
from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import from_rotation_vector, multiply, normalise
from pilotfish.models import AdaptedSkill
from pilotfish.planning import observe_via_points, via_point
from pilotfish.plots.coordinates import panel_rows
from pilotfish.plots.spreads import ambient_covariances
from pilotfish.plots.style import column_colour, column_dash

SPHERE_LAYOUT = Layout(
    (
        Part("orientation", Quantity.ORIENTATION, 4, "1"),
        Part("position", Quantity.POSITION, 3, "m"),
    )
)


def random_covariances(rng: np.random.Generator, states: int, width: int) -> np.ndarray:
    roots = rng.normal(size=(states, width, 2 * width))
    return roots @ roots.transpose(0, 2, 1) / width


def test_the_spread_of_columns_is_that_of_many_samples(rng: np.random.Generator):
    """Poses deviating by rotation vectors in body axes have the covariance told, to first order."""
    mean = np.concatenate([normalise(rng.normal(size=4)), rng.normal(size=3)])
    covariance = 1e-4 * random_covariances(rng, 1, 6)
    deviations = rng.multivariate_normal(np.zeros(6), covariance[0], size=200_000)
    turned = multiply(mean[:4], from_rotation_vector(deviations[:, :3]))
    samples = np.hstack([turned, mean[4:] + deviations[:, 3:]])
    told = ambient_covariances(mean[None], covariance, SPHERE_LAYOUT)[0]
    np.testing.assert_allclose(told, np.cov(samples.T), atol=0.02 * np.abs(told).max())
    np.testing.assert_allclose(told[:4, :4] @ mean[:4], 0.0, atol=1e-18)


def test_without_orientations_on_the_sphere_nothing_changes(rng: np.random.Generator):
    """Covariances of a flat skill are those of its columns."""
    covariances = random_covariances(rng, 3, 7)
    assert ambient_covariances(rng.normal(size=(3, 7)), covariances, pose_layout()) is covariances


def test_positions_have_the_same_ellipses_on_the_sphere(rng: np.random.Generator, make_skill_of_size):
    """Where an orientation stands before the position, pictures still find the position's covariance."""
    flat = make_skill_of_size(2, ("world",), Layout((Part("position", Quantity.POSITION, 3, "m"),)))
    wide = random_covariances(rng, 2, 6)
    wide[:, 3:, 3:] = flat.covariances[0].dense
    q = normalise(rng.normal(size=(2, 4)))
    means = np.concatenate([q, flat.means[0]], axis=1)
    curved = replace(flat, means=means[None], covariances=(DenseCovariances(wide),), layout=SPHERE_LAYOUT)
    shown = []
    for skill in (flat, curved):
        model = AdaptedSkill(
            skill.dynamics, skill.means[0], skill.covariances[0].dense, skill.layout, skill.period
        )
        width = skill.layout.width
        motion = Motion(np.tile(skill.means[0, :1], (5, 1)), np.zeros((4, width)), skill.period)
        figure = plots.reproduction(model, motion, [])
        shown.append([patch.get_xy() for patch in figure.axes[0].patches])
    assert len(shown[0]) == 2
    np.testing.assert_allclose(shown[1], shown[0], rtol=1e-12)


def test_deviations_on_the_sphere_are_those_of_rotation_vectors(rng: np.random.Generator, make_skill_of_size):
    """Three lines [rad] for an orientation, the roots of the variances in body axes."""
    plain = make_skill_of_size(2, ("world",), Layout((Part("position", Quantity.POSITION, 3, "m"),)))
    wide = random_covariances(rng, 2, 6)
    means = np.concatenate([normalise(rng.normal(size=(1, 2, 4))), plain.means], axis=2)
    curved = replace(plain, means=means, covariances=(DenseCovariances(wide),), layout=SPHERE_LAYOUT)
    turns, places = plots.state_deviations(curved).axes
    for panel, first in ((turns, 0), (places, 3)):
        for i, line in enumerate(panel.get_lines()):
            np.testing.assert_allclose(line.get_ydata(), np.sqrt(wide[:, first + i, first + i]))
    assert (turns.get_ylabel(), places.get_ylabel()) == ("deviation [rad]", "deviation [m]")
    assert len(turns.get_lines()) == 3


def test_a_whole_orientation_to_pass_takes_the_sign_of_the_motion(rng: np.random.Generator):
    """On S^3 as among four numbers: the wish is drawn on the motion's side, and half as wide as its angle."""
    q = normalise(rng.normal(size=4))
    x = np.tile(np.concatenate([q, np.zeros(3)]), (5, 1))
    for sign in (1.0, -1.0):
        (seen,) = observe_via_points(
            [via_point("orientation", sign * q, time=0.2, deviation=0.1)], SPHERE_LAYOUT, x, 0.1
        )
        np.testing.assert_allclose(seen.values, q)
        np.testing.assert_allclose(seen.deviations, 0.05)


def test_points_to_pass_are_diamonds_in_the_planes_that_they_name(rng: np.random.Generator, inputs):
    """A whole position stands in every panel, one of its columns in none."""
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


def test_parts_of_one_column_share_rows(rng: np.random.Generator):
    """Joints stand four abreast; the columns of a larger part keep a row of their own."""
    joints = [Part(f"joint {n}", Quantity.SCALAR, 1, "rad") for n in range(5)]
    layout = Layout(
        (*joints, Part("position", Quantity.POSITION, 3, "m"), Part("grip", Quantity.SCALAR, 1, "m"))
    )
    assert panel_rows(layout, list(range(9))) == [[0, 1, 2, 3], [4], [5, 6, 7], [8]]
    assert panel_rows(layout, [1, 6, 8]) == [[1], [6], [8]]


def test_columns_of_one_colour_have_different_dashes():
    """Twenty joints in one panel are told apart by colour and dashes."""
    looks = {(column_colour(f"joint {n}", n), str(column_dash(f"joint {n}", n))) for n in range(20)}
    assert len(looks) == 20
