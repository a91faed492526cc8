"""Signals that stop a command: SIGINT, SIGTERM and SIGHUP.

While a stream is learned, a signal is recorded and the stream ends after the current datapoints
(`catch_signals`). Elsewhere a signal raises StopRequested in the main thread (`raise_on_signals`).
"""

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
SIGNAL_EXIT_OFFSET = 128  # exit code minus the number of the signal, as in shells
MIN_INTERVAL = 1.0  # s; an earlier signal would interrupt the clean-up after the previous one
RERAISE_DELAY = 0.02  # s, until an exception that Python could not raise is raised again


class StopRequested(BaseException):
    """A signal requests the process to stop; on the way out, partly written files are removed.

    Attributes:
        number: Number of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


@contextmanager
def catch_signals() -> Iterator[Callable[[], int]]:
    """Record signals instead of raising StopRequested; the previous handlers are restored afterwards.

    Signals that were ignored, as for a background job, remain ignored.

    Yields:
        A function that returns the number of the first signal, or 0 before any signal.
    """
    received: list[int] = []

    def record_signal(number: int, _: FrameType | None) -> None:
        received.append(number)

    previous = {number: signal.getsignal(number) for number in _active_signals()}
    try:
        for number in previous:
            signal.signal(number, record_signal)
        yield lambda: received[0] if received else 0
    finally:
        for number, action in previous.items():
            signal.signal(number, action)


def raise_on_signals() -> None:
    """Raise StopRequested in the main thread at every signal from now on.

    Python prints and drops an exception that a signal handler raises inside a destructor or a callback of
    the interpreter. Here it is not printed, and it is raised again after RERAISE_DELAY.
    """
    last = [-MIN_INTERVAL]

    def stop(number: int, _: FrameType | None) -> None:
        if (now := time.monotonic()) >= last[0] + MIN_INTERVAL:
            last[0] = now
            raise StopRequested(number)

    def raise_later(unraised: Any) -> None:
        if not isinstance(unraised.exc_value, StopRequested):
            sys.__unraisablehook__(unraised)
            return
        number = unraised.exc_value.number

        def raise_again(*_: object) -> None:
            raise StopRequested(number)

        signal.signal(signal.SIGALRM, raise_again)
        signal.setitimer(signal.ITIMER_REAL, RERAISE_DELAY)

    sys.unraisablehook = raise_later
    for number in _active_signals():
        signal.signal(number, stop)


def restore_default_signals() -> None:
    """Let signals end the process at once from now on, because no clean-up is left to do."""
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number in _active_signals():
        signal.signal(number, signal.SIG_DFL)


def _active_signals() -> list[signal.Signals]:
    return [n for n in SIGNALS if signal.getsignal(n) not in (signal.SIG_IGN, None)]
