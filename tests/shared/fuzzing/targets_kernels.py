"""Target of the compiled kernels and their NumPy references: see tests/fuzz/test_kernels.py."""

import importlib.util
from collections.abc import Callable
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

from fuzzing.soundness import InvariantViolation
from fuzzing.target import Target
from pilotfish.errors import SkillError

TESTS = Path(__file__).parents[2] / "fuzz" / "test_kernels.py"


def _module() -> ModuleType:
    spec = importlib.util.spec_from_file_location("kernels_under_test", TESTS)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _kernels() -> Target:
    """Return a target whose edits draw the number of a mutant of a kernel."""
    from kernel_arguments import DRAW_ARGUMENTS, Mutant, draw_mutant

    from pilotfish.kernels import reference

    tests = _module()
    try:
        from pilotfish.kernels import compiled
    except ImportError:  # where there is no compiler, the references run alone
        compiled = reference

    def edit(value: tuple[str, int], rng: Random) -> tuple[tuple[str, int], str]:
        number = rng.randrange(10**9)
        return (value[0], number), f"{value[0]}: mutant {number}"

    def read(value: tuple[str, Mutant]) -> Any:
        kernel, mutated = value
        found = [tests.outcome(kernels, kernel, mutated.arguments) for kernels in (compiled, reference)]
        if wrong := tests.difference(mutated, kernel, *found):
            raise InvariantViolation(f"{kernel}, {mutated.kind}: {wrong}")
        for refusal in found:
            if isinstance(refusal, SkillError):
                raise refusal
        return found

    def write(value: tuple[str, int]) -> tuple[str, Mutant]:
        return value[0], draw_mutant(value[0], 0, value[1])

    return Target([(kernel, 0) for kernel in DRAW_ARGUMENTS], edit, write, read, lambda value, thorough: None)


TARGETS: dict[str, tuple[Callable[[], Target], float]] = {"kernels": (_kernels, 2.0)}
