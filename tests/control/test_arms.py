"""Laws of holding an arm: balance at rest, limits that always hold, targets that mean nothing, doors."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pilotfish.control import (
    ArmLimits,
    ArmState,
    ImpedanceParameters,
    ToolTarget,
    arm_limits,
    impedance,
    impedance_torque,
    posture_torque,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import from_rotation_vector, multiply, rotation_matrix
from pilotfish.kernels import reference

ARM = 7
STRONG = arm_limits([-4.0] * ARM, [4.0] * ARM, [2.0] * ARM, [1e4] * ARM)
WEAK = arm_limits([-4.0] * ARM, [4.0] * ARM, [2.0] * ARM, [50.0] * 4 + [15.0] * 3)
UP = np.array([1.0, 0.0, 0.0, 0.0])


def unit(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def reading_of(rng, *, still=False):
    """An arm somewhere, away from singular postures."""
    J = rng.normal(size=(6, ARM))
    while np.linalg.svd(J, compute_uv=False)[-1] < 0.3:
        J = rng.normal(size=(6, ARM))
    velocity = np.zeros(ARM) if still else rng.normal(size=ARM)
    bias = rng.uniform(-10.0, 10.0, ARM)
    return ArmState(rng.uniform(-3.0, 3.0, ARM), velocity, rng.normal(size=3), unit(rng), J, bias)


def target_near(rng, reading, distance=0.01):
    step = distance * rng.normal(size=6)
    turned = multiply(from_rotation_vector(step[3:]), reading.quaternion)
    return ToolTarget(reading.position + step[:3], turned, np.zeros(6)), step


def test_at_rest_the_springs_balance_a_force_whatever_the_posture(rng):
    """What the torques beyond the bias are worth at the tool, J^+T tau, is K e: a hand that holds the tool
    away from its target feels the springs and nothing of the posture that the arm would rather have.
    """
    reading = reading_of(rng, still=True)
    target, step = target_near(rng, reading)
    for posture_stiffness in (0.0, 10.0, 80.0):
        springs = impedance(rng.normal(size=ARM), posture_stiffness=posture_stiffness)
        command = impedance_torque(springs, STRONG, reading, target)
        felt = np.linalg.pinv(reading.jacobian).T @ (command.torque - reading.bias)
        np.testing.assert_allclose(felt, springs.stiffness * step, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(command.wrench, springs.stiffness * step, rtol=1e-8, atol=1e-9)


def test_an_arm_that_is_where_and_how_it_should_be_carries_its_weight_alone(rng):
    """At the target, in the posture, moving as asked with joints undamped: the torque is the bias."""
    reading = reading_of(rng)
    springs = impedance(reading.q, joint_damping=0.0)
    twist = reading.jacobian @ reading.velocity
    target = ToolTarget(reading.position, -reading.quaternion, twist)
    command = impedance_torque(springs, STRONG, reading, target)
    np.testing.assert_allclose(command.torque, reading.bias, atol=1e-9)
    assert command.torque_fraction == 1.0


def test_dampers_take_energy_from_the_arm(rng):
    """Without springs, and the target at rest, the power of all beyond the bias is not positive, while no
    torque is cut.
    """
    springs = impedance(np.zeros(ARM), stiffness=(0.0, 0.0), posture_stiffness=0.0, limit_stiffness=0.0)
    for _ in range(20):
        reading = reading_of(rng)
        target, _ = target_near(rng, reading)
        command = impedance_torque(springs, STRONG, reading, target)
        assert reading.velocity @ (command.torque - reading.bias) < 0.0


def test_turning_the_world_leaves_the_torques(rng):
    """Springs alike along every axis know no directions: a turned world has the same torques."""
    reading, springs = reading_of(rng), impedance(np.zeros(ARM))
    target, _ = target_near(rng, reading, 0.5)
    turn, shift = unit(rng), rng.normal(size=3)
    R, RR = rotation_matrix(turn), np.kron(np.eye(2), rotation_matrix(turn))
    there = dataclasses.replace(
        reading,
        position=R @ reading.position + shift,
        quaternion=multiply(turn, reading.quaternion),
        jacobian=RR @ reading.jacobian,
    )
    wanted = ToolTarget(R @ target.position + shift, multiply(turn, target.quaternion), RR @ target.twist)
    one, other = (impedance_torque(springs, WEAK, *pair) for pair in ((reading, target), (there, wanted)))
    np.testing.assert_allclose(other.torque, one.torque, atol=1e-9)
    np.testing.assert_allclose(other.wrench, RR @ one.wrench, atol=1e-9)


def test_far_targets_pull_no_harder_than_the_limits_on_force(rng):
    """The wrench's norms stay within force_limit and moment_limit, along the springs' own directions."""
    reading, springs = (
        reading_of(rng, still=True),
        impedance(np.zeros(ARM), force_limit=20.0, moment_limit=3.0),
    )
    target, step = target_near(rng, reading, 0.5)
    wrench = impedance_torque(springs, STRONG, reading, target).wrench
    for part, most in ((slice(0, 3), 20.0), (slice(3, 6), 3.0)):
        np.testing.assert_allclose(np.linalg.norm(wrench[part]), most, rtol=1e-12)
        direction = step[part] / np.linalg.norm(step[part])
        np.testing.assert_allclose(wrench[part], most * direction, rtol=1e-7)


def test_a_spring_alone_moves_a_tool_no_faster_than_limit_over_damping(rng):
    """At that speed towards a far target spring and damper are even; faster, the damper brakes."""
    springs = impedance(np.zeros(ARM), damping=(50.0, 3.0), force_limit=20.0)
    reading = dataclasses.replace(reading_of(rng), jacobian=np.eye(6, ARM))
    target = ToolTarget(reading.position + 5.0 * np.eye(3)[0], reading.quaternion, np.zeros(6))
    for speed, force in ((0.0, 20.0), (0.2, 10.0), (0.4, 0.0), (0.6, -10.0)):
        moving = dataclasses.replace(reading, velocity=speed * np.eye(ARM)[0])
        wrench = impedance_torque(springs, STRONG, moving, target).wrench
        np.testing.assert_allclose(wrench, force * np.eye(6)[0], atol=1e-9)


def test_each_joint_gives_what_its_own_limit_leaves(rng):
    """Weak joints get what strong ones get, each cut; share is the least part that one could give."""
    springs = impedance(np.zeros(ARM), force_limit=500.0, moment_limit=100.0, posture_stiffness=60.0)
    shares = []
    for _ in range(20):
        reading = reading_of(rng)
        target, _ = target_near(rng, reading, 0.3)
        strong, weak = (impedance_torque(springs, limits, reading, target) for limits in (STRONG, WEAK))
        assert strong.torque_fraction == 1.0
        np.testing.assert_allclose(weak.torque, np.clip(strong.torque, -WEAK.torque, WEAK.torque), atol=1e-9)
        given = [
            (torque - bias) / (whole - bias)
            for torque, whole, bias in zip(weak.torque, strong.torque, reading.bias, strict=True)
        ]
        assert weak.torque_fraction == pytest.approx(min(1.0, *given), abs=1e-9)
        shares.append(weak.torque_fraction)
    assert 0.0 < min(shares) < 1.0


def test_a_joint_that_cannot_carry_its_weight_does_not_stop_the_others(rng):
    """Its torque is cut, share tells that it gives nothing, and the others do what they would have done."""
    reading = reading_of(rng)
    bias = reading.bias.copy()
    bias[1] = -1e4  # whatever is asked of it beyond, it is over its limit
    heavy = dataclasses.replace(reading, bias=bias)
    target, others = target_near(rng, reading)[0], np.arange(ARM) != 1
    for torque in (
        lambda limits, read: impedance_torque(impedance(np.zeros(ARM)), limits, read, target),
        lambda limits, read: posture_torque(50.0, 1.0, limits, read, np.zeros(ARM)),
    ):
        command = torque(WEAK, heavy)
        assert command.torque_fraction == 0.0
        assert command.torque[1] == -WEAK.torque[1]
        np.testing.assert_array_equal(command.torque[others], torque(WEAK, reading).torque[others])


ANY = st.floats(width=64) | st.floats(-5.0, 5.0)  # infinities and numbers that are none, among others


def arrays(*shape):
    size = int(np.prod(shape))
    return st.lists(ANY, min_size=size, max_size=size).map(lambda numbers: np.array(numbers).reshape(shape))


@given(
    st.builds(ArmState, arrays(3), arrays(3), arrays(3), arrays(4), arrays(6, 3), arrays(3)),
    st.builds(ToolTarget, arrays(3), arrays(4), arrays(6)),
)
def test_torques_are_finite_and_within_limits_whatever_is_read_and_asked(reading, target):
    """Total: any 64-bit numbers in reading and target, and no torque leaves its limits or raises; the NumPy
    twin of the kernel keeps this too.
    """
    limits = arm_limits([-3.0] * 3, [3.0] * 3, [1.0] * 3, [50.0, 20.0, 5.0])
    for command in (
        impedance_torque(impedance([0.1, 0.2, 0.3]), limits, reading, target),
        reference.impedance(impedance([0.1, 0.2, 0.3]), limits, reading, target),
        posture_torque(100.0, 2.0, limits, reading, target.position),
    ):
        assert (np.abs(command.torque) <= limits.torque).all()
        assert 0.0 <= command.torque_fraction <= 1.0
        assert np.linalg.norm(command.wrench[:3]) <= 60.0 * (1.0 + 1e-12)
        assert np.linalg.norm(command.wrench[3:]) <= 12.0 * (1.0 + 1e-12)


@pytest.mark.parametrize("part", ["position", "quaternion", "twist"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_target_that_means_nothing_brakes_the_arm_and_carries_it(rng, part, value):
    """Bias less joint damping, and what keeps off the joints' limits; no wrench, no posture."""
    reading, springs = reading_of(rng), impedance(np.zeros(ARM), joint_damping=2.0)
    target, _ = target_near(rng, reading)
    spoilt = getattr(target, part).copy()
    spoilt[2] = value
    command = impedance_torque(springs, STRONG, reading, dataclasses.replace(target, **{part: spoilt}))
    np.testing.assert_allclose(command.torque, reading.bias - 2.0 * reading.velocity, atol=1e-12)
    np.testing.assert_array_equal(command.wrench, 0.0)


def test_an_orientation_of_no_length_is_no_target(rng):
    """The quaternion of four zeros turns nowhere: as with a target that is not finite."""
    reading = reading_of(rng, still=True)
    target = ToolTarget(reading.position + 0.1, np.zeros(4), np.zeros(6))
    command = impedance_torque(impedance(np.zeros(ARM)), STRONG, reading, target)
    np.testing.assert_array_equal(command.torque, reading.bias)


def test_joints_near_their_limits_are_pushed_back(rng):
    """The push is limit_stiffness times how deep a joint is inside the margin, and zero up to there."""
    springs = impedance(
        np.zeros(ARM), posture_stiffness=0.0, limit_margin=0.2, limit_stiffness=50.0, joint_damping=0.0
    )
    reading = reading_of(rng, still=True)
    target = ToolTarget(reading.position, reading.quaternion, np.zeros(6))
    depth = np.array([-1.0, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3])  # within 0.2 of the limits at 4, and beyond
    for sign in (1.0, -1.0):
        near = dataclasses.replace(reading, q=sign * (4.0 + depth))
        push = impedance_torque(springs, STRONG, near, target).torque - reading.bias
        np.testing.assert_allclose(push, -sign * 50.0 * np.maximum(depth + 0.2, 0.0), atol=1e-9)


def test_joints_are_held_at_a_posture_within_their_limits(rng):
    """Springs and dampers at the joints; a posture outside the limits is one at them."""
    reading, posture = reading_of(rng), 3.0 * rng.normal(size=ARM)
    stiffness, damping = rng.uniform(10.0, 100.0, ARM), rng.uniform(1.0, 5.0, ARM)
    command = posture_torque(stiffness, damping, STRONG, reading, posture)
    pull = stiffness * (np.clip(posture, -4.0, 4.0) - reading.q) - damping * reading.velocity
    np.testing.assert_allclose(command.torque, reading.bias + pull, atol=1e-9)
    np.testing.assert_array_equal(command.wrench, 0.0)
    posture[3] = np.nan
    lost = posture_torque(stiffness, damping, STRONG, reading, posture).torque
    np.testing.assert_allclose(np.delete(lost, 3), np.delete(command.torque, 3), atol=1e-12)
    np.testing.assert_allclose(lost[3], reading.bias[3] - damping[3] * reading.velocity[3], atol=1e-12)


def test_every_number_given_at_the_door_arrives_in_its_field():
    """Pairs stand for translations and rotations."""
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
    ("wrong", "words"),
    [
        ({"posture": []}, "expected .n,.: one for each of 1 to 16 joints"),
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
def test_springs_that_cannot_be_are_refused(wrong, words):
    """The door names the value, what was expected and where it helps the fix."""
    with pytest.raises(InvalidInput, match=words):
        impedance(**({"posture": np.zeros(ARM)} | wrong))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({0: [0.0, 2.0]}, "joint 1 goes from 2 to 1 rad, expected lower below upper"),
        ({1: [1.0]}, r"upper has shape \(1,\), expected \(2,\)"),
        ({2: [1.0, 0.0]}, "velocity is 0, expected more than zero"),
        ({3: [-1.0, 1.0]}, "torque is -1, expected more than zero"),
        ({0: [[0.0]]}, "lower has shape"),
    ],
)
def test_limits_that_cannot_be_are_refused(change, words):
    """The door names the joint or the value, and what was expected."""
    given_limits = {0: [0.0, 0.0], 1: [1.0, 1.0], 2: [1.0, 1.0], 3: [1.0, 1.0]} | change
    with pytest.raises(InvalidInput, match=words):
        arm_limits(*given_limits.values())
