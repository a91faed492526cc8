"""Semi-Markov models: E-step by enumeration, monotone likelihood, recovery of durations."""

import itertools
from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest
from scipy.special import logsumexp

from pilotfish import datasets
from pilotfish.demonstrations import Layout, Part, Quantity, Views, demonstration, views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import DenseCovariances, Diagonal, Full, SemiTied
from pilotfish.models import (
    Censoring,
    DurationModel,
    EMSettings,
    FromModel,
    HiddenModel,
    KMeans,
    MarkovChain,
    SemiMarkovChain,
    expected_statistics,
    learn,
    log_emissions,
    log_likelihood,
    maximise_likelihood,
    state_segments,
    viterbi,
)
from pilotfish.models.durations import (
    DISTRIBUTIONS,
    Gamma,
    Gaussian,
    Histogram,
    LogNormal,
    NegativeBinomial,
    Poisson,
    Segments,
)
from pilotfish.models.viterbi_durations import count_durations

DURATION_MODELS = {
    **{name: DurationModel(distribution) for name, distribution in DISTRIBUTIONS.items()},
    "geometric": DurationModel(NegativeBinomial, options={"shape": 1.0}),
}
LAYOUT = Layout((Part("place", Quantity.SCALAR, 1, "m"),))


def make_durations(rng, K, kind):
    match kind:
        case "gaussian":
            return Gaussian(rng.uniform(1.0, 4.0, K), rng.uniform(0.5, 2.0, K))
        case "log-normal":
            return LogNormal(rng.uniform(0.2, 1.5, K), rng.uniform(0.2, 0.6, K))
        case "gamma":
            return Gamma(rng.uniform(1.0, 6.0, K), rng.uniform(1.0, 2.0, K))
        case "poisson":
            return Poisson(rng.uniform(0.5, 3.0, K))
        case "negative-binomial":
            return NegativeBinomial(rng.uniform(0.5, 4.0, K), rng.uniform(0.4, 0.8, K))
    return Histogram(rng.dirichlet(np.ones(4), size=K).T)


KINDS = list(DISTRIBUTIONS)


def random_model(rng, K=3, kind="gaussian", censoring=Censoring.RIGHT, final=True, P=1, D=1):
    A = rng.random((K, K)) * (1 - np.eye(K)) + 1e-3 * (1 - np.eye(K))
    A = A / np.maximum(A.sum(axis=1, keepdims=True), 1e-300)
    if final:
        A[-1] = 0.0
    chain = SemiMarkovChain(rng.dirichlet(np.ones(K)), A, make_durations(rng, K, kind), censoring)
    spread = np.broadcast_to(np.eye(D), (P, K, D, D)).copy()
    return HiddenModel(chain, 2 * rng.normal(size=(P, K, D)), tuple(DenseCovariances(c) for c in spread))


def enumerate_segmentations(chain, log_b):
    """Yield (states, lengths, log p) of every segmentation of the recording, by definition."""
    T, K = log_b.shape
    N = 400
    p = np.exp(chain.durations.log_table(N))
    longer = np.cumsum(p[::-1], axis=0)[::-1]
    excess = np.cumsum(longer[::-1], axis=0)[::-1]
    mean = np.arange(1, N + 1) @ p
    first, last = chain.censoring.left, chain.censoring.right
    final = ~chain.transitions.any(axis=1)

    def weight(k, d, begins, ends):
        if ends and last and final[k]:
            return 1.0
        if begins and first:
            return (excess if ends and last else longer)[d - 1, k] / mean[k]
        return (longer if ends and last else p)[d - 1, k]

    for cuts in itertools.chain.from_iterable(itertools.combinations(range(1, T), n) for n in range(T)):
        begins, ends = (0, *cuts), (*cuts, T)
        lengths = [e - b for b, e in zip(begins, ends, strict=True)]
        for states in itertools.product(range(K), repeat=len(lengths)):
            if any(final[k] for k in states[:-1]):
                continue
            prior = chain.initial[states[0]]
            prior *= np.prod([chain.transitions[i, j] for i, j in itertools.pairwise(states)])
            for k, b, e in zip(states, begins, ends, strict=True):
                prior *= weight(k, e - b, b == 0, e == T)
            if prior > 0.0:
                recorded = sum(log_b[b:e, k].sum() for k, b, e in zip(states, begins, ends, strict=True))
                yield states, lengths, np.log(prior) + recorded


@pytest.mark.parametrize("censoring", Censoring)
@pytest.mark.parametrize("kind", KINDS)
def test_expected_statistics_equal_enumeration_of_segmentations(rng, kind, censoring):
    """Likelihood, first states, transitions, counts and segments of every kind of censoring."""
    K, T = 3, 5
    model, x = random_model(rng, K, kind, censoring), 2 * rng.normal(size=(1, T, 1))
    data = Views(x, np.array([T]))
    listed = list(enumerate_segmentations(model.dynamics, log_emissions(model, data)))
    log_p = np.array([p for _, _, p in listed])
    statistics = expected_statistics(model, data, max_duration=T)
    np.testing.assert_allclose(statistics.log_likelihood, logsumexp(log_p), rtol=1e-8)
    initial_counts, pairs, counts, segments = np.zeros(K), np.zeros((K, K)), np.zeros(K), np.zeros((4, T, K))
    final = ~model.dynamics.transitions.any(axis=1)
    for (states, lengths, _), share in zip(listed, np.exp(log_p - logsumexp(log_p)), strict=True):
        initial_counts[states[0]] += share
        np.add.at(pairs, (list(states[:-1]), list(states[1:])), share)
        np.add.at(counts, list(states), share * np.array(lengths))
        for n, (k, d) in enumerate(zip(states, lengths, strict=True)):
            ended = n == len(states) - 1 and censoring.right
            begun = n == 0 and censoring.left
            if not (ended and final[k]):
                segments[2 * begun + ended, d - 1, k] += share
    np.testing.assert_allclose(statistics.initial_counts, initial_counts, atol=1e-8)
    np.testing.assert_allclose(statistics.transitions, pairs, atol=1e-8)
    np.testing.assert_allclose(statistics.moments[0].counts, counts, atol=1e-8)
    for actual, expected in zip(fields(statistics.segments), segments, strict=True):
        np.testing.assert_allclose(getattr(statistics.segments, actual.name), expected, atol=1e-8)


@pytest.mark.parametrize("censoring", Censoring)
def test_viterbi_equals_most_probable_of_all_segmentations(rng, censoring):
    model = random_model(rng, 3, "gamma", censoring)
    x = 2 * rng.normal(size=(5, 1))
    demo = demonstration(x, 0.1, LAYOUT, (), "five steps")
    listed = list(enumerate_segmentations(model.dynamics, log_emissions(model, views([demo]))))
    states, lengths, _ = max(listed, key=lambda one: one[2])
    np.testing.assert_array_equal(viterbi(model, demo), np.repeat(states, lengths))


@pytest.mark.parametrize("censoring", [Censoring.RIGHT, Censoring.BOTH])
@pytest.mark.parametrize("kind", KINDS)
def test_log_likelihood_equals_forward_recursion(rng, kind, censoring):
    """The E-step and the forward recursion are two algorithms; the last state is summed out."""
    model = random_model(rng, 3, kind, censoring, final=False)
    demos = [demonstration(rng.normal(size=(T, 1)), 0.1, LAYOUT, (), f"{T}") for T in (2, 4, 30)]
    actual = log_likelihood(model, demos)
    for value, demo in zip(actual, demos, strict=True):
        log_b = log_emissions(model, views([demo]))
        forward = model.dynamics.forward(log_b, len(log_b))
        np.testing.assert_allclose(value, logsumexp(forward.log_forward[-1]), rtol=1e-9)


def geometric_model(rng, K):
    exit_probs = rng.uniform(0.1, 0.6, K)
    transitions = rng.random((K, K)) * (1 - np.eye(K))
    transitions /= transitions.sum(axis=1, keepdims=True)
    initial = rng.dirichlet(np.ones(K))
    steps = np.diag(1 - exit_probs) + exit_probs[:, None] * transitions
    durations = NegativeBinomial(np.ones(K), exit_probs)
    return SemiMarkovChain(initial, transitions, durations), MarkovChain(initial, steps)


def test_geometric_durations_equal_markov_model(rng):
    """The same likelihood, and one M-step leads to the same model."""
    semi, markov = geometric_model(rng, 3)
    emissions = random_model(rng, 3, D=2)
    data = Views(rng.normal(size=(1, 70, 2)), np.array([30, 40]))
    a, b = replace(emissions, dynamics=semi), replace(emissions, dynamics=markov)
    exact, plain = expected_statistics(a, data, max_duration=40), expected_statistics(b, data)
    np.testing.assert_allclose(exact.log_likelihood, plain.log_likelihood)
    np.testing.assert_allclose(
        exact.moments[0].scatter_matrices, plain.moments[0].scatter_matrices, atol=1e-8
    )

    def chain(statistics, previous):
        duration_model = DURATION_MODELS["geometric"]
        return SemiMarkovChain.fit(statistics, previous, duration_model=duration_model, min_variance=1.0)

    new = maximise_likelihood(exact, a, Full(), 0.0, chain).dynamics
    old = maximise_likelihood(plain, b, Full(), 0.0, MarkovChain.fit).dynamics
    np.testing.assert_allclose(new.initial, old.initial)
    np.testing.assert_allclose(new.durations.exit_probs, 1.0 - np.diag(old.transitions), rtol=1e-6)
    onward = new.durations.exit_probs[:, None] * new.transitions
    np.testing.assert_allclose(onward, old.transitions * (1 - np.eye(3)), rtol=1e-6)
    np.testing.assert_allclose(MarkovChain.fit(exact).transitions, old.transitions, rtol=1e-7)


@pytest.mark.parametrize(
    ("structure", "censoring"),
    [
        *((Full(), censoring) for censoring in Censoring),
        (SemiTied(1.0), Censoring.RIGHT),
        (Diagonal(), Censoring.BOTH),
    ],
    ids=lambda value: value.label if hasattr(value, "label") else value.value,
)
@pytest.mark.parametrize("name", DURATION_MODELS)
def test_semi_markov_em_is_monotone(rng, make_demonstrations, name, structure, censoring):
    """Every step gains, up to rounding, for all distributions, kinds of censoring and structures."""
    data = views(make_demonstrations(lengths=(25, 30, 21), width=2, stops=3, noise=0.5))
    assert_likelihood_never_falls(data, rng, replace(DURATION_MODELS[name], censoring=censoring), structure)


def assert_likelihood_never_falls(data, rng, duration_model, structure, steps=4, states=3):
    initial_statistics = KMeans().initial_statistics(data, states, rng)
    model = maximise_likelihood(initial_statistics, None, structure, 1e-6, MarkovChain.fit)
    chain = count_durations(model, data, 1.0)
    broad = Gaussian(chain.durations.means, np.maximum(2.0, 0.7 * chain.durations.means))
    model = replace(model, dynamics=replace(chain, durations=broad, censoring=duration_model.censoring))
    max_duration, values = int(data.lengths.max()), []
    for _ in range(steps):
        statistics = expected_statistics(model, data, max_duration=max_duration)
        values.append(statistics.log_likelihood)
        model = maximise_likelihood(
            statistics,
            model,
            structure,
            0.0,
            partial(SemiMarkovChain.fit, duration_model=duration_model, min_variance=0.05),
        )
    # The first step changes the class of the distribution; only later steps are ascent.
    assert np.diff(values[1:]).min() > -1e-9 * abs(values[-1]), np.diff(values)


@pytest.mark.parametrize("name", DURATION_MODELS)
def test_semi_markov_em_valve_recordings_is_monotone(data_folder, name):
    """Real recordings, right-censored or censored at both ends."""
    demos = datasets.valve()[:4]
    for censoring in (Censoring.RIGHT, Censoring.BOTH):
        fit = learn(
            demos,
            states=5,
            rng=np.random.default_rng(0),
            durations=replace(DURATION_MODELS[name], censoring=censoring),
            settings=EMSettings(tolerance=0.0, max_iterations=4),
        )
        assert np.diff(fit.log_likelihoods).min(initial=0.0) >= 0.0
        np.testing.assert_allclose(log_likelihood(fit.skill, demos).sum(), fit.log_likelihoods[-1], rtol=1e-6)


def test_statistics_of_parts_sum_to_statistics_of_all(rng, make_demonstrations):
    """Segments included."""
    demos = make_demonstrations(lengths=(12, 20, 17, 31), frames=1)
    model = random_model(rng, 3, "gamma", D=2, P=1)
    whole = expected_statistics(model, views(demos))
    parts = expected_statistics(model, views(demos[2:])) + expected_statistics(model, views(demos[:2]))
    np.testing.assert_allclose(parts.log_likelihood, whole.log_likelihood)
    np.testing.assert_allclose(parts.transitions, whole.transitions, atol=1e-9)
    for f in fields(whole.segments):
        np.testing.assert_allclose(
            getattr(parts.segments, f.name), getattr(whole.segments, f.name), atol=1e-7
        )


@pytest.mark.parametrize("censoring", [Censoring.RIGHT, Censoring.BOTH])
@pytest.mark.parametrize("kind", KINDS)
def test_sampled_state_frequencies_equal_filtered_state_probs(kind, censoring):
    """For every distribution, with and without left-censoring."""
    rng = np.random.default_rng(5)
    chain, horizon, N = random_model(rng, 3, kind, censoring).dynamics, 8, 500
    counts = np.zeros((horizon, 3))
    for _ in range(N):
        counts[np.arange(horizon), chain.sample(horizon, rng)] += 1
    expected = chain.filtered_state_probs(np.empty((0, 3)), horizon)
    np.testing.assert_allclose(expected.sum(axis=1), 1.0)
    np.testing.assert_allclose(counts / N, expected, atol=5 * 0.5 / np.sqrt(N))


def test_left_censored_chain_is_stationary():
    """Two states in turn, with initial probabilities equal to their shares of time."""
    durations = Gamma(np.array([4.0, 9.0]), np.array([0.5, 0.5]))
    shares = durations.means / durations.means.sum()
    chain = SemiMarkovChain(shares, np.eye(2)[::-1], durations, Censoring.BOTH)
    np.testing.assert_allclose(
        chain.filtered_state_probs(np.empty((0, 2)), 60), np.tile(shares, (60, 1)), atol=1e-9
    )


def sample_demonstrations(rng, count, length=120):
    """Return recordings of three states in a loop, their mean durations and their true segments."""
    durations = Gamma(np.array([20.0, 9.0, 30.0]), np.array([2.0, 0.6, 1.5]))
    chain = SemiMarkovChain(np.full(3, 1 / 3), np.roll(np.eye(3), 1, axis=1), durations)
    demos, true = [], np.zeros((4, length, 3))
    for m in range(count):
        states = chain.sample(length, rng)
        x = 3.0 * states[:, None] + rng.normal(size=(length, 1))
        demos.append(demonstration(x, 0.1, LAYOUT, (), f"passage {m}"))
        segment_states, lengths = state_segments(states)
        np.add.at(true[0], (lengths[:-1] - 1, segment_states[:-1]), 1.0)
        true[1, lengths[-1] - 1, segment_states[-1]] += 1.0
    return demos, durations.means, Segments(*true)


def test_durations_are_recovered_from_samples():
    """The error shrinks to that of the true segments; counted durations stay too short."""
    initialisation = HiddenModel(
        MarkovChain(np.full(3, 1 / 3), np.full((3, 3), 0.05) + 0.85 * np.eye(3)),
        np.array([[[0.0], [3.0], [6.0]]]),
        (DenseCovariances(np.ones((3, 1, 1))),),
    )
    errors = {}
    for count in (4, 64):
        actual = {"exact": [], "counted": [], "true segments": []}
        for seed in range(4):
            rng = np.random.default_rng(seed)
            demos, truth, segments = sample_demonstrations(rng, count)
            fit = learn(
                demos,
                states=3,
                rng=rng,
                initialisation=FromModel(initialisation),
                durations=DurationModel(Gamma),
            )
            actual["exact"].append(fit.skill.dynamics.durations.means / truth - 1.0)
            actual["counted"].append(
                count_durations(fit.markov_skill, views(demos), 1.0).durations.means / truth - 1.0
            )
            actual["true segments"].append(Gamma.fit(segments).means / truth - 1.0)
        errors[count] = {name: np.sqrt(np.mean(np.square(values))) for name, values in actual.items()}
    assert errors[64]["exact"] < errors[4]["exact"] / 1.8, errors
    for count in errors:
        assert errors[count]["exact"] < 1.4 * errors[count]["true segments"], errors
    assert errors[64]["counted"] > 2.0 * errors[64]["exact"], errors
    assert np.mean(actual["counted"]) < -0.05, actual


def test_semi_markov_fit_continues_from_given_skill(make_demonstrations):
    """The first likelihood is no lower than the last of the given skill."""
    demos, rng = make_demonstrations(lengths=(30, 36)), np.random.default_rng(0)
    fit = learn(demos, states=3, rng=rng, durations=DurationModel(Poisson))
    duration_model = DurationModel(Poisson, max_duration=36)
    again = learn(demos, states=3, rng=rng, initialisation=FromModel(fit.skill), durations=duration_model)
    assert again.log_likelihoods[0] >= fit.log_likelihoods[-1] - 1e-3 * abs(fit.log_likelihoods[-1])
    assert isinstance(again.markov_skill.dynamics, MarkovChain)
    markov = learn(demos, states=3, rng=rng, dynamics="markov", initialisation=FromModel(fit.skill))
    np.testing.assert_allclose(markov.skill.dynamics.transitions.sum(axis=1), 1.0)


def test_max_duration_too_short_raises(rng):
    """Two states of 20 steps each cannot be explained by segments of at most 5 steps."""
    x = np.repeat([[0.0], [50.0]], 20, axis=0) + 0.1 * rng.normal(size=(40, 1))
    demo = demonstration(x, 0.1, LAYOUT, (), "long segments")
    with pytest.raises(InvalidInput, match=r"segments of at most 5 steps.*raise max_duration"):
        learn(
            [demo],
            states=2,
            rng=rng,
            durations=DurationModel(censoring=Censoring.NONE, max_duration=5),
        )


def test_semi_markov_one_state_one_demonstration_is_fitted(rng):
    demo = demonstration(rng.normal(size=(12, 1)), 0.1, LAYOUT, (), "one")
    fit = learn([demo], states=1, rng=rng, durations=DurationModel())
    np.testing.assert_array_equal(fit.skill.dynamics.transitions, [[0.0]])
    np.testing.assert_allclose(log_likelihood(fit.skill, [demo]), fit.log_likelihoods[-1])


def test_semi_markov_state_without_data_is_dropped_with_its_segments(rng, make_demonstrations):
    demos = make_demonstrations(stops=2, frames=1)
    model = learn(demos, states=2, rng=rng, durations=DurationModel()).skill
    far = np.full_like(model.means[:, :1], 1e3)
    durations = Gaussian(np.full(3, 8.0), np.full(3, 4.0))
    initialisation = HiddenModel(
        SemiMarkovChain(np.full(3, 1 / 3), (1 - np.eye(3)) / 2, durations),
        np.concatenate([model.means, far], axis=1),
        tuple(DenseCovariances(np.concatenate([c.dense, np.eye(2)[None]])) for c in model.covariances),
    )
    fit = learn(demos, states=3, rng=rng, initialisation=FromModel(initialisation), durations=DurationModel())
    assert fit.skill.states == 2
    assert "state 2 of 3" in fit.convergence.dropped[0]
    assert np.isfinite(fit.skill.dynamics.durations.means).all()


def test_invalid_arguments_raise(rng, make_demonstrations):
    with pytest.raises(InvalidInput, match="max_duration is 0"):
        DurationModel(max_duration=0)
    with pytest.raises(InvalidInput, match="'width', but gamma has no option"):
        DurationModel(Gamma, options={"width": 1.0})
    with pytest.raises(InvalidInput, match="shape is 0"):
        DurationModel(NegativeBinomial, options={"shape": 0.0})
    statistics = KMeans().initial_statistics(views(make_demonstrations()), 2, rng)
    with pytest.raises(InvalidInput, match="no segments"):
        SemiMarkovChain.fit(statistics, duration_model=DurationModel(), min_variance=1.0)
    arguments = {"states": 2, "rng": rng}
    with pytest.raises(InvalidInput, match="dynamics is 'hmm', expected one of 'mixture', 'markov'"):
        learn(make_demonstrations(), dynamics="hmm", **arguments)
    with pytest.raises(InvalidInput, match='expected dynamics="semi-markov"'):
        learn(make_demonstrations(), dynamics="markov", durations=DurationModel(), **arguments)


@pytest.mark.parametrize("name", ["gaussian", "poisson", "histogram"])
def test_max_duration_beyond_recordings_changes_nothing(make_demonstrations, name):
    """No array has its size: 10^9 steps would fit in no memory."""
    demos = make_demonstrations(lengths=(30, 36))
    fits = [
        learn(
            demos,
            states=2,
            rng=np.random.default_rng(0),
            durations=replace(DURATION_MODELS[name], max_duration=max_duration),
        )
        for max_duration in (36, 10**6, 2**31 - 1)
    ]
    for fit in fits[1:]:
        np.testing.assert_array_equal(fit.log_likelihoods, fits[0].log_likelihoods)
        np.testing.assert_array_equal(fit.skill.means, fits[0].skill.means)
    with pytest.raises(InvalidInput, match=r"max_duration is 1000000000000, expected a whole number from 1"):
        DurationModel(max_duration=10**12)
