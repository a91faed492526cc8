"""Data in parts: learning is a fold over sufficient statistics, and each part may be on another machine.

Learning asks for two things only. `map` applies a function to every part and returns the results in the order
of the parts. `transform` makes new data of every part, which stay where the part is. Models travel to the
data, and statistics come back. Functions are pure, so that a part that is lost can be computed again.

Sums. Parts are `PARTITION_SIZE` demonstrations each, whatever computes them, and results are added in the
order of the parts. A fit therefore does not depend on the number of processes or on which of them is faster.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

from pilotfish.demonstrations import Demonstration, Views, require_compatible, views
from pilotfish.validation import shorten_repr

PARTITION_SIZE = 100  # demonstrations: their statistics take little memory beside them

T_co = TypeVar("T_co", covariant=True)
S = TypeVar("S")


@runtime_checkable
class Partitions(Protocol[T_co]):
    """A data set in parts; `InProcess` keeps them in memory, `pilotfish.cluster` on other machines."""

    def map(self, function: Callable[[T_co], S]) -> Iterator[S]:
        """Apply a function to every part, and return the results in the order of the parts.

        Args:
            function: A pure function that can be pickled.

        Returns:
            The results, one after another.
        """
        ...

    def transform(self, function: Callable[[T_co], S]) -> "Partitions[S]":
        """Apply a function to every part, and keep the results where the parts are.

        Args:
            function: A pure function that can be pickled.

        Returns:
            The results, in parts.
        """
        ...


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class InProcess(Partitions[T_co]):
    """A data set in the memory of this process.

    Attributes:
        parts: The parts.
    """

    parts: tuple[T_co, ...]

    def map(self, function: Callable[[T_co], S]) -> Iterator[S]:
        """Apply a function to every part, one after another.

        Args:
            function: A pure function.

        Returns:
            The results, each computed when it is asked for.
        """
        return map(function, self.parts)

    def transform(self, function: Callable[[T_co], S]) -> Partitions[S]:
        """Apply a function to every part, and keep the results.

        Args:
            function: A pure function.

        Returns:
            The results, in parts.
        """
        return InProcess(tuple(map(function, self.parts)))


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class DemonstrationGroup:
    """Some consecutive demonstrations of a set.

    Attributes:
        start: Number of the first of them in the set, from 0.
        demonstrations: At least one.
    """

    start: int
    demonstrations: tuple[Demonstration, ...]


def partition(demonstrations: Sequence[Demonstration]) -> InProcess[DemonstrationGroup]:
    """Group demonstrations as every fit does.

    Args:
        demonstrations: At least one; all have the same layout, period and frame names.

    Returns:
        The groups, in memory.

    Raises:
        InvalidInput: If there is none, or if they differ in layout, period or frame names.
    """
    require_compatible(demonstrations)
    starts = range(0, len(demonstrations), PARTITION_SIZE)
    return InProcess(
        tuple(DemonstrationGroup(m, tuple(demonstrations[m : m + PARTITION_SIZE])) for m in starts)
    )


def as_groups(
    demonstrations: Sequence[Demonstration] | Partitions[DemonstrationGroup],
) -> Partitions[DemonstrationGroup]:
    """Return demonstrations in groups; a set in parts has them already.

    Args:
        demonstrations: Demonstrations, or a set in parts.

    Raises:
        InvalidInput: If there is none, or if they differ in layout, period or frame names.
    """
    if isinstance(demonstrations, Partitions):
        return demonstrations
    return partition(demonstrations)


def first_demonstration(source: Partitions[DemonstrationGroup]) -> Demonstration:
    """Return the first demonstration of a set.

    Args:
        source: The set.
    """
    first = next(source.map(_first_of_set))
    assert first is not None
    return first


def _first_of_set(group: DemonstrationGroup) -> Demonstration | None:
    return None if group.start else group.demonstrations[0]


def group_views(group: DemonstrationGroup, first: Demonstration) -> Views:
    """Return a group as every frame sees it, with the quaternion signs of the first demonstration.

    Args:
        group: The group.
        first: First demonstration of the set.
    """
    return views(group.demonstrations, first)


def as_partitions(data: Views | Partitions[Views]) -> Partitions[Views]:
    """Return views as one part, and partitions unchanged.

    Args:
        data: Views or partitions of views.
    """
    if isinstance(data, Views):
        return InProcess((data,))
    return data
