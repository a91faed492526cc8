"""One second of each task with guidance and with impedance control satisfies all annotations.

Other physics tests run unchecked, because checks cost five to eight times the physics.
"""

import numpy as np
import pytest
from jaxtyping import config
from simulated_demonstration import simulate_human_demonstration

from pilotfish.environments import RECORDED_VALVE, TASKS, Workcell

EVERY_TASK = {**TASKS, RECORDED_VALVE.name: RECORDED_VALVE}


@pytest.fixture(autouse=True)
def annotations_are_checked(checked):
    assert not config.jaxtyping_disable


@pytest.mark.parametrize("name", sorted(EVERY_TASK))
def test_step_guidance_every_task_satisfies_annotations(name, rng):
    task = EVERY_TASK[name]
    cell = simulate_human_demonstration(task, task.sample_situation(rng), rng, seconds=1.0)
    assert cell.time == pytest.approx(1.0, abs=0.02)
    assert not cell.outcome().success


@pytest.mark.parametrize("name", sorted(EVERY_TASK))
def test_step_impedance_every_task_satisfies_annotations(name, rng):
    task = EVERY_TASK[name]
    cell = Workcell(task, task.sample_situation(rng))
    goal = type(cell.target)(cell.target.position + np.array([0.0, 0.05, 0.0]), cell.target.quaternion)
    for _ in range(10):
        cell.step_impedance(goal, 0.0, 100)
    assert np.linalg.norm(cell.arm.tool.position - goal.position) < 0.02
    assert not cell.outcome().success
