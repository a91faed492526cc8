"""Writers of demonstrations for other programs, one module for each format."""

from pilotfish.io.writers.export import WRITERS, export_demonstrations

__all__ = ["WRITERS", "export_demonstrations"]
