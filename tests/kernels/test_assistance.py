"""One step of assistance: both implementations agree, and never lose the invariants of their result."""

from dataclasses import fields, replace

import numpy as np
import pytest
from assistance_arguments import assistance_arguments

from pilotfish.errors import InvalidInput
from pilotfish.kernels import reference
from pilotfish.kernels.assistance_types import AUTONOMOUS, DIRECT
from pilotfish.kernels.reference.target_motion import deviation

pytestmark = pytest.mark.usefixtures("unchecked")  # annotations cost many times the steps


def require_close(one, other):
    """Compare every number of two memories."""
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if field.name == "filter":
            require_close(a, b)
        else:
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9, err_msg=field.name)


def test_compiled_step_equals_reference(compiled, rng):
    """Any number of states, scalars and ages, with and without orientation, in every mode."""
    for _ in range(60):
        arguments = assistance_arguments(rng)
        one, other = (kernels.assistance_step(*arguments) for kernels in (compiled, reference))
        require_close(one.memory, other.memory)
        np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(one.probabilities, other.probabilities, rtol=1e-9, atol=1e-12)


def test_compiled_steps_in_a_row_equal_reference(compiled, rng):
    """Differences do not grow over 200 steps with jumps of the hand and changes of the clutch."""
    *model, settings, memory, given = assistance_arguments(rng)
    given = replace(given, mode=1, given_pose=None, given_covariance=None, dt=0.02)
    memories = [memory, memory]
    centre = memory.pose
    for step in range(200):
        if step % 20 == 0:
            hand = centre + 0.05 * rng.normal(size=centre.size)
        given = replace(given, hand=hand, is_closed=bool(rng.random() < 0.9), has_changed=step % 50 == 0)
        memories = [
            kernels.assistance_step(*model, settings, before, given).memory
            for kernels, before in zip((compiled, reference), memories, strict=True)
        ]
    require_close(*memories)


def test_step_keeps_belief_and_limits(kernels, rng):
    for _ in range(30):
        *model, settings, memory, given = assistance_arguments(rng)
        after, covariance, probabilities = kernels.assistance_step(*model, settings, memory, given)
        assert after.filter.belief.sum() == pytest.approx(1.0)
        assert probabilities.sum() == pytest.approx(1.0)
        assert 0.0 <= after.authority <= 1.0
        assert abs(after.authority - memory.authority) <= 2.0 * given.dt + 1e-12
        np.testing.assert_allclose(covariance, covariance.T, atol=1e-12)
        assert np.linalg.eigvalsh(covariance).min() > -1e-12
        assert np.linalg.norm(after.velocity[:3]) <= settings.speed + 1e-9
        assert np.isfinite(after.pose).all()


def test_direct_control_far_from_limits_is_the_mapped_hand(kernels, rng):
    """With a desired pose that has been reached and moves slowly, the target is the command."""
    while True:
        *model, settings, memory, given = assistance_arguments(rng)
        if memory.is_following and given.is_closed and np.isfinite(given.hand).all():
            break
    given = replace(given, mode=DIRECT, given_pose=None, given_covariance=None, has_changed=False, dt=0.1)
    memory = replace(memory, blend_time=9.0, held_values=np.full_like(memory.held_values, np.nan))
    free = replace(settings, speed=1e3, acceleration=1e6, angular_speed=1e3, angular_acceleration=1e6)
    free = replace(free, lower=np.full(3, -9.0), upper=np.full(3, 9.0))
    for _ in range(3):
        memory = kernels.assistance_step(*model, free, memory, given).memory
    hand_map, x = model[0], memory.command
    np.testing.assert_allclose(x[:3], hand_map.matrix @ given.hand[:3] + hand_map.shift, atol=1e-12)
    np.testing.assert_allclose(deviation(x, memory.pose, x.size != memory.offset.size), 0.0, atol=1e-9)


def test_change_does_not_move_a_target_that_is_far_behind_the_desired_pose(kernels, rng):
    """The blend begins at the target, and not where the desired pose was."""
    for _ in range(20):
        *model, settings, memory, given = assistance_arguments(rng)
        far = memory.pose.copy()
        far[:3] += 0.3
        memory = replace(memory, velocity=np.zeros_like(memory.velocity), desired=far)
        settings = replace(settings, lower=np.full(3, -9.0), upper=np.full(3, 9.0))
        after = kernels.assistance_step(*model, settings, memory, replace(given, has_changed=True)).memory
        np.testing.assert_allclose(after.pose[:3], memory.pose[:3], atol=1e-9)


def bad_arguments(name: str) -> tuple[int, dict]:
    """Return the index of the argument to change, and the change."""
    return {
        "orphan column": (4, {"held_values": np.zeros(7)}),
        "mode": (5, {"mode": 3}),
        "time": (5, {"dt": 0.0}),
        "flag": (5, {"is_closed": 1}),
        "plan": (5, {"mode": AUTONOMOUS, "given_pose": None, "given_covariance": None}),
        "half": (5, {"mode": DIRECT, "given_pose": None, "given_covariance": np.eye(2)}),
        "period": (3, {"period": np.nan}),
        "means": (1, {"actual_means": np.full((2, 3), np.nan)}),
    }[name]


@pytest.mark.parametrize("name", ["orphan column", "mode", "time", "flag", "plan", "half", "period", "means"])
def test_invalid_arguments_raise(kernels, name):
    arguments = assistance_arguments(np.random.default_rng(0))
    index, changes = bad_arguments(name)
    arguments[index] = replace(arguments[index], **changes)
    with pytest.raises(InvalidInput):
        kernels.assistance_step(*arguments)
