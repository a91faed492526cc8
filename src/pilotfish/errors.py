"""Errors that pilotfish raises on purpose: one class for each case that a caller handles differently."""

from pathlib import Path

MAX_MESSAGE_LENGTH = 500  # characters


class SkillError(Exception):
    """Base class of every error that this library raises on purpose.

    The message is one printable line of at most MAX_MESSAGE_LENGTH characters. Control characters are
    escaped. A longer text is cut in the middle, so that the fix at its end remains.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(_format_line(message))


class InvalidInput(SkillError, ValueError):
    """An argument cannot be used; the message gives its value, what was expected and the nearest fix."""


class OutputExists(InvalidInput):
    """Another process created a file under the name of an output.

    Attributes:
        path: Where the result was kept instead.
    """

    def __init__(self, message: str, path: Path) -> None:
        super().__init__(message)
        self.path = path


class NotPositiveDefinite(SkillError, ArithmeticError):
    """A covariance or weight has no Cholesky factor; use more regularisation or more data."""


class UnreadableFile(SkillError):
    """A file that this version cannot read: damaged, of another type, or written by a newer version."""


class FramesNotVisible(SkillError):
    """The frames of objects cannot be observed now, such as when a marker is covered; wait or stop."""


def escape(text: str) -> str:
    """Return text with a backslash escape in place of every character that is not printable.

    Args:
        text: Any text, lone surrogates included.
    """
    if text.isprintable():
        return text
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode("ascii")
        for character in text
    )


def _format_line(message: str) -> str:
    if len(message) > MAX_MESSAGE_LENGTH:  # cut first, so that escaping a huge text stays cheap
        message = f"{message[: 2 * MAX_MESSAGE_LENGTH]} ... {message[-2 * MAX_MESSAGE_LENGTH :]}"
    line = escape(" ".join(message.split()))
    if len(line) <= MAX_MESSAGE_LENGTH:
        return line
    end = MAX_MESSAGE_LENGTH // 3
    return f"{line[: MAX_MESSAGE_LENGTH - end - 5]} ... {line[-end:]}"
