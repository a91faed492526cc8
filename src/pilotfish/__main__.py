"""The command `pilotfish`, also run by `python -m pilotfish`."""

import os
import signal
from types import FrameType


def main() -> None:
    """Run the command line; a signal during its import ends the process at once, without a traceback."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # a background job ignores some signals
            signal.signal(number, _exit)
    from pilotfish.cli import main as run

    run()


def _exit(number: int, _: FrameType | None) -> None:
    os._exit(128 + number)


if __name__ == "__main__":
    main()
