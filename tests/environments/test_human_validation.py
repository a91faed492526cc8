"""People, acts and tasks that cannot be are refused in words that help."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pilotfish.environments.human import DemonstrationPlan, HumanModel, Subtask, within_tolerance
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, from_rotation_vector

ACT = Subtask("go", lambda frames: frames["goal"], 0.01, 0.1)


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
def test_impossible_people_are_refused(changes: dict[str, float], message: str):
    """The message names the number, what was expected and the nearest fix."""
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
        ({"speed": -1.0}, "speed of subtask 'go' is -1.0"),
        ({"grip": 1.5}, r"grip of subtask 'go' is 1.5, expected 0 \(open\) to 1 \(closed\)"),
        ({"dwell": -0.1}, "dwell of subtask 'go' is -0.1 s"),
        ({"passing": True, "dwell": 1.0}, "'go' is passing, expected no dwell"),
        ({"passing": True, "tracking": True}, "'go' is passing, expected no dwell and no tracking"),
    ],
)
def test_impossible_acts_are_refused(changes: dict[str, Any], message: str):
    """The message names the act, the number, and what was expected."""
    with pytest.raises(InvalidInput, match=message):
        replace(ACT, **changes)


@pytest.mark.parametrize(
    ("script", "round_trip", "message"),
    [
        ((), 0.0, "subtasks is empty, expected at least one Subtask"),
        ((ACT,), -0.5, "round_trip is -0.5 s, expected 0 or more"),
        ((ACT,), float("inf"), "round_trip is inf s"),
    ],
)
def test_impossible_tasks_are_refused(subtasks: tuple[Subtask, ...], round_trip: float, message: str):
    """A script has acts, a round trip takes a time."""
    with pytest.raises(InvalidInput, match=message):
        DemonstrationPlan(HumanModel(), subtasks, round_trip)


def test_within_means_both_tolerances():
    """Near enough and turned enough; the sign of a quaternion does not matter."""
    goal = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    turned = from_rotation_vector(np.array([0.0, 0.09, 0.0]))
    assert within_tolerance(Pose(np.array([0.009, 0.0, 0.0]), -turned), goal, ACT)
    assert not within_tolerance(Pose(np.array([0.011, 0.0, 0.0]), turned), goal, ACT)
    assert not within_tolerance(
        Pose(np.zeros(3), from_rotation_vector(np.array([0.0, 0.11, 0.0]))), goal, ACT
    )
