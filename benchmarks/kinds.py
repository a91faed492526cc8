"""The kinds of things that cases are made of: libraries, entries, cases and promises."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Library:
    """distribution is its name in a package index, module what a user imports, does what it is timed at.

    environment names its list and its folder: peers.txt and build/peers-venv; empty for the one that calls.
    """

    name: str
    distribution: str
    module: str
    does: str
    environment: str = ""


@dataclass(frozen=True, slots=True)
class Entry:
    """One contestant: a library (a file of libraries/) and the function of that file which prepares it.

    differs says in what its model is another, so that only where it begins can be compared.
    """

    library: str
    function: str
    label: str
    differs: str = ""


@dataclass(frozen=True, slots=True)
class Case:
    """One computation. agreement is how far apart, relatively, answers may lie; None where models differ.

    unit is what times are for, where speed is told by how many a second: a datapoint of a stream.
    lengthy ones are left out of quick runs.
    """

    name: str
    title: str
    problem: str
    explanation: str
    answer: str
    entries: tuple[Entry, ...]
    agreement: float | None = None
    unit: str = ""
    lengthy: bool = False


@dataclass(frozen=True, slots=True)
class TimeLimit:
    """pilotfish's first entry, or the one of that label, takes at most so many milliseconds of CPU."""

    case: str
    milliseconds: float
    entry: str = ""


@dataclass(frozen=True, slots=True)
class MinRate:
    """pilotfish's first entry learns at least so many datapoints for each second of CPU."""

    case: str
    datapoints_per_second: float


@dataclass(frozen=True, slots=True)
class MinSpeedup:
    """Every entry of another library takes at least so many times pilotfish's CPU; over None: of all."""

    case: str
    times: float
    over: str | None = None


@dataclass(frozen=True, slots=True)
class MemoryLimit:
    """pilotfish's first entry needs at most so many times the memory of the data, beyond the data itself."""

    case: str
    data_mb: float
    times: float


@dataclass(frozen=True, slots=True)
class BestAnswer:
    """pilotfish's first entry has a larger answer than every entry of another library."""

    case: str


Requirement = TimeLimit | MinRate | MinSpeedup | MemoryLimit | BestAnswer
