"""Switches the checks of annotations off where they cost more than what they check."""

from collections.abc import Iterator
from contextlib import contextmanager

from jaxtyping import config


@contextmanager
def unchecked_annotations() -> Iterator[None]:
    """Run what is inside without checks of annotations."""
    before = config.jaxtyping_disable
    config.update("jaxtyping_disable", True)
    try:
        yield
    finally:
        config.update("jaxtyping_disable", before)
