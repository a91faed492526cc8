"""Operators of a remote robot in physics: link, displaced view, assistance and its target."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pilotfish.assistance import Assistant, assisted_skill, make_assistant
from pilotfish.environments import TASKS, Task, Workcell
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, angle, from_rotation_vector
from pilotfish.io import open_skill
from pilotfish.simulation import (
    Link,
    TeleoperationResult,
    displace_view,
    situation_from_seed,
    teleoperate,
)

pytestmark = pytest.mark.usefixtures("unchecked")

Run = Callable[..., TeleoperationResult]


@pytest.fixture(scope="module")
def assistant(alignment_skill: Path) -> Assistant:
    return make_assistant([assisted_skill(open_skill(alignment_skill / "skill"))])


@pytest.fixture
def operate(assistant: Assistant, alignment_task: Task[Any]) -> Run:
    """Return a function that operates the robot in one situation."""

    def run(number: int = 0, **options: Any) -> TeleoperationResult:
        situation = situation_from_seed(alignment_task, "test", 0, number)
        return teleoperate(assistant, alignment_task, situation, np.random.default_rng(number), **options)

    return run


def last_distance(result: TeleoperationResult) -> float:
    """Return the distance of the last target from the last command [m]."""
    return float(np.linalg.norm(result.targets[-1, :3] - result.hands[-1, :3]))


def test_teleoperate_direct_target_is_command(operate: Run):
    result = operate(mode="direct")
    assert result.outcome.success
    assert (result.authority == 0.0).all()
    assert last_distance(result) < 1e-6
    assert len(result.hands) == len(result.forces) == pytest.approx(result.duration / 0.02, abs=1)
    same = operate(mode="direct")
    assert np.array_equal(same.measured, result.measured)


@pytest.mark.parametrize("number", range(2))
def test_teleoperate_view_is_off_fails_directly_and_succeeds_shared(operate: Run, number: int):
    """The operator moves to where the objects seem to be; shared control carries him to where they are."""
    link = Link(view_distance=0.05)
    direct, shared = (operate(number, mode=mode, link=link) for mode in ("direct", "shared"))
    assert not direct.outcome.success
    assert direct.outcome.error == pytest.approx(0.05, abs=0.015)
    assert shared.outcome.success
    assert last_distance(shared) == pytest.approx(0.05, abs=0.015)


def test_teleoperate_delay_delays_commands(operate: Run):
    prompt, late = (operate(mode="direct", link=Link(delay=delay)) for delay in (0.0, 0.5))
    np.testing.assert_array_equal(late.hands[:25], np.repeat(prompt.hands[:1], 25, axis=0))
    np.testing.assert_allclose(late.hands[25 : len(prompt.hands)], prompt.hands[:-25], atol=1e-9)
    assert late.outcome.success


def test_teleoperate_autonomous_finishes_without_operator(operate: Run):
    """Control switches while the operator is on the way, and the plan continues from there."""
    result = operate(mode=lambda time: "shared" if time < 0.5 else "autonomous")
    assert result.outcome.success
    steps = np.linalg.norm(np.diff(result.targets[:, :3], axis=0), axis=1)
    assert steps.max() < 0.5 * 0.02 + 1e-6  # the default limit of speed


def test_displace_view_is_rigid(rng: np.random.Generator):
    poses = {name: Pose(rng.normal(size=3), from_rotation_vector(rng.normal(size=3))) for name in "abc"}
    seen = displace_view(poses, Link(view_distance=0.03, view_angle=0.2), rng)(poses)
    middle = np.mean([pose.position for pose in poses.values()], axis=0)
    shift = np.mean([pose.position for pose in seen.values()], axis=0) - middle
    assert np.linalg.norm(shift) == pytest.approx(0.03)
    assert shift[2] == pytest.approx(0.0, abs=1e-12)
    for name, pose in poses.items():
        assert angle(seen[name].quaternion, pose.quaternion) == pytest.approx(0.2)
        between, expected = (
            np.linalg.norm(each["a"].position - each[name].position) for each in (seen, poses)
        )
        assert between == pytest.approx(expected)


@pytest.mark.parametrize(
    "options", [{"delay": -1.0}, {"delay": np.nan}, {"view_distance": 2.0}, {"view_angle": 4.0}]
)
def test_link_out_of_range_is_refused(options: dict[str, float]):
    with pytest.raises(InvalidInput, match=next(iter(options))):
        Link(**options)


def test_teleoperate_other_task_is_refused(assistant: Assistant):
    for name, message in (("stab", "columns"), ("plate", "frames")):
        task = TASKS[name]
        with pytest.raises(InvalidInput, match=message):
            teleoperate(assistant, task, situation_from_seed(task, "test", 0, 0), np.random.default_rng(0))


def test_step_teleoperation_moves_arms_apart(alignment_task: Task[Any]):
    """Each arm reaches its own target."""
    cell = Workcell(alignment_task, situation_from_seed(alignment_task, "test", 0, 0), guided=True)
    up, down = (
        Pose(cell.target.position + np.array([0.0, 0.0, z]), cell.target.quaternion) for z in (0.05, -0.02)
    )
    cell.step_teleoperation(up, down, 0.0, 1000)
    cell.step_teleoperation(up, down, 0.0, 1000)
    assert np.linalg.norm(cell.guided_tool.position - up.position) < 0.005
    assert np.linalg.norm(cell.arm.tool.position - down.position) < 0.005
    with pytest.raises(InvalidInput, match="guided=True"):
        Workcell(alignment_task, cell.situation).step_teleoperation(up, down, 0.0, 1)
