"""Scaling of columns for online learning changes units only."""

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.demonstrations import (
    add_derivatives,
    demonstration,
    frame_from_pose,
    moving_frame_from_poses,
    pose_layout,
    position_layout,
    views,
)
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import Pose, normalise


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(rng.normal(size=3), normalise(rng.normal(size=4)))


def random_demonstrations(rng: np.random.Generator, *, moving: bool) -> list[pf.Demonstration]:
    """Return six short pose movements with velocities, in the frame of an object at random poses."""
    layout, made = pose_layout(), []
    for m in range(6):
        steps = np.linspace(0.0, 1.0, 20)[:, None]
        a, b = random_pose(rng), random_pose(rng)
        b = b if a.quaternion @ b.quaternion > 0.0 else Pose(b.position, -b.quaternion)
        x = np.hstack([(1 - steps) * a.position + steps * b.position,
                       normalise((1 - steps) * a.quaternion + steps * b.quaternion)])  # fmt: skip
        if moving:
            frame = moving_frame_from_poses("thing", layout, [random_pose(rng)] * 20)
        else:
            frame = frame_from_pose("thing", layout, random_pose(rng))
        made.append(add_derivatives(demonstration(x, 0.1, layout, [frame], f"{m}")))
    return made


@pytest.mark.parametrize("moving", [False, True])
def test_scale_demonstration_views_equal_scaled_views(rng, moving):
    """Views of the scaled demonstration are the scaled views, up to the signs of quaternions."""
    demos = random_demonstrations(rng, moving=moving)
    skill = pf.learn(demos, states=2, rng=rng).skill
    scales = pf.online.column_scales(skill)
    expected = views(demos).x
    actual = views([pf.online.scale_demonstration(d, scales, skill) for d in demos]).x * scales
    np.testing.assert_allclose(np.abs(actual), np.abs(expected), atol=1e-9)
    flat = [c for c in range(14) if c not in (3, 4, 5, 6, 10, 11, 12, 13)]
    np.testing.assert_allclose(actual[..., flat], expected[..., flat], atol=1e-9)


def test_scale_demonstration_negated_quaternions_give_same_views(rng):
    """Recordings that differ in the sign of quaternions give the same numbers."""
    layout, turn, level = pose_layout(), normalise(rng.normal(size=4)), np.array([1.0, 0.0, 0.0, 0.0])
    flip = np.array([1.0] * 3 + [-1.0] * 4)  # of the quaternion
    made = []
    for m in range(6):
        x = np.hstack([rng.normal(size=(20, 3)), normalise(turn + 0.2 * rng.normal(size=(20, 4)))])
        thing = frame_from_pose("thing", layout, Pose(rng.normal(size=3), level))
        made.append([add_derivatives(demonstration(y, 0.1, layout, [thing], f"{m}")) for y in (x, flip * x)])
    straight = [pair[0] for pair in made]
    mixed = [pair[m % 2] for m, pair in enumerate(made)]
    skill = pf.learn(straight, states=2, rng=rng).skill
    scales = pf.online.column_scales(skill)
    one, other = (
        views([pf.online.scale_demonstration(d, scales, skill) for d in some]).x for some in (straight, mixed)
    )
    np.testing.assert_allclose(one, other, atol=1e-9)


def test_column_scales_equal_deviation_of_each_part(rng):
    """Each part has the root of its mean variance over columns, states and frames."""
    demos = random_demonstrations(rng, moving=False)
    skill = pf.learn(demos, states=3, rng=rng).skill
    scales = pf.online.column_scales(skill)
    (covariances,) = skill.covariances
    for columns in skill.layout.slices:
        inside = [covariances.dense[k, c, c] for k in range(3) for c in range(columns.start, columns.stop)]
        np.testing.assert_allclose(scales[columns], np.sqrt(np.mean(inside)))


def test_unscale_skill_equals_skill_of_original(rng):
    """Without regularisation, which has a unit, means and covariances are equal."""
    demos = [
        add_derivatives(demonstration(d.x[:, :3], 0.1, position_layout()))
        for d in random_demonstrations(rng, moving=False)
    ]
    reference = pf.learn(demos, states=2, rng=rng).skill
    scales = pf.online.column_scales(reference)
    settings = pf.models.EMSettings(regularisation=0.0, max_iterations=5)
    plain, again = (
        pf.learn(some, states=2, rng=np.random.default_rng(0), settings=settings).skill
        for some in (demos, [pf.online.scale_demonstration(d, scales, reference) for d in demos])
    )
    back = pf.online.unscale_skill(again, scales, plain.layout)
    assert back.layout == plain.layout
    np.testing.assert_allclose(back.means, plain.means, atol=1e-7)
    for ours, theirs in zip(back.covariances, plain.covariances, strict=True):
        assert isinstance(ours, DenseCovariances)
        np.testing.assert_allclose(ours.dense, theirs.dense, atol=1e-7)


def test_scaling_incompatible_layout_is_refused(rng):
    """The number of columns and their quantities must fit."""
    demos = random_demonstrations(rng, moving=False)
    skill = pf.learn(demos, states=2, rng=rng).skill
    scales = pf.online.column_scales(skill)
    with pytest.raises(InvalidInput, match="as the reference has"):
        pf.online.scale_demonstration(pf.online.scale_demonstration(demos[0], scales, skill), scales, skill)
    with pytest.raises(InvalidInput, match=r"scales has shape \(3,\)"):
        pf.online.scale_demonstration(demos[0], np.ones(3), skill)
    with pytest.raises(InvalidInput, match="expected the scaled columns"):
        pf.online.unscale_skill(skill, scales, skill.layout)
    layout = pose_layout()
    things = [frame_from_pose("thing", layout, random_pose(rng)) for _ in demos]
    poses = [demonstration(d.x[:, :7], 0.1, layout, [f]) for d, f in zip(demos, things, strict=True)]
    spherical = [add_derivatives(pf.demonstrations.to_sphere(d)) for d in poses]
    with pytest.raises(InvalidInput, match="orientations on S"):
        pf.online.column_scales(pf.learn(spherical, states=2, rng=rng).skill)
