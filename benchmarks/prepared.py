"""What a library hands to the clock: a call to time, and how to read what it returned."""

from collections.abc import Callable
from dataclasses import dataclass
from math import nan
from typing import Any


@dataclass(frozen=True, slots=True)
class CommandResult:
    """A number by which libraries are compared, and how many units of work (EM iterations, say) it took.

    begin is the same number before the first unit, NaN where there is none.
    """

    value: float
    units: int = 1
    print_note: str = ""
    begin: float = nan


@dataclass(frozen=True, slots=True)
class Prepared:
    """run is timed; answer reads its result afterwards."""

    run: Callable[[], Any]
    answer: Callable[[Any], CommandResult]
