"""The coordinates of a skill: marginal, flat quaternions on S^3, refused layouts."""

from dataclasses import replace

import assisted_task as task
import numpy as np
import pytest

import pilotfish as pf
from pilotfish import assistance
from pilotfish.assistance.coordinates import coordinate_frames, coordinate_skill
from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout, position_layout
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import log_map, normalise


def test_flat_covariance_becomes_that_of_rotation_vectors(rng):
    skill = task.learn("flat")
    k, p = 2, 1
    q, S = skill.means[p, k, 3:7], skill.covariances[p].dense[k][3:7, 3:7]
    scale = 1e-3  # small deviations, for which the map is linear
    samples = q + scale * rng.multivariate_normal(np.zeros(4), S, size=200_000)
    deviations = log_map(normalise(q), normalise(samples), (0,)) / scale
    covariance = coordinate_skill(skill).covariances[p].dense[k][3:6, 3:6]
    assert np.allclose(np.cov(deviations.T), covariance, rtol=0.03, atol=0.01 * np.trace(covariance))


def test_derivatives_are_marginalised_out():
    with_rates, plain = coordinate_skill(task.learn("derivatives")), task.learn("derivatives")
    assert with_rates.layout.names[:3] == plain.layout.names[:3]
    assert with_rates.width == 8
    assert np.array_equal(with_rates.means[:, :, :3], plain.means[:, :, :3])
    assert np.allclose(with_rates.covariances[0].dense[:, :3, :3], plain.covariances[0].dense[:, :3, :3])


@pytest.mark.parametrize(
    "layout",
    [
        position_layout(2),
        Layout((Part("joints", Quantity.SCALAR, 7, "rad"),)),
        Layout((*position_layout(3).parts, Part("force", Quantity.VECTOR, 3, "N"))),
        Layout((Part("grip", Quantity.SCALAR, 1, "1"), *position_layout(3).parts)),
        Layout((*pose_layout().parts, Part("second", Quantity.QUATERNION, 4, "1"))),
    ],
    ids=lambda layout: layout.parts[-1].name,
)
def test_layout_of_no_pose_is_refused(layout):
    x = np.tile(np.linspace(0.1, 1.0, 30)[:, None], layout.width)
    for columns in layout.quaternions:
        x[:, columns] = [1.0, 0.0, 0.0, 0.0]
    skill = pf.learn([pf.demonstration(x, 0.1, layout)], states=2, rng=np.random.default_rng(0)).skill
    with pytest.raises(InvalidInput, match="expected a position of three axes"):
        assistance.assisted_skill(skill)


def with_covariance(change) -> pf.Skill:
    skill = task.learn("sphere")
    first = skill.covariances[0].dense.copy()
    change(first)
    return replace(skill, covariances=(DenseCovariances(first), *skill.covariances[1:]))


def test_covariance_that_is_not_finite_is_refused():
    def change(covariances):
        covariances[1, 0, 0] = np.nan

    with pytest.raises(InvalidInput, match="not finite"):
        assistance.assisted_skill(with_covariance(change))


def test_singular_covariance_is_refused_with_its_frame_and_state():
    def change(covariances):
        covariances[3] = 0.0

    with pytest.raises(NotPositiveDefinite, match="frame 'cube': the covariance of state 3"):
        assistance.assisted_skill(with_covariance(change))


def test_quaternion_of_norm_zero_is_refused():
    skill = task.learn("flat")
    means = skill.means.copy()
    means[1, 2, 3:7] = 0.0
    with pytest.raises(InvalidInput, match="state 2, frame 'tray', has norm 0"):
        assistance.assisted_skill(replace(skill, means=means))


def test_frames_of_all_columns_or_of_coordinates_are_the_same():
    skill = task.learn("derivatives")
    demo = pf.add_derivatives(task.demonstrations()[0])
    full = coordinate_frames(list(demo.frames), skill.layout)
    own = coordinate_frames(list(task.demonstrations()[0].frames), skill.layout)
    assert all(np.array_equal(p.A, q.A) and np.array_equal(p.b, q.b) for p, q in zip(full, own, strict=True))


def test_frame_of_another_width_is_refused():
    with pytest.raises(InvalidInput, match="expected 8 columns"):
        coordinate_frames([pf.Frame("cube", np.eye(3), np.zeros(3))], task.learn().layout)
