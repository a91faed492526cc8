"""The command `pilotfish`, which `python -m pilotfish` is too."""

import os
import signal
from types import FrameType


def main() -> None:
    """Run the command line. Until it is imported, a signal ends the process at once and prints nothing."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as it is for a job in the background
            signal.signal(number, _end)
    from pilotfish.cli import main as run

    run()


def _end(number: int, _: FrameType | None) -> None:
    os._exit(128 + number)


if __name__ == "__main__":
    main()
