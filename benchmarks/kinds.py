"""Parts of the benchmarks: libraries, entries and cases."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Library:
    """Library that takes part.

    Attributes:
        name: Name in the tables.
        distribution: Name in the package index.
        module: Module that a user imports.
        description: What is timed.
        environment: Name of its requirements and environment, such as peers for peers.txt and
            build/peers-venv; empty for the calling environment.
    """

    name: str
    distribution: str
    module: str
    description: str
    environment: str = ""


@dataclass(frozen=True, slots=True)
class Entry:
    """One contestant of a case.

    Attributes:
        library: File of libraries/ without its suffix.
        function: Function of that file that prepares the call.
        label: Name in the tables.
        differs: How its model differs, so that only the start can be compared; empty if it is the same.
    """

    library: str
    function: str
    label: str
    differs: str = ""


@dataclass(frozen=True, slots=True)
class Case:
    """One computation that all entries perform.

    Attributes:
        name: Name in the tables and on the command line.
        title: Short description with the sizes.
        problem: Folder of the arrays.
        explanation: What is computed on which data.
        answer: Meaning of the answer.
        entries: Contestants.
        agreement: Largest relative difference of the answers; None if the models differ.
        unit: Unit of work of a stream, such as datapoint; empty for other cases.
        lengthy: Whether quick runs leave it out.
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
