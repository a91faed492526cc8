"""Switch for the checks of annotations, which cost more than the physics in some tests."""

from collections.abc import Iterator
from contextlib import contextmanager

from jaxtyping import config


@contextmanager
def check_annotations(enabled: bool) -> Iterator[None]:
    """Run the body with or without checks of annotations."""
    before = config.jaxtyping_disable
    config.update("jaxtyping_disable", not enabled)
    try:
        yield
    finally:
        config.update("jaxtyping_disable", before)
