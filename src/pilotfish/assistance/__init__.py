"""Assistance in teleoperation: direct, shared and autonomous control of a remote arm, and virtual fixtures.

`step_assistance` is one step: state, command, frames observed by the operator and actual frames in, state and
target out. The operator's command is recognised in the scene that the operator saw, and carried into the
actual scene. `step_fixture` is one step along a virtual fixture. The package has no network, clock or
simulation.
"""

from pilotfish.assistance.assistant import Assistant, AssistedSkill, assisted_skill, make_assistant
from pilotfish.assistance.authority import Gate, calibrate_gate, coverage_distances
from pilotfish.assistance.intention import (
    Intention,
    IntentionCalibration,
    IntentionFilter,
    IntentionState,
    calibrate_intention,
    intention_filter,
    predictive_log_densities,
    start_intention,
    step_intention,
)
from pilotfish.assistance.learn_fixture import learn_virtual_fixture
from pilotfish.assistance.limits import Limits
from pilotfish.assistance.literal import joint_demonstration
from pilotfish.assistance.mapping import OperatorMapping
from pilotfish.assistance.operator_noise import OperatorNoise
from pilotfish.assistance.phase import add_phase
from pilotfish.assistance.phase_switches import PhaseSwitch
from pilotfish.assistance.rest import direct_skill, misalignment, rest_target
from pilotfish.assistance.step import initial_state, step_assistance
from pilotfish.assistance.values import MODES, AssistanceState, Command, Target
from pilotfish.assistance.virtual_fixture import (
    FixtureState,
    FixtureTarget,
    VirtualFixture,
    nearest_phase,
    start_fixture,
    step_fixture,
    virtual_fixture,
)

__all__ = [
    "MODES",
    "AssistanceState",
    "Assistant",
    "AssistedSkill",
    "Command",
    "FixtureState",
    "FixtureTarget",
    "Gate",
    "Intention",
    "IntentionCalibration",
    "IntentionFilter",
    "IntentionState",
    "Limits",
    "OperatorMapping",
    "OperatorNoise",
    "PhaseSwitch",
    "Target",
    "VirtualFixture",
    "add_phase",
    "assisted_skill",
    "calibrate_gate",
    "calibrate_intention",
    "coverage_distances",
    "direct_skill",
    "initial_state",
    "intention_filter",
    "joint_demonstration",
    "learn_virtual_fixture",
    "make_assistant",
    "misalignment",
    "nearest_phase",
    "predictive_log_densities",
    "rest_target",
    "start_fixture",
    "start_intention",
    "step_assistance",
    "step_fixture",
    "step_intention",
    "virtual_fixture",
]
