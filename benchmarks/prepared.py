"""A call that is timed, and how its answer is read."""

from collections.abc import Callable
from dataclasses import dataclass
from math import nan
from typing import Any


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer of a call.

    Attributes:
        value: Number by which libraries are compared.
        units: Units of work of the call, such as EM iterations.
        remark: Remark for the table.
        begin: The same number before the first unit; NaN if there is none.
    """

    value: float
    units: int = 1
    remark: str = ""
    begin: float = nan


@dataclass(frozen=True, slots=True)
class Prepared:
    """Call that is timed, and the function that reads the answer from its result."""

    run: Callable[[], Any]
    answer: Callable[[Any], Answer]
