"""The few loops that decide how long learning and planning take: arrays in, arrays out, no state.
Each exists twice, compiled and as a NumPy twin in kernels.twins; ACTIVE says which of them these names are.
"""

from pilotfish.kernels.active import (
    ACTIVE,
    SlowKernels,
    e_step,
    forward_backward,
    log_emissions,
    observe,
    riccati,
    semi_markov,
    semi_markov_e_step,
    semi_markov_forward,
    semi_markov_viterbi,
    semi_tied_sweeps,
    viterbi,
    whiteners,
)
from pilotfish.kernels.arguments import Emissions, SemiMarkovTables
from pilotfish.kernels.results import (
    EStep,
    ForwardBackward,
    Riccati,
    SemiMarkov,
    SemiMarkovEStep,
    SemiMarkovForward,
    Viterbi,
)
from pilotfish.kernels.streams import (
    StreamColumn,
    StreamHead,
    StreamRules,
    StreamState,
    StreamStep,
    Weighting,
    empty_stream,
    stream_row_length,
)

__all__ = [
    "ACTIVE",
    "EStep",
    "Emissions",
    "ForwardBackward",
    "Riccati",
    "SemiMarkov",
    "SemiMarkovEStep",
    "SemiMarkovForward",
    "SemiMarkovTables",
    "SlowKernels",
    "StreamColumn",
    "StreamHead",
    "StreamRules",
    "StreamState",
    "StreamStep",
    "Viterbi",
    "Weighting",
    "e_step",
    "empty_stream",
    "forward_backward",
    "log_emissions",
    "observe",
    "riccati",
    "semi_markov",
    "semi_markov_e_step",
    "semi_markov_forward",
    "semi_markov_viterbi",
    "semi_tied_sweeps",
    "stream_row_length",
    "viterbi",
    "whiteners",
]
