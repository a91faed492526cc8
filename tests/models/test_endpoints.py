"""Start and end of the demonstrations in every frame, and in a new situation."""

from dataclasses import replace

import numpy as np
from reaches import make_reaches

from pilotfish.demonstrations import (
    Layout,
    Part,
    Quantity,
    demonstration,
    frame,
    frame_from_pose,
    pose_layout,
    views,
)
from pilotfish.gaussians import Gaussian, affine_transform, product
from pilotfish.geometry import Pose, angle, from_rotation_vector, multiply
from pilotfish.models import TimeBins, adapt, learn
from pilotfish.models.endpoints import fit_endpoints

PLACE = Layout((Part("place", Quantity.POSITION, 2, "m"),))


def two_demonstrations():
    """Return two recordings of three rows, seen from the world and from an object that turns."""
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    frames = [
        (frame("world", np.eye(2), np.zeros(2)), frame("object", np.eye(2), np.array([1.0, 2.0]))),
        (frame("world", np.eye(2), np.zeros(2)), frame("object", quarter, np.array([0.0, -1.0]))),
    ]
    x = [np.array([[0.0, 1.0], [9.0, 9.0], [4.0, 4.0]]), np.array([[2.0, 3.0], [7.0, 7.0], [6.0, 8.0]])]
    pairs = zip(x, frames, strict=True)
    return [demonstration(rows, 0.1, PLACE, seen, f"number {n}") for n, (rows, seen) in enumerate(pairs)]


def test_fit_endpoints_two_demonstrations_in_two_frames_equal_values_by_hand():
    """From the object, rows (x, y) of the second recording are (y + 1, -x)."""
    endpoints = fit_endpoints(views(two_demonstrations()), np.array([0.25, 0.5]))
    np.testing.assert_allclose(endpoints.means[0], [[1.0, 2.0], [5.0, 6.0]], atol=1e-12)
    np.testing.assert_allclose(endpoints.variances[0], [[1.25, 1.5], [1.25, 4.5]], atol=1e-12)
    # starts (-1, -1) and (4, -2), ends (3, 2) and (9, -6)
    np.testing.assert_allclose(endpoints.means[1], [[1.5, -1.5], [6.0, -2.0]], atol=1e-12)
    np.testing.assert_allclose(endpoints.variances[1], [[6.5, 0.75], [9.25, 16.5]], atol=1e-12)


def test_adapt_endpoints_equal_products_of_frame_gaussians(rng):
    demos = make_reaches(0)
    skill, frames = learn(demos, states=4, rng=rng).skill, demos[2].frames
    ends = adapt(skill, frames).endpoints
    for n in range(2):
        pairs = zip(skill.endpoints.means[:, n], skill.endpoints.variances[:, n], frames, strict=True)
        expected = product([affine_transform(Gaussian(m, np.diag(v)), f.A, f.b) for m, v, f in pairs])
        np.testing.assert_allclose(ends.means[n], expected.mean, atol=1e-9)
        np.testing.assert_allclose(ends.covariances[n], expected.covariance, rtol=1e-9, atol=1e-12)


def test_adapt_relevance_of_end_is_that_of_last_state(rng):
    """A frame without relevance in the last state has no part in the end, and the other way round."""
    demos = make_reaches(0)
    skill = learn(demos, states=4, rng=rng, initialisation=TimeBins()).skill
    frames, relevance = demos[2].frames, np.ones((2, 4))
    relevance[1, 0] = relevance[0, 3] = 0.0
    found = adapt(skill, frames, relevance=relevance).endpoints
    np.testing.assert_allclose(found.means[0], skill.endpoints.means[0, 0], atol=1e-9)
    np.testing.assert_allclose(found.means[1], skill.endpoints.means[1, 1] + frames[1].b, atol=1e-9)


def pose_reaches(sphere: bool):
    """Return poses that end 10 cm above an object, turned by a fixed rotation from it."""
    rng = np.random.default_rng(1)
    layout = pose_layout()
    if sphere:
        layout = Layout((layout.parts[0], replace(layout.parts[1], quantity=Quantity.ORIENTATION)))
    grasp = from_rotation_vector(np.array([0.4, 0.0, 0.2]))
    demos, goals = [], []
    for n in range(4):
        place, turn = rng.normal(size=3), from_rotation_vector(0.3 * rng.normal(size=3))
        progress = np.linspace(0.0, 1.0, 40)[:, None]
        start = 0.02 * rng.normal(size=3)
        goal = place + np.array([0.0, 0.0, 0.1])
        half = from_rotation_vector(np.zeros(3))
        q = half + progress * (multiply(turn, grasp) - half)
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        x = np.hstack([start + progress * (goal - start), q])
        frames = (
            frame_from_pose("world", layout, Pose(np.zeros(3), half)),
            frame_from_pose("object", layout, Pose(place, turn)),
        )
        demos.append(demonstration(x, 0.1, layout, frames, f"pose {n}"))
        goals.append((goal, multiply(turn, grasp)))
    return demos, goals


def test_adapt_endpoints_of_orientations_on_sphere_and_in_space_agree(rng):
    """In every situation, the end has the demonstrated orientation from the object; q has norm one."""
    for sphere in (False, True):
        demos, goals = pose_reaches(sphere)
        skill = learn(demos, states=4, rng=rng).skill
        assert skill.endpoints.means.shape == (2, 2, 7)
        assert skill.endpoints.variances.shape == (2, 2, 6 if sphere else 7)
        for demo, (_, q) in zip(demos, goals, strict=True):
            end = adapt(skill, demo.frames).endpoints.means[1]
            assert angle(end[3:], q) < 0.02
            assert np.linalg.norm(end[3:]) - 1.0 < 1e-9
