"""pilotfish with the portable kernels for any 64-bit processor."""

from libraries import pilotfish
from libraries.pilotfish import em, em_semi_markov
from libraries.pilotfish_streams import from_array, worst_case

from pilotfish.kernels import compiled

compiled._native = compiled._baseline

__all__ = ["em", "em_semi_markov", "from_array", "remark", "worst_case"]


def remark() -> str:
    return f"kernels: portable, not {pilotfish.remark().removeprefix('kernels: ')}"
