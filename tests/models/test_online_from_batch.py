"""Online models from a batch fit, and the penalties that are estimated from it."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.errors import InvalidInput
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import MarkovChain, online, state_segments, viterbi
from pilotfish.models.online import DPGMM, Maintenance


@pytest.fixture(scope="module")
def demonstrations():
    return synthetic_valve(np.random.default_rng(0))[:3]


@pytest.fixture(scope="module")
def skill(demonstrations):
    return pf.learn(demonstrations, states=5, rng=np.random.default_rng(0)).skill


@pytest.mark.parametrize("scales", [True, False], ids=["scaled", "unscaled"])
def test_from_batch_fit_means_and_covariances_equal_skill(demonstrations, skill, scales):
    """With every direction stored, covariances are those of the skill in scaled columns."""
    settings = online.estimate_penalties(
        skill, demonstrations, maintenance=Maintenance(extra_directions=skill.width), scales=scales
    )
    model = online.from_batch_fit(skill, demonstrations, settings)
    np.testing.assert_allclose(model.means.transpose(1, 0, 2), skill.means, rtol=1e-15)
    scale = np.ones(skill.width) if model.scales is None else model.scales[0]
    stored = np.einsum("kpdc,kpc,kpec->pkde", model.state.bases, model.state.variances, model.state.bases)
    for p, covariances in enumerate(skill.covariances):
        np.testing.assert_allclose(stored[p] * np.outer(scale, scale), covariances.dense, atol=1e-12)
    ranks = model.state.ranks[..., None]
    for k in range(skill.states):  # mean squared distances to the first k directions, by their definition
        U, S = model.state.bases[k, 0], skill.covariances[0].dense[k] / np.outer(scale, scale)
        for d in range(int(ranks[k, 0, 0]) + 1):
            outside = np.eye(skill.width) - U[:, :d] @ U[:, :d].T
            np.testing.assert_allclose(
                model.state.distances[k, 0, d],
                np.trace(outside @ S @ outside),
                rtol=1e-6,
                atol=1e-9,
            )


def test_from_batch_fit_segments_and_transitions_equal_enumeration(demonstrations, skill):
    """Counted from the most probable state sequences; the last segment is censored."""
    model = online.from_batch_fit(skill, demonstrations, online.estimate_penalties(skill, demonstrations))
    K = skill.states
    counts, lengths, starts = np.zeros((K, K)), [[] for _ in range(K)], np.zeros(K)
    points = np.zeros(K)
    for demonstration in demonstrations:
        states = viterbi(skill, demonstration)
        points += np.bincount(states, minlength=K)
        for i, j in itertools.pairwise(states):
            counts[i, j] += 1
        segment_states, steps = state_segments(states)
        starts[segment_states[0]] += 1
        for k, n in zip(segment_states[:-1], steps[:-1], strict=True):
            lengths[k].append(n)
    np.testing.assert_array_equal(model.transition_counts, counts)
    np.testing.assert_allclose(model.priors, points / points.sum())
    chain = online.to_skill(model).dynamics
    np.testing.assert_allclose(chain.initial, starts / 3)
    complete = [k for k in range(K) if lengths[k]]
    np.testing.assert_allclose(chain.durations.means[complete], [np.mean(lengths[k]) for k in complete])
    assert model.datapoints == sum(len(d.x) for d in demonstrations)


def test_estimate_penalties_training_data_start_no_cluster(demonstrations, skill):
    """Each datapoint alone, at the start of a demonstration, goes to an existing cluster."""
    model = online.from_batch_fit(skill, demonstrations, online.estimate_penalties(skill, demonstrations))
    assert model.clusters == skill.states
    for demonstration in demonstrations:
        points = pf.demonstrations.views([demonstration]).x.transpose(1, 0, 2)
        for point in points[::5]:
            _, cluster_id, cost, _ = online.observe(model, point)
            assert cluster_id < skill.states
            assert cost <= model.settings.cluster


def test_estimate_penalties_larger_share_gives_more_dimensions(demonstrations, skill):
    """lambda_1 and sigma^2 decrease with the share, and dimensions do not."""
    found = [
        online.estimate_penalties(skill, demonstrations, explained_variance=share)
        for share in (0.6, 0.8, 0.95, 0.99)
    ]
    for less, more in itertools.pairwise(found):
        assert more.dimension <= less.dimension
        assert more.noise <= less.noise
        few, many = (
            online.from_batch_fit(skill, demonstrations, settings).dimensions for settings in (less, more)
        )
        assert (many >= few).all()


@pytest.mark.parametrize("explained_variance", [0.5, 0.9])
def test_estimate_penalties_directions_above_lambda_1_explain_share(
    demonstrations, skill, explained_variance
):
    """Enumerated over the eigenvalues of each state's datapoints; no row of these recordings is wild."""
    settings = online.estimate_penalties(
        skill, demonstrations, explained_variance=explained_variance, scales=False
    )
    states = np.concatenate([viterbi(skill, d) for d in demonstrations])
    x = pf.demonstrations.views(demonstrations).x
    above = total = rest = weight = 0.0
    for view in x:
        for k, count in enumerate(np.bincount(states, minlength=skill.states).tolist()):
            for value in np.linalg.eigvalsh(np.cov(view[states == k].T, bias=True)):
                total += count * value
                above += count * value * (value > settings.dimension)
                rest += count * value * (value <= settings.dimension)
                weight += count * (value <= settings.dimension)
    assert explained_variance <= above / total < explained_variance + 0.2
    np.testing.assert_allclose(settings.noise, rest / weight, rtol=1e-9)


def test_estimate_penalties_merge_distance_separates_states(demonstrations, skill):
    """No two states are closer than the merge distance, unless it is given."""
    settings = online.estimate_penalties(skill, demonstrations)
    means = (skill.means / np.array(settings.scales)).transpose(1, 0, 2).reshape(skill.states, -1)
    distances = [np.linalg.norm(a - b) for n, a in enumerate(means) for b in means[:n]]
    np.testing.assert_allclose(settings.maintenance.merge_distance, 0.5 * min(distances))
    named = online.estimate_penalties(
        skill, demonstrations, maintenance=Maintenance(merge_distance=0.1, batch=3)
    )
    assert named.maintenance == Maintenance(merge_distance=0.1, batch=3)


@pytest.mark.parametrize(
    ("maintenance", "largest"),
    [(Maintenance(discount=0.98), 50.0), (Maintenance(constant_weight=7.0), 7.0)],
    ids=["decay", "constant"],
)
def test_from_batch_fit_weights_have_their_upper_bound(demonstrations, skill, maintenance, largest):
    settings = online.estimate_penalties(skill, demonstrations, maintenance=maintenance)
    np.testing.assert_allclose(online.from_batch_fit(skill, demonstrations, settings).weights, largest)


def test_observe_demonstration_after_batch_fit_adds_datapoints(demonstrations, skill):
    """The skill can then be adapted to a new situation."""
    fourth = synthetic_valve(np.random.default_rng(1))[3]
    model = online.from_batch_fit(skill, demonstrations, online.estimate_penalties(skill, demonstrations))
    after, _ = online.observe_demonstration(model, fourth)
    assert after.datapoints == model.datapoints + len(fourth.x)
    assert after.demonstrations == 4
    assert np.isfinite(pf.adapt(online.to_skill(after), fourth.frames).means).all()


def test_from_batch_fit_spheres_have_no_dimensions(demonstrations, skill):
    settings = DPGMM(cluster=1.0, noise=0.01)
    model = online.from_batch_fit(skill, demonstrations, settings)
    assert not model.dimensions.any()
    np.testing.assert_array_equal(model.means.transpose(1, 0, 2), skill.means)


def test_from_batch_fit_state_without_datapoints_is_left_out(demonstrations, skill):
    """The state is far from all datapoints."""
    means = skill.means.copy()
    means[:, 2] += 1e3
    anywhere = MarkovChain(np.full(5, 0.2), np.full((5, 5), 0.2))
    moved = replace(skill, means=means, dynamics=anywhere)
    model = online.from_batch_fit(moved, demonstrations, DPGMM(cluster=1.0, noise=0.01))
    assert model.clusters == skill.states - 1
    assert model.cluster_ids.tolist() == list(range(skill.states - 1))


def test_from_batch_fit_incompatible_arguments_are_refused(demonstrations, skill):
    short = [replace(d, frames=d.frames[:1]) for d in demonstrations]
    with pytest.raises(InvalidInput, match="1 frames of 14 columns, expected 2 of 14"):
        online.from_batch_fit(skill, short, DPGMM(1.0, 0.1))
    with pytest.raises(InvalidInput, match="explained_variance is 1"):
        online.estimate_penalties(skill, demonstrations, explained_variance=1.0)
    on_sphere = [pf.demonstrations.to_sphere(d) for d in demonstrations]
    turned = pf.learn(on_sphere, states=3, rng=np.random.default_rng(0)).skill
    with pytest.raises(InvalidInput, match="without on_sphere"):
        online.estimate_penalties(turned, on_sphere)
