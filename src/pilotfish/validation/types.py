"""Checks of the type of an argument."""

from pilotfish.errors import InvalidInput


def require_type(value: object, label: str, types: type | tuple[type, ...], fix: str) -> None:
    """Check that a value is an instance of one of some types.

    Args:
        value: Value to check; a bool is accepted only if bool is one of the types.
        label: Name of the value; the message begins with it.
        types: Accepted type or types.
        fix: How to obtain an accepted value; the message ends with it.

    Raises:
        InvalidInput: If it is not.
    """
    listed = types if isinstance(types, tuple) else (types,)
    unwanted_bool = isinstance(value, bool) and bool not in listed and object not in listed
    if isinstance(value, type) or unwanted_bool or not isinstance(value, types):
        expected = " or ".join(accepted.__name__ for accepted in listed)
        raise InvalidInput(f"{label} has type {type(value).__name__}, expected {expected}; {fix}")
