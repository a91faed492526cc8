"""What a laboratory has on its disk: signals with their own times, before they become a demonstration.

A reader of `pilotfish.io.readers` returns recordings with the values of the file. Units, the order of
quaternions and rates are interpreted by `build_demonstration`, which resamples all signals to one period.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """Columns that were recorded together, as in the file.

    Attributes:
        name: Name of the topic, group or file, such as "/tool_pose"; may be empty if there is only one.
        values: One row per sample.
        columns: Name of each column, as in the file.
        units: Unit of each column, as in the file; "" where the file states none.
        times: Time of each row [s]; None if the file has no times.
        reference_frame: Frame that the poses or points are relative to; "" if the file states none.
    """

    name: str
    values: Float[Array, "T D"]
    columns: tuple[str, ...]
    units: tuple[str, ...]
    times: Float[Array, " T"] | None = None
    reference_frame: str = ""


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One execution of a task, as in the file.

    Attributes:
        name: Name of the execution.
        signals: At least one, with different names.
        labels: Label of each row of the first signal, by the name of the label, such as "phase".
        period: Time between two rows that the file states [s]; None if it states none.
        format: Name of the format, such as "LeRobot v3".
        attributes: Texts that the file states about the execution, by name, such as "task" or "env_args".
        notes: What the reader left out or could not use, one sentence each.
    """

    name: str
    signals: tuple[Signal, ...]
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    period: float | None = None
    format: str = ""
    attributes: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
