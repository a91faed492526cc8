"""State of a simulated person during a demonstration."""

from dataclasses import dataclass, replace
from enum import Enum
from math import inf

import numpy as np

from pilotfish.environments.human.crossover_model import Sample
from pilotfish.environments.human.submovements import Submovement
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

Phase = Enum("Phase", ["MOVE_AND_WAIT", "TRACKING", "DONE"])


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class HumanState:
    """State of a person after a step.

    Attributes:
        time: Time of the last step [s].
        hand: Pose of the hand, which is the commanded tool pose.
        grip: Commanded grip, 0 to 1.
        subtask: Index of the present subtask.
        phase: How the person acts now.
        subtask_start: Time when the subtask began [s].
        n_attempts: Sub-movements of this subtask.
        dwell_end: Time when the dwell ends [s]; infinite until the goal is reached.
        near_since: Time since when a tracked goal is within tolerance [s]; infinite if it is not.
        rest_pose: Pose of the hand before the sub-movements that have not ended.
        submovements: Sub-movements that have not ended.
        rest_time: Time when the last sub-movement ends or ended [s].
        lead: Offset from the tool to the hand when both rested last [m, rad].
        samples: Recent observations of a moving goal, oldest first.
        n_submovements: Sub-movements in total.
        path_length: Length of the hand's path [m].
        n_timeouts: Subtasks that ended by timeout.
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

    @property
    def done(self) -> bool:
        """Return whether all subtasks have ended."""
        return self.phase is Phase.DONE


def initial_state(tool: Pose, time: float, grip: float = 0.0) -> HumanState:
    """Return the state of a person whose hand is at the tool, before the first subtask.

    Args:
        tool: Pose of the tool.
        time: Present time [s].
        grip: Present grip, 0 to 1.
    """
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
    """Return the state at the start of the next subtask, or the final state after the last one."""
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
