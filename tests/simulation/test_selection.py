"""Selection by success: candidates are performed in the same situations, which no other command uses."""

import numpy as np
import pytest

from pilotfish.demonstrations import add_derivatives
from pilotfish.environments import TASKS
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import Full
from pilotfish.models import Candidate, learn
from pilotfish.planning import DEFAULT_CANDIDATE
from pilotfish.simulation import RecordedDemonstration, perform, select_by_success, situation_from_seed

VALVE, SITUATIONS = TASKS["valve"], 2


def test_select_by_success_scores_equal_executions_by_hand(
    valve_recordings: tuple[RecordedDemonstration, ...], unchecked: None
):
    demonstrations = [add_derivatives(recorded.demonstration) for recorded in valve_recordings]
    weighted, candidate = Candidate(frames="relevance"), Candidate(5, Full())
    finished: list[Candidate] = []
    selection = select_by_success(
        demonstrations, [candidate, weighted], VALVE, situations=SITUATIONS, callback=finished.append
    )
    assert [score.candidate for score in selection.scores] == [DEFAULT_CANDIDATE, candidate]
    assert [failed for failed, _ in selection.failures] == [weighted]
    assert (selection.fits, selection.executions) == (3, 2 * SITUATIONS)
    assert finished == [DEFAULT_CANDIDATE] * 2 + [candidate] * 2 + [weighted] * 2
    skill = learn(demonstrations, states=5, structure=Full(), rng=np.random.default_rng(0)).skill
    situation = situation_from_seed(VALVE, "selection", 0, 1)
    outcome = perform(skill, VALVE, situation).outcome
    assert selection.scores[1].values[1] == (not outcome.success)
    assert selection.scores[1].measures["error [rad]"][1] == pytest.approx(outcome.error)
    assert selection.scores[1].values.sum() == 0.0


def test_select_by_success_too_little_is_refused(valve_recordings: tuple[RecordedDemonstration, ...]):
    demonstrations = [add_derivatives(recorded.demonstration) for recorded in valve_recordings]
    with pytest.raises(InvalidInput, match="situations is 0"):
        select_by_success(demonstrations, [Candidate()], VALVE, situations=0)
    with pytest.raises(InvalidInput, match="at least two"):
        select_by_success(demonstrations[:1], [Candidate()], VALVE)
