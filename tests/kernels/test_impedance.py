"""Impedance control against its definition, near singularities, and with arguments that are not finite."""

import dataclasses
import importlib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pilotfish.kernels import ArmLimits, ArmState, ImpedanceParameters, ToolTarget, reference


def unit(rng):
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def parameters(rng, n, **changes):
    """Return springs and dampers whose limits are out of reach, except those that are passed."""
    given = ImpedanceParameters(
        stiffness=rng.uniform(10.0, 1000.0, 6),
        damping=rng.uniform(1.0, 60.0, 6),
        posture=rng.normal(size=n),
        posture_stiffness=10.0,
        joint_damping=1.0,
        force_limit=1e6,
        moment_limit=1e6,
        min_singular_value=0.05,
        limit_margin=0.1,
        limit_stiffness=100.0,
    )
    return dataclasses.replace(given, **changes)


def limits_of(n, torque=1e6):
    return ArmLimits(np.full(n, -4.0), np.full(n, 4.0), np.ones(n), np.full(n, torque))


def arm(rng, n, jacobian=None):
    """Return a random arm and a random target of its tool."""
    J = rng.normal(size=(6, n)) if jacobian is None else jacobian
    reading = ArmState(
        rng.uniform(-3.0, 3.0, n), rng.normal(size=n), rng.normal(size=3), unit(rng), J, rng.normal(size=n)
    )
    return reading, ToolTarget(rng.normal(size=3), unit(rng), rng.normal(size=6))


def rotation_error_by_definition(p, q):
    """Return the rotation vector of q p^-1 by SciPy."""
    first, second = (Rotation.from_quat(np.roll(quaternion, -1)) for quaternion in (p, q))
    return (second * first.inv()).as_rotvec()


def by_definition(parameters, reading, target, min_singular_value):
    """Return F and the torque beyond the bias, with the damping of Chiaverini for each singular direction."""
    J, q = reading.jacobian, reading.q
    error = np.concatenate(
        [
            target.position - reading.position,
            rotation_error_by_definition(reading.quaternion, target.quaternion),
        ]
    )
    F = parameters.stiffness * error - parameters.damping * (J @ reading.velocity - target.twist)
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    damping = np.where(
        s < min_singular_value, min_singular_value**2 * (1.0 - (s / min_singular_value) ** 2), 0.0
    )
    pseudo = Vt.T @ np.diag(s / (s**2 + damping)) @ U.T
    posture = parameters.posture_stiffness * (parameters.posture - q)
    null = np.eye(len(q)) - J.T @ pseudo.T
    return F, J.T @ F + null @ posture - parameters.joint_damping * reading.velocity


@pytest.mark.parametrize("n", [1, 2, 5, 6, 7, 16])
def test_impedance_torque_without_limits_equals_equation(kernels, rng, n):
    """Equation 6.11, with the rotation by SciPy and the pseudo-inverse by singular values."""
    given, (reading, target) = parameters(rng, n), arm(rng, n)
    s = np.linalg.svd(reading.jacobian, compute_uv=False)
    for threshold in (1e-3, float(s[len(s) // 2])):  # with the latter, half of all directions are damped
        given = dataclasses.replace(given, min_singular_value=threshold)
        command = kernels.impedance_torque(given, limits_of(n), reading, target)
        F, push = by_definition(given, reading, target, threshold)
        scale = np.abs(push).max() * (s[0] / max(threshold, s[-1])) ** 2  # J J^T squares the condition
        assert command.torque_fraction == 1.0
        np.testing.assert_allclose(command.wrench, F, rtol=1e-12, atol=1e-11)
        np.testing.assert_allclose(command.torque, reading.bias + push, rtol=0, atol=1e-14 * scale + 1e-11)


@pytest.mark.parametrize("n", range(1, 17))
def test_impedance_torque_compiled_equals_reference(compiled, rng, n):
    """Any number of joints, limits active or not, to 1e-12 of the largest torque."""
    for strength, force, edge in [(1e6, 1e6, 4.0), (50.0, 60.0, 4.0), (20.0, 5.0, 0.5), (0.1, 60.0, 4.0)]:
        given = parameters(rng, n, force_limit=force, moment_limit=0.2 * force, min_singular_value=0.3)
        limits = dataclasses.replace(limits_of(n, strength), lower=np.full(n, -edge), upper=np.full(n, edge))
        reading, target = arm(rng, n)
        compiled_command, reference_command = (
            module.impedance_torque(given, limits, reading, target) for module in (compiled, reference)
        )
        scale = max(float(np.abs(reference_command.torque).max()), 1.0)
        np.testing.assert_allclose(
            compiled_command.torque, reference_command.torque, rtol=0, atol=1e-12 * scale
        )
        np.testing.assert_allclose(compiled_command.wrench, reference_command.wrench, rtol=1e-12, atol=1e-12)
        assert abs(compiled_command.torque_fraction - reference_command.torque_fraction) < 1e-12


@pytest.mark.parametrize(
    "part", ["position", "quaternion", "jacobian", "q", "velocity", "bias", "target", "twist"]
)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e200, 1e308])
def test_impedance_torque_not_finite_argument_is_finite_and_within_limits(compiled, rng, part, value):
    """One number that is not finite or overflows: both implementations agree."""
    given, (reading, target) = parameters(rng, 7, force_limit=60.0, moment_limit=12.0), arm(rng, 7)
    if part in ("target", "twist"):
        name = "position" if part == "target" else part
        changed = getattr(target, name).copy()
        changed[-1] = value
        target = dataclasses.replace(target, **{name: changed})
    else:
        changed = getattr(reading, part).copy()
        changed[..., -1] = value
        reading = dataclasses.replace(reading, **{part: changed})
    compiled_command, reference_command = (
        module.impedance_torque(given, limits_of(7, 50.0), reading, target)
        for module in (compiled, reference)
    )
    np.testing.assert_allclose(compiled_command.torque, reference_command.torque, rtol=0, atol=1e-10)
    np.testing.assert_allclose(compiled_command.wrench, reference_command.wrench, rtol=0, atol=1e-10)
    assert (np.abs(compiled_command.torque) <= 50.0).all()
    assert np.isfinite(compiled_command.wrench).all()


def singular_arm(rng, values):
    U, V = (np.linalg.qr(rng.normal(size=(size, size)))[0] for size in (6, 7))
    return lambda weak: U @ np.hstack([np.diag([*values, *weak]), np.zeros((6, 1))]) @ V.T


def test_impedance_torque_near_singularity_is_continuous(kernels, rng):
    """Singular values fall through the threshold to zero, or change order below it.

    The null space then changes by at most 2 / threshold times their change, the slope of (s / threshold)^2.
    """
    threshold, n = 0.05, 7
    t = np.linspace(-1.0, 1.0, 401)
    sinking = [(2.0 * threshold * abs(value),) for value in t]
    swapping = [(threshold * (0.5 + 0.4 * value), threshold * (0.5 - 0.4 * value)) for value in t]
    for weak in (sinking, swapping):
        jacobian = singular_arm(rng, rng.uniform(0.5, 2.0, 6 - len(weak[0])))
        reading, target = arm(rng, n)
        reading = dataclasses.replace(reading, velocity=np.zeros(n))
        given = parameters(rng, n, stiffness=np.zeros(6), damping=np.zeros(6), min_singular_value=threshold)
        pull = np.linalg.norm(10.0 * (given.posture - reading.q))
        torques = np.array(
            [
                kernels.impedance_torque(
                    given, limits_of(n), dataclasses.replace(reading, jacobian=jacobian(values)), target
                ).torque
                for values in weak
            ]
        )
        largest_change = np.abs(np.diff(np.array(weak), axis=0)).max(axis=1)
        jumps = np.linalg.norm(np.diff(torques, axis=0), axis=1)
        assert (jumps <= 2.0 / threshold * largest_change * pull * 1.001 + 1e-9).all()


def test_impedance_torque_posture_is_in_null_space(kernels, rng):
    """Away from singularities J N = 0: with equal joint inertias the tool would not move."""
    given, (reading, target) = parameters(rng, 7, joint_damping=0.0, damping=np.zeros(6)), arm(rng, 7)
    with_posture = kernels.impedance_torque(given, limits_of(7), reading, target).torque
    without = kernels.impedance_torque(
        dataclasses.replace(given, posture_stiffness=0.0), limits_of(7), reading, target
    ).torque
    assert np.linalg.norm(with_posture - without) > 1e-3
    np.testing.assert_allclose(reading.jacobian @ (with_posture - without), 0.0, atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, 3.0, np.pi - 1e-6])
def test_impedance_torque_rotation_takes_shorter_way(kernels, rng, angle):
    """For a target rotated about a world axis, the moment is along that axis.

    The sign and the length of the quaternions do not matter.
    """
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    reading, target = arm(rng, 7)
    turned = Rotation.from_rotvec(angle * axis) * Rotation.from_quat(np.roll(reading.quaternion, -1))
    wanted = np.roll(turned.as_quat(), 1)
    given = parameters(rng, 7, stiffness=np.ones(6), damping=np.zeros(6))
    for sign in (1.0, -1.0, 3.0, -0.2):
        aim = dataclasses.replace(target, quaternion=sign * wanted)
        wrench = kernels.impedance_torque(given, limits_of(7), reading, aim).wrench
        np.testing.assert_allclose(wrench[3:], angle * axis, rtol=1e-8, atol=1e-14)


def test_impedance_torque_both_instruction_sets_agree(compiled, monkeypatch, rng):
    given, (reading, target) = parameters(rng, 7, force_limit=60.0, moment_limit=12.0), arm(rng, 7)
    newest = compiled.impedance_torque(given, limits_of(7, 50.0), reading, target)
    monkeypatch.setattr(compiled, "_native", importlib.import_module("pilotfish.kernels._baseline"))
    oldest = compiled.impedance_torque(given, limits_of(7, 50.0), reading, target)
    np.testing.assert_allclose(newest.torque, oldest.torque, rtol=0, atol=1e-10)
    np.testing.assert_allclose(newest.wrench, oldest.wrench, rtol=0, atol=1e-10)


def test_impedance_torque_wrong_shapes_raise(compiled, rng):
    """Shapes are checked before arrays are read; at most 16 joints."""
    baseline = importlib.import_module("pilotfish.kernels._baseline")
    numbers = [10.0, 1.0, 60.0, 12.0, 0.05, 0.1, 100.0]

    def call(n=3, **wrong):
        sizes = {"stiffness": 6, "damping": 6, "posture": n}
        later = {"lower": n, "upper": n, "torque": n, "q": n, "velocity": n, "position": 3, "quaternion": 4}
        last = {"bias": n, "target": 3, "turn": 4, "twist": 6}
        first, middle, end = (
            [np.ones(wrong.get(name, size)) for name, size in some.items()] for some in (sizes, later, last)
        )
        return baseline.impedance_torque(
            *first, *numbers, *middle, np.ones(wrong.get("jacobian", (6, n))), *end
        )

    call()
    call(16)
    for name in ("stiffness", "damping", "posture", "lower", "upper", "torque", "velocity", "position"):
        with pytest.raises(ValueError, match="entries along axis 0, expected"):
            call(**{name: 2})
    for name in ("quaternion", "bias", "target", "turn", "twist"):
        with pytest.raises(ValueError, match="entries along axis 0, expected"):
            call(**{name: 2})
    for shape in ((6, 2), (5, 3)):
        with pytest.raises(ValueError, match="jacobian has"):
            call(jacobian=shape)
    with pytest.raises(ValueError, match="more than 16 entries"):
        call(17)
    with pytest.raises(ValueError, match="q is empty"):
        call(0)
