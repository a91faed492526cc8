"""Libraries of the extra `io`, imported by the reader or writer that needs them."""

from importlib import import_module
from typing import Any

from pilotfish.errors import InvalidInput


def require_library(module: str, purpose: str) -> Any:
    """Return a module of an optional library.

    Args:
        module: Dotted name, such as "h5py".
        purpose: What needs it; the message begins with it, as in "robomimic files".

    Raises:
        InvalidInput: If the library is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        library = module.partition(".")[0]
        raise InvalidInput(f"{purpose} need {library}: pip install '.[io]' in the clone") from error
