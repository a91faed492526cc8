"""The compiled kernels where they exist, their NumPy references elsewhere."""

import warnings


class SlowKernelsWarning(UserWarning):
    """The compiled kernels are missing: the same numbers, an order of magnitude later."""


try:
    from pilotfish.kernels.compiled import INSTRUCTION_SET as BACKEND
    from pilotfish.kernels.compiled import (
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
except ImportError as reason:
    from pilotfish.kernels.reference import (
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

    BACKEND = "numpy"
    warnings.warn(
        f"pilotfish runs on NumPy, without its compiled kernels ({reason}): same results, but learning "
        "and planning take many times as long; install a C++17 compiler (Debian: g++, python3-dev), "
        "then install pilotfish again",
        SlowKernelsWarning,
        stacklevel=2,
    )

__all__ = [
    "BACKEND",
    "SlowKernelsWarning",
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
