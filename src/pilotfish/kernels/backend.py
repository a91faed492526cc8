"""Choice of the implementation: the compiled kernels if they were built, else their NumPy references."""

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

from pilotfish.kernels import reference
from pilotfish.kernels.validation import KERNELS


class SlowKernelsWarning(UserWarning):
    """Warning that the compiled kernels are missing: same results, about ten times slower."""


_implementation: Any
try:
    _implementation = import_module("pilotfish.kernels.compiled")
    BACKEND: str = _implementation.INSTRUCTION_SET
except ImportError as reason:
    _implementation = reference
    BACKEND = "numpy"
    warnings.warn(
        f"pilotfish runs on NumPy, without its compiled kernels ({reason}): same results, but learning "
        "and planning take many times as long; install a C++17 compiler (Debian: g++, python3-dev), "
        "then install pilotfish again",
        SlowKernelsWarning,
        stacklevel=2,
    )

if TYPE_CHECKING:
    from pilotfish.kernels.compiled import *  # noqa: F403 (signatures of all kernels)
else:
    for name in KERNELS:
        globals()[name] = getattr(_implementation, name)
        globals()[name].__doc__ = getattr(reference, name).__doc__
