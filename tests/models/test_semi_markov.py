"""Exact semi-Markov learning: its definition, a likelihood that never falls, what comes back of samples."""

import itertools
from dataclasses import fields, replace

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
    Gamma,
    GammaDurations,
    Gaussian,
    GaussianDurations,
    HiddenModel,
    Histogram,
    HistogramDurations,
    KMeans,
    LogNormal,
    LogNormalDurations,
    MarkovChain,
    NegativeBinomial,
    NegativeBinomialDurations,
    Poisson,
    PoissonDurations,
    Segments,
    SemiMarkovChain,
    count_durations,
    expected_statistics,
    filtered_state_probs,
    fit_markov_chain,
    fit_semi_markov_chain,
    learn_markov,
    learn_semi_markov,
    log_emissions,
    log_likelihood,
    maximise_likelihood,
    sample_states,
    semi_markov_forward,
    state_segments,
    viterbi,
)

DISTRIBUTIONS = [
    Gaussian(),
    LogNormal(),
    Gamma(),
    Poisson(),
    NegativeBinomial(),
    NegativeBinomial(1.0),
    Histogram(),
]
CENSORING_BY_NAME = [Censoring(first, last) for first in (False, True) for last in (True, False)]
PLACE = Layout((Part("place", Quantity.SCALAR, 1, "m"),))


def make_durations(rng, K, kind):
    match kind:
        case "gaussian":
            return GaussianDurations(rng.uniform(1.0, 4.0, K), rng.uniform(0.5, 2.0, K))
        case "log-normal":
            return LogNormalDurations(rng.uniform(0.2, 1.5, K), rng.uniform(0.2, 0.6, K))
        case "gamma":
            return GammaDurations(rng.uniform(1.0, 6.0, K), rng.uniform(1.0, 2.0, K))
        case "poisson":
            return PoissonDurations(rng.uniform(0.5, 3.0, K))
        case "negative binomial":
            return NegativeBinomialDurations(rng.uniform(0.5, 4.0, K), rng.uniform(0.4, 0.8, K))
    return HistogramDurations(rng.dirichlet(np.ones(4), size=K).T)


KINDS = ["gaussian", "log-normal", "gamma", "poisson", "negative binomial", "histogram"]


def random_model(rng, K=3, kind="gaussian", censoring=CENSORING_BY_NAME[0], final=True, P=1, D=1):
    A = rng.random((K, K)) * (1 - np.eye(K)) + 1e-3 * (1 - np.eye(K))
    A = A / np.maximum(A.sum(axis=1, keepdims=True), 1e-300)
    if final:
        A[-1] = 0.0
    chain = SemiMarkovChain(rng.dirichlet(np.ones(K)), A, make_durations(rng, K, kind), censoring)
    spread = np.broadcast_to(np.eye(D), (P, K, D, D)).copy()
    return HiddenModel(chain, 2 * rng.normal(size=(P, K, D)), tuple(DenseCovariances(c) for c in spread))


def enumerate_segmentations(chain, log_b):
    """(states, lengths, log p) for every way to cover the recording with visits, by definition."""
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
                seen = sum(log_b[b:e, k].sum() for k, b, e in zip(states, begins, ends, strict=True))
                yield states, lengths, np.log(prior) + seen


@pytest.mark.parametrize("censoring", CENSORING_BY_NAME, ids=lambda c: f"left={c.left},right={c.right}")
@pytest.mark.parametrize("kind", KINDS)
def test_statistics_are_expectations_over_every_segmentation(rng, kind, censoring):
    """Likelihood, first states, transitions, masses and visits of every kind, by listing them."""
    K, T = 3, 5
    model, x = random_model(rng, K, kind, censoring), 2 * rng.normal(size=(1, T, 1))
    data = Views(x, np.array([T]))
    listed = list(enumerate_segmentations(model.dynamics, log_emissions(model, data)))
    log_p = np.array([p for _, _, p in listed])
    statistics = expected_statistics(model, data, max_duration=T)
    np.testing.assert_allclose(statistics.log_likelihood, logsumexp(log_p), rtol=1e-8)
    first, pairs, counts, segments = np.zeros(K), np.zeros((K, K)), np.zeros(K), np.zeros((4, T, K))
    final = ~model.dynamics.transitions.any(axis=1)
    for (states, lengths, _), share in zip(listed, np.exp(log_p - logsumexp(log_p)), strict=True):
        first[states[0]] += share
        np.add.at(pairs, (list(states[:-1]), list(states[1:])), share)
        np.add.at(counts, list(states), share * np.array(lengths))
        for n, (k, d) in enumerate(zip(states, lengths, strict=True)):
            ended = n == len(states) - 1 and censoring.right
            begun = n == 0 and censoring.left
            if not (ended and final[k]):
                segments[2 * begun + ended, d - 1, k] += share
    np.testing.assert_allclose(statistics.first, first, atol=1e-8)
    np.testing.assert_allclose(statistics.transitions, pairs, atol=1e-8)
    np.testing.assert_allclose(statistics.moments[0].counts, counts, atol=1e-8)
    for found, expected in zip(fields(statistics.segments), segments, strict=True):
        np.testing.assert_allclose(getattr(statistics.segments, found.name), expected, atol=1e-8)


@pytest.mark.parametrize("censoring", CENSORING_BY_NAME, ids=lambda c: f"left={c.left},right={c.right}")
def test_viterbi_finds_the_most_probable_of_all_segmentations(rng, censoring):
    model = random_model(rng, 3, "gamma", censoring)
    x = 2 * rng.normal(size=(5, 1))
    demo = demonstration(x, 0.1, PLACE, (), "five steps")
    listed = list(enumerate_segmentations(model.dynamics, log_emissions(model, views([demo]))))
    states, lengths, _ = max(listed, key=lambda one: one[2])
    np.testing.assert_array_equal(viterbi(model, demo), np.repeat(states, lengths))


@pytest.mark.parametrize("first", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_the_likelihood_is_that_of_the_forward_recursion(rng, kind, first):
    """Kernel and recursion over time are two algorithms; what the last step is in does not matter."""
    model = random_model(rng, 3, kind, Censoring(left=first), final=False)
    demos = [demonstration(rng.normal(size=(T, 1)), 0.1, PLACE, (), f"{T}") for T in (2, 4, 30)]
    found = log_likelihood(model, demos)
    for value, demo in zip(found, demos, strict=True):
        log_b = log_emissions(model, views([demo]))
        forward = semi_markov_forward(model.dynamics, log_b, len(log_b))
        np.testing.assert_allclose(value, logsumexp(forward.log_forward[-1]), rtol=1e-9)


def geometric_model(rng, K):
    leaving = rng.uniform(0.1, 0.6, K)
    between = rng.random((K, K)) * (1 - np.eye(K))
    between /= between.sum(axis=1, keepdims=True)
    initial = rng.dirichlet(np.ones(K))
    steps = np.diag(1 - leaving) + leaving[:, None] * between
    durations = NegativeBinomialDurations(np.ones(K), leaving)
    return SemiMarkovChain(initial, between, durations), MarkovChain(initial, steps)


def test_with_geometric_durations_it_is_the_markov_model(rng):
    """The same likelihood, states and update: one M-step of either leads to the same model."""
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
        return fit_semi_markov_chain(statistics, previous, DurationModel(NegativeBinomial(1.0)), 1.0)

    new = maximise_likelihood(exact, a, Full(), 0.0, chain).dynamics
    old = maximise_likelihood(plain, b, Full(), 0.0, fit_markov_chain).dynamics
    np.testing.assert_allclose(new.initial, old.initial)
    np.testing.assert_allclose(new.durations.exit_probs, 1.0 - np.diag(old.transitions), rtol=1e-6)
    onward = new.durations.exit_probs[:, None] * new.transitions
    np.testing.assert_allclose(onward, old.transitions * (1 - np.eye(3)), rtol=1e-6)
    np.testing.assert_allclose(fit_markov_chain(exact).transitions, old.transitions, rtol=1e-7)


@pytest.mark.parametrize(
    ("structure", "censoring"),
    [
        *((Full(), c) for c in CENSORING_BY_NAME),
        (SemiTied(1.0), CENSORING_BY_NAME[0]),
        (Diagonal(), CENSORING_BY_NAME[2]),
    ],
    ids=lambda v: v.label if hasattr(v, "label") else f"left={v.left},right={v.right}",
)
@pytest.mark.parametrize("law", DISTRIBUTIONS, ids=lambda distribution: distribution.label)
def test_the_likelihood_of_exact_learning_never_falls(
    rng, make_demonstrations, distribution, structure, censoring
):
    """Every single step gains, to rounding: all laws, what is cut off, and covariance structures."""
    data = views(make_demonstrations(lengths=(25, 30, 21), width=2, stops=3, noise=0.5))
    assert_likelihood_never_falls(data, rng, distribution, censoring, structure, steps=4)


def assert_likelihood_never_falls(data, rng, distribution, censoring, structure, steps, states=3):
    duration_model = DurationModel(distribution, censoring)
    initial_statistics = KMeans().initial_statistics(data, states, rng)
    model = maximise_likelihood(initial_statistics, None, structure, 1e-6, fit_markov_chain)
    chain = count_durations(model, data, 1.0)
    broad = GaussianDurations(chain.durations.means, np.maximum(2.0, 0.7 * chain.durations.means))
    model = replace(model, dynamics=replace(chain, durations=broad, censoring=censoring))
    max_duration, values = int(data.lengths.max()), []
    for _ in range(steps):
        statistics = expected_statistics(model, data, max_duration=max_duration)
        values.append(statistics.log_likelihood)
        model = maximise_likelihood(
            statistics,
            model,
            structure,
            0.0,
            lambda s, before: fit_semi_markov_chain(s, before, duration_model, 0.05),
        )
    # The first step goes from one family of laws to another: only from there on is it ascent.
    assert np.diff(values[1:]).min() > -1e-9 * abs(values[-1]), np.diff(values)


@pytest.mark.parametrize("law", DISTRIBUTIONS, ids=lambda distribution: distribution.label)
def test_the_likelihood_of_exact_learning_never_falls_on_the_valve(data_folder, distribution):
    """Real recordings, with the ends of demonstrations cut off, and their beginnings too."""
    demos = datasets.valve()[:4]
    for censoring in CENSORING_BY_NAME[:3:2]:
        fit = learn_semi_markov(
            demos,
            states=5,
            rng=np.random.default_rng(0),
            duration_model=DurationModel(distribution, censoring),
            settings=EMSettings(tolerance=0.0, max_iterations=4),
        )
        assert np.diff(fit.log_likelihoods).min(initial=0.0) >= 0.0
        np.testing.assert_allclose(log_likelihood(fit.skill, demos).sum(), fit.log_likelihoods[-1], rtol=1e-6)


def test_statistics_of_parts_sum_to_statistics_of_all(rng, make_demonstrations):
    """Visits too: learning is a fold over demonstrations."""
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


@pytest.mark.parametrize("first", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_sampled_state_frequencies_equal_filtered_state_probs(kind, first):
    """Of every law, begun with a visit or inside one."""
    rng = np.random.default_rng(5)
    chain, horizon, N = random_model(rng, 3, kind, Censoring(left=first)).dynamics, 8, 500
    counts = np.zeros((horizon, 3))
    for _ in range(N):
        counts[np.arange(horizon), sample_states(chain, horizon, rng)] += 1
    expected = filtered_state_probs(chain, np.empty((0, 3)), horizon)
    np.testing.assert_allclose(expected.sum(axis=1), 1.0)
    np.testing.assert_allclose(counts / N, expected, atol=5 * 0.5 / np.sqrt(N))


def test_left_censored_chain_is_stationary():
    """Two states in turn, met inside a visit with probability as its share of time: no moment is special."""
    durations = GammaDurations(np.array([4.0, 9.0]), np.array([0.5, 0.5]))
    shares = durations.means / durations.means.sum()
    chain = SemiMarkovChain(shares, np.eye(2)[::-1], durations, Censoring(left=True))
    np.testing.assert_allclose(
        filtered_state_probs(chain, np.empty((0, 2)), 60), np.tile(shares, (60, 1)), atol=1e-9
    )


def sample_demonstrations(rng, count, length=120):
    """Recordings of three states in a loop, at places apart by three deviations; and visits as they were."""
    durations = GammaDurations(np.array([20.0, 9.0, 30.0]), np.array([2.0, 0.6, 1.5]))
    chain = SemiMarkovChain(np.full(3, 1 / 3), np.roll(np.eye(3), 1, axis=1), durations)
    demos, true = [], np.zeros((4, length, 3))
    for m in range(count):
        states = sample_states(chain, length, rng)
        x = 3.0 * states[:, None] + rng.normal(size=(length, 1))
        demos.append(demonstration(x, 0.1, PLACE, (), f"passage {m}"))
        visited, lengths = state_segments(states)
        np.add.at(true[0], (lengths[:-1] - 1, visited[:-1]), 1.0)
        true[1, lengths[-1] - 1, visited[-1]] += 1.0
    return demos, durations.means, Segments(*true)


def test_durations_are_recovered_from_samples():
    """The error shrinks with the data, down to that of the true visits; counted durations stay too short."""
    initialisation = HiddenModel(
        MarkovChain(np.full(3, 1 / 3), np.full((3, 3), 0.05) + 0.85 * np.eye(3)),
        np.array([[[0.0], [3.0], [6.0]]]),
        (DenseCovariances(np.ones((3, 1, 1))),),
    )
    errors = {}
    for count in (4, 64):
        found = {"exact": [], "counted": [], "seen": []}
        for seed in range(4):
            rng = np.random.default_rng(seed)
            demos, truth, segments = sample_demonstrations(rng, count)
            fit = learn_semi_markov(
                demos,
                states=3,
                rng=rng,
                initialisation=FromModel(initialisation),
                duration_model=DurationModel(Gamma()),
            )
            found["exact"].append(fit.skill.dynamics.durations.means / truth - 1.0)
            found["counted"].append(
                count_durations(fit.markov_skill, views(demos), 1.0).durations.means / truth - 1.0
            )
            found["seen"].append(Gamma().estimate(segments, None, 1.0).means / truth - 1.0)
        errors[count] = {name: np.sqrt(np.mean(np.square(values))) for name, values in found.items()}
    assert errors[64]["exact"] < errors[4]["exact"] / 1.8, errors
    for count in errors:
        assert errors[count]["exact"] < 1.4 * errors[count]["seen"], errors
    assert errors[64]["counted"] > 2.0 * errors[64]["exact"], errors
    assert np.mean(found["counted"]) < -0.05, found


def test_semi_markov_fit_continues_from_given_skill(make_demonstrations):
    """Its first likelihood is no lower than the last of the one before."""
    demos, rng = make_demonstrations(lengths=(30, 36)), np.random.default_rng(0)
    fit = learn_semi_markov(demos, states=3, rng=rng, duration_model=DurationModel(Poisson()))
    duration_model = DurationModel(Poisson(), max_duration=36)
    again = learn_semi_markov(
        demos, states=3, rng=rng, initialisation=FromModel(fit.skill), duration_model=duration_model
    )
    assert again.log_likelihoods[0] >= fit.log_likelihoods[-1] - 1e-3 * abs(fit.log_likelihoods[-1])
    assert isinstance(again.markov_skill.dynamics, MarkovChain)
    markov = learn_markov(demos, states=3, rng=rng, initialisation=FromModel(fit.skill))
    np.testing.assert_allclose(markov.skill.dynamics.transitions.sum(axis=1), 1.0)


def test_max_duration_too_short_raises(rng):
    """One state after the other for 20 steps each, but visits of 5 at most, and no way back nor on."""
    x = np.repeat([[0.0], [50.0]], 20, axis=0) + 0.1 * rng.normal(size=(40, 1))
    demo = demonstration(x, 0.1, PLACE, (), "long visits")
    with pytest.raises(InvalidInput, match=r"5 steps a visit.*raise longest"):
        learn_semi_markov(
            [demo],
            states=2,
            rng=rng,
            duration_model=DurationModel(censoring=Censoring(right=False), max_duration=5),
        )


def test_one_state_and_one_demonstration_are_enough(rng):
    demo = demonstration(rng.normal(size=(12, 1)), 0.1, PLACE, (), "one")
    fit = learn_semi_markov([demo], states=1, rng=rng)
    np.testing.assert_array_equal(fit.skill.dynamics.transitions, [[0.0]])
    np.testing.assert_allclose(log_likelihood(fit.skill, [demo]), fit.log_likelihoods[-1])


def test_semi_markov_state_without_data_is_dropped_with_its_segments(rng, make_demonstrations):
    demos = make_demonstrations(stops=2, frames=1)
    model = learn_semi_markov(demos, states=2, rng=rng).skill
    far = np.full_like(model.means[:, :1], 1e3)
    durations = GaussianDurations(np.full(3, 8.0), np.full(3, 4.0))
    initialisation = HiddenModel(
        SemiMarkovChain(np.full(3, 1 / 3), (1 - np.eye(3)) / 2, durations),
        np.concatenate([model.means, far], axis=1),
        tuple(DenseCovariances(np.concatenate([c.dense, np.eye(2)[None]])) for c in model.covariances),
    )
    fit = learn_semi_markov(demos, states=3, rng=rng, initialisation=FromModel(initialisation))
    assert fit.skill.states == 2
    assert "state 2 of 3" in fit.convergence.dropped[0]
    assert np.isfinite(fit.skill.dynamics.durations.means).all()


def test_invalid_arguments_raise(rng, make_demonstrations):
    with pytest.raises(InvalidInput, match="longest is 0"):
        DurationModel(max_duration=0)
    with pytest.raises(InvalidInput, match=r"pf\.LogNormal\(\)"):
        DurationModel(distribution=Gaussian)
    with pytest.raises(InvalidInput, match="without durations"):
        fit_semi_markov_chain(
            KMeans().initial_statistics(views(make_demonstrations()), 2, rng), None, DurationModel(), 1.0
        )


@pytest.mark.parametrize(
    "law", [Gaussian(), Poisson(), Histogram(1.0)], ids=lambda distribution: distribution.label
)
def test_max_duration_beyond_recordings_changes_nothing(make_demonstrations, distribution):
    """It sized arrays: a fit of 40 rows took half a minute with a million steps, and no memory held 10^9."""
    demos = make_demonstrations(lengths=(30, 36))
    fits = [
        learn_semi_markov(
            demos,
            states=2,
            rng=np.random.default_rng(0),
            duration_model=DurationModel(distribution, max_duration=max_duration),
        )
        for max_duration in (36, 10**6, 2**31 - 1)
    ]
    for fit in fits[1:]:
        np.testing.assert_array_equal(fit.log_likelihoods, fits[0].log_likelihoods)
        np.testing.assert_array_equal(fit.skill.means, fits[0].skill.means)
    with pytest.raises(InvalidInput, match=r"longest is 1000000000000, expected a whole number from 1"):
        DurationModel(distribution, max_duration=10**12)
