"""Receive window against repeated datagrams, and counts of the refused ones.

Both have a fixed size, whatever arrives.
"""

from dataclasses import dataclass, field
from enum import IntEnum

WINDOW = 1024  # sequences
LAST_CAUSES = 16


@dataclass(frozen=True, slots=True)
class ReceiveWindow:
    """Sequences that arrived: the highest one, and which of the 1024 up to it.

    Attributes:
        highest: Highest sequence; -1 before the first.
        received: One bit per sequence, the highest one in the lowest bit.
    """

    highest: int = -1
    received: int = field(default=0, repr=False)

    def accepts(self, sequence: int) -> bool:
        """Return whether a sequence is neither repeated nor too old to know.

        Args:
            sequence: Sequence of a datagram.
        """
        age = self.highest - sequence
        return age < 0 or (age < WINDOW and not self.received >> age & 1)

    def add(self, sequence: int) -> "ReceiveWindow":
        """Return the window after a sequence that it accepts.

        Args:
            sequence: Sequence of an authentic datagram.
        """
        age = self.highest - sequence
        if age >= 0:
            return ReceiveWindow(self.highest, self.received | 1 << age)
        if -age >= WINDOW:
            return ReceiveWindow(sequence, 1)
        return ReceiveWindow(sequence, (self.received << -age | 1) & ((1 << WINDOW) - 1))


EMPTY_WINDOW = ReceiveWindow()


class Cause(IntEnum):
    """Why a datagram was refused.

    Attributes:
        MALFORMED: Its length, version, kind or message is wrong.
        UNKNOWN_SENDER: No peer has this number.
        UNEXPECTED_KIND: This side does not receive messages of this kind.
        OTHER_BOOT: It belongs to another start of the robot.
        OTHER_CONNECTION: It belongs to a connection that is not in use.
        REPEATED: It arrived before, or is too old to know.
        UNAUTHENTIC: It was not sealed with the key of its sender.
        CONNECTIONS_EXHAUSTED: The robot gave the last connection; restart it.
    """

    MALFORMED = 0
    UNKNOWN_SENDER = 1
    UNEXPECTED_KIND = 2
    OTHER_BOOT = 3
    OTHER_CONNECTION = 4
    REPEATED = 5
    UNAUTHENTIC = 6
    CONNECTIONS_EXHAUSTED = 7


@dataclass(frozen=True, slots=True)
class Audit:
    """Refused datagrams.

    Attributes:
        counts: Number of refused datagrams of each cause, in the order of `Cause`.
        last: Sender that the header names, and cause, of the last sixteen; -1 if the header cannot be read.
    """

    counts: tuple[int, ...] = (0,) * len(Cause)
    last: tuple[tuple[int, Cause], ...] = ()

    def add(self, sender: int, cause: Cause) -> "Audit":
        """Return the audit after one more refused datagram.

        Args:
            sender: Sender that the header names; -1 if it cannot be read.
            cause: Cause.
        """
        counts = tuple(count + (n == cause) for n, count in enumerate(self.counts))
        return Audit(counts, (*self.last, (sender, cause))[-LAST_CAUSES:])

    def count(self, cause: Cause) -> int:
        """Return the number of datagrams that were refused for a cause.

        Args:
            cause: Cause.
        """
        return self.counts[cause]


EMPTY_AUDIT = Audit()
