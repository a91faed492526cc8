"""pilotfish with the kernels of any 64-bit processor, where this one would run newer ones."""

from libraries import pilotfish
from libraries.pilotfish import em, em_visits
from libraries.pilotfish_streams import from_array, worst_case

from pilotfish.kernels import compiled

compiled._native = compiled._baseline

__all__ = ["em", "em_visits", "from_array", "remark", "worst_case"]


def print_note() -> str:
    return f"kernels: portable, not {pilotfish.print_note().removeprefix('kernels: ')}"
