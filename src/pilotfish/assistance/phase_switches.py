"""Grip in a virtual fixture: two-valued columns switch at phases on which most demonstrations agree."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_count, require_type, shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class PhaseSwitch:
    """Column that switches between two values as the phase advances.

    Attributes:
        column: Column of the pose.
        phases: Phases at which the value changes, increasing.
        values: Value before the first change and after each: one more than there are changes.
    """

    column: int
    phases: Float[Array, " C"]
    values: Float[Array, " V"]

    def value_at(self, phase: float) -> float:
        """Return the value at a phase.

        Args:
            phase: Phase, 0 to 1.
        """
        return float(self.values[np.searchsorted(self.phases, phase, side="right")])


def learn_switch(
    column: int, values: Sequence[Float[Array, " _"]], phases: Sequence[Float[Array, " _"]]
) -> PhaseSwitch:
    """Return the value of most demonstrations at every phase; the higher value if they are divided equally.

    Args:
        column: Column of the pose.
        values: Values of the column in each demonstration.
        phases: Phase of each step of each demonstration, which does not decrease.
    """
    low, high = min(v.min() for v in values), max(v.max() for v in values)
    is_high = [v > 0.5 * (low + high) for v in values]
    changes = [np.flatnonzero(np.diff(above)) + 1 for above in is_high]
    merged = np.unique(np.concatenate([s[rows] for s, rows in zip(phases, changes, strict=True)]))
    votes = np.zeros(len(merged) + 1)
    for above, s, rows in zip(is_high, phases, changes, strict=True):
        passed = np.searchsorted(s[rows], np.append(-np.inf, merged), side="right")
        votes += above[np.append(0, rows)][passed]
    majority = votes >= 0.5 * len(values)
    kept = np.flatnonzero(np.diff(majority))
    return PhaseSwitch(column, merged[kept], np.where(majority[np.append(0, kept + 1)], high, low))


def validate_switches(switches: Sequence[PhaseSwitch], layout: Layout) -> None:
    """Raise InvalidInput unless each switch fits a column of its own, other than a quaternion's."""
    require_type(switches, "switches", (list, tuple), "give a list of PhaseSwitch")
    columns = []
    for switch in switches:
        require_type(switch, "a switch", PhaseSwitch, "create one with PhaseSwitch")
        columns.append(require_count(switch.column, "column of a switch", layout.width - 1))
        phases = finite_array(switch.phases, "phases of a switch")
        if phases.ndim != 1 or phases.min(initial=0.0) < 0.0 or phases.max(initial=1.0) > 1.0:
            raise InvalidInput("phases of a switch are not one row of numbers from 0 to 1; give such a row")
        if (np.diff(phases) < 0.0).any():
            raise InvalidInput("phases of a switch decrease, expected increasing ones; sort them")
        finite_array(switch.values, "values of a switch", (len(phases) + 1,))
    if len(set(columns)) < len(columns):
        raise InvalidInput(f"switches have the columns {columns}, expected each once; merge them")
    if oriented := [c for c in columns if any(q.start <= c < q.stop for q in layout.unit_quaternions)]:
        raise InvalidInput(f"column {oriented[0]} belongs to a quaternion, expected another for a switch")
