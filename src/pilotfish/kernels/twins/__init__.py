"""Every kernel in NumPy, reading like its derivation.
They specify the compiled kernels, test them, and run in their place where the installation found no compiler.
"""

from pilotfish.kernels.twins.chain import forward_backward, viterbi
from pilotfish.kernels.twins.emission import log_emissions
from pilotfish.kernels.twins.expectation import e_step, semi_markov_e_step
from pilotfish.kernels.twins.impedance import impedance
from pilotfish.kernels.twins.semi_markov import semi_markov, semi_markov_forward, semi_markov_viterbi
from pilotfish.kernels.twins.semi_tied import semi_tied_sweeps
from pilotfish.kernels.twins.streaming import observe, observe_one
from pilotfish.kernels.twins.tracking import riccati
from pilotfish.kernels.twins.whitening import whiteners

__all__ = [
    "e_step",
    "forward_backward",
    "impedance",
    "log_emissions",
    "observe",
    "observe_one",
    "riccati",
    "semi_markov",
    "semi_markov_e_step",
    "semi_markov_forward",
    "semi_markov_viterbi",
    "semi_tied_sweeps",
    "viterbi",
    "whiteners",
]
