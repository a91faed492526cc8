"""Every kernel in NumPy, reading like its derivation.
They specify the compiled kernels, test them, and run in their place where the installation found no compiler.
"""

from pilotfish.kernels.reference.validated import (
    e_step,
    forward_backward,
    impedance,
    log_emissions,
    observe,
    observe_one,
    precision_cholesky,
    riccati,
    semi_markov,
    semi_markov_e_step,
    semi_markov_forward,
    semi_markov_viterbi,
    semi_tied_sweeps,
    viterbi,
)

__all__ = [
    "e_step",
    "forward_backward",
    "impedance",
    "log_emissions",
    "observe",
    "observe_one",
    "precision_cholesky",
    "riccati",
    "semi_markov",
    "semi_markov_e_step",
    "semi_markov_forward",
    "semi_markov_viterbi",
    "semi_tied_sweeps",
    "viterbi",
]
