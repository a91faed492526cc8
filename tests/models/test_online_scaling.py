"""Scaling the columns for a stream changes units and nothing else."""

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
    """Six short pose movements with their speeds, seen from an object that stands elsewhere each time."""
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
def test_what_a_frame_sees_is_scaled_like_the_world(rng, moving):
    """A scaled showing seen from its scaled frames is the showing seen from its frames, divided by scales,
    whatever the signs in which poses tell their quaternions.
    """
    shown = random_demonstrations(rng, moving=moving)
    scales = pf.online.estimate_scales(pf.learn(shown, states=2, rng=rng).skill)
    seen = views(shown).x
    again = views([pf.online.scale_demonstration(d, scales) for d in shown]).x * scales.values
    np.testing.assert_allclose(np.abs(again), np.abs(seen), atol=1e-9)
    flat = [c for c in range(14) if c not in (3, 4, 5, 6, 10, 11, 12, 13)]
    np.testing.assert_allclose(again[..., flat], seen[..., flat], atol=1e-9)


def test_signs_follow_the_states_of_the_skill(rng):
    """Movements whose orientations stay within half a turn of each other are seen with one sign, whichever
    they were recorded with: the same numbers as without the flips.
    """
    layout, turn, level = pose_layout(), normalise(rng.normal(size=4)), np.array([1.0, 0.0, 0.0, 0.0])
    flip = np.array([1.0] * 3 + [-1.0] * 4)  # of the quaternion
    made = []
    for m in range(6):
        x = np.hstack([rng.normal(size=(20, 3)), normalise(turn + 0.2 * rng.normal(size=(20, 4)))])
        thing = frame_from_pose("thing", layout, Pose(rng.normal(size=3), level))
        made.append([add_derivatives(demonstration(y, 0.1, layout, [thing], f"{m}")) for y in (x, flip * x)])
    straight = [pair[0] for pair in made]
    mixed = [pair[m % 2] for m, pair in enumerate(made)]
    scales = pf.online.estimate_scales(pf.learn(straight, states=2, rng=rng).skill)
    one, other = (
        views([pf.online.scale_demonstration(d, scales) for d in some]).x for some in (straight, mixed)
    )
    np.testing.assert_allclose(one, other, atol=1e-9)


def test_scales_are_the_deviations_within_states_part_by_part(rng):
    """Each part has the root of its mean variance, over columns, states and frames, in all its columns."""
    shown = random_demonstrations(rng, moving=False)
    skill = pf.learn(shown, states=3, rng=rng).skill
    scales = pf.online.estimate_scales(skill)
    (covariances,) = skill.covariances
    for columns in skill.layout.slices:
        inside = [covariances.dense[k, c, c] for k in range(3) for c in range(columns.start, columns.stop)]
        np.testing.assert_allclose(scales.values[columns], np.sqrt(np.mean(inside)))


def test_a_scaled_skill_comes_back(rng):
    """Learned of scaled showings and unscaled, a skill of places is the one that was learned of the showings
    themselves: the same means and covariances, where regularisation, which has a unit, is nothing.
    """
    shown = [
        add_derivatives(demonstration(d.x[:, :3], 0.1, position_layout()))
        for d in random_demonstrations(rng, moving=False)
    ]
    scales = pf.online.estimate_scales(pf.learn(shown, states=2, rng=rng).skill)
    settings = pf.models.EMSettings(regularisation=0.0, max_iterations=5)
    plain, again = (
        pf.learn(some, states=2, rng=np.random.default_rng(0), settings=settings).skill
        for some in (shown, [pf.online.scale_demonstration(d, scales) for d in shown])
    )
    back = pf.online.unscale_skill(again, scales)
    assert back.layout == plain.layout
    np.testing.assert_allclose(back.means, plain.means, atol=1e-7)
    for ours, theirs in zip(back.covariances, plain.covariances, strict=True):
        assert isinstance(ours, DenseCovariances)
        np.testing.assert_allclose(ours.dense, theirs.dense, atol=1e-7)


def test_other_columns_are_refused(rng):
    """Scales belong to a layout; a skill that was not scaled cannot be unscaled; S^3 has no scale."""
    shown = random_demonstrations(rng, moving=False)
    skill = pf.learn(shown, states=2, rng=rng).skill
    scales = pf.online.estimate_scales(skill)
    with pytest.raises(InvalidInput, match="the scales are of"):
        pf.online.scale_demonstration(pf.online.scale_demonstration(shown[0], scales), scales)
    with pytest.raises(InvalidInput, match="were scaled by these scales"):
        pf.online.unscale_skill(skill, scales)
    layout = pose_layout()
    things = [frame_from_pose("thing", layout, random_pose(rng)) for _ in shown]
    poses = [demonstration(d.x[:, :7], 0.1, layout, [f]) for d, f in zip(shown, things, strict=True)]
    curved = [add_derivatives(pf.to_sphere(d)) for d in poses]
    with pytest.raises(InvalidInput, match="orientations on S"):
        pf.online.estimate_scales(pf.learn(curved, states=2, rng=rng).skill)
