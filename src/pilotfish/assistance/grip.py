"""Scalars such as a grip: they follow the operator, and hold when control changes hands.

After a change of mode a grip must not open because the operator's hand happens to be open. The last value
holds until the operator changes the command, or until both agree.
"""

from dataclasses import dataclass

import numpy as np

from pilotfish.assistance.assistant import AssistedSkill
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

TOLERANCE = 0.1  # unit of the scalar: a smaller difference is agreement, a larger change a command


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class HeldScalars:
    """Values that hold, and the command at which they were held.

    Attributes:
        values: Value of each scalar that holds; NaN for one that follows the operator.
        commands: Command at the change of mode.
    """

    values: Float[Array, " S"]
    commands: Float[Array, " S"]


def hold_scalars(target: Float[Array, " S"], command: Float[Array, " S"]) -> HeldScalars:
    """Return scalars that hold at the target.

    Args:
        target: Scalars of the target.
        command: Scalars that the operator commands.
    """
    return HeldScalars(target.copy(), command.copy())


def follow_scalars(held: HeldScalars, command: Float[Array, " S"]) -> tuple[HeldScalars, Float[Array, " S"]]:
    """Return the scalars of the target while the operator is in control.

    Args:
        held: Scalars that hold.
        command: Scalars that the operator commands.

    Returns:
        Those that still hold, and the scalars of the target.
    """
    released = (np.abs(command - held.values) <= TOLERANCE) | (np.abs(command - held.commands) > TOLERANCE)
    values = np.where(released, np.nan, held.values)
    return HeldScalars(values, held.commands), np.where(np.isnan(values), command, values)


def plan_scalars(skill: AssistedSkill, planned: Float[Array, " D"], state: int) -> Float[Array, " D"]:
    """Return a planned pose with each switch at the value of its state.

    Args:
        skill: Prepared skill.
        planned: Pose and scalars of the plan.
        state: State of the plan.
    """
    pose = planned.copy()
    for column, low, high in zip(skill.switches, *skill.levels, strict=True):
        means = np.array([m[state, column] for m in skill.skill.means]).mean()
        pose[column] = high if means > 0.5 * (low + high) else low
    return pose
