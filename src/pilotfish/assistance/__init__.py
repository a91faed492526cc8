"""Assistance in teleoperation: the virtual fixture, along which the operator pulls the robot."""

from pilotfish.assistance.learn_fixture import learn_virtual_fixture
from pilotfish.assistance.phase import add_phase
from pilotfish.assistance.phase_switches import PhaseSwitch
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
    "PhaseSwitch",
    "VirtualFixture",
    "add_phase",
    "learn_virtual_fixture",
    "nearest_phase",
    "start_fixture",
    "step_fixture",
    "virtual_fixture",
]
