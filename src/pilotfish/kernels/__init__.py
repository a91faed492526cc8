"""The loops that dominate the time of learning and planning: arrays in, arrays out, no state.

Each kernel exists twice, compiled and as a NumPy reference in kernels.reference; BACKEND names the one in
use.
"""

from pilotfish.kernels.arguments import Emissions, SemiMarkovTables
from pilotfish.kernels.arm_types import (
    ArmCommand,
    ArmLimits,
    ArmState,
    ImpedanceParameters,
    ToolTarget,
    clip_torque,
    zero_non_finite,
)
from pilotfish.kernels.backend import (
    BACKEND,
    SlowKernelsWarning,
    e_step,
    forward_backward,
    impedance_torque,
    log_emissions,
    observe,
    observe_one,
    precision_cholesky,
    riccati,
    semi_markov_e_step,
    semi_markov_forward,
    semi_markov_forward_backward,
    semi_markov_viterbi,
    semi_tied_sweeps,
    viterbi,
)
from pilotfish.kernels.results import EStep
from pilotfish.kernels.stream_state import (
    MAX_VALUE,
    Assignments,
    StreamParameters,
    StreamState,
    Weighting,
    zero_arrays,
)

__all__ = [
    "BACKEND",
    "MAX_VALUE",
    "ArmCommand",
    "ArmLimits",
    "ArmState",
    "Assignments",
    "EStep",
    "Emissions",
    "ImpedanceParameters",
    "SemiMarkovTables",
    "SlowKernelsWarning",
    "StreamParameters",
    "StreamState",
    "ToolTarget",
    "Weighting",
    "clip_torque",
    "e_step",
    "forward_backward",
    "impedance_torque",
    "log_emissions",
    "observe",
    "observe_one",
    "precision_cholesky",
    "riccati",
    "semi_markov_e_step",
    "semi_markov_forward",
    "semi_markov_forward_backward",
    "semi_markov_viterbi",
    "semi_tied_sweeps",
    "viterbi",
    "zero_arrays",
    "zero_non_finite",
]
