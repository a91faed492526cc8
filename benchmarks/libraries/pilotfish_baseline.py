"""pilotfish with the kernels of any 64-bit processor, where this one would run newer ones."""

from libraries import pilotfish
from libraries.pilotfish import em, em_visits

from pilotfish.kernels import compiled

compiled._native = compiled._baseline

__all__ = ["em", "em_visits", "remark"]


def remark() -> str:
    return f"kernels: portable, not {pilotfish.remark().removeprefix('kernels: ')}"
