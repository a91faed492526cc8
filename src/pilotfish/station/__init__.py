"""The roof over all rooms: the command line."""

from pilotfish.station.command_line import main

__all__ = ["main"]
