"""Every error that pilotfish raises on purpose: one name for each thing that a caller does differently."""

from pathlib import Path

MAX_MESSAGE_LENGTH = 500  # characters


class SkillError(Exception):
    """Base of every error that this library raises on purpose.

    The message is one printable line of at most LONGEST_MESSAGE characters, whatever was put into it: control
    characters are escaped, and the middle of a longer text is left out, so that the remedy at its end stays.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(_format_line(message))


class InvalidInput(SkillError, ValueError):
    """What was given cannot be used; the message says where, what was expected and the nearest fix."""


class OutputExists(InvalidInput):
    """Another process made something under the name of an output; the result is kept at `path` instead."""

    def __init__(self, message: str, path: Path) -> None:
        super().__init__(message)
        self.path = path


class NotPositiveDefinite(SkillError, ArithmeticError):
    """A covariance or weight has no Cholesky factor; more regularisation or more data mends it."""


class UnreadableFile(SkillError):
    """A skill file that this version cannot read: damaged, of another kind, or written by a newer version."""


def escape(text: str) -> str:
    """Return text with every character that is not printable written as a backslash escape."""
    if text.isprintable():
        return text
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode("ascii")
        for character in text
    )


def require_type(label: str, value: object, types: type | tuple[type, ...], fix: str) -> None:
    """Nothing, when value is of one of the kinds.

    Raises: InvalidInput otherwise, naming the kind given, those expected and the fix.
    """
    listed = types if isinstance(types, tuple) else (types,)
    unwanted_bool = (
        isinstance(value, bool) and bool not in listed and object not in listed
    )  # an int, to Python alone
    if isinstance(value, type) or unwanted_bool or not isinstance(value, types):
        expected = " or ".join(kind.__name__ for kind in listed)
        raise InvalidInput(f"{label} is of the kind {type(value).__name__}, expected {expected}; {fix}")


def _format_line(message: str) -> str:
    if len(message) > MAX_MESSAGE_LENGTH:  # before anything is done to each character
        message = f"{message[: 2 * MAX_MESSAGE_LENGTH]} ... {message[-2 * MAX_MESSAGE_LENGTH :]}"
    line = escape(" ".join(message.split()))
    if len(line) <= MAX_MESSAGE_LENGTH:
        return line
    end = MAX_MESSAGE_LENGTH // 3
    return f"{line[: MAX_MESSAGE_LENGTH - end - 5]} ... {line[-end:]}"
