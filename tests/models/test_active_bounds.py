"""Bounds that decide a fit are reported; those that do not are not."""

from functools import cache

import numpy as np
import pytest

from pilotfish.demonstrations import Demonstration, demonstration, position_layout
from pilotfish.gaussians.structures import Diagonal, Full
from pilotfish.models import Candidate, DurationModel, EMSettings, Fit, learn, select, structure_notes

STAY, DEVIATION = 40, 0.1  # steps at each of three places, and the deviation there


@cache
def visits() -> tuple[Demonstration, ...]:
    rng, places = np.random.default_rng(0), np.repeat([[0.0], [1.0], [2.0]], STAY, axis=0)
    return tuple(
        demonstration(places + DEVIATION * rng.normal(size=places.shape), 0.1, position_layout(1), ())
        for _ in range(3)
    )


def fit_visits(max_duration: int | None = None, regularisation: float | None = None) -> Fit:
    return learn(
        visits(),
        states=3,
        rng=np.random.default_rng(0),
        durations=DurationModel(max_duration=max_duration),
        settings=EMSettings(regularisation=regularisation),
    )


def test_fit_with_maximum_duration_below_the_visits_names_it():
    free, bound = fit_visits(), fit_visits(max_duration=10)
    assert bound.log_likelihoods[-1] < free.log_likelihoods[-1] - 100.0
    (note,) = bound.active_bounds
    assert "max_duration is 10 steps" in note
    assert "states 0, 1 reach" in note
    assert "raise max_duration" in note


@pytest.mark.parametrize("max_duration", [None, 41, 60])
def test_fit_with_maximum_duration_above_the_visits_has_no_active_bound(max_duration: int | None):
    assert fit_visits(max_duration).active_bounds == ()


@pytest.mark.parametrize("regularisation", [None, 0.1 * DEVIATION**2])
def test_fit_with_small_regularisation_has_no_active_bound(regularisation: float | None):
    assert fit_visits(regularisation=regularisation).active_bounds == ()


def test_fit_with_regularisation_far_above_the_variances_names_it():
    (note,) = fit_visits(regularisation=20.0 * DEVIATION**2).active_bounds
    assert "regularisation is 0.2, which is the variance of 3 of 3 states in frame 'world'" in note


def test_structure_notes_of_full_covariances_count_rows_per_state():
    """A column needs three: three demonstrations of 30 rows give as many to each of 30 states, two fewer."""
    rng = np.random.default_rng(0)
    plain = [demonstration(d.x[:30], 0.1, d.layout, ()) for d in visits()]
    enough = learn(plain, states=30, rng=rng, structure=Full()).skill
    few = learn(plain[:2], states=30, rng=rng, structure=Full()).skill
    diagonal = learn(plain[:2], states=30, rng=rng, structure=Diagonal()).skill
    assert enough.states == few.states == diagonal.states == 30
    assert structure_notes(enough) == structure_notes(diagonal) == ()
    (note,) = structure_notes(few)
    assert "datapoints for full covariances of 1 columns, expected at least 3" in note


def test_select_score_has_the_notes_of_its_fit():
    candidate = Candidate(states=3, structure=Full(), durations=DurationModel(max_duration=10))
    selection = select(visits(), [candidate], rng=np.random.default_rng(0))
    (score,) = selection.scores
    assert "max_duration is 10 steps" in score.notes[0]
