"""How far a person has come with what they do."""

from dataclasses import dataclass, replace
from enum import Enum
from math import inf

import numpy as np

from pilotfish.environments.human.crossover import Sample
from pilotfish.environments.human.movements import Submovement
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float

Phase = Enum("Phase", ["MOVE_AND_WAIT", "TRACKING", "DONE"])


@dataclass(frozen=True, slots=True, eq=False)
class HumanState:
    """A person at work.

    time       of the last step [s]
    hand       where the hand was then
    grip       what it asks of the gripper
    act        index of the act, phase what is done for it
    act_began  time [s], and tries the sub-movements made since
    until      when the dwell is over [s]; infinite while the goal has not been reached
    near       since when a tracked goal is within tolerance [s]; infinite when it is not
    rest       where the hand rested before the moves that are not over
    at_rest    when the hand rests again, or rested [s]
    ahead      from the tool to the hand, as last seen when both rested [m], [rad]
    memory     what was seen of a moving goal and the tool, oldest first
    movements  sub-movements made in all: open-loop moves
    path       travelled by the hand [m]
    given_up   acts that were left without reaching their goal
    """

    time: float
    hand: Pose
    grip: float
    subtask: int
    phase: Phase
    subtask_start: float
    n_attempts: int
    dwell_end: float
    near_since: float
    rest_pose: Pose
    submovements: tuple[Submovement, ...]
    rest_time: float
    lead: Float[Array, " 6"]
    samples: tuple[Sample, ...]
    n_submovements: int
    path_length: float
    n_timeouts: int


def initial_state(tool: Pose, time: float, grip: float = 0.0) -> HumanState:
    """A person whose hand stands for the tool where it is, before the first act."""
    return HumanState(
        time=float(time),
        hand=tool,
        grip=grip,
        subtask=0,
        phase=Phase.MOVE_AND_WAIT,
        subtask_start=float(time),
        n_attempts=0,
        dwell_end=inf,
        near_since=inf,
        rest_pose=tool,
        submovements=(),
        rest_time=-inf,
        lead=np.zeros(6),
        samples=(),
        n_submovements=0,
        path_length=0.0,
        n_timeouts=0,
    )


def next_subtask(state: HumanState, n_subtasks: int) -> HumanState:
    """The same hand at the beginning of the next of so many acts, or done with all."""
    phase = Phase.DONE if state.subtask + 1 == n_subtasks else Phase.MOVE_AND_WAIT
    return replace(
        state,
        subtask=min(state.subtask + 1, n_subtasks - 1),
        phase=phase,
        subtask_start=state.time,
        n_attempts=0,
        dwell_end=inf,
        near_since=inf,
        samples=(),
    )
