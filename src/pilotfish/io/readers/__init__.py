"""Readers of recordings as laboratories have them, one module for each format.

`read_recordings` finds the reader of a file or folder. A new format is one module with `FORMAT`,
`recognises(path)` and `read(path)`, and its name in `recognition.READERS`.
"""

from pilotfish.io.readers.read_options import ReadOptions
from pilotfish.io.readers.recognition import read_recordings, reader_formats

__all__ = ["ReadOptions", "read_recordings", "reader_formats"]
