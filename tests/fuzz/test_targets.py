"""The tables of what is fuzzed leave nothing out."""

from fnmatch import fnmatch

from fuzzing.public_examples import EXCLUDED, PACKAGES, examples, public_functions
from fuzzing.targets import GROUPS, TARGETS


def test_every_target_is_in_a_group() -> None:
    patterns = [pattern for group in GROUPS.values() for pattern in group]
    assert [name for name in TARGETS if not any(fnmatch(name, one) for one in patterns)] == []


def test_every_public_function_has_valid_arguments_or_a_reason() -> None:
    """A new function fails here until it is added to the table, and so to what is fuzzed."""
    known = {name for package in PACKAGES for name in examples(package)}
    assert [name for name in public_functions() if name not in known and name not in EXCLUDED] == []
