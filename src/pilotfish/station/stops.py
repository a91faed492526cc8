"""Ctrl-C and its kin as something that is looked at, not something that breaks in."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def stops() -> Iterator[Callable[[], int]]:
    """Tells which signal asked to stop, 0 while none has; what the work had in hand stays whole.

    Signals that were ignored, as in the background, stay ignored. Afterwards all are as they were.
    """
    asked: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        asked.append(number)

    before = {number: signal.getsignal(number) for number in SIGNALS}
    heard = [number for number, action in before.items() if action not in (signal.SIG_IGN, None)]
    try:
        for number in heard:
            signal.signal(number, note)
        yield lambda: asked[0] if asked else 0
    finally:
        for number in heard:
            signal.signal(number, before[number])
