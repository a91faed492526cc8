"""Target of the fuzzer: a decoder or function with valid values and edits."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

from fuzzing.edits import Edit

COUNTS = (1, 1, 1, 1, 2, 2, 3, 5)  # numbers of edits of a mutant, one is drawn


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Decoder with valid values, edits and checks.

    Attributes:
        bases: Valid values, in a form that is easy to edit.
        edit: Makes one edit.
        write: Converts an edited value to the decoder's input.
        read: The decoder.
        use: Checks an accepted value; its second argument is whether to check thoroughly.
    """

    bases: Sequence[Any]
    edit: Edit
    write: Callable[[Any], Any]
    read: Callable[[Any], Any]
    use: Callable[[Any, bool], None]


@dataclass(frozen=True, slots=True, eq=False)
class Mutant:
    """Input of the decoder.

    Attributes:
        data: The input.
        base: Index of the base.
        edits: Description of each edit.
    """

    data: Any
    base: int
    edits: tuple[str, ...]


def plan_of(target: Target, name: str, seed: int, index: int) -> tuple[int, tuple[int, ...]]:
    """Return the index of the base and the seeds of the edits of one mutant, a function of the arguments."""
    rng = Random(f"{name} {seed} {index}")
    base = rng.randrange(len(target.bases))
    return base, tuple(rng.getrandbits(48) for _ in range(rng.choice(COUNTS)))


def mutant_of(target: Target, base: int, edits: Sequence[int]) -> Mutant:
    """Return the base after the edits of these seeds."""
    value, said = target.bases[base], []
    for seed in edits:
        value, what = target.edit(value, Random(seed))
        said.append(what)
    return Mutant(target.write(value), base, tuple(said))
