"""Faults of a session: each is survived, and an invariant that is violated is noticed."""

import numpy as np
import pytest
from fault_rig import Pilot, Rig, path
from faults import SCENARIOS, order, summarise, try_fault

from pilotfish import teleop
from pilotfish.teleop import SessionState

pytestmark = pytest.mark.usefixtures("unchecked")
FAST = ("R1", "R3", "R8", "R9", "R10", "R11, robot", "R15", "R17", "R21, wrong hash", "R22")
RUNS = 2


@pytest.mark.parametrize("name", FAST)
def test_fault_of_one_seed_is_survived(name, rng):
    assert try_fault(name, int(rng.integers(10**6))) == []


@pytest.mark.slow  # a minute: every fault, one of them in physics
@pytest.mark.parametrize("name", order())
def test_fault_of_some_seeds_is_survived(name):
    assert [try_fault(name, seed) for seed in range(RUNS)] == [[]] * RUNS


def test_faults_cover_every_number_of_the_specification():
    numbers = {int(name.split(",")[0][1:]) for name in SCENARIOS}
    assert numbers == set(range(1, 26))
    assert all(summarise(name, [[], ["broken"]]).statement for name in SCENARIOS)


def test_rig_motion_in_a_state_of_rest_is_noticed(monkeypatch):
    rig = Rig(np.random.default_rng(0), [Pilot("direct")], skills=())
    rig.run_until_active()
    rig.run(1.0)
    original = rig.session.step_robot

    def moving(time_ns, robot, injected=()):
        step = original(time_ns, robot, injected)
        control = step.site.control
        object.__setattr__(control, "state", SessionState.DISARMED)
        return step

    monkeypatch.setattr(rig.session, "step_robot", moving)
    rig.pilots[1].offset = np.array([0.3, 0.0, 0.0])
    rig.run(0.5)
    assert any("moves in" in statement for statement in rig.broken)


def test_rig_hand_follows_the_demonstration():
    rig = Rig(np.random.default_rng(0), [Pilot("direct")], skills=())
    rig.run_until_active()
    rig.run(5.0)
    distances = np.linalg.norm(path(6)[:, :3] - rig.pose[:3], axis=1)
    assert distances.min() < 0.005
    assert isinstance(rig.views[1].report, teleop.Report)
