"""Relevance of frames for orientations on S^3."""

from dataclasses import replace

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.demonstrations import Layout, Quantity, demonstration, frame_from_pose, pose_layout
from pilotfish.geometry import Pose, angle, from_rotation_vector, normalise
from pilotfish.models import EMSettings, TimeBins, adapt, learn, relevance, select_frames

pytestmark = pytest.mark.usefixtures("unchecked")

POSE = pose_layout()
SPHERE = Layout((POSE.parts[0], replace(POSE.parts[1], quantity=Quantity.ORIENTATION)))
NAMES = ("cup", "tray", "distractor")
KEYPOINTS = np.array(
    [[0.3, 0.1, 0.2, 0.5, 0.0, 0.0], [0.0, 0.4, 0.1, 0.0, 0.3, 0.2]]
)  # places, rotation vectors


def random_pose(rng, spread=1.0):
    return Pose(spread * rng.normal(size=3), normalise(rng.normal(size=4)))


def record_demonstration(rng, name):
    """Return a tool that rests at the cup in its orientation, then at the tray, with noise."""
    frames = [frame_from_pose(each, SPHERE, random_pose(rng)) for each in NAMES]
    stops = np.repeat(KEYPOINTS + 0.03 * rng.normal(size=(2, 6)), [18, 15], axis=0)
    stops += 0.01 * rng.normal(size=stops.shape)
    local = np.hstack([stops[:, :3], from_rotation_vector(stops[:, 3:])])
    world = [local[:18] @ frames[0].A.T + frames[0].b, local[18:] @ frames[1].A.T + frames[1].b]
    return demonstration(np.concatenate(world), 0.1, SPHERE, frames, name)


@pytest.fixture
def demos(rng):
    return [record_demonstration(rng, f"passage {m}") for m in range(5)]


def learn_relevance(demos, states=2, **options):
    return relevance(learn(demos, states=states, rng=np.random.default_rng(0), **options).skill, demos)


def negate_quaternions(demo, rng):
    """Return the demonstration with random rows and frames negated."""
    x, frames = demo.x.copy(), []
    x[:, 3:7] *= np.where(rng.uniform(size=(len(x), 1)) < 0.5, -1.0, 1.0)
    for frame in demo.frames:
        A = frame.A.copy()
        A[3:7, 3:7] *= rng.choice([-1.0, 1.0])
        frames.append(replace(frame, A=A))
    return demonstration(x, demo.period, demo.layout, frames, demo.name)


def move_world(demo, world):
    """Return the demonstration in another world frame."""
    to = frame_from_pose("there", demo.layout, world)
    frames = [replace(f, A=to.A @ f.A, b=to.A @ f.b + to.b) for f in demo.frames]
    return demonstration(demo.x @ to.A.T + to.b, demo.period, demo.layout, frames, demo.name)


def test_relevance_on_s3_distractor_is_zero_at_every_state(demos):
    found = learn_relevance(demos)
    np.testing.assert_allclose(found.values, [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]], atol=0.05)
    assert found.distractors == ("distractor",)
    kept = select_frames(demos, found)
    assert {tuple(f.name for f in demo.frames) for demo in kept} == {("cup", "tray")}


def test_relevance_on_s3_orientation_only_finds_distractor(rng):
    """Demonstrations without positions.

    With five instead of eight demonstrations, a random frame explains the rest by chance once in forty draws.
    """
    demos = [record_demonstration(rng, f"passage {m}") for m in range(8)]
    turning = Layout((SPHERE.parts[1],))
    only = [
        demonstration(
            d.x[:, 3:], d.period, turning, [replace(f, A=f.A[3:, 3:], b=np.zeros(4)) for f in d.frames]
        )
        for d in demos
    ]
    found = learn_relevance(only)
    assert found.distractors == ("distractor",)
    assert found.values[0, 0] == found.values[1, 1] == 1.0


def test_relevance_on_s3_negated_quaternions_is_unchanged(demos, rng):
    """Random rows and frames are negated."""
    one, other = learn_relevance(demos), learn_relevance([negate_quaternions(d, rng) for d in demos])
    np.testing.assert_allclose(other.values, one.values, atol=1e-6)
    np.testing.assert_allclose(other.costs, one.costs, atol=1e-4)


def test_relevance_on_s3_moved_world_is_unchanged(demos, rng):
    world = random_pose(rng, 3.0)
    one, other = learn_relevance(demos), learn_relevance([move_world(d, world) for d in demos])
    np.testing.assert_allclose(other.values, one.values, atol=1e-3)
    np.testing.assert_allclose(other.costs, one.costs, atol=1e-3)


def add_distractors(demos, rng):
    """Return the demonstrations with a further frame at random poses."""
    return [replace(d, frames=(*d.frames, distractor(d.layout, rng))) for d in demos]


def distractor(layout, rng):
    return frame_from_pose("distractor", layout, random_pose(rng))


def test_relevance_on_s3_valve_finds_frames(data_folder, rng):
    """The frame before the turn is relevant at the grasp, the frame after it from the turn on."""
    demos = [pf.demonstrations.to_sphere(d) for d in add_distractors(pf.datasets.valve()[:4], rng)]
    in_order = {"initialisation": TimeBins(complete=True), "settings": EMSettings(min_gain=0.5)}
    found = learn_relevance(demos, states=7, **in_order)
    assert found.distractors == ("distractor",)
    assert found.values[0, 1] == 1.0
    np.testing.assert_array_equal(found.values[1, 3:], 1.0)
    world = random_pose(rng)
    for others in ([negate_quaternions(d, rng) for d in demos], [move_world(d, world) for d in demos]):
        again = learn_relevance(others, states=7, **in_order)
        np.testing.assert_allclose(again.values, found.values, atol=0.01)
        np.testing.assert_allclose(again.costs, found.costs, atol=0.01)


def test_plan_on_s3_moved_distractor_changes_less_than_one_percent(data_folder, rng):
    """Targets and motion of the valve, positions and orientations, relative to the extent of the motion.

    Without relevance the moved frame changes both by more than a twentieth.
    """
    demos = [pf.demonstrations.to_sphere(d) for d in add_distractors(pf.datasets.valve()[:4], rng)]
    skill = learn(demos, states=7, rng=rng).skill
    pool_weights = relevance(skill, demos).values
    here = demos[0]
    elsewhere = replace(here, frames=(*here.frames[:2], distractor(here.layout, rng)))
    assert max(plan_changes(skill, here, elsewhere, pool_weights)) < 0.01
    assert min(plan_changes(skill, here, elsewhere, None)) > 0.05


def plan_changes(skill, here, elsewhere, pool_weights):
    """Return the largest change of position and orientation, relative to the extents of the motion."""
    one, other = (plan_in_tangent_chart(skill, demo.frames, here, pool_weights) for demo in (here, elsewhere))
    motion = one[len(one) // 2 :]
    place = np.abs(one - other)[:, :3].max() / np.ptp(motion[:, :3], axis=0).max()
    turn = angle(one[:, 3:7], other[:, 3:7]).max() / angle(motion[:, 3:7], motion[:1, 3:7]).max()
    return place, turn


def plan_in_tangent_chart(skill, frames, here, pool_weights):
    """Return targets and tracked motion as poses in the world, with one tangent chart."""
    flat = pf.planning.tangent_chart(adapt(skill, frames, relevance=pool_weights), base_pose=here.x[0])
    start, steps = flat.to_tangent(here.x[0]), len(here.x)
    reference = pf.plan(flat.skill, start, horizon=steps)
    motion = pf.track(
        pf.control.double_integrator(6, period=here.period), reference, control_cost=9.0
    ).rollout(start)
    return np.vstack([flat.to_manifold(reference.targets), flat.to_manifold(motion.x[:steps])])
