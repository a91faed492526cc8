"""Skills with orientations on S^3: invariance to quaternion signs and to the world frame."""

from dataclasses import replace

import numpy as np
import pytest
from published import published_options

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Quantity,
    add_derivatives,
    demonstration,
    frame_from_pose,
    pose_layout,
    to_sphere,
    views,
)
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import RiemannianGaussian
from pilotfish.gaussians.structures import Full, SemiTied, Spherical
from pilotfish.geometry import (
    Pose,
    angle,
    exp_map,
    from_rotation_vector,
    karcher_mean,
    log_map,
    multiply,
    quaternion_exp,
)
from pilotfish.models import (
    DurationModel,
    EMSettings,
    KMeans,
    MixtureWeights,
    TimeBins,
    adapt,
    expected_statistics,
    filtered_regression,
    learn,
    maximise_likelihood,
)
from pilotfish.models.statistics import labelled_statistics

POSE = pose_layout()
SPHERE = Layout((POSE.parts[0], replace(POSE.parts[1], quantity=Quantity.ORIENTATION)))
PLAIN = EMSettings(regularisation=0.0, tolerance=1e-5, max_iterations=100)


def random_pose(rng, turn=1.0):
    return Pose(rng.normal(size=3), quaternion_exp(turn * rng.normal(size=3)))


def demonstrate_reach(rng, a, b, steps, noise=0.03):
    """Return a tool that moves and rotates from object a to object b."""
    s = np.linspace(0.0, 1.0, steps)[:, None]
    path = 0.5 * log_map(a.quaternion, b.quaternion, (0,))
    q = multiply(
        multiply(a.quaternion, quaternion_exp(s * path)), quaternion_exp(noise * rng.normal(size=(steps, 3)))
    )
    p = (1 - s) * a.position + s * b.position + noise * rng.normal(size=(steps, 3))
    frames = [frame_from_pose(name, SPHERE, pose) for name, pose in (("a", a), ("b", b))]
    return demonstration(np.hstack([p, q]), 0.1, SPHERE, frames)


@pytest.fixture
def situations(rng):
    """Return poses of two objects in four situations, up to about 90 degrees apart."""
    homes = [random_pose(rng) for _ in range(4)]
    return [
        (a, Pose(rng.normal(size=3), multiply(quaternion_exp(0.4 * rng.normal(size=3)), a.quaternion)))
        for a in homes
    ]


@pytest.fixture
def demos(rng, situations):
    return [demonstrate_reach(rng, a, b, 30 + 3 * m) for m, (a, b) in enumerate(situations)]


def negate_quaternions(rng, demos, every_frame=False):
    """Return the demonstrations with random rows and frames negated."""
    negated_demos = []
    for demo in demos:
        signs = np.ones(demo.x.shape)
        signs[:, 3:7] = np.where(rng.uniform(size=(len(signs), 1)) < 0.5, -1.0, 1.0)
        frames = []
        for frame in demo.frames:
            A = frame.A.copy()
            A[3:7, 3:7] *= -1.0 if every_frame or rng.uniform() < 0.5 else 1.0
            frames.append(replace(frame, A=A))
        negated_demos.append(demonstration(signs * demo.x, demo.period, demo.layout, frames))
    return negated_demos


def rotate_world(demos: list[Demonstration], world: Pose) -> list[Demonstration]:
    """Return the recordings in another world frame."""
    A = frame_from_pose("world", demos[0].layout, world)
    return [
        demonstration(
            demo.x @ A.A.T + A.b,
            demo.period,
            demo.layout,
            [replace(f, A=A.A @ f.A, b=A.A @ f.b + A.b) for f in demo.frames],
        )
        for demo in demos
    ]


def assert_same_skill(one, other, tolerance=1e-9):
    difference = log_map(one.means, other.means, one.layout.orientation_starts)
    np.testing.assert_allclose(difference, 0.0, atol=tolerance)
    for a, b in zip(one.covariances, other.covariances, strict=True):
        np.testing.assert_allclose(a.dense, b.dense, atol=tolerance)


@pytest.mark.parametrize("initialisation", [TimeBins(), KMeans()], ids=lambda s: type(s).__name__)
@pytest.mark.parametrize("velocities", [False, True])
def test_learn_is_invariant_to_quaternion_signs(rng, demos, initialisation, velocities):
    """Any rows, any frames: the same trace and the same Gaussians."""
    demos = [add_derivatives(d) for d in demos] if velocities else demos
    one, other = (
        learn(
            negated_demos,
            states=3,
            rng=np.random.default_rng(0),
            initialisation=initialisation,
            dynamics="markov",
        )
        for negated_demos in (demos, negate_quaternions(rng, demos))
    )
    np.testing.assert_allclose(other.log_likelihoods, one.log_likelihoods, rtol=1e-10)
    assert_same_skill(one.skill, other.skill)


@pytest.mark.parametrize("velocities", [False, True])
def test_learn_is_invariant_to_world_rotation(rng, demos, velocities):
    demos = [add_derivatives(d) for d in demos] if velocities else demos
    one, other = (
        learn(negated_demos, states=3, rng=np.random.default_rng(0), dynamics="markov")
        for negated_demos in (demos, rotate_world(demos, random_pose(rng)))
    )
    np.testing.assert_allclose(other.log_likelihoods, one.log_likelihoods, rtol=1e-8)
    assert_same_skill(one.skill, other.skill, 1e-7)


@pytest.mark.parametrize("structure", [Full(), Spherical(), SemiTied()], ids=lambda s: s.label)
def test_fit_on_s3_likelihood_never_decreases(rng, demos, structure):
    """The M-step is exact on S^3 to first order only; the likelihood still does not decrease."""
    fit = learn(demos, states=3, rng=rng, structure=structure, settings=PLAIN, dynamics="markov")
    assert np.all(np.diff(fit.log_likelihoods) >= 0.0)
    assert fit.log_likelihoods[-1] > fit.log_likelihoods[0]
    assert fit.convergence.converged or fit.convergence.iterations == PLAIN.max_iterations


def test_fit_on_s3_fixed_point_is_karcher_mean(rng):
    """The mean is the exact Karcher mean weighted by responsibilities."""
    layout, homes = Layout((SPHERE.parts[1],)), quaternion_exp(np.array([[0.0, 0.0, 0.0], [1.2, 0.0, 0.0]]))
    q = multiply(homes[np.arange(60) // 30], quaternion_exp(0.35 * rng.normal(size=(60, 3))))
    data = views([demonstration(q, 0.1, layout)])
    statistics = labelled_statistics(data, np.arange(60) // 25 % 2, 2)
    for _ in range(200):
        model = maximise_likelihood(statistics, None, Full(), 0.0, MixtureWeights.fit)
        statistics = expected_statistics(model, data)
    (m,) = statistics.moments
    np.testing.assert_allclose(m.deviation_sums / m.counts[:, None], 0.0, atol=1e-9)
    np.testing.assert_allclose(
        m.outer_products / m.counts[:, None, None], model.covariances[0].dense, atol=1e-9
    )


def test_fit_on_s3_small_rotations_equals_fit_of_rotation_vectors(rng):
    """Within a thousandth of a radian S^3 is flat, to the same relative size."""
    size, home = 1e-3, quaternion_exp(rng.normal(size=3))
    parts = Layout((replace(SPHERE.tangent.parts[1], name="turn"),))
    stops = rng.normal(size=(3, 3))
    vectors = [size * (stops[np.arange(40) * 3 // 40] + 0.2 * rng.normal(size=(40, 3))) for _ in range(3)]
    flat = [demonstration(v, 0.1, parts) for v in vectors]
    layout = Layout((SPHERE.parts[1],))
    sphere = [demonstration(multiply(home, from_rotation_vector(v)), 0.1, layout) for v in vectors]
    fits = [
        learn(d, states=3, rng=rng, settings=EMSettings(regularisation=0.0), dynamics="markov")
        for d in (flat, sphere)
    ]
    for n in (0, -1):
        np.testing.assert_allclose(fits[1].log_likelihoods[n], fits[0].log_likelihoods[n], rtol=size**2)
    tangent_means = log_map(home, fits[1].skill.means[0], (0,))
    np.testing.assert_allclose(tangent_means, fits[0].skill.means[0], atol=10 * size**2)
    dense = [fit.skill.covariances[0].dense for fit in fits]
    np.testing.assert_allclose(dense[1], dense[0], atol=10 * size**3)


@pytest.mark.parametrize(
    ("dynamics", "durations"),
    [("semi-markov", None), ("markov", None), ("mixture", None), ("semi-markov", DurationModel())],
)
def test_learn_on_s3_any_dynamics_gives_unit_quaternions(rng, demos, dynamics, durations):
    fit = learn(demos, states=3, rng=rng, dynamics=dynamics, durations=durations)
    assert fit.skill.means.shape == (2, 3, 7)
    assert fit.skill.covariances[0].dense.shape == (3, 6, 6)
    np.testing.assert_allclose(np.linalg.norm(fit.skill.means[..., 3:], axis=-1), 1.0)


def test_learn_mixed_orientation_kinds_is_refused(rng, demos):
    flat = demonstration(demos[0].x, 0.1, POSE, demos[0].frames)
    with pytest.raises(InvalidInput, match="layout"):
        learn([*demos, flat], states=2, rng=rng, dynamics="markov")
    assert to_sphere(flat).layout == demos[0].layout


@pytest.mark.parametrize("velocities", [False, True])
def test_adapt_on_s3_moved_world_moves_skill(rng, demos, velocities):
    """Means move as the objects do; covariances of orientations in body axes do not change."""
    demos = [add_derivatives(d) for d in demos] if velocities else demos
    skill, world = learn(demos, states=3, rng=rng, dynamics="markov").skill, random_pose(rng)
    negated_demos = negate_quaternions(rng, rotate_world(demos, world))[0].frames
    adapted, moved = adapt(skill, demos[0].frames), adapt(skill, negated_demos)
    A = frame_from_pose("world", skill.layout, world)
    np.testing.assert_allclose(
        log_map(moved.means, adapted.means @ A.A.T + A.b, skill.layout.orientation_starts), 0.0, atol=1e-7
    )
    rotation = A.tangent_map(skill.layout)
    np.testing.assert_allclose(moved.covariances, rotation @ adapted.covariances @ rotation.T, atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(moved.means[:, 3:7], axis=1), 1.0)


def test_adapt_on_s3_negated_quaternions_give_same_skill(rng, demos):
    adapted = [
        adapt(learn(negated_demos, states=3, rng=np.random.default_rng(0)).skill, negated_demos[0].frames)
        for negated_demos in (demos, negate_quaternions(rng, demos))
    ]
    difference = log_map(adapted[0].means, adapted[1].means, adapted[0].layout.orientation_starts)
    np.testing.assert_allclose(difference, 0.0, atol=1e-8)
    np.testing.assert_allclose(adapted[1].covariances, adapted[0].covariances, atol=1e-8)


def test_adapt_on_s3_mean_maximises_product_of_powers(rng, demos):
    """At the mean of each state no step increases sum_j r_j log p_j.

    Frames of the published fit agree. Where they conflict, the product may end at a half turn from a frame,
    where its density jumps and has no mode; `tests/gaussians/test_riemannian.py` covers that.
    """
    skill, frame_weights = (
        learn(demos, states=3, rng=rng, dynamics="markov", **published_options()).skill,
        rng.uniform(0.1, 1.0, size=(2, 3)),
    )
    frame_weights[1, 0] = 0.0
    frames = demos[1].frames
    adapted, h = adapt(skill, frames, relevance=frame_weights), 1e-4 * rng.normal(size=(50, 6))
    for k in range(3):
        points = exp_map(adapted.means[k], np.vstack([np.zeros(6), h]), skill.layout.orientation_starts)
        log_density = np.zeros(51)
        for p, f in enumerate(frames):
            own = RiemannianGaussian(
                skill.means[p, k], skill.covariances[p].dense[k], skill.layout.orientation_starts
            )
            log_density += frame_weights[p, k] * own.log_density((points - f.b) @ np.linalg.inv(f.A).T)
        assert log_density.argmax() == 0
    np.testing.assert_allclose(
        adapted.covariances[0],
        frames[0].tangent_map(skill.layout)
        @ (skill.covariances[0].dense[0] / frame_weights[0, 0])
        @ frames[0].tangent_map(skill.layout).T,
        rtol=1e-9,
        atol=1e-12,
    )


def test_log_state_likelihoods_on_s3_either_sign_finds_state(rng, demos, situations):
    """With q or -q, the first row is in the first state and the last row in the last."""
    adapted = adapt(learn(demos, states=3, rng=rng).skill, demos[0].frames)
    for x in (demos[0].x, demos[0].x * np.repeat([1.0, -1.0], [3, 4])):
        states = adapted.log_state_likelihoods(x).argmax(axis=1)
        assert (states[0], states[-1]) == (0, 2)


def test_adapt_frame_outside_s3_is_refused(rng, demos):
    skill, (a, b) = learn(demos, states=2, rng=rng, dynamics="markov").skill, demos[0].frames
    with pytest.raises(InvalidInput, match="left multiplication by a unit quaternion"):
        adapt(skill, [a, replace(b, A=np.eye(7) * 2.0)])


@pytest.mark.parametrize("dynamics", ["mixture", "markov", "semi-markov"])
def test_filtered_regression_on_s3_predicts_orientation(rng, demos, dynamics):
    """The error is smaller than that of one constant orientation, and quaternions have unit norm."""
    adapted = adapt(learn(demos, states=3, rng=rng, dynamics=dynamics).skill, demos[0].frames)
    x, q = demos[0].x[:, :3], demos[0].x[:, 3:]
    regression = filtered_regression(adapted, np.arange(3), x)
    np.testing.assert_allclose(np.linalg.norm(regression.means, axis=1), 1.0)
    one = karcher_mean(q, np.ones(len(q)), (0,))
    assert np.mean(angle(regression.means, q) ** 2) < 0.5 * np.mean(angle(one, q) ** 2)
    assert regression.covariances.shape == (len(q), 3, 3)
    if dynamics == "mixture":
        with pytest.raises(InvalidInput, match="filtered_regression"):
            adapted.as_mixture()
