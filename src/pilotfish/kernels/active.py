"""The compiled kernels where they exist, their NumPy twins elsewhere."""

import warnings


class SlowKernels(UserWarning):
    """The compiled kernels are missing: the same numbers, an order of magnitude later."""


try:
    from pilotfish.kernels.compiled import LEVEL as ACTIVE
    from pilotfish.kernels.compiled import (
        e_step,
        forward_backward,
        impedance,
        log_emissions,
        observe,
        observe_one,
        riccati,
        semi_markov,
        semi_markov_e_step,
        semi_markov_forward,
        semi_markov_viterbi,
        semi_tied_sweeps,
        viterbi,
        whiteners,
    )
except ImportError as reason:
    from pilotfish.kernels.twins import (
        e_step,
        forward_backward,
        impedance,
        log_emissions,
        observe,
        observe_one,
        riccati,
        semi_markov,
        semi_markov_e_step,
        semi_markov_forward,
        semi_markov_viterbi,
        semi_tied_sweeps,
        viterbi,
        whiteners,
    )

    ACTIVE = "numpy"
    warnings.warn(
        f"pilotfish runs on NumPy, without its compiled kernels ({reason}): same results, but learning "
        "and planning take many times as long; install a C++17 compiler (Debian: g++, python3-dev), "
        "then install pilotfish again",
        SlowKernels,
        stacklevel=2,
    )

__all__ = [
    "ACTIVE",
    "SlowKernels",
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
