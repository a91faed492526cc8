"""Assistance in teleoperation: direct, shared and autonomous control of a remote arm with a learned skill.

`step_assistance` is one step: state, command, frames observed by the operator and actual frames in, state and
target out. The operator's command is recognised in the scene that the operator saw, and carried into the
actual scene. The package has no network, clock or simulation.
"""

from pilotfish.assistance.assistant import Assistant, AssistedSkill, assisted_skill, make_assistant
from pilotfish.assistance.authority import Gate, calibrate_gate, coverage_distances
from pilotfish.assistance.limits import Limits
from pilotfish.assistance.literal import joint_demonstration
from pilotfish.assistance.mapping import OperatorMapping
from pilotfish.assistance.operator_noise import OperatorNoise
from pilotfish.assistance.step import initial_state, step_assistance
from pilotfish.assistance.values import MODES, AssistanceState, Command, Target

__all__ = [
    "MODES",
    "AssistanceState",
    "Assistant",
    "AssistedSkill",
    "Command",
    "Gate",
    "Limits",
    "OperatorMapping",
    "OperatorNoise",
    "Target",
    "assisted_skill",
    "calibrate_gate",
    "coverage_distances",
    "initial_state",
    "joint_demonstration",
    "make_assistant",
    "step_assistance",
]
