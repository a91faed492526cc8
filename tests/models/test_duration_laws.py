"""The likeliest durations for visits, of which recordings cut some off."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import optimize, stats
from scipy.special import logsumexp

from pilotfish.errors import InvalidInput
from pilotfish.models import (
    Gamma,
    GaussianDurations,
    Histogram,
    HistogramDurations,
    LogNormal,
    LogNormalDurations,
    NegativeBinomial,
    NegativeBinomialDurations,
    Normal,
    Poisson,
    PoissonDurations,
    Visits,
)
from pilotfish.models.duration_laws import _completed
from pilotfish.models.duration_negative_binomial import _best_shapes
from pilotfish.models.durations_fit import Family, completed_visits, evaluated
from pilotfish.models.visits import lengths_seen, whole_visits

LAWS = [Normal(), LogNormal(), Gamma(), Poisson(), NegativeBinomial(), NegativeBinomial(1.0), Histogram()]
S, K = 24, 3


def some_visits(rng, kinds=4):
    """Visits about lengths that differ from state to state; the first kinds of the four."""
    places = rng.uniform(3.0, 15.0, size=K)
    counts = np.zeros((4, S, K))
    for kind in range(kinds):
        for k in range(K):
            lengths = np.clip(rng.normal(places[k], 3.0, size=8).round(), 1, S).astype(int)
            np.add.at(counts[kind, :, k], lengths - 1, rng.uniform(0.1, 2.0, size=8))
    return Visits(*counts)


def log_likelihood(durations, visits):
    """State by state, by definition."""
    N = 1500  # nothing lasts longer that matters
    log_p = durations.log_table(N)
    steps = np.arange(1.0, N + 1)[:, None]
    log_mean = logsumexp(log_p, b=steps, axis=0)
    total = np.zeros(visits.whole.shape[1])
    with np.errstate(divide="ignore"):
        for d in range(1, len(visits.whole) + 1):
            longer = logsumexp(log_p[d - 1 :], axis=0)
            excess = logsumexp(log_p[d - 1 :], b=steps[: N - d + 1], axis=0)
            for counts, log_weight in (
                (visits.whole, log_p[d - 1]),
                (visits.goes_on, longer),
                (visits.had_begun, longer - log_mean),
                (visits.fills, excess - log_mean),
            ):
                total += np.where(counts[d - 1] > 0.0, counts[d - 1] * np.maximum(log_weight, -1e9), 0.0)
    return total


def moved(durations, rng, size):
    """The same law with other parameters nearby."""
    if isinstance(durations, HistogramDurations):
        p = durations.probabilities * np.exp(size * rng.normal(size=durations.probabilities.shape))
        return HistogramDurations(p / p.sum(axis=0))
    new = {f.name: getattr(durations, f.name) * np.exp(size * rng.normal(size=K)) for f in fields(durations)}
    if isinstance(durations, GaussianDurations):
        new["means"] = np.maximum(new["means"], 1.0)  # its family has its peak there or later
    if isinstance(durations, NegativeBinomialDurations):
        new["leaving"] = np.minimum(new["leaving"], 1.0 - 1e-6)
        if (durations.shapes == 1.0).all():
            new["shapes"] = np.ones(K)
    return type(durations)(**new)


@pytest.mark.parametrize("kinds", [1, 2, 3, 4])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.label)
def test_no_law_nearby_is_likelier(rng, law, kinds):
    """Whole visits, and those cut off at the end, at the beginning, and at both, against definitions."""
    visits, durations = some_visits(rng, kinds), None
    if law == NegativeBinomial() and kinds > 1:
        pytest.skip("its shape is approached in many iterations where visits are cut off")
    for _ in range(60 if isinstance(law, Histogram) else 1):
        durations = law.estimate(visits, durations, 1e-3)
    best = log_likelihood(durations, visits)
    for size in (0.3, 0.03, 0.003):
        for _ in range(3):
            other = log_likelihood(moved(durations, rng, size), visits)
            assert (other <= best + 1e-5 * np.abs(best)).all()


@pytest.mark.parametrize("kinds", [1, 4])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.label)
def test_an_estimate_is_at_least_as_likely_as_the_law_before(rng, law, kinds):
    """From wherever it goes on, also where the visits lie far in the tails of the law before."""
    visits = some_visits(rng, kinds)
    for size in (0.01, 0.4):
        previous = moved(law.estimate(some_visits(rng), None, 0.25), rng, size)
        after = law.estimate(visits, previous, 0.25)
        before = log_likelihood(previous, visits)
        assert (log_likelihood(after, visits) >= before - 1e-9 * np.abs(before)).all()


def test_gradient_and_information_are_derivatives_of_the_log_likelihood(rng):
    """Finite differences, with visits cut off in every way."""
    visits = some_visits(rng)
    wide = np.full((2, K), np.inf)
    family = Family(
        lambda s: np.stack([np.log(s), s * 1.0], axis=1), lambda s: np.zeros((len(s), 1)), -wide, wide
    )
    theta = np.stack([rng.uniform(0.5, 3.0, K), rng.uniform(-0.9, -0.2, K)])
    here, h = evaluated(family, visits, theta), 1e-5
    for q in range(2):
        shift = h * np.eye(2)[:, q, None]
        above, below = (evaluated(family, visits, theta + sign * shift) for sign in (1, -1))
        np.testing.assert_allclose((above.value - below.value) / (2 * h), here.gradient[q], rtol=1e-6)
        curvature = (above.gradient - below.gradient) / (2 * h)
        np.testing.assert_allclose(-curvature.T, here.information[:, q], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(
    "law", [Normal(), LogNormal(), Gamma(), Poisson(), NegativeBinomial()], ids=lambda law: law.label
)
def test_visits_that_last_alike_leave_a_law_of_some_width(law):
    """Three visits of 20 steps: the mean is theirs, the deviation the floor's or the law's own."""
    counts = np.zeros((30, 1))
    counts[19] = 3.0
    durations = law.estimate(whole_visits(counts), None, 4.0)
    np.testing.assert_allclose(durations.means, 20.0, rtol=1e-2)
    if law.label in ("normal", "log-normal", "gamma"):
        np.testing.assert_allclose(durations.deviations, 2.0, rtol=2e-2)
    else:
        np.testing.assert_allclose(durations.deviations, np.sqrt(19.0), rtol=2e-2)


@pytest.mark.parametrize("kinds", [1, 4])
def test_the_shape_is_the_best_for_visits_spread_over_what_they_may_have_lasted(rng, kinds):
    """No shape nearby, with the leaving that suits it best, is likelier; visits met at random too."""
    visits = some_visits(rng, kinds)
    shapes, staying = np.array([2.0, 3.0, 1.5]), np.array([0.7, 0.6, 0.8])
    before = NegativeBinomialDurations(shapes, 1.0 - staying)
    log_p = before.log_table(400)
    counts = completed_visits(log_p, visits)
    met = (visits.had_begun + visits.fills).sum(axis=0)
    found = _best_shapes(visits, shapes, staying)
    more = np.arange(400)

    def best(k, r):
        def loss(p):
            log_q = stats.nbinom.logpmf(more, r, p)
            return met[k] * np.log(1.0 + r * (1.0 - p) / p) - counts[:, k] @ log_q

        return -optimize.minimize_scalar(loss, bounds=(1e-4, 1 - 1e-6), method="bounded").fun

    for k in range(K):
        beside = (0.9, 1.1) if found[k] < 9e3 else (0.9,)  # no shape is larger than 1e4
        assert best(k, found[k]) >= max(best(k, near * found[k]) for near in beside) - 1e-7


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.label)
def test_a_state_without_visits_keeps_its_law_and_one_visit_is_enough(rng, law):
    visits = some_visits(rng, 2)
    previous = law.estimate(visits, None, 1.0)
    none = replace(visits, whole=visits.whole * [0, 1, 1], goes_on=visits.goes_on * [0, 1, 1])
    np.testing.assert_allclose(law.estimate(none, previous, 1.0).means[0], previous.means[0])
    one = np.zeros((S, K))
    one[7] = [1.0, 0.0, 1e-9]
    alone = law.estimate(whole_visits(one), None, 1.0)
    np.testing.assert_allclose(alone.means[[0, 2]], 8.0, rtol=0.3)
    assert np.isfinite(alone.means).all()
    assert (alone.deviations >= 0.0).all()


def test_whole_visits_of_a_histogram_are_its_frequencies(rng):
    visits = whole_visits(rng.uniform(size=(9, 2)))
    p = Histogram().estimate(visits, None, 1.0).probabilities
    np.testing.assert_allclose(p, visits.whole / visits.whole.sum(axis=0))
    spread = Histogram(pseudocount=2.0).estimate(visits, None, 1.0).probabilities
    expected = (visits.whole + 2.0 / 9) / (visits.whole.sum(axis=0) + 2.0)
    np.testing.assert_allclose(spread, expected)


@pytest.mark.parametrize("kinds", [1, 2, 3, 4])
@pytest.mark.parametrize("least", [1e-3, 1e-200, 1e-320, 0.0])
def test_visits_are_completed_alike_by_numbers_and_by_logarithms(rng, kinds, least):
    """Also where long visits have hardly any probability, or none: who was met there counts all the same."""
    visits = some_visits(rng, kinds)
    p = rng.dirichlet(np.ones(len(visits.whole)), size=visits.whole.shape[1]).T
    p[len(p) // 2 :] *= least
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = completed_visits(np.log(p), visits)
        found = _completed(p, visits)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-200)


def test_visits_cut_off_at_the_end_give_the_product_limit(rng):
    """Kaplan and Meier 1958: p(s > d) is the product over s <= d of 1 - ended(s) / at risk(s)."""
    visits, durations = some_visits(rng, 2), None
    last = np.zeros((S, K))
    last[-1] = 1.0  # a whole visit of the greatest length: no mass is left beyond
    visits = replace(visits, whole=visits.whole + last)
    for _ in range(300):
        durations = Histogram().estimate(visits, durations, 1.0)
    seen = visits.whole + visits.goes_on
    at_risk = np.cumsum(seen[::-1], axis=0)[::-1] - visits.goes_on  # d steps seen: not known to last longer
    survival = np.cumprod(1.0 - visits.whole / at_risk, axis=0)
    np.testing.assert_allclose(1.0 - np.cumsum(durations.probabilities, axis=0), survival, atol=1e-6)


def test_the_geometric_law_leaves_as_often_as_was_seen(rng):
    """Shape one: departures over steps, visits cut off by the end counting only as steps."""
    visits = some_visits(rng, 2)
    durations = NegativeBinomial(1.0).estimate(visits, None, 1.0)
    steps = np.arange(1.0, S + 1) @ (visits.whole + visits.goes_on)
    departures = visits.whole.sum(axis=0)
    np.testing.assert_allclose(
        durations.leaving, departures / (steps - visits.goes_on.sum(axis=0)), rtol=1e-6
    )


def test_lengths_seen_are_pooled_where_a_state_has_none():
    counts = np.zeros((5, 2))
    counts[[1, 3], 0] = 1.0
    means, variances = lengths_seen(whole_visits(counts))
    np.testing.assert_allclose(means, [3.0, 3.0])
    np.testing.assert_allclose(variances, [1.0, 1.0])


def test_visits_add_up_whatever_their_longest(rng):
    a, b = some_visits(rng), Visits(*np.ones((4, S + 3, K)))
    total = a + b
    for f in fields(total):
        np.testing.assert_allclose(getattr(total, f.name).sum(), getattr(a, f.name).sum() + K * (S + 3))
        np.testing.assert_array_equal(getattr(total, f.name), getattr(b + a, f.name))


def test_a_law_goes_on_from_its_own_kind_and_begins_anew_from_another(rng):
    visits = some_visits(rng, 1)
    other = GaussianDurations(np.full(K, 500.0), np.ones(K))
    for law, kind in ((LogNormal(), LogNormalDurations), (Poisson(), PoissonDurations)):
        found = law.estimate(visits, other, 1.0)
        assert type(found) is kind
        np.testing.assert_allclose(found.means, lengths_seen(visits)[0], rtol=0.1)


def test_nonsense_is_refused():
    with pytest.raises(InvalidInput, match="pseudocount is -1"):
        Histogram(-1.0)
    with pytest.raises(InvalidInput, match="shape is 0"):
        NegativeBinomial(0.0)


@pytest.mark.parametrize("law", [Gamma(), Poisson()], ids=lambda law: law.label)
def test_parameters_may_change_their_sign_on_the_way(law):
    """A shape from below one to above it, a mean from below two steps to above: not stuck at the turn."""
    counts = np.zeros((30, 1))
    counts[[0, 1, 2]] = [[8.0], [1.0], [1.0]]
    before = law.estimate(whole_visits(counts), None, 1.0)
    counts = np.zeros((30, 1))
    counts[10:16] = 1.0
    after = law.estimate(whole_visits(counts), before, 1.0)
    for _ in range(10):
        after = law.estimate(whole_visits(counts), after, 1.0)
    np.testing.assert_allclose(after.means, 13.5, rtol=1e-3)
