"""Atomic writes: a file or folder that is replaced as a whole (`whole_file`, `whole_folder`), and folders for
them (`make_folder`). Whatever interrupts a write, the old content or the new one is there.
"""

from pilotfish.files.renaming import make_folder
from pilotfish.files.whole_files import whole_file
from pilotfish.files.whole_folders import whole_folder

__all__ = ["make_folder", "whole_file", "whole_folder"]
