"""The command line `pilotfish`."""

from pilotfish.cli.main import main

__all__ = [
    "main",
]
