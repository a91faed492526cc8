"""Covariance structures inside expectation-maximisation: likelihood, parameter counts and adaptation."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import (
    EMLLT,
    HDDC,
    MFA,
    MLT,
    MPPCA,
    DenseCovariances,
    Full,
    LatentCovariances,
    SemiTied,
)
from pilotfish.io import datasets
from pilotfish.models import (
    EMSettings,
    KMeans,
    MarkovChain,
    MixtureWeights,
    TimeBins,
    adapt,
    expected_statistics,
    learn,
    maximise_likelihood,
    semi_markov_parameter_count,
)
from pilotfish.models.degrees_of_freedom import degrees_of_freedom

STRUCTURES = [
    MFA(1),
    MFA(2),
    MPPCA(1),
    HDDC(2),
    HDDC((2, 1, 1)),
    HDDC(0.8),
    EMLLT(5),
    MLT(2),
]


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: s.label)
@pytest.mark.parametrize("frames", [1, 2])
@pytest.mark.parametrize("chain", [MarkovChain.fit, MixtureWeights.fit])
@pytest.mark.parametrize("initialisation", [TimeBins(1.0), KMeans()], ids=["bins", "k-means"])
def test_em_without_regularisation_is_monotone(
    rng, make_demonstrations, structure, frames, chain, initialisation
):
    """Every step gains, up to rounding."""
    data = views(make_demonstrations(frames=frames, width=3, stops=3, lengths=(50, 60, 31), noise=0.3))
    model = maximise_likelihood(initialisation.initial_statistics(data, 3, rng), None, structure, 0.0, chain)
    values = []
    for _ in range(12):
        statistics = expected_statistics(model, data)
        values.append(statistics.log_likelihood)
        model = maximise_likelihood(statistics, model, structure, 0.0, chain)
    assert np.diff(values).min() > -1e-9 * abs(values[-1])


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: s.label)
def test_em_full_after_structure_is_at_least_as_likely(rng, make_demonstrations, structure):
    """Full covariances contain every structure."""
    demos, settings = (
        make_demonstrations(width=3, stops=3, noise=0.3),
        EMSettings(regularisation=0.0, max_iterations=20),
    )
    model = learn(demos, states=3, rng=rng, dynamics="markov", structure=structure, settings=settings).skill
    statistics = expected_statistics(model, views(demos))
    free = maximise_likelihood(statistics, None, Full(), 0.0, MarkovChain.fit)
    rounding = 1e-9 * abs(statistics.log_likelihood)
    assert expected_statistics(free, views(demos)).log_likelihood >= statistics.log_likelihood - rounding


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: s.label)
@pytest.mark.parametrize("dynamics", ["semi-markov", "mixture"])
def test_adapt_structured_skill_equals_dense_skill(rng, make_demonstrations, structure, dynamics):
    demos = make_demonstrations(width=3, noise=0.3)
    skill = learn(demos, states=3, rng=rng, dynamics=dynamics, structure=structure).skill
    assert skill.provenance.structure == structure.label
    dense = replace(skill, covariances=tuple(DenseCovariances(c.dense) for c in skill.covariances))
    structured, expected = (adapt(s, demos[0].frames) for s in (skill, dense))
    np.testing.assert_allclose(structured.means, expected.means, atol=1e-12)
    np.testing.assert_allclose(structured.covariances, expected.covariances, atol=1e-12)


@pytest.mark.parametrize("structure", [MFA(4), MPPCA(4), HDDC(0.9), EMLLT(24), MLT(2)], ids=lambda s: s.label)
def test_em_valve_recordings_is_monotone(rng, data_folder, monkeypatch, structure):
    """Valve opening, 14 columns in two frames, with the smallest regularisation that prevents a collapse."""
    monkeypatch.setenv("PILOTFISH_DATA", str(data_folder))
    data = views(datasets.valve()[:4])
    model = maximise_likelihood(
        TimeBins(0.5).initial_statistics(data, 5, rng), None, structure, 1e-6, MarkovChain.fit
    )
    values = []
    for _ in range(8):
        statistics = expected_statistics(model, data)
        values.append(statistics.log_likelihood)
        model = maximise_likelihood(statistics, model, structure, 1e-6, MarkovChain.fit)
    assert np.diff(values).min() > 0.0


@pytest.mark.parametrize(
    ("structure", "states", "count"),
    [(MFA(4), 3, 267), (MFA(4), 4, 360), (HDDC((4, 3, 4)), 3, 211 + 3), (HDDC((5, 5, 4, 3)), 4, 318 + 4)],
)
def test_parameter_count_latent_models_equals_table_5_1(structure, states, count):
    """Tanwani 2018, table 5.1: D = 14; it omits the noise of subspaces, one number per state."""
    assert semi_markov_parameter_count(structure, states, 14) == count


def test_parameter_count_after_fit_equals_sum_over_frames(rng, make_demonstrations):
    """Counts known before the fit are the same after it; HDDC by explained variance is counted after it."""
    demos = make_demonstrations(width=4, noise=0.3)
    for structure in (MFA(2), SemiTied(), Full()):
        skill = learn(demos, states=3, rng=rng, structure=structure).skill
        known = 2 * structure.parameter_count(3, 4)
        assert structure.fitted_parameter_count(skill.covariances) == known
        dynamics = skill.dynamics.degrees_of_freedom()
        covariances = degrees_of_freedom(skill, structure) - dynamics - skill.means.size
        assert covariances == 2 * structure.degrees_of_freedom(3, 4)
    skill = learn(demos, states=3, rng=rng, structure=HDDC(0.8)).skill
    expected = 0
    for c in skill.covariances:
        assert isinstance(c, LatentCovariances)
        expected += int((4 * c.factors + 1).sum())
    assert HDDC(0.8).fitted_parameter_count(skill.covariances) == expected
    with pytest.raises(InvalidInput, match=r"structure\.fitted"):
        HDDC(0.8).parameter_count(3, 4)
