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
from pilotfish.kernels.assistance_types import (
    AUTONOMOUS,
    DIRECT,
    SHARED,
    AssistanceInput,
    AssistanceMemory,
    AssistanceSettings,
    AssistanceStep,
    CarriedModel,
)
from pilotfish.kernels.backend import (
    BACKEND,
    SlowKernelsWarning,
    assistance_step,
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
from pilotfish.kernels.hand_map import HandMap, is_valid_hand, map_hand
from pilotfish.kernels.occupancy import (
    OccupancyTables,
    StateFilter,
    advance_filter,
    observe_command,
    predict_belief,
)
from pilotfish.kernels.reference.assistance import (
    command_log_likelihoods,
    coverage_distance,
    gate_authority,
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
    "AUTONOMOUS",
    "BACKEND",
    "DIRECT",
    "MAX_VALUE",
    "SHARED",
    "ArmCommand",
    "ArmLimits",
    "ArmState",
    "Assignments",
    "AssistanceInput",
    "AssistanceMemory",
    "AssistanceSettings",
    "AssistanceStep",
    "CarriedModel",
    "EStep",
    "Emissions",
    "HandMap",
    "ImpedanceParameters",
    "OccupancyTables",
    "SemiMarkovTables",
    "SlowKernelsWarning",
    "StateFilter",
    "StreamParameters",
    "StreamState",
    "ToolTarget",
    "Weighting",
    "advance_filter",
    "assistance_step",
    "clip_torque",
    "command_log_likelihoods",
    "coverage_distance",
    "e_step",
    "forward_backward",
    "gate_authority",
    "impedance_torque",
    "is_valid_hand",
    "log_emissions",
    "map_hand",
    "observe",
    "observe_command",
    "observe_one",
    "precision_cholesky",
    "predict_belief",
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
