"""A stream that begins where a batch fit ended, and the penalties that such a fit suggests."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.errors import InvalidInput
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import MarkovChain, online, runs, viterbi
from pilotfish.models.online import DPGMM, ConstantWeight, ExponentialDecay, Maintenance


@pytest.fixture(scope="module")
def demonstrations():
    return synthetic_valve(np.random.default_rng(0))[:3]


@pytest.fixture(scope="module")
def skill(demonstrations):
    return pf.learn(demonstrations, states=5, rng=np.random.default_rng(0)).skill


def test_the_model_is_the_skill_before_the_first_datapoint(demonstrations, skill):
    """Means are the skill's, and with every direction remembered so are covariances."""
    settings = online.estimate_penalties(
        skill, demonstrations, maintenance=Maintenance(extra_directions=skill.width)
    )
    model = online.from_batch_fit(skill, demonstrations, settings)
    np.testing.assert_array_equal(model.means.transpose(1, 0, 2), skill.means)
    remembered = np.einsum("kpdc,kpc,kpec->pkde", model.bases, model.variances, model.bases)
    for p, covariances in enumerate(skill.covariances):
        np.testing.assert_allclose(remembered[p], covariances.dense, atol=1e-12)
    ranks = model.state.ranks[..., None]
    for k in range(skill.states):  # mean squared distances to the first k directions, by their definition
        U, S = model.bases[k, 0], skill.covariances[0].dense[k]
        for d in range(int(ranks[k, 0, 0]) + 1):
            use_free_name = np.eye(skill.width) - U[:, :d] @ U[:, :d].T
            np.testing.assert_allclose(
                model.distances[k, 0, d],
                np.log_likelihoods(use_free_name @ S @ use_free_name),
                rtol=1e-6,
                atol=1e-9,
            )


def test_visits_and_transitions_are_those_of_the_most_likely_states(demonstrations, skill):
    """Counted by brute force; the last visit of each demonstration is cut off, the first one begins there."""
    model = online.from_batch_fit(skill, demonstrations, online.estimate_penalties(skill, demonstrations))
    K = skill.states
    counts, lengths, begun = np.zeros((K, K)), [[] for _ in range(K)], np.zeros(K)
    points = np.zeros(K)
    for demonstration in demonstrations:
        states = viterbi(skill, demonstration)
        points += np.bincount(states, minlength=K)
        for i, j in itertools.pairwise(states):
            counts[i, j] += 1
        visited, steps = runs(states)
        begun[visited[0]] += 1
        for k, n in zip(visited[:-1], steps[:-1], strict=True):
            lengths[k].append(n)
    np.testing.assert_array_equal(model.counts, counts)
    np.testing.assert_allclose(model.priors, points / points.sum())
    chain = online.to_skill(model).dynamics
    np.testing.assert_allclose(chain.initial, begun / 3)
    seen = [k for k in range(K) if lengths[k]]
    np.testing.assert_allclose(chain.durations.means[seen], [np.mean(lengths[k]) for k in seen])
    assert model.datapoints == sum(len(d.x) for d in demonstrations)


def test_no_datapoint_that_the_skill_learned_from_would_begin_a_cluster(demonstrations, skill):
    """Each of them alone, met where a demonstration begins, goes to a cluster that is there."""
    model = online.from_batch_fit(skill, demonstrations, online.estimate_penalties(skill, demonstrations))
    assert model.clusters == skill.states
    for demonstration in demonstrations:
        seen = pf.demonstrations.views([demonstration]).x.transpose(1, 0, 2)
        for point in seen[::5]:
            _, went = online.observe(model, point)
            assert went.cluster_id < skill.states
            assert went.cost <= model.settings.cluster


def test_more_explained_means_more_dimensions_and_less_noise(demonstrations, skill):
    """lambda_1 and sigma^2 fall as the share rises, and subspaces never get smaller."""
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


@pytest.mark.parametrize("explained", [0.5, 0.9])
def test_the_directions_above_lambda_1_explain_the_share(demonstrations, skill, explained_variance):
    """By brute force over all eigenvalues, weighted by how many datapoints each state has."""
    settings = online.estimate_penalties(skill, demonstrations, explained_variance=explained_variance)
    states = np.concatenate([viterbi(skill, d) for d in demonstrations])
    shares = np.bincount(states, minlength=skill.states) / len(states)
    above = total = rest = weight = 0.0
    for covariances in skill.covariances:
        for k, covariance in enumerate(covariances.dense):
            for value in np.linalg.eigvalsh(covariance):
                total += shares[k] * value
                above += shares[k] * value * (value > settings.dimension)
                rest += shares[k] * value * (value <= settings.dimension)
                weight += shares[k] * (value <= settings.dimension)
    assert explained_variance <= above / total < explained_variance + 0.2
    np.testing.assert_allclose(settings.noise, rest / weight, rtol=1e-9)


def test_states_of_the_skill_stay_apart(demonstrations, skill):
    """No two are closer than the merge distance, unless one is named."""
    settings = online.estimate_penalties(skill, demonstrations)
    means = skill.means.transpose(1, 0, 2).reshape(skill.states, -1)
    apart = [np.linalg.norm(a - b) for n, a in enumerate(means) for b in means[:n]]
    np.testing.assert_allclose(settings.maintenance.merge_distance, 0.5 * min(apart))
    named = online.estimate_penalties(
        skill, demonstrations, maintenance=Maintenance(merge_distance=0.1, batch=3)
    )
    assert named.maintenance == Maintenance(merge_distance=0.1, batch=3)


@pytest.mark.parametrize(
    ("weighting", "largest"),
    [(ExponentialDecay(0.98), 50.0), (ConstantWeight(7.0), 7.0)],
    ids=["trace", "constant"],
)
def test_weights_are_what_the_weighting_can_hold(demonstrations, skill, weighting, largest):
    settings = online.estimate_penalties(skill, demonstrations, maintenance=Maintenance(weighting))
    np.testing.assert_allclose(online.from_batch_fit(skill, demonstrations, settings).weights, largest)


def test_the_stream_goes_on_from_there(demonstrations, skill):
    """One more demonstration adds its datapoints; the skill read out adapts to where none was shown."""
    fourth = synthetic_valve(np.random.default_rng(1))[3]
    model = online.from_batch_fit(skill, demonstrations, online.estimate_penalties(skill, demonstrations))
    after, _ = online.observe_demonstration(model, fourth)
    assert after.datapoints == model.datapoints + len(fourth.x)
    assert after.demonstrations == 4
    assert np.isfinite(pf.adapt(online.to_skill(after), fourth.frames).means).all()


def test_spheres_may_begin_from_a_fit_too(demonstrations, skill):
    settings = DPGMM(cluster=1.0, noise=0.01)
    model = online.from_batch_fit(skill, demonstrations, settings)
    assert not model.dimensions.any()
    np.testing.assert_array_equal(model.means.transpose(1, 0, 2), skill.means)


def test_a_state_that_is_never_visited_is_left_out(demonstrations, skill):
    """A state so far away that no datapoint is in it."""
    means = skill.means.copy()
    means[:, 2] += 1e3
    anywhere = MarkovChain(np.full(5, 0.2), np.full((5, 5), 0.2))
    moved = replace(skill, means=means, dynamics=anywhere)
    model = online.from_batch_fit(moved, demonstrations, DPGMM(cluster=1.0, noise=0.01))
    assert model.clusters == skill.states - 1
    assert model.cluster_ids.tolist() == list(range(skill.states - 1))


def test_what_does_not_belong_together_is_refused(demonstrations, skill):
    short = [replace(d, frames=d.frames[:1]) for d in demonstrations]
    with pytest.raises(InvalidInput, match="1 frames of 14 columns, the model knows 2"):
        online.from_batch_fit(skill, short, DPGMM(1.0, 0.1))
    with pytest.raises(InvalidInput, match="explained is 1"):
        online.estimate_penalties(skill, demonstrations, explained_variance=1.0)
    turned = pf.learn([pf.to_sphere(d) for d in demonstrations], states=3, rng=np.random.default_rng(0)).skill
    with pytest.raises(InvalidInput, match="without on_sphere"):
        online.estimate_penalties(turned, [pf.to_sphere(d) for d in demonstrations])
