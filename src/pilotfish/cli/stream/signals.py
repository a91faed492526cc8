"""Ctrl-C and other signals that ask to stop: noted while a stream is learned, elsewhere an exception."""

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
SIGNAL_EXIT_OFFSET = 128  # and the number of the signal: the exit code, as shells have it
MIN_INTERVAL = 1.0  # s: a signal that comes sooner after another does not interrupt what that one cleans up
RERAISE_DELAY = 0.02  # s, after which an exception that Python could not raise where it came is raised anew


class StopRequested(BaseException):
    """A signal asks the process to stop; on the way out, files that are half written are removed."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


@contextmanager
def catch_signals() -> Iterator[Callable[[], int]]:
    """Tells which signal asked to stop, 0 while none has; what the work had in hand stays whole.

    Signals that were ignored, as in the background, stay ignored. Afterwards all are as they were.
    """
    asked: list[int] = []

    def record_signal(number: int, _: FrameType | None) -> None:
        asked.append(number)

    before = {number: signal.getsignal(number) for number in _active_signals()}
    try:
        for number in before:
            signal.signal(number, record_signal)
        yield lambda: asked[0] if asked else 0
    finally:
        for number, action in before.items():
            signal.signal(number, action)


def raise_on_signals() -> None:
    """Raise Stopped in the main thread at every signal that asks to stop, from now on.

    Python drops an exception that a signal raises inside a destructor or a callback of the interpreter, and
    prints it. That is not printed here, and the exception comes again.
    """
    last = [-MIN_INTERVAL]

    def stop(number: int, _: FrameType | None) -> None:
        if (now := time.monotonic()) >= last[0] + MIN_INTERVAL:
            last[0] = now
            raise StopRequested(number)

    def unraisable(unraised: Any) -> None:
        if not isinstance(unraised.exc_value, StopRequested):
            sys.__unraisablehook__(unraised)
            return
        stopped = unraised.exc_value.number

        def raise_again(*_: object) -> None:
            raise StopRequested(stopped)

        signal.signal(signal.SIGALRM, raise_again)
        signal.setitimer(signal.ITIMER_REAL, RERAISE_DELAY)

    sys.unraisablehook = unraisable
    for number in _active_signals():
        signal.signal(number, stop)


def restore_default_signals() -> None:
    """From now on, signals that ask to stop end the process at once: there is nothing left to clean up."""
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number in _active_signals():
        signal.signal(number, signal.SIG_DFL)


def _active_signals() -> list[signal.Signals]:
    return [n for n in SIGNALS if signal.getsignal(n) not in (signal.SIG_IGN, None)]
