"""Impedance control: balance at rest, limits, unusable targets, and checks of parameters."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pilotfish.control import (
    arm_limits,
    impedance,
    impedance_torque,
    posture_torque,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import from_rotation_vector, multiply, rotation_matrix
from pilotfish.kernels import ArmLimits, ArmState, ImpedanceParameters, ToolTarget, reference

ARM = 7
STRONG = arm_limits([-4.0] * ARM, [4.0] * ARM, [2.0] * ARM, [1e4] * ARM)
WEAK = arm_limits([-4.0] * ARM, [4.0] * ARM, [2.0] * ARM, [50.0] * 4 + [15.0] * 3)
UP = np.array([1.0, 0.0, 0.0, 0.0])


def unit_quaternion(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def random_state(rng, *, at_rest=False):
    """Return a random state of an arm away from singular postures."""
    J = rng.normal(size=(6, ARM))
    while np.linalg.svd(J, compute_uv=False)[-1] < 0.3:
        J = rng.normal(size=(6, ARM))
    velocity = np.zeros(ARM) if at_rest else rng.normal(size=ARM)
    bias = rng.uniform(-10.0, 10.0, ARM)
    return ArmState(rng.uniform(-3.0, 3.0, ARM), velocity, rng.normal(size=3), unit_quaternion(rng), J, bias)


def target_near(rng, reading, distance=0.01):
    step = distance * rng.normal(size=6)
    rotated = multiply(from_rotation_vector(step[3:]), reading.quaternion)
    return ToolTarget(reading.position + step[:3], rotated, np.zeros(6)), step


def test_impedance_torque_at_rest_equals_spring_force_for_any_posture(rng):
    """The torques beyond the bias equal K e at the tool, J^+' tau, whatever the posture."""
    reading = random_state(rng, at_rest=True)
    target, step = target_near(rng, reading)
    for posture_stiffness in (0.0, 10.0, 80.0):
        springs = impedance(rng.normal(size=ARM), posture_stiffness=posture_stiffness)
        command = impedance_torque(springs, STRONG, reading, target)
        wrench = np.linalg.pinv(reading.jacobian).T @ (command.torque - reading.bias)
        np.testing.assert_allclose(wrench, springs.stiffness * step, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(command.wrench, springs.stiffness * step, rtol=1e-8, atol=1e-9)


def test_impedance_torque_at_target_equals_bias(rng):
    """At the target pose, posture and twist, with undamped joints, the torque is the bias."""
    reading = random_state(rng)
    springs = impedance(reading.q, joint_damping=0.0)
    twist = reading.jacobian @ reading.velocity
    target = ToolTarget(reading.position, -reading.quaternion, twist)
    command = impedance_torque(springs, STRONG, reading, target)
    np.testing.assert_allclose(command.torque, reading.bias, atol=1e-9)
    assert command.torque_fraction == 1.0


def test_impedance_torque_without_springs_dissipates_energy(rng):
    """Without springs and with a target at rest, the power beyond the bias is not positive."""
    springs = impedance(np.zeros(ARM), stiffness=(0.0, 0.0), posture_stiffness=0.0, limit_stiffness=0.0)
    for _ in range(20):
        reading = random_state(rng)
        target, _ = target_near(rng, reading)
        command = impedance_torque(springs, STRONG, reading, target)
        assert reading.velocity @ (command.torque - reading.bias) < 0.0


def test_impedance_torque_rotated_world_is_unchanged(rng):
    """Isotropic springs give the same torques in a rotated world."""
    reading, springs = random_state(rng), impedance(np.zeros(ARM))
    target, _ = target_near(rng, reading, 0.5)
    turn, shift = unit_quaternion(rng), rng.normal(size=3)
    R, RR = rotation_matrix(turn), np.kron(np.eye(2), rotation_matrix(turn))
    rotated = dataclasses.replace(
        reading,
        position=R @ reading.position + shift,
        quaternion=multiply(turn, reading.quaternion),
        jacobian=RR @ reading.jacobian,
    )
    rotated_target = ToolTarget(
        R @ target.position + shift, multiply(turn, target.quaternion), RR @ target.twist
    )
    expected = impedance_torque(springs, WEAK, reading, target)
    found = impedance_torque(springs, WEAK, rotated, rotated_target)
    np.testing.assert_allclose(found.torque, expected.torque, atol=1e-9)
    np.testing.assert_allclose(found.wrench, RR @ expected.wrench, atol=1e-9)


def test_impedance_torque_far_target_reaches_force_limits(rng):
    """The norms of force and moment equal their limits, in the direction of the springs."""
    reading, springs = (
        random_state(rng, at_rest=True),
        impedance(np.zeros(ARM), force_limit=20.0, moment_limit=3.0),
    )
    target, step = target_near(rng, reading, 0.5)
    wrench = impedance_torque(springs, STRONG, reading, target).wrench
    for part, limit in ((slice(0, 3), 20.0), (slice(3, 6), 3.0)):
        np.testing.assert_allclose(np.linalg.norm(wrench[part]), limit, rtol=1e-12)
        direction = step[part] / np.linalg.norm(step[part])
        np.testing.assert_allclose(wrench[part], limit * direction, rtol=1e-7)


def test_impedance_torque_speed_is_bounded_by_limit_over_damping(rng):
    """At limit / damping, spring and damper balance; above, the damper brakes."""
    springs = impedance(np.zeros(ARM), damping=(50.0, 3.0), force_limit=20.0)
    reading = dataclasses.replace(random_state(rng), jacobian=np.eye(6, ARM))
    target = ToolTarget(reading.position + 5.0 * np.eye(3)[0], reading.quaternion, np.zeros(6))
    for speed, force in ((0.0, 20.0), (0.2, 10.0), (0.4, 0.0), (0.6, -10.0)):
        moving = dataclasses.replace(reading, velocity=speed * np.eye(ARM)[0])
        wrench = impedance_torque(springs, STRONG, moving, target).wrench
        np.testing.assert_allclose(wrench, force * np.eye(6)[0], atol=1e-9)


def test_impedance_torque_weak_joints_are_clipped_separately(rng):
    """Torques equal those of strong joints, clipped; torque_fraction is the smallest fraction given."""
    springs = impedance(np.zeros(ARM), force_limit=500.0, moment_limit=100.0, posture_stiffness=60.0)
    fractions = []
    for _ in range(20):
        reading = random_state(rng)
        target, _ = target_near(rng, reading, 0.3)
        strong, weak = (impedance_torque(springs, limits, reading, target) for limits in (STRONG, WEAK))
        assert strong.torque_fraction == 1.0
        np.testing.assert_allclose(weak.torque, np.clip(strong.torque, -WEAK.torque, WEAK.torque), atol=1e-9)
        shares = [
            (torque - bias) / (unclipped - bias)
            for torque, unclipped, bias in zip(weak.torque, strong.torque, reading.bias, strict=True)
        ]
        assert weak.torque_fraction == pytest.approx(min(1.0, *shares), abs=1e-9)
        fractions.append(weak.torque_fraction)
    assert 0.0 < min(fractions) < 1.0


def test_torque_overloaded_joint_leaves_others_unchanged(rng):
    """Its torque is clipped, torque_fraction is 0, and the other joints are unaffected."""
    reading = random_state(rng)
    bias = reading.bias.copy()
    bias[1] = -1e4  # over its limit for any further torque
    heavy = dataclasses.replace(reading, bias=bias)
    target, others = target_near(rng, reading)[0], np.arange(ARM) != 1
    for controller in (
        lambda limits, read: impedance_torque(impedance(np.zeros(ARM)), limits, read, target),
        lambda limits, read: posture_torque(50.0, 1.0, limits, read, np.zeros(ARM)),
    ):
        command = controller(WEAK, heavy)
        assert command.torque_fraction == 0.0
        assert command.torque[1] == -WEAK.torque[1]
        np.testing.assert_array_equal(command.torque[others], controller(WEAK, reading).torque[others])


ANY = st.floats(width=64) | st.floats(-5.0, 5.0)  # includes infinity and NaN


def arrays(*shape):
    size = int(np.prod(shape))
    return st.lists(ANY, min_size=size, max_size=size).map(lambda numbers: np.array(numbers).reshape(shape))


@given(
    st.builds(ArmState, arrays(3), arrays(3), arrays(3), arrays(4), arrays(6, 3), arrays(3)),
    st.builds(ToolTarget, arrays(3), arrays(4), arrays(6)),
)
def test_torque_any_numbers_give_finite_torques_within_limits(reading, target):
    """Any 64-bit numbers in state and target give finite torques within the limits, in both backends."""
    limits = arm_limits([-3.0] * 3, [3.0] * 3, [1.0] * 3, [50.0, 20.0, 5.0])
    for command in (
        impedance_torque(impedance([0.1, 0.2, 0.3]), limits, reading, target),
        reference.impedance_torque(impedance([0.1, 0.2, 0.3]), limits, reading, target),
        posture_torque(100.0, 2.0, limits, reading, target.position),
    ):
        assert (np.abs(command.torque) <= limits.torque).all()
        assert 0.0 <= command.torque_fraction <= 1.0
        assert np.linalg.norm(command.wrench[:3]) <= 60.0 * (1.0 + 1e-12)
        assert np.linalg.norm(command.wrench[3:]) <= 12.0 * (1.0 + 1e-12)


@pytest.mark.parametrize("part", ["position", "quaternion", "twist"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_impedance_torque_target_not_finite_leaves_bias_and_damping(rng, part, value):
    """Only bias, joint damping and the joint-limit springs remain: no wrench and no posture."""
    reading, springs = random_state(rng), impedance(np.zeros(ARM), joint_damping=2.0)
    target, _ = target_near(rng, reading)
    changed = getattr(target, part).copy()
    changed[2] = value
    command = impedance_torque(springs, STRONG, reading, dataclasses.replace(target, **{part: changed}))
    np.testing.assert_allclose(command.torque, reading.bias - 2.0 * reading.velocity, atol=1e-12)
    np.testing.assert_array_equal(command.wrench, 0.0)


def test_impedance_torque_zero_quaternion_gives_bias(rng):
    """The zero quaternion is treated as a target that is not finite."""
    reading = random_state(rng, at_rest=True)
    target = ToolTarget(reading.position + 0.1, np.zeros(4), np.zeros(6))
    command = impedance_torque(impedance(np.zeros(ARM)), STRONG, reading, target)
    np.testing.assert_array_equal(command.torque, reading.bias)


def test_impedance_torque_joint_in_margin_is_pushed_back(rng):
    """The torque is limit_stiffness times the depth inside the margin, and zero outside it."""
    springs = impedance(
        np.zeros(ARM), posture_stiffness=0.0, limit_margin=0.2, limit_stiffness=50.0, joint_damping=0.0
    )
    reading = random_state(rng, at_rest=True)
    target = ToolTarget(reading.position, reading.quaternion, np.zeros(6))
    depth = np.array(
        [-1.0, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3]
    )  # relative to the limit at 4, with a margin of 0.2
    for sign in (1.0, -1.0):
        near = dataclasses.replace(reading, q=sign * (4.0 + depth))
        torque = impedance_torque(springs, STRONG, near, target).torque - reading.bias
        np.testing.assert_allclose(torque, -sign * 50.0 * np.maximum(depth + 0.2, 0.0), atol=1e-9)


def test_posture_torque_equals_springs_and_dampers(rng):
    """A posture outside the limits is clipped to them."""
    reading, posture = random_state(rng), 3.0 * rng.normal(size=ARM)
    stiffness, damping = rng.uniform(10.0, 100.0, ARM), rng.uniform(1.0, 5.0, ARM)
    command = posture_torque(stiffness, damping, STRONG, reading, posture)
    torque = stiffness * (np.clip(posture, -4.0, 4.0) - reading.q) - damping * reading.velocity
    np.testing.assert_allclose(command.torque, reading.bias + torque, atol=1e-9)
    np.testing.assert_array_equal(command.wrench, 0.0)
    posture[3] = np.nan
    partial = posture_torque(stiffness, damping, STRONG, reading, posture).torque
    np.testing.assert_allclose(np.delete(partial, 3), np.delete(command.torque, 3), atol=1e-12)
    np.testing.assert_allclose(partial[3], reading.bias[3] - damping[3] * reading.velocity[3], atol=1e-12)


def test_impedance_and_arm_limits_set_every_field():
    """Pairs hold one number for translations and one for rotations."""
    numbers = {
        "posture_stiffness": 1.0,
        "joint_damping": 2.0,
        "force_limit": 3.0,
        "moment_limit": 4.0,
        "min_singular_value": 5.0,
        "limit_margin": 6.0,
        "limit_stiffness": 7.0,
    }
    springs = impedance([0.1, 0.2], stiffness=(8.0, 9.0), damping=range(6), **numbers)
    assert {name: getattr(springs, name) for name in numbers} == numbers
    np.testing.assert_array_equal(springs.stiffness, [8, 8, 8, 9, 9, 9])
    np.testing.assert_array_equal(springs.damping, range(6))
    np.testing.assert_array_equal(springs.posture, [0.1, 0.2])
    limits = arm_limits([-1, -2], [1, 2], [3, 4], [5, 6])
    fields = [getattr(limits, field.name).tolist() for field in dataclasses.fields(ArmLimits)]
    assert fields == [[-1, -2], [1, 2], [3, 4], [5, 6]]
    assert isinstance(springs, ImpedanceParameters)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"posture": []}, r"expected \(n,\): one for each of 1 to 16 joints"),
        ({"posture": [0.0] * 17}, "1 to 16"),
        ({"posture": [np.nan]}, r"posture\[0\] is nan, expected a finite"),
        ({"posture": "straight"}, "posture has .* not real numbers"),
        ({"stiffness": (1.0, 2.0, 3.0)}, r"stiffness has shape \(3,\), expected \(6,\)"),
        ({"stiffness": (1.0, -2.0)}, "stiffness is -2, expected zero or more"),
        ({"damping": (np.inf, 1.0)}, "expected a finite"),
        ({"joint_damping": -1.0}, "joint_damping is -1"),
        ({"force_limit": 0.0}, "force_limit is 0, expected more than zero"),
        ({"min_singular_value": 0.0}, "singular_value is 0"),
        ({"limit_margin": np.nan}, "limit_margin is nan"),
    ],
)
def test_impedance_unusable_parameter_is_refused(wrong, message):
    """The message gives the value and what was expected."""
    with pytest.raises(InvalidInput, match=message):
        impedance(**({"posture": np.zeros(ARM)} | wrong))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({0: [0.0, 2.0]}, "joint 1 goes from 2 to 1 rad, expected lower below upper"),
        ({1: [1.0]}, r"upper has shape \(1,\), expected \(2,\)"),
        ({2: [1.0, 0.0]}, "velocity is 0, expected more than zero"),
        ({3: [-1.0, 1.0]}, "torque is -1, expected more than zero"),
        ({0: [[0.0]]}, "lower has shape"),
    ],
)
def test_arm_limits_unusable_limit_is_refused(change, message):
    """The message gives the joint or the value, and what was expected."""
    given_limits = {0: [0.0, 0.0], 1: [1.0, 1.0], 2: [1.0, 1.0], 3: [1.0, 1.0]} | change
    with pytest.raises(InvalidInput, match=message):
        arm_limits(*given_limits.values())
