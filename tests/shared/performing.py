"""A simulated person performs a task in physics."""

from collections.abc import Callable
from typing import Any

import numpy as np

from pilotfish.environments import Task, Workcell, people

LOOK = 20  # ticks of 1 ms between two looks of the person


def perform_as_person(
    task: Task[Any],
    situation: Any,
    rng: np.random.Generator,
    *,
    lag: float = 0.0,
    seconds: float | None = None,
    watch: Callable[[Workcell[Any]], None] = lambda _: None,
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
    cell = Workcell(task, situation, lead=True)
    errand = people.Errand(people.Person(), task.script(situation), lag)
    doing, done = people.begin(cell.arm.tool, 0.0), False
    while not done and cell.time < (seconds or task.seconds):
        seen = people.Seen(cell.arm.tool, cell.frames())
        doing, wish = people.act_step(errand, doing, cell.time, seen, rng)
        cell.led(wish.pose, wish.grip, LOOK)
        done = wish.done
        watch(cell)
    return cell
