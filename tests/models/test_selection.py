"""The right size of a model is found on demonstrations that it did not learn from."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import views, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import Diagonal, Full, SemiTied
from pilotfish.models import (
    Candidate,
    DurationModel,
    EMSettings,
    KMeans,
    MarkovChain,
    MixtureWeights,
    Score,
    Selection,
    SemiMarkovChain,
    bic,
    degrees_of_freedom,
    learn,
    log_likelihood,
    select,
)
from pilotfish.models.durations import (
    Gamma,
    Gaussian,
    Histogram,
    LogNormal,
    NegativeBinomial,
    Poisson,
    Segments,
)


def candidate(states=3, structure=None, **options):
    return Candidate(states, structure or Full(), **options)


def use_world_frame(demos):
    return [replace(d, frames=(world_frame(d.layout.width),)) for d in demos]


@pytest.mark.parametrize(("dynamics", "count"), [("semi-markov", 6), ("markov", 3), ("mixture", 3)])
def test_degrees_of_freedom_left_right_skill_equals_count_by_hand(rng, make_demonstrations, dynamics, count):
    """Four states, two frames, two columns: 16 means, 24 covariances, and the dynamics.

    Left-right: three states may stay or go on (3), the last stays and the first begins. Counted: three
    durations of a mean and a deviation. A mixture: four weights that sum to one.
    """
    demos = make_demonstrations(stops=4, noise=0.02)
    skill = learn(demos, states=4, rng=rng, dynamics=dynamics).skill
    assert degrees_of_freedom(skill, Full()) == 16 + 24 + count


def test_tied_directions_are_counted_once(rng, make_demonstrations):
    """D^2 entries of a basis whose D lengths mean nothing, and K D variances, in each frame."""
    skill = learn(
        make_demonstrations(width=3), states=3, rng=rng, structure=SemiTied(), dynamics="mixture"
    ).skill
    assert degrees_of_freedom(skill, SemiTied()) == 2 * (3 * 3 + (9 - 3) + 3 * 3) + 2


def test_degrees_of_freedom_zero_probabilities_do_not_count():
    initial, rows = np.array([0.5, 0.5, 0.0]), np.array([[0, 0.3, 0.7], [1.0, 0, 0], [0, 0, 0]])
    durations = Histogram(np.array([[0.2, 0.0, 1.0], [0.3, 1.0, 0.0], [0.5, 0.0, 0.0]]))
    assert MixtureWeights(initial).degrees_of_freedom() == 1
    assert MarkovChain(initial, np.full((3, 3), 1.0 / 3.0)).degrees_of_freedom() == 1 + 6
    assert SemiMarkovChain(initial, rows, durations).degrees_of_freedom() == 1 + 1 + 2


@pytest.mark.parametrize(
    ("distribution", "count"),
    [(Gaussian, 2), (LogNormal, 2), (Gamma, 2), (Poisson, 1), (NegativeBinomial, 2)],
)
def test_degrees_of_freedom_durations_of_non_final_states_count(distribution, count):
    """A fixed shape does not count."""
    counts = np.zeros((12, 3))
    counts[3:9] = 1.0
    rows = np.array([[0, 1.0, 0], [0, 0, 1.0], [0, 0, 0]])
    chain = SemiMarkovChain(np.eye(3)[0], rows, distribution.fit(Segments.all_uncensored(counts)))
    assert chain.degrees_of_freedom() == 2 * count
    geometric = DurationModel(NegativeBinomial, options={"shape": 1.0})
    durations = geometric.fit(Segments.all_uncensored(counts), None, 1.0)
    chain = SemiMarkovChain(np.eye(3)[0], rows, durations)
    assert chain.degrees_of_freedom(geometric.fixed_parameters) == 2


def test_bic_is_that_of_one_gaussian_in_closed_form(rng, make_demonstrations):
    """One state, one frame: N/2 (log |2 pi e S|) nats and D + D (D + 1) / 2 parameters."""
    demos = [replace(d, frames=d.frames[:1]) for d in make_demonstrations(width=2)]
    settings = EMSettings(regularisation=0.0)
    one = candidate(states=1, dynamics="mixture")
    score = select(demos, [one], rng=rng, settings=settings).scores[0]
    x = views(demos).x[0]
    nats = -0.5 * len(x) * np.linalg.slogdet(2.0 * np.pi * np.e * np.cov(x.T, bias=True))[1]
    assert score.parameters == 5
    np.testing.assert_allclose(score.log_likelihood, nats, rtol=1e-9)
    np.testing.assert_allclose(score.bic, -2.0 * nats + 5 * np.log(len(x)), rtol=1e-9)
    assert bic(-10.0, 3, 100) == 20.0 + 3 * np.log(100)


@pytest.mark.parametrize("dynamics", ["semi-markov", "markov", "mixture"])
def test_a_demonstration_is_scored_by_the_model_of_the_others(rng, make_demonstrations, dynamics):
    demos = make_demonstrations(lengths=(30, 42, 37))
    score = select(demos, [candidate(dynamics=dynamics)], rng=rng).scores[0]
    for m, nats in enumerate(score.held_out):
        others = [d for n, d in enumerate(demos) if n != m]
        skill = learn(others, states=3, rng=rng, dynamics=dynamics).skill
        np.testing.assert_allclose(nats, log_likelihood(skill, [demos[m]])[0] / len(demos[m].x))
    np.testing.assert_allclose(score.held_out_mean, score.held_out.mean())
    np.testing.assert_allclose(score.standard_error, score.held_out.std(ddof=1) / np.sqrt(3))


def test_the_number_of_places_is_found(rng, make_demonstrations):
    """Points that scatter about three places ask for three states, neither fewer nor more."""
    demos = use_world_frame(make_demonstrations(lengths=(40,) * 8, stops=3, noise=0.3))
    sizes = [candidate(states=K, initialisation=KMeans()) for K in (1, 2, 3, 4, 5)]
    found = select(demos, sizes, rng=rng)
    assert found.best.states == 3


def test_uncorrelated_columns_ask_for_no_more_than_variances(rng, make_demonstrations):
    demos = use_world_frame(make_demonstrations(lengths=(25,) * 4, width=4))
    found = select(demos, [candidate(), candidate(structure=Diagonal())], rng=rng)
    assert found.best.candidate.structure == Diagonal()
    assert found.lowest_bic.candidate.structure == Diagonal()


def test_failed_candidate_is_reported(rng, make_demonstrations):
    """Too many states for the shortest demonstration, and covariances that collapse."""
    heard = []
    tried = [candidate(), candidate(states=35), candidate(states=12)]
    rough = EMSettings(regularisation=0.0)
    found = select(
        make_demonstrations(lengths=(30, 42, 37)), tried, rng=rng, settings=rough, callback=heard.append
    )
    assert [failed.states for failed, _ in found.failures] == [35, 12]
    assert "35 states" in found.failures[0][1]
    assert "positive definite" in found.failures[1][1]
    assert heard == tried
    with pytest.raises(InvalidInput, match=r"no candidate.*35 states"):
        _ = Selection((), found.failures).best


def test_a_score_depends_on_the_seed_and_not_on_the_other_candidates(make_demonstrations):
    demos = make_demonstrations(noise=1.0)
    one, other = candidate(states=4, initialisation=KMeans()), candidate(states=5, initialisation=KMeans())

    def score(candidates, seed):
        scores = select(demos, candidates, rng=np.random.default_rng(seed)).scores
        return next(s for s in scores if s.candidate is one).held_out

    np.testing.assert_array_equal(score([one, other], 7), score([other, one], 7))
    assert any(not np.array_equal(score([one], 7), score([one], seed)) for seed in range(5))


def make_selection(parameters, *held_out):
    return Score(candidate(), 3, parameters, 0.0, 0.0, np.array(held_out))


def test_the_best_is_the_smallest_that_loses_no_more_than_a_standard_error():
    """Losses are compared demonstration by demonstration; what some demonstrations rule out is not near."""
    top = make_selection(50, 3.0, 4.0, 8.0)
    near = make_selection(20, 2.9, 4.1, 7.9)  # loses .03, standard error .07
    steady = make_selection(10, 2.9, 3.9, 7.9)  # loses .1 each time
    never = make_selection(5, 9.0, 9.0, -np.inf)
    assert Selection((top, near, steady, never), ()).best is near
    assert Selection((top, near, steady, never), ()).highest_held_out is top
    assert Selection((top, steady, never), ()).best is top
    assert np.isnan(never.standard_error)


def test_select_with_too_little_data_raises(rng, make_demonstrations):
    with pytest.raises(InvalidInput, match="at least two"):
        select(make_demonstrations()[:1], [candidate()], rng=rng)
    with pytest.raises(InvalidInput, match="no candidates"):
        select(make_demonstrations(), [], rng=rng)
