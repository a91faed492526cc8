"""Switches the checks of annotations off where they cost more than what they check, and on again."""

from collections.abc import Iterator
from contextlib import contextmanager

from jaxtyping import config


@contextmanager
def check_annotations(enabled: bool) -> Iterator[None]:
    """Run what is inside with or without checks of annotations."""
    before = config.jaxtyping_disable
    config.update("jaxtyping_disable", not enabled)
    try:
        yield
    finally:
        config.update("jaxtyping_disable", before)
