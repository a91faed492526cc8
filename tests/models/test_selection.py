"""Model selection by held-out demonstrations, and degrees of freedom."""

from dataclasses import replace

import numpy as np
import pytest
from published import published_options

from pilotfish.demonstrations import views, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import Diagonal, Full, SemiTied
from pilotfish.models import (
    Candidate,
    EMSettings,
    KMeans,
    MarkovChain,
    MixtureWeights,
    Score,
    Selection,
    SemiMarkovChain,
    TimeBins,
    learn,
    log_likelihood,
    select,
)
from pilotfish.models.degrees_of_freedom import bic, degrees_of_freedom
from pilotfish.models.durations import (
    Gamma,
    Gaussian,
    Histogram,
    LogNormal,
    NegativeBinomial,
    Poisson,
    Segments,
)

DYNAMICS = ("semi-markov", "markov", "mixture")


def candidate(states=3, structure=None, dynamics="semi-markov", **options):
    return Candidate(states, structure or Full(), dynamics, **options)


def use_world_frame(demos):
    return [replace(d, frames=(world_frame(d.layout.width),)) for d in demos]


@pytest.mark.parametrize(("dynamics", "count"), [("semi-markov", 6), ("markov", 3), ("mixture", 3)])
def test_degrees_of_freedom_full_covariances_equal_count_by_hand(rng, make_demonstrations, dynamics, count):
    """Four states, two frames, two columns: 16 means, 24 covariances, and the dynamics.

    Left-right: three states may stay or go on (3), the last stays and the first begins. Counted durations:
    mean and deviation of three states. Mixture: four weights that sum to one.
    """
    demos = make_demonstrations(stops=4, noise=0.02)
    skill = learn(demos, states=4, rng=rng, dynamics=dynamics, **published_options()).skill
    assert degrees_of_freedom(skill, Full()) == 16 + 24 + count


def test_degrees_of_freedom_semi_tied_counts_shared_directions_once(rng, make_demonstrations):
    """D^2 entries of a basis without its D lengths, and K D variances, in each frame."""
    demos = make_demonstrations(width=3)
    skill = learn(demos, states=3, rng=rng, structure=SemiTied(), dynamics="mixture").skill
    assert degrees_of_freedom(skill, SemiTied()) == 2 * (3 * 3 + (9 - 3) + 3 * 3) + 2


def test_dynamics_degrees_of_freedom_zero_probabilities_are_not_free():
    initial, rows = np.array([0.5, 0.5, 0.0]), np.array([[0, 0.3, 0.7], [1.0, 0, 0], [0, 0, 0]])
    durations = Histogram(np.array([[0.2, 0.0, 1.0], [0.3, 1.0, 0.0], [0.5, 0.0, 0.0]]))
    assert MixtureWeights(initial).degrees_of_freedom() == 1
    assert MarkovChain(initial, np.full((3, 3), 1.0 / 3.0)).degrees_of_freedom() == 1 + 6
    assert SemiMarkovChain(initial, rows, durations).degrees_of_freedom() == 1 + 1 + 2


@pytest.mark.parametrize(
    ("distribution", "each"),
    [(Gaussian, 2), (LogNormal, 2), (Gamma, 2), (Poisson, 1), (NegativeBinomial, 2)],
    ids=lambda value: getattr(value, "name", None),
)
def test_duration_degrees_of_freedom_exclude_final_states(distribution, each):
    """Two of three states are left; a parameter that is fixed does not count."""
    counts = np.zeros((12, 3))
    counts[3:9] = 1.0
    segments = Segments.all_uncensored(counts)
    rows = np.array([[0, 1.0, 0], [0, 0, 1.0], [0, 0, 0]])
    chain = SemiMarkovChain(np.eye(3)[0], rows, distribution.fit(segments))
    assert chain.degrees_of_freedom() == 2 * each
    assert chain.degrees_of_freedom(1) == 2 * (each - 1)


def test_bic_one_gaussian_equals_closed_form(rng, make_demonstrations):
    """One state, one frame: N/2 (log |2 pi e S|) nats and D + D (D + 1) / 2 parameters."""
    demos = [replace(d, frames=d.frames[:1]) for d in make_demonstrations(width=2)]
    settings = EMSettings(regularisation=0.0)
    score = select(demos, [candidate(states=1, dynamics="mixture")], rng=rng, settings=settings).scores[0]
    x = views(demos).x[0]
    nats = -0.5 * len(x) * np.linalg.slogdet(2.0 * np.pi * np.e * np.cov(x.T, bias=True))[1]
    assert score.parameters == 5
    np.testing.assert_allclose(score.log_likelihood, nats, rtol=1e-9)
    np.testing.assert_allclose(score.bic, -2.0 * nats + 5 * np.log(len(x)), rtol=1e-9)
    assert bic(-10.0, 3, 100) == 20.0 + 3 * np.log(100)


@pytest.mark.parametrize("dynamics", DYNAMICS)
def test_select_held_out_equals_likelihood_under_model_of_others(rng, make_demonstrations, dynamics):
    demos = make_demonstrations(lengths=(30, 42, 37))
    score = select(demos, [candidate(dynamics=dynamics, initialisation=TimeBins())], rng=rng).scores[0]
    for m, nats in enumerate(score.held_out):
        others = [d for n, d in enumerate(demos) if n != m]
        skill = learn(others, states=3, rng=rng, dynamics=dynamics, initialisation=TimeBins()).skill
        np.testing.assert_allclose(nats, log_likelihood(skill, [demos[m]])[0] / len(demos[m].x))
    np.testing.assert_allclose(score.held_out_mean, score.held_out.mean())
    np.testing.assert_allclose(score.standard_error, score.held_out.std(ddof=1) / np.sqrt(3))


def test_select_three_clusters_gives_three_states(rng, make_demonstrations):
    demos = use_world_frame(make_demonstrations(lengths=(40,) * 8, stops=3, noise=0.3))
    candidates = [candidate(states=K, initialisation=KMeans()) for K in (1, 2, 3, 4, 5)]
    assert select(demos, candidates, rng=rng).best.states == 3


def test_select_uncorrelated_columns_gives_diagonal(rng, make_demonstrations):
    demos = use_world_frame(make_demonstrations(lengths=(25,) * 4, width=4))
    selection = select(demos, [candidate(), candidate(structure=Diagonal())], rng=rng)
    assert selection.best.candidate.structure == Diagonal()
    assert selection.lowest_bic.candidate.structure == Diagonal()


def test_select_failed_candidate_is_reported(rng, make_demonstrations):
    """Too many states for the shortest demonstration, and covariances that collapse.

    Twelve time bins of two or three points collapse without regularisation.
    """
    finished = []
    candidates = [candidate(states=K, initialisation=TimeBins()) for K in (3, 35, 12)]
    selection = select(
        make_demonstrations(lengths=(30, 42, 37)),
        candidates,
        rng=rng,
        settings=EMSettings(regularisation=0.0),
        callback=finished.append,
    )
    assert [failed.states for failed, _ in selection.failures] == [35, 12]
    assert "35 states" in selection.failures[0][1]
    assert "positive definite" in selection.failures[1][1]
    assert finished == candidates
    with pytest.raises(InvalidInput, match=r"no candidate.*35 states"):
        _ = Selection((), selection.failures).best


def test_select_score_depends_on_seed_not_on_other_candidates(make_demonstrations):
    demos = make_demonstrations(noise=1.0)
    four, five = (candidate(states=states, initialisation=KMeans()) for states in (4, 5))

    def held_out(candidates, seed):
        scores = select(demos, candidates, rng=np.random.default_rng(seed)).scores
        return next(score for score in scores if score.candidate is four).held_out

    np.testing.assert_array_equal(held_out([four, five], 7), held_out([five, four], 7))
    assert any(not np.array_equal(held_out([four], 7), held_out([four], seed)) for seed in range(5))


def make_score(parameters, *held_out):
    return Score(candidate(), 3, parameters, 0.0, 0.0, np.array(held_out))


def test_best_is_smallest_within_one_standard_error():
    """Losses are paired by demonstration; an infinite loss is never within the standard error."""
    top = make_score(50, 3.0, 4.0, 8.0)
    near = make_score(20, 2.9, 4.1, 7.9)  # loses .03, standard error .07
    steady = make_score(10, 2.9, 3.9, 7.9)  # loses .1 each time
    infinite = make_score(5, 9.0, 9.0, -np.inf)
    assert Selection((top, near, steady, infinite), ()).best is near
    assert Selection((top, near, steady, infinite), ()).highest_held_out is top
    assert Selection((top, steady, infinite), ()).best is top
    assert np.isnan(infinite.standard_error)


def test_select_too_little_data_is_refused(rng, make_demonstrations):
    with pytest.raises(InvalidInput, match="at least two"):
        select(make_demonstrations()[:1], [candidate()], rng=rng)
    with pytest.raises(InvalidInput, match="candidates is empty"):
        select(make_demonstrations(), [], rng=rng)
