"""Invalid human models, subtasks and plans are refused with the value and the expected range."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pilotfish.environments.human import DemonstrationPlan, HumanModel, Subtask
from pilotfish.environments.human.demonstration_plan import within_tolerance
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, from_rotation_vector

SUBTASK = Subtask("go", lambda frames: frames["goal"], 0.01, 0.1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"peak_speed": 0.0}, "peak_speed is 0.0, expected a positive number"),
        ({"min_duration": float("inf")}, "min_duration is inf, expected a positive number"),
        ({"tau_e": float("nan")}, "tau_e is nan"),
        ({"timeout": -1.0}, "timeout is -1.0"),
        ({"parallel_noise": -0.1}, "parallel_noise is -0.1, expected 0 or more"),
        ({"min_noise": float("nan")}, "min_noise is nan"),
        ({"reaction_time": float("inf")}, "reaction_time is inf"),
        ({"gain": 2.0}, "gain is 2.0, expected less than 2"),
        ({"phase_margin": 35.0}, "phase_margin is 35.0 rad, .*math.radians"),
    ],
)
def test_human_model_invalid_number_is_refused(changes: dict[str, float], message: str):
    with pytest.raises(InvalidInput, match=message):
        replace(HumanModel(), **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"position_tolerance": 0.0},
            "position_tolerance of subtask 'go' is 0.0, expected a positive number",
        ),
        ({"angle_tolerance": float("nan")}, "angle_tolerance of subtask 'go' is nan"),
        ({"speed_factor": -1.0}, "speed_factor of subtask 'go' is -1.0"),
        ({"grip": 1.5}, r"grip of subtask 'go' is 1.5, expected 0 \(open\) to 1 \(closed\)"),
        ({"dwell": -0.1}, "dwell of subtask 'go' is -0.1 s"),
        ({"passing": True, "dwell": 1.0}, "'go' is passing, expected no dwell"),
        ({"passing": True, "tracking": True}, "'go' is passing, expected no dwell and no tracking"),
    ],
)
def test_subtask_invalid_number_is_refused(changes: dict[str, Any], message: str):
    with pytest.raises(InvalidInput, match=message):
        replace(SUBTASK, **changes)


@pytest.mark.parametrize(
    ("subtasks", "round_trip", "message"),
    [
        ((), 0.0, "subtasks is empty, expected at least one Subtask"),
        ((SUBTASK,), -0.5, "round_trip is -0.5 s, expected 0 or more"),
        ((SUBTASK,), float("inf"), "round_trip is inf s"),
    ],
)
def test_demonstration_plan_invalid_argument_is_refused(
    subtasks: tuple[Subtask, ...], round_trip: float, message: str
):
    with pytest.raises(InvalidInput, match=message):
        DemonstrationPlan(HumanModel(), subtasks, round_trip)


def test_within_tolerance_requires_both_tolerances():
    goal = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    turned = from_rotation_vector(np.array([0.0, 0.09, 0.0]))
    assert within_tolerance(Pose(np.array([0.009, 0.0, 0.0]), -turned), goal, SUBTASK)
    assert not within_tolerance(Pose(np.array([0.011, 0.0, 0.0]), turned), goal, SUBTASK)
    assert not within_tolerance(
        Pose(np.zeros(3), from_rotation_vector(np.array([0.0, 0.11, 0.0]))), goal, SUBTASK
    )
