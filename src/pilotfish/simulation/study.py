"""The value of assistance under delay: conditions, operators and runs of a study of simulated missions.

A run is one mission: an operator does a task in one situation, in one condition. All conditions of a task are
run in the same situations, with the same seeds of motor noise, link and view: runs with the same number are
paired. Each operator has situations of his own, so that pairs are independent and can be resampled.

The conditions are four modes over round trips, displaced views and losses in bursts, and two arms in which
assistance could do harm. In one arm the skill belongs to a neighbouring object. In the other one the operator
aims at another place. Success then means that the tool was where the operator wanted it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import floor, radians

import numpy as np

from pilotfish.environments.human import HumanModel
from pilotfish.simulation.mission import MissionSettings
from pilotfish.simulation.teleoperation import Link
from pilotfish.teleop import MODES, ContractLimits, LinkSettings
from pilotfish.validation import shorten_repr

STANDARD, WRONG_SKILL, ASIDE = "standard", "wrong skill", "aside"
MAIN_TASKS, OTHER_TASKS = ("valve", "stab"), ("screwdriver", "carabiner")
ROUND_TRIPS = (0.0, 0.25, 0.5, 1.0, 2.0)  # s
LOSSES = (0.05, 0.3)
REFERENCE = 1.0  # s, round trip of losses, other tasks and arms
MEAN_BURST = 5.0  # datagrams
SITUATIONS = 5  # of each operator
DISPLACED_VIEW = Link(view_distance=0.03, view_angle=radians(5.0))
ASIDE_DISPLACEMENT = 0.1  # m, horizontally across the direction in which the robot faces
COMMAND_PERIOD = 0.02  # s
MAX_FALSE_ALARMS = 1.0  # per minute
CONTRACT = ContractLimits(mode_budgets=dict.fromkeys(MODES, 60.0))

NOISE_FREE = "noise-free"
OPERATORS: Mapping[str, HumanModel] = {
    "ordinary": HumanModel(),
    "careful": HumanModel(
        parallel_noise=0.05,
        perpendicular_noise=0.025,
        min_noise=0.0007,
        angular_noise=0.035,
        min_angular_noise=radians(0.35),
        reaction_time=0.35,
        peak_speed=0.15,
        peak_angular_speed=0.9,
        min_duration=0.5,
    ),
    "hasty": HumanModel(
        parallel_noise=0.1,
        perpendicular_noise=0.05,
        min_noise=0.0015,
        angular_noise=0.07,
        min_angular_noise=radians(0.75),
        reaction_time=0.2,
        peak_speed=0.32,
        peak_angular_speed=2.0,
        min_duration=0.28,
    ),
}
"""Operators by name. Precision costs time: standard deviations of the careful one are 0.7 times those of an
ordinary person at 0.6 times the speed, those of the hasty one about 1.45 times at 1.3 times the speed."""

PERFECT_OPERATOR = HumanModel(
    parallel_noise=0.0,
    perpendicular_noise=0.0,
    min_noise=0.0,
    angular_noise=0.0,
    min_angular_noise=0.0,
    gain=1.0,
)
"""Operator without motor noise, as fast as an ordinary person: no such person needs less time."""


@shorten_repr
@dataclass(frozen=True, slots=True)
class Condition:
    """What is the same in all runs that are compared with each other.

    Attributes:
        task: Name of the task.
        mode: Mode of the commands.
        round_trip: Delay of both directions together [s].
        loss: Share of the datagrams that are lost, in bursts, in each direction.
        view_off: Whether the operator's view is displaced by 3 cm and 5 degrees.
        arm: "standard", "wrong skill" or "aside".
    """

    task: str
    mode: str
    round_trip: float = REFERENCE
    loss: float = 0.0
    view_off: bool = False
    arm: str = STANDARD

    @property
    def name(self) -> str:
        """Name without the mode, for tables."""
        parts = [self.task, f"{self.round_trip:g} s"]
        parts += [f"loss {100 * self.loss:g} %"] * (self.loss > 0.0)
        parts += ["view off"] * self.view_off
        return ", ".join(parts + [self.arm] * (self.arm != STANDARD))


@shorten_repr
@dataclass(frozen=True, slots=True)
class StudyRun:
    """One mission of the study.

    Attributes:
        condition: What is compared.
        operator: Name of the operator.
        number: Number of the situation and of the seeds; runs with equal numbers are paired.
    """

    condition: Condition
    operator: str
    number: int

    @property
    def key(self) -> str:
        """Unique name of the run."""
        return f"{self.condition.name}, {self.condition.mode}, {self.operator} {self.number}"


def study_conditions(*, quick: bool = False) -> tuple[Condition, ...]:
    """Return the conditions of the three operators.

    Args:
        quick: Whether only a small part is studied, to try the command.
    """
    if quick:
        return _quick_conditions()
    conditions = [
        Condition(task, mode, round_trip, view_off=view_off)
        for task in MAIN_TASKS
        for round_trip in ROUND_TRIPS
        for view_off in (False, True)
        for mode in MODES
    ]
    conditions += [
        Condition(task, mode, loss=loss) for task in MAIN_TASKS for loss in LOSSES for mode in MODES
    ]
    conditions += [Condition(task, mode) for task in OTHER_TASKS for mode in MODES]
    return (*conditions, *_arms(MAIN_TASKS))


def _quick_conditions() -> tuple[Condition, ...]:
    standard = [
        Condition(task, mode, round_trip)
        for task in MAIN_TASKS
        for round_trip in (0.0, REFERENCE)
        for mode in MODES
    ]
    return (*standard, *_arms(("stab",)))


def _arms(tasks: Sequence[str]) -> list[Condition]:
    modes = ("direct", "shared")
    return [
        Condition(task, mode, arm=arm) for task in tasks for arm in (WRONG_SKILL, ASIDE) for mode in modes
    ]


def study_runs(*, quick: bool = False) -> tuple[StudyRun, ...]:
    """Return all runs, pairs close together, so that the first part of the study is balanced.

    The noise-free operator does the two main tasks at a round trip of 1 s in direct and shared control, in
    the situations of all operators.

    Args:
        quick: Whether only a small part is studied: one situation for each operator.
    """
    conditions = study_conditions(quick=quick)
    perfect = [Condition(task, mode) for task in MAIN_TASKS for mode in ("direct", "shared")]
    runs: list[StudyRun] = []
    for n in range(1 if quick else SITUATIONS):
        for index, operator in enumerate(OPERATORS):
            number = SITUATIONS * index + n
            runs += [StudyRun(condition, operator, number) for condition in conditions]
            runs += [StudyRun(condition, NOISE_FREE, number) for condition in perfect if not quick]
    return tuple(runs)


def allowed_silence(loss: float, period: float, mean_burst: float = MEAN_BURST) -> float:
    """Return how long messages may be missing because of a loss: the smallest multiple of 0.25 s [s].

    It is chosen so that less than once a minute, on average, they are missing for two periods more, when the
    link is declared lost. The losses are those of a chain of two states.

    Args:
        loss: Share of the datagrams that are lost.
        period: Time between two messages [s].
        mean_burst: Mean number of consecutive losses.
    """
    silence = 0.25
    bursts = 60.0 / period * loss / mean_burst  # per minute
    while loss > 0.0:
        lost = floor(silence / period) + 2  # messages in a row
        if bursts * (1.0 - 1.0 / mean_burst) ** (lost - 1) < MAX_FALSE_ALARMS:
            break
        silence += 0.25
    return silence


def mission_settings(run: StudyRun) -> MissionSettings:
    """Return the settings of the mission of a run.

    With losses, the jitter has time for lost commands. The budget needs none for lost reports, which do not
    count as a longer round trip.

    Args:
        run: Run of the study.
    """
    condition = run.condition
    link = LinkSettings(delay=condition.round_trip / 2)
    if condition.loss:
        link = replace(link, loss=condition.loss, mean_burst=MEAN_BURST)
    return MissionSettings(
        mode=condition.mode,
        forward=link,
        backward=link,
        view=DISPLACED_VIEW if condition.view_off else Link(),
        human_model=PERFECT_OPERATOR if run.operator == NOISE_FREE else OPERATORS[run.operator],
        jitter=allowed_silence(condition.loss, COMMAND_PERIOD),
        contract=CONTRACT,
        aside=np.array([0.0, ASIDE_DISPLACEMENT, 0.0]) if condition.arm == ASIDE else None,
        piece_steps=1,
    )


def skill_name(condition: Condition) -> str:
    """Return the name of the skill that a condition needs, as in `learn_study_skills`.

    Args:
        condition: Condition of a run.
    """
    return f"{condition.task}-neighbour" if condition.arm == WRONG_SKILL else condition.task
