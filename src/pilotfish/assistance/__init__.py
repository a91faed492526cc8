"""Assistance in teleoperation: the virtual fixture, a learned path along which the operator pulls the robot."""

from pilotfish.assistance.learn_fixture import learn_virtual_fixture
from pilotfish.assistance.phase import add_phase, logistic_phase, path_phase
from pilotfish.assistance.phase_regression import Guide, PhaseMixture, condition_on_phase, regress_on_phase
from pilotfish.assistance.phase_switches import PhaseSwitch, learn_switch
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
    "FixtureState",
    "FixtureTarget",
    "Guide",
    "PhaseMixture",
    "PhaseSwitch",
    "VirtualFixture",
    "add_phase",
    "condition_on_phase",
    "learn_switch",
    "learn_virtual_fixture",
    "logistic_phase",
    "nearest_phase",
    "path_phase",
    "regress_on_phase",
    "start_fixture",
    "step_fixture",
    "virtual_fixture",
]
