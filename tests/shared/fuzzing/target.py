"""A decoder under test."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

from fuzzing.edits import Edit

COUNTS = (1, 1, 1, 1, 2, 2, 3, 5)  # edits of one mutant


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A decoder, the valid values that mutants are made of, and the check of what it accepts.

    bases  valid values, in a form that is easy to edit
    edit   makes one edit
    write  makes of an edited value what the decoder reads
    read   the decoder
    use    checks what was accepted; it is told whether to be thorough
    """

    bases: Sequence[Any]
    edit: Edit
    write: Callable[[Any], Any]
    read: Callable[[Any], Any]
    use: Callable[[Any, bool], None]


@dataclass(frozen=True, slots=True, eq=False)
class Mutant:
    """What the decoder reads, and how it was made: the base's number and what each edit did."""

    data: Any
    base: int
    edits: tuple[str, ...]


def plan_of(target: Target, name: str, seed: int, index: int) -> tuple[int, tuple[int, ...]]:
    """The base and the seeds of the edits of one mutant, which depend on nothing but these numbers."""
    rng = Random(f"{name} {seed} {index}")
    base = rng.randrange(len(target.bases))
    return base, tuple(rng.getrandbits(48) for _ in range(rng.choice(COUNTS)))


def mutant_of(target: Target, base: int, edits: Sequence[int]) -> Mutant:
    """The mutant that these edits make of a base."""
    value, said = target.bases[base], []
    for seed in edits:
        value, what = target.edit(value, Random(seed))
        said.append(what)
    return Mutant(target.write(value), base, tuple(said))
