"""Relevance of frames, estimated from held-out demonstrations."""

from dataclasses import replace

import numpy as np
import pytest
from published import published_options

import pilotfish as pf
from pilotfish.demonstrations import Frame, MovingFrame, frame_from_pose
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Gaussian, affine_transform, log_density, product
from pilotfish.geometry import normalise, pose
from pilotfish.models import adapt, learn, relevance, select_frames
from pilotfish.models.opinion_pools import (
    FrameOpinions,
    fit_pool_weights,
    held_out_log_probs,
    log_prob_gradient,
)

P, E, M = 3, 2, 4


@pytest.fixture
def pooled_segments(rng):
    """Return random Gaussians of three frames for four held-out segments."""
    held, maps = [], []
    for _ in range(M):
        factors = np.tril(rng.normal(size=(P, E, E)))
        root = rng.normal(size=(P, E, E))
        maps.append(np.stack([np.linalg.qr(rng.normal(size=(E, E)))[0] for _ in range(P)]))
        scatter = root[0] @ root[0].T  # one segment in all frames
        scatter_matrices = np.stack([B @ scatter @ B.T for B in maps[-1]])
        held.append((rng.normal(size=(P, E)), factors + 2.0 * np.eye(E), scatter_matrices))
    return FrameOpinions.from_frames(maps, held), maps, held


def test_held_out_log_probs_equal_pooled_gaussian_density(rng, pooled_segments):
    """The density is that of the normalised product of powers of the Gaussians."""
    pooled, maps, held = pooled_segments
    pool_weights = rng.uniform(0.2, 1.0, size=P)
    for m, score in enumerate(held_out_log_probs(pooled, pool_weights)):
        gaussians = []
        for p in range(P):
            W, B = held[m][1][p], maps[m][p]
            weighted = Gaussian(held[m][0][p], np.linalg.inv(W.T @ W) / pool_weights[p])
            gaussians.append(affine_transform(weighted, np.linalg.inv(B), np.zeros(E)))
        root = np.linalg.cholesky(maps[m][0].T @ held[m][2][0] @ maps[m][0])
        points = np.sqrt(E) * np.concatenate([root.T, -root.T])  # of mean zero and exactly this scatter
        expected = log_density(product(gaussians), points).mean() + 0.5 * E * np.log(2.0 * np.pi)
        np.testing.assert_allclose(score, expected, rtol=1e-9)


def test_log_prob_gradient_equals_finite_difference(rng, pooled_segments):
    pool_weights, step = rng.uniform(0.3, 1.0, size=P), 1e-6
    differences = [
        (
            held_out_log_probs(pooled_segments[0], pool_weights + step * e)
            - held_out_log_probs(pooled_segments[0], pool_weights - step * e)
        ).mean()
        / (2 * step)
        for e in np.eye(P)
    ]
    np.testing.assert_allclose(
        log_prob_gradient(pooled_segments[0], pool_weights), differences, rtol=1e-6, atol=1e-7
    )


def test_fit_pool_weights_equals_best_of_grid(rng, pooled_segments):
    """No weights of a grid have a higher held-out log-probability."""
    best = fit_pool_weights(pooled_segments[0], np.ones(P, dtype=bool))
    top = held_out_log_probs(pooled_segments[0], best).mean()
    grid = np.concatenate([[1e-9], np.geomspace(1e-3, 10.0, 18)])
    others = [
        held_out_log_probs(pooled_segments[0], np.array([a, b, c])).mean()
        for a in grid
        for b in grid
        for c in grid
    ]
    assert top >= max(others) - 1e-6
    np.testing.assert_array_equal(fit_pool_weights(pooled_segments[0], np.array([True, False, True]))[1], 0.0)


def test_relevance_distractor_is_zero_at_every_state(make_two_object_demonstrations, rng):
    """The first object is relevant at the first stop, the world at the second, the other at the last."""
    demos = make_two_object_demonstrations(count=6, distractors=1)
    fit = learn(demos, states=3, rng=rng)
    found = relevance(fit.skill, demos)
    assert found.distractors == ("distractor 0",)
    np.testing.assert_allclose(found.values[:3], [[1, 0, 0], [0, 0, 1], [0, 1, 0]], atol=0.05)
    np.testing.assert_array_equal(found.values[3], 0.0)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_relevance_few_demonstrations_finds_distractors(make_two_object_demonstrations, rng, count):
    demos = make_two_object_demonstrations(count=count, distractors=2)
    found = relevance(learn(demos, states=3, rng=rng).skill, demos)
    assert found.distractors == ("distractor 0", "distractor 1")
    assert found.values[0, 0] == found.values[2, 1] == found.values[1, 2] == 1.0


def test_identical_frames_share_relevance(make_two_object_demonstrations, rng):
    """An object and its copy: one of them has relevance 1, and excluding either costs nothing."""
    demos = [
        replace(d, frames=(*d.frames, replace(d.frames[0], name="copy")))
        for d in make_two_object_demonstrations(count=5)
    ]
    found = relevance(learn(demos, states=3, rng=rng).skill, demos)
    assert found.values[[0, 3], 0].max() == 1.0
    assert found.values[1, 2] == 1.0
    assert np.abs(found.costs[[0, 3], 0]).max() < 0.1  # each alone can be done without


def test_relevance_single_frame_is_one(make_two_object_demonstrations, rng):
    demos = [replace(d, frames=d.frames[:1]) for d in make_two_object_demonstrations(count=3)]
    found = relevance(learn(demos, states=3, rng=rng).skill, demos)
    np.testing.assert_array_equal(found.values, 1.0)
    assert np.isposinf(found.costs).all()


@pytest.mark.parametrize("dynamics", ["semi-markov", "markov", "mixture"])
def test_relevance_any_dynamics_finds_distractor(make_two_object_demonstrations, rng, dynamics):
    demos = make_two_object_demonstrations(count=5, distractors=1)
    assert relevance(learn(demos, states=3, rng=rng, dynamics=dynamics).skill, demos).distractors == (
        "distractor 0",
    )


def test_relevance_moved_world_and_reversed_frames_is_unchanged(make_two_object_demonstrations, rng):
    """The world is rotated and moved, and frames are in reverse order."""
    demos = make_two_object_demonstrations(count=4, distractors=1)
    turn, _ = np.linalg.qr(rng.normal(size=(2, 2)))
    there = [
        replace(
            d,
            x=d.x @ turn.T + 3.0,
            frames=tuple(Frame(f.name, turn @ f.A, turn @ f.b + 3.0) for f in d.frames[::-1]),
        )
        for d in demos
    ]
    here, elsewhere = (relevance(learn(ds, states=3, rng=rng).skill, ds) for ds in (demos, there))
    np.testing.assert_allclose(elsewhere.values[::-1], here.values, atol=1e-3)
    np.testing.assert_allclose(elsewhere.costs[::-1], here.costs, atol=1e-3)


def test_select_frames_learned_skill_equals_skill_without_distractors(make_two_object_demonstrations, rng):
    demos = make_two_object_demonstrations(count=5, distractors=2)
    kept = select_frames(demos, relevance(learn(demos, states=3, rng=rng).skill, demos))
    assert [f.name for f in kept[0].frames] == ["object 0", "object 1", "world"]
    plain = [replace(d, frames=d.frames[:3]) for d in demos]
    one, other = (learn(ds, states=3, rng=rng).skill for ds in (kept, plain))
    np.testing.assert_array_equal(one.means, other.means)


def test_relevance_invalid_demonstrations_are_refused(make_two_object_demonstrations, rng):
    demos = make_two_object_demonstrations(count=3)
    skill = learn(demos, states=3, rng=rng).skill
    with pytest.raises(InvalidInput, match="at least two"):
        relevance(skill, demos[:1])
    with pytest.raises(InvalidInput, match="learned from"):
        relevance(skill, [replace(d, frames=d.frames[:1]) for d in demos])
    moving = [
        replace(
            d,
            frames=(
                d.frames[0],
                MovingFrame("object 1", np.tile(np.eye(2), (len(d.x), 1, 1)), d.x),
                d.frames[2],
            ),
        )
        for d in demos
    ]
    with pytest.raises(InvalidInput, match=r"frame\.at"):
        relevance(skill, moving)
    with pytest.raises(InvalidInput, match="object 1"):
        select_frames([replace(d, frames=d.frames[:1]) for d in demos], relevance(skill, demos))


def with_distractor(demos, rng):
    """Return the demonstrations with a further frame at random poses."""
    everywhere = np.concatenate([d.x[:, :3] for d in demos])
    middle, spread = everywhere.mean(axis=0), everywhere.std(axis=0).max()
    return [replace(d, frames=(*d.frames, _move_frame(d, middle, spread, rng))) for d in demos]


def _move_frame(demo, middle, spread, rng):
    placed = pose(middle + spread * rng.normal(size=3), normalise(rng.normal(size=4)))
    return frame_from_pose("distractor", demo.layout, placed)


def test_plan_with_relevance_moved_distractor_changes_less_than_one_percent(data_folder, rng):
    """Targets and motion of the valve, relative to the extent of the motion.

    Without relevance the moved frame changes the plan by more than a tenth of that.
    """
    demos = with_distractor(pf.datasets.valve()[:4], rng)
    skill = learn(demos, states=7, rng=rng, **published_options()).skill
    pool_weights = relevance(skill, demos).values
    np.testing.assert_array_equal(pool_weights[2], 0.0)
    assert pool_weights[0, 1] == 1.0  # the valve before it is turned, when it is grasped
    np.testing.assert_array_equal(pool_weights[1, 3:], 1.0)  # the valve after it, from when it is turned
    here = demos[0]
    elsewhere = with_distractor([replace(here, frames=here.frames[:2])], rng)[0]
    weighted, plain = (_plan_change(skill, here, elsewhere, r) for r in (pool_weights, None))
    assert weighted < 0.01
    assert plain > 0.1


def _plan_change(skill, here, elsewhere, pool_weights):
    """Return the largest change of position in targets and motion, relative to the extent of the motion."""
    moves = []
    for demo in (here, elsewhere):
        adapted = adapt(skill, demo.frames, relevance=pool_weights)
        reference = pf.plan(adapted, demo.x[0], horizon=len(demo.x))
        motion = pf.track(
            pf.control.double_integrator(7, period=demo.period), reference, control_cost=9.0
        ).rollout(demo.x[0])
        moves.append(np.hstack([reference.targets[:, :3], motion.x[:, :3]]))
    return np.abs(moves[0] - moves[1]).max() / np.ptp(moves[0][:, 3:], axis=0).max()


def test_relevance_negated_quaternions_is_unchanged(data_folder):
    """A recording or a frame with -q is equivalent."""
    demos = pf.datasets.valve()[:3]
    turned = np.repeat([1.0, -1.0, 1.0, -1.0], [3, 4, 3, 4])
    other = replace(demos[2], x=demos[2].x * turned)
    flipped = replace(demos[1].frames[0], A=demos[1].frames[0].A * turned)
    third = replace(demos[1], frames=(flipped, demos[1].frames[1]))
    found, same = (
        relevance(learn(ds, states=7, rng=np.random.default_rng(0)).skill, ds)
        for ds in (demos, (demos[0], third, other))
    )
    np.testing.assert_allclose(same.costs, found.costs, atol=1e-2)


def test_relevance_costs_equal_definition(make_two_object_demonstrations, rng):
    """One state: Gaussians of the points of the others, pooled in the world, on all held-out points."""
    demos = [
        replace(d, frames=d.frames[:2], x=d.x[:18])
        for d in make_two_object_demonstrations(count=4, noise=0.5)
    ]
    skill = learn(demos, states=1, rng=rng, dynamics="mixture").skill
    found = relevance(skill, demos)

    def pooled_segments(m, p):
        others = [
            np.linalg.solve(d.frames[p].A, (d.x - d.frames[p].b).T).T for d in demos if d is not demos[m]
        ]
        x = np.concatenate(others)
        sample = np.cov(x.T, bias=True)
        drawn = 0.5 * sample + 0.5 * np.eye(2) * np.trace(sample) / 2.0  # E + 1 = 3 against 3 demonstrations
        frame = demos[m].frames[p]
        return affine_transform(Gaussian(x.mean(axis=0), drawn + 1e-5 * np.eye(2)), frame.A, frame.b)

    opinions_of = [[pooled_segments(m, p) for p in range(2)] for m in range(4)]

    def score(m, pool_weights):
        precisions = [
            v * np.linalg.inv(g.covariance) for g, v in zip(opinions_of[m], pool_weights, strict=True)
        ]
        weighed = [L @ g.mean for L, g in zip(precisions, opinions_of[m], strict=True)]
        error = demos[m].x - np.linalg.solve(sum(precisions), sum(weighed))
        distance = np.einsum("ti,ij,tj->t", error, sum(precisions), error).mean()
        return 0.5 * np.linalg.slogdet(sum(precisions))[1] - 0.5 * distance

    def best(choices):
        return max(sum(score(m, pool_weights) for m in range(4)) for pool_weights in choices)

    grid = np.geomspace(1e-4, 3.0, 40)
    both = best([(a, b) for a in grid for b in grid])
    alone = [best([(0.0, b) for b in grid]), best([(a, 0.0) for a in grid])]
    np.testing.assert_allclose(found.costs[:, 0], np.array([both, both]) - alone, atol=0.15)
