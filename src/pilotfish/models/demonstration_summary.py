"""What a fit keeps of each demonstration of a set: its name, length and hash, and statistics of all."""

import hashlib
from dataclasses import dataclass
from functools import partial

import numpy as np

from pilotfish.demonstrations import Demonstration, require_compatible
from pilotfish.models.demonstration_statistics import DemonstrationStatistics, demonstration_statistics
from pilotfish.models.partitions import DemonstrationGroup, Partitions, first_demonstration
from pilotfish.types import Array, Int
from pilotfish.validation import shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class DemonstrationSummary:
    """Summary of a set of demonstrations, which the process that learns holds instead of their rows.

    Attributes:
        first: The first demonstration.
        names: Names of all.
        lengths: Numbers of rows of all.
        digest: SHA-256 of values, shapes, periods and frames.
        statistics: Scales and ranges.
    """

    first: Demonstration
    names: tuple[str, ...]
    lengths: Int[Array, " M"]
    digest: str
    statistics: DemonstrationStatistics


def summarise(source: Partitions[DemonstrationGroup]) -> DemonstrationSummary:
    """Summarise a set of demonstrations.

    Args:
        source: The set.

    Raises:
        InvalidInput: If demonstrations differ in layout, period or frame names.
    """
    first = first_demonstration(source)
    names: list[str] = []
    lengths: list[int] = []
    digests: list[str] = []
    for group_names, group_lengths, digest in source.map(partial(_describe, first=first)):
        names += group_names
        lengths += group_lengths
        digests.append(digest)
    digest = digests[0] if len(digests) == 1 else hashlib.sha256("".join(digests).encode()).hexdigest()
    return DemonstrationSummary(
        first, tuple(names), np.array(lengths, dtype=np.int64), digest, demonstration_statistics(source)
    )


def _describe(group: DemonstrationGroup, first: Demonstration) -> tuple[list[str], list[int], str]:
    demonstrations = group.demonstrations
    require_compatible(demonstrations, first, group.start)
    lengths = [len(demo.x) for demo in demonstrations]
    return [demo.name for demo in demonstrations], lengths, _hash_demonstrations(demonstrations)


def _hash_demonstrations(demonstrations: tuple[Demonstration, ...]) -> str:
    """Return the SHA-256 of values, shapes, periods and frames of a group."""
    digest = hashlib.sha256()
    for demonstration in demonstrations:
        shape, period, parts = demonstration.x.shape, demonstration.period, demonstration.layout.parts
        digest.update(f"({shape!r}, {period!r}, Layout(parts={parts!r}))".encode())
        for array in (demonstration.x, *(a for frame in demonstration.frames for a in (frame.A, frame.b))):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
