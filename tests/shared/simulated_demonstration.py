"""Simulate a person who performs a task in physics."""

from collections.abc import Callable
from typing import Any

import numpy as np

from pilotfish.environments import Task, Workcell, human

OBSERVATION_STEPS = 20  # of 1 ms between observations of the person


def simulate_human_demonstration(
    task: Task[Any],
    situation: Any,
    rng: np.random.Generator,
    *,
    lag: float = 0.0,
    seconds: float | None = None,
    callback: Callable[[Workcell[Any]], None] = lambda _: None,
) -> Workcell[Any]:
    """Guide the arm through a task and return the workcell at the end.

    Args:
        task: Task whose script the person follows.
        situation: Situation of the task.
        rng: Generator of the motor noise.
        lag: Time from a movement of the hand to that of the tool [s], as the person expects it.
        seconds: Longest duration; None takes that of the task.
        callback: Function that is called with the workcell after each observation.
    """
    cell = Workcell(task, situation, guided=True)
    demonstration_plan = human.DemonstrationPlan(
        human.HumanModel(), task.demonstration_script(situation), lag
    )
    state = human.initial_state(cell.arm.tool, 0.0)
    while not state.done and cell.time < (seconds or task.time_limit):
        observation = human.Observation(cell.arm.tool, cell.frames())
        state = human.step_human(demonstration_plan, state, cell.time, observation, rng)
        cell.step_guidance(state.hand, state.grip, OBSERVATION_STEPS)
        callback(cell)
    return cell
