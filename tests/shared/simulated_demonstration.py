"""A simulated person performs a task in physics."""

from collections.abc import Callable
from typing import Any

import numpy as np

from pilotfish.environments import Task, Workcell, human

OBSERVATION_PERIOD = 20  # ticks of 1 ms between two looks of the person


def simulate_human_demonstration(
    task: Task[Any],
    situation_from_seed: Any,
    rng: np.random.Generator,
    *,
    lag: float = 0.0,
    seconds: float | None = None,
    callback: Callable[[Workcell[Any]], None] = lambda _: None,
) -> Workcell[Any]:
    """Lead the arm through a task and return the workcell at the end.

    Args:
        task: The task whose script the person follows.
        situation: Where its objects are.
        rng: The person's randomness.
        lag: Time from a move of the hand to that of the tool [s], as the person expects it.
        seconds: When to stop at the latest; the task's own time by default.
        watch: Called with the workcell after each look.
    """
    cell = Workcell(task, situation_from_seed, lead=True)
    demonstration_plan = human.DemonstrationPlan(
        human.HumanModel(), task.demonstration_script(situation_from_seed), lag
    )
    human_state, done = human.initial_state(cell.arm.tool, 0.0), False
    while not done and cell.time < (seconds or task.time_limit):
        observation = human.Observation(cell.arm.tool, cell.frames())
        human_state, command = human.step_human(demonstration_plan, human_state, cell.time, observation, rng)
        cell.step_guidance(command.pose, command.grip, OBSERVATION_PERIOD)
        done = command.done
        callback(cell)
    return cell
