"""A stream that begins where a batch fit ended, and the penalties that such a fit suggests."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.errors import InvalidInput
from pilotfish.models import MarkovChain, online, runs, viterbi
from pilotfish.models.online import DPGMM, Constant, Trace, Upkeep
from pilotfish.store import synthetic_valve


@pytest.fixture(scope="module")
def shown():
    return synthetic_valve(np.random.default_rng(0))[:3]


@pytest.fixture(scope="module")
def skill(shown):
    return pf.learn(shown, states=5, rng=np.random.default_rng(0)).skill


def test_the_model_is_the_skill_before_the_first_datapoint(shown, skill):
    """Means are the skill's, and with every direction remembered so are covariances."""
    settings = online.penalties_from(skill, shown, upkeep=Upkeep(spare=skill.width))
    model = online.begin_from(skill, shown, settings)
    np.testing.assert_array_equal(model.means.transpose(1, 0, 2), skill.means)
    remembered = np.einsum("kpdc,kpc,kpec->pkde", model.bases, model.variances, model.bases)
    for p, covariances in enumerate(skill.covariances):
        np.testing.assert_allclose(remembered[p], covariances.dense, atol=1e-12)
    ranks = model.state.ranks[..., None]
    for k in range(skill.states):  # mean squared distances to the first k directions, by their definition
        U, S = model.bases[k, 0], skill.covariances[0].dense[k]
        for d in range(int(ranks[k, 0, 0]) + 1):
            beside = np.eye(skill.width) - U[:, :d] @ U[:, :d].T
            np.testing.assert_allclose(
                model.distances[k, 0, d], np.trace(beside @ S @ beside), rtol=1e-6, atol=1e-9
            )


def test_visits_and_transitions_are_those_of_the_most_likely_states(shown, skill):
    """Counted by brute force; the last visit of each demonstration is cut off, the first one begins there."""
    model = online.begin_from(skill, shown, online.penalties_from(skill, shown))
    K = skill.states
    counts, lengths, begun = np.zeros((K, K)), [[] for _ in range(K)], np.zeros(K)
    points = np.zeros(K)
    for demonstration in shown:
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
    chain = online.read_out(model).dynamics
    np.testing.assert_allclose(chain.initial, begun / 3)
    seen = [k for k in range(K) if lengths[k]]
    np.testing.assert_allclose(chain.durations.means[seen], [np.mean(lengths[k]) for k in seen])
    assert model.datapoints == sum(len(d.x) for d in shown)


def test_no_datapoint_that_the_skill_learned_from_would_begin_a_cluster(shown, skill):
    """Each of them alone, met where a demonstration begins, goes to a cluster that is there."""
    model = online.begin_from(skill, shown, online.penalties_from(skill, shown))
    assert model.clusters == skill.states
    for demonstration in shown:
        seen = pf.demonstrations.views([demonstration]).x.transpose(1, 0, 2)
        for point in seen[::5]:
            _, went = online.observe(model, point)
            assert went.identity < skill.states
            assert went.cost <= model.settings.cluster


def test_more_explained_means_more_dimensions_and_less_noise(shown, skill):
    """lambda_1 and sigma^2 fall as the share rises, and subspaces never get smaller."""
    found = [online.penalties_from(skill, shown, explained=share) for share in (0.6, 0.8, 0.95, 0.99)]
    for less, more in itertools.pairwise(found):
        assert more.dimension <= less.dimension
        assert more.noise <= less.noise
        few, many = (online.begin_from(skill, shown, settings).dimensions for settings in (less, more))
        assert (many >= few).all()


@pytest.mark.parametrize("explained", [0.5, 0.9])
def test_the_directions_above_lambda_1_explain_the_share(shown, skill, explained):
    """By brute force over all eigenvalues, weighted by how many datapoints each state has."""
    settings = online.penalties_from(skill, shown, explained=explained)
    states = np.concatenate([viterbi(skill, d) for d in shown])
    shares = np.bincount(states, minlength=skill.states) / len(states)
    above = total = rest = weight = 0.0
    for covariances in skill.covariances:
        for k, covariance in enumerate(covariances.dense):
            for value in np.linalg.eigvalsh(covariance):
                total += shares[k] * value
                above += shares[k] * value * (value > settings.dimension)
                rest += shares[k] * value * (value <= settings.dimension)
                weight += shares[k] * (value <= settings.dimension)
    assert explained <= above / total < explained + 0.2
    np.testing.assert_allclose(settings.noise, rest / weight, rtol=1e-9)


def test_states_of_the_skill_stay_apart(shown, skill):
    """No two are closer than the merge distance, unless one is named."""
    settings = online.penalties_from(skill, shown)
    means = skill.means.transpose(1, 0, 2).reshape(skill.states, -1)
    apart = [np.linalg.norm(a - b) for n, a in enumerate(means) for b in means[:n]]
    np.testing.assert_allclose(settings.upkeep.merge_distance, 0.5 * min(apart))
    named = online.penalties_from(skill, shown, upkeep=Upkeep(merge_distance=0.1, batch=3))
    assert named.upkeep == Upkeep(merge_distance=0.1, batch=3)


@pytest.mark.parametrize(
    ("weighting", "largest"), [(Trace(0.98), 50.0), (Constant(7.0), 7.0)], ids=["trace", "constant"]
)
def test_weights_are_what_the_weighting_can_hold(shown, skill, weighting, largest):
    settings = online.penalties_from(skill, shown, upkeep=Upkeep(weighting))
    np.testing.assert_allclose(online.begin_from(skill, shown, settings).weights, largest)


def test_the_stream_goes_on_from_there(shown, skill):
    """One more demonstration adds its datapoints; the skill read out adapts to where none was shown."""
    fourth = synthetic_valve(np.random.default_rng(1))[3]
    model = online.begin_from(skill, shown, online.penalties_from(skill, shown))
    after, _ = online.observe_demonstration(model, fourth)
    assert after.datapoints == model.datapoints + len(fourth.x)
    assert after.demonstrations == 4
    assert np.isfinite(pf.adapt(online.read_out(after), fourth.frames).means).all()


def test_spheres_may_begin_from_a_fit_too(shown, skill):
    settings = DPGMM(cluster=1.0, noise=0.01)
    model = online.begin_from(skill, shown, settings)
    assert not model.dimensions.any()
    np.testing.assert_array_equal(model.means.transpose(1, 0, 2), skill.means)


def test_a_state_that_is_never_visited_is_left_out(shown, skill):
    """A state so far away that no datapoint is in it."""
    means = skill.means.copy()
    means[:, 2] += 1e3
    anywhere = MarkovChain(np.full(5, 0.2), np.full((5, 5), 0.2))
    moved = replace(skill, means=means, dynamics=anywhere)
    model = online.begin_from(moved, shown, DPGMM(cluster=1.0, noise=0.01))
    assert model.clusters == skill.states - 1
    assert model.identities.tolist() == list(range(skill.states - 1))


def test_what_does_not_belong_together_is_refused(shown, skill):
    short = [replace(d, frames=d.frames[:1]) for d in shown]
    with pytest.raises(InvalidInput, match="1 frames of 14 columns, the model knows 2"):
        online.begin_from(skill, short, DPGMM(1.0, 0.1))
    with pytest.raises(InvalidInput, match="explained is 1"):
        online.penalties_from(skill, shown, explained=1.0)
    turned = pf.learn([pf.on_sphere(d) for d in shown], states=3, rng=np.random.default_rng(0)).skill
    with pytest.raises(InvalidInput, match="without on_sphere"):
        online.penalties_from(turned, [pf.on_sphere(d) for d in shown])
