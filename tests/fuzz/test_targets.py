"""The tables of fuzz targets cover every decoder and public function."""

from fnmatch import fnmatch
from importlib import import_module

import pytest
from fuzzing.public_examples import (
    EXAMPLES,
    EXCLUDED,
    EXCLUDED_PACKAGES,
    examples,
    function_named,
    public_functions,
)
from fuzzing.targets import GROUPS, TARGETS

MIN_FUNCTIONS = 155  # functions with examples: lower it only by the functions that leave an `__all__`


def test_targets_belong_to_groups() -> None:
    patterns = [pattern for group in GROUPS.values() for pattern in group]
    assert [name for name in TARGETS if not any(fnmatch(name, pattern) for pattern in patterns)] == []


def test_public_functions_have_examples_or_reasons() -> None:
    """A new function fails here until the fuzzer has arguments for it."""
    known = {name for package in EXAMPLES for name in examples(package)}
    assert [name for name in public_functions() if name not in known and name not in EXCLUDED] == []
    assert not set(EXAMPLES) & set(EXCLUDED_PACKAGES)


def is_public_method(name: str) -> bool:
    """Return whether a name such as gaussians.Gaussian.ellipse is a method of a public class."""
    package, _, owner = name.rpartition(".")[0].rpartition(".")
    return (
        bool(package)
        and owner in import_module(f"pilotfish.{package}").__all__
        and callable(function_named(name))
    )


def test_examples_name_public_functions() -> None:
    """A function that was renamed fails here instead of leaving the fuzzer silently."""
    public = set(public_functions())
    known = [name for package in EXAMPLES for name in examples(package)]
    stale = [
        name
        for name in known
        if name not in public and not name.startswith("manipulation.") and not is_public_method(name)
    ]
    assert stale == []
    assert len(known) >= MIN_FUNCTIONS


@pytest.mark.parametrize("package", EXAMPLES)
@pytest.mark.usefixtures("unchecked")
def test_examples_are_valid_arguments(package: str) -> None:
    """An example that its function refuses would leave the fuzzer with refusals only."""
    for name, arguments in examples(package).items():
        result = function_named(name)(**arguments)
        if hasattr(result, "__next__"):
            tuple(result)
