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
from pilotfish.kernels.results import EStep, SemiMarkovForward
from pilotfish.kernels.stream_state import (
    MAX_VALUE,
    ClusterColumn,
    StreamCounter,
    StreamParameters,
    StreamState,
    StreamStep,
    Weighting,
    empty_stream,
    round_up_to_four,
    stream_row_length,
    zero_stream,
)

__all__ = [
    "BACKEND",
    "MAX_VALUE",
    "ArmCommand",
    "ArmLimits",
    "ArmState",
    "ClusterColumn",
    "EStep",
    "Emissions",
    "ImpedanceParameters",
    "SemiMarkovForward",
    "SemiMarkovTables",
    "SlowKernelsWarning",
    "StreamCounter",
    "StreamParameters",
    "StreamState",
    "StreamStep",
    "ToolTarget",
    "Weighting",
    "clip_torque",
    "e_step",
    "empty_stream",
    "forward_backward",
    "impedance_torque",
    "log_emissions",
    "observe",
    "observe_one",
    "precision_cholesky",
    "riccati",
    "round_up_to_four",
    "semi_markov_e_step",
    "semi_markov_forward",
    "semi_markov_forward_backward",
    "semi_markov_viterbi",
    "semi_tied_sweeps",
    "stream_row_length",
    "viterbi",
    "zero_non_finite",
    "zero_stream",
]
