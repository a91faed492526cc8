"""The few loops that decide how long learning and planning take: arrays in, arrays out, no state."""

from pilotfish.kernels.results import EStep, ForwardBackward, Riccati, Viterbi
from pilotfish.kernels.twins import (
    e_step,
    forward_backward,
    log_emissions,
    riccati,
    semi_tied_sweeps,
    viterbi,
)

__all__ = [
    "EStep",
    "ForwardBackward",
    "Riccati",
    "Viterbi",
    "e_step",
    "forward_backward",
    "log_emissions",
    "riccati",
    "semi_tied_sweeps",
    "viterbi",
]
