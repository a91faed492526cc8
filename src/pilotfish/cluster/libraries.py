"""Libraries of the extra `scale`, imported by the function that needs them."""

from importlib import import_module
from typing import Any

from pilotfish.errors import InvalidInput


def require_distributed() -> Any:
    """Return the module `distributed`.

    Raises:
        InvalidInput: If it is not installed.
    """
    try:
        return import_module("distributed")
    except ImportError as error:
        raise InvalidInput("a cluster needs Dask: pip install '.[scale]' in the clone") from error
