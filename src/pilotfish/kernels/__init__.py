"""The few loops that decide how long learning and planning take: arrays in, arrays out, no state.
Each exists twice, compiled and as a NumPy twin in kernels.twins; ACTIVE says which of them these names are.
"""

from pilotfish.kernels.active import (
    ACTIVE,
    SlowKernels,
    e_step,
    forward_backward,
    log_emissions,
    riccati,
    semi_tied_sweeps,
    viterbi,
)
from pilotfish.kernels.results import EStep, ForwardBackward, Riccati, Viterbi

__all__ = [
    "ACTIVE",
    "EStep",
    "ForwardBackward",
    "Riccati",
    "SlowKernels",
    "Viterbi",
    "e_step",
    "forward_backward",
    "log_emissions",
    "riccati",
    "semi_tied_sweeps",
    "viterbi",
]
