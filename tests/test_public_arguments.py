"""Unusable arguments of public functions give a SkillError or a finite result, nothing else."""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np
import pytest
from annotations import check_annotations

import pilotfish as pf
from pilotfish import control, demonstrations, gaussians, geometry, planning
from pilotfish.errors import SkillError
from pilotfish.gaussians.gaussian import confidence_radius
from pilotfish.geometry.rotation_vectors import skew_matrix
from pilotfish.planning.moving import moving_frame_reference
from pilotfish.planning.plan import reference_from_states

INVALID: dict[str, Any] = {
    "bool": True,
    "text": "3",
    "float": 3.0,
    "numpy integer": np.int64(3),
    "negative": -1,
    "zero": 0,
    "huge integer": 10**400,
    "nan": np.nan,
    "infinity": np.inf,
    "none": None,
    "empty list": [],
    "empty array": np.empty(0),
    "ragged": [[1.0], [1.0, 2.0]],
    "masked": np.ma.masked_array([1.0, 2.0, 3.0, 4.0], [False, True, False, False]),
    "hidden mask": [np.ma.masked_array([1.0, 2.0], [False, True])],
    "complex": 1 + 2j,
    "no axis": np.array(3.0),
    "three axes": np.ones((2, 2, 2)),
    "square overflows": 1e155,
    "square underflows": 1e-155,
    "largest": 1e308,
    "smallest": 5e-324,
    "texts": ["a"] * 4,
}
NOT_NUMBERS = ("bool", "text", "masked", "hidden mask", "complex", "texts")
ANY_VALUE = {"name", "first", "last"}  # arguments that accept text or a bool


@dataclass(frozen=True)
class Call:
    """A function and valid arguments."""

    function: Callable[..., Any]
    arguments: dict[str, Any]


def small_calls() -> list[Call]:
    """Return functions of numbers and small arrays."""
    q, v, one = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.2, 0.3]), np.ones(4)
    g = gaussians.Gaussian(np.zeros(2), np.eye(2))
    continuous, column = control.continuous_double_integrator(2), np.array([0])
    rows, layout = np.zeros((3, 2)), demonstrations.position_layout(3)
    turn = {"orientation_starts": (0,)}
    springs = ("posture_stiffness", "joint_damping", "force_limit", "moment_limit", "min_singular_value")
    calls: list[tuple[Callable[..., Any], dict[str, Any]]] = [
        (control.discretise, {"system": continuous, "period": 0.1}),
        (control.double_integrator, {"axes": 2, "period": 0.1}),
        (control.continuous_double_integrator, {"axes": 2}),
        (control.arm_limits, {"lower": -one, "upper": one, "velocity": one, "torque": one}),
        (control.impedance, {"posture": one, "stiffness": (1.0, 1.0), **dict.fromkeys(springs, 1.0)}),
        (geometry.pose, {"position": v, "quaternion": q}),
        (geometry.multiply, {"p": q, "q": q}),
        (geometry.conjugate, {"q": q}),
        (geometry.normalise, {"q": q}),
        (geometry.left_multiplication_matrix, {"q": q}),
        (geometry.rotation_matrix, {"q": q}),
        (geometry.quaternion_from_rotation_matrix, {"R": np.eye(3)}),
        (geometry.quaternion_exp, {"v": v}),
        (geometry.quaternion_log, {"q": q}),
        (geometry.angle, {"p": q, "q": q}),
        (geometry.unwrap_quaternions, {"q": q[None]}),
        (skew_matrix, {"v": v}),
        (geometry.right_jacobian, {"v": v}),
        (geometry.inverse_right_jacobian, {"v": v}),
        (geometry.inverse_right_jacobian_derivative, {"v": v, "w": v}),
        (geometry.relative_rotation_vector, {"p": q, "q": q}),
        (geometry.log_map, {"base": q, "x": q, **turn}),
        (geometry.exp_map, {"base": q, "v": v, **turn}),
        (geometry.parallel_transport, {"d": v, **turn}),
        (geometry.exp_map_jacobian, {"v": v, **turn}),
        (geometry.log_map_jacobian, {"v": v, **turn}),
        (geometry.karcher_mean, {"x": q[None], "weights": np.ones(1), **turn}),
        (gaussians.cholesky, {"covariances": np.eye(2)[None]}),
        (gaussians.precision_cholesky, {"covariances": np.eye(2)[None]}),
        (gaussians.log_density, {"g": g, "x": rows}),
        (gaussians.affine_transform, {"g": g, "A": np.eye(2), "b": np.zeros(2)}),
        (gaussians.product, {"gaussians": [g, g]}),
        (gaussians.marginal, {"g": g, "columns": column}),
        (gaussians.condition, {"g": g, "columns": column, "value": np.zeros(1)}),
        (gaussians.sample, {"g": g, "count": 3, "rng": np.random.default_rng(0)}),
        (confidence_radius, {"width": 2, "probability": 0.9}),
        (g.in_confidence_region, {"x": rows, "probability": 0.9}),
        (g.ellipse, {"radius": 1.0, "points": 9}),
        (gaussians.Moments.from_data, {"x": rows, "responsibilities": np.ones((3, 1))}),
        (gaussians.structures.SemiTied, {"tying": 0.5, "sweeps": 2}),
        (gaussians.structures.MFA, {"factors": 2, "sweeps": 2, "min_noise": 1e-8}),
        (gaussians.structures.MPPCA, {"components": 2, "sweeps": 2, "min_noise": 1e-8}),
        (gaussians.structures.HDDC, {"dimensions": 2}),
        (gaussians.structures.HDDC, {"dimensions": 0.9}),
        (gaussians.structures.EMLLT, {"directions": 3, "sweeps": 2}),
        (gaussians.structures.MLT, {"transforms": 2}),
        (
            pf.models.EMSettings,
            {"regularisation": 1e-5, "tolerance": 1e-5, "max_iterations": 9, "restarts": 1},
        ),
        (pf.models.EMSettings, {"duration_regularisation": 1.0, "threads": 1}),
        (pf.models.TimeBins, {"jitter": 0.5}),
        (pf.models.KMeans, {"pseudocount": 1.0}),
        (pf.models.DurationModel, {"max_duration": 10}),
        (pf.online.DPGMM, {"cluster": 1.0, "noise": 0.1}),
        (pf.online.Maintenance, {"discount": 0.9, "forget_below": 0.0}),
        (pf.online.Maintenance, {"constant_weight": 1.0}),
        (
            pf.online.Maintenance,
            {"merge_distance": 1.0, "extra_directions": 1, "max_clusters": 5, "batch": 1},
        ),
        (pf.online.online_model, {"settings": pf.online.DPGMM(1.0, 0.1), "layout": layout, "period": 0.1}),
        (pf.demonstration, {"x": np.zeros((3, 3)), "period": 0.1, "layout": layout}),
        (demonstrations.frame, {"name": "a", "A": np.eye(3), "b": v}),
        (demonstrations.moving_frame, {"name": "a", "A": np.eye(3)[None], "b": v[None]}),
        (demonstrations.position_layout, {"axes": 3}),
        (demonstrations.world_frame, {"width": 3}),
        (pf.via_point, {"name": "position", "value": v, "time": 0.5, "deviation": 0.1}),
    ]
    return [Call(*call) for call in calls]


def calls_with_a_skill() -> list[Call]:
    """Return functions that need demonstrations, a skill or a plan."""
    rng = np.random.default_rng(0)
    demos = pf.io.synthetic_valve(rng)[:2]
    skill = pf.learn(demos, states=2, rng=rng, settings=pf.models.EMSettings(max_iterations=2)).skill
    adapted, start = pf.adapt(skill, demos[0].frames), demos[0].x[0]
    planned, system = pf.plan(adapted, start, horizon=5), pf.control.double_integrator(7, 0.1)
    learning = {"demonstrations": demos, "states": 2, "rng": rng}
    following = {"reference": planned, "control_cost": 1.0}
    states = np.zeros(3, dtype=np.int64)
    continuous = {"system": control.continuous_double_integrator(7), **following, "period": 0.1}
    plan = {"adapted": adapted, "start": start, "horizon": 5}
    calls: list[tuple[Callable[..., Any], dict[str, Any]]] = [
        (pf.learn, learning),
        (pf.learn, {**learning, "dynamics": "markov"}),
        (pf.learn, {**learning, "dynamics": "mixture"}),
        (pf.learn, {**learning, "durations": pf.models.DurationModel()}),
        (pf.adapt, {"skill": skill, "frames": demos[0].frames}),
        (pf.plan, {**plan, "covariance_regularisation": 1e-3}),
        (planning.plan_states, plan),
        (pf.plan, {"adapted": adapted, "horizon": 5, "covariance_regularisation": 1e-3}),
        (reference_from_states, {"adapted": adapted, "states": states, "covariance_regularisation": 0.1}),
        (
            moving_frame_reference,
            {"now": adapted, "later": adapted, "states": states, "covariance_regularisation": 0.1},
        ),
        (pf.plan, {**plan, "via_points": [], "covariance_regularisation": 1e-3}),
        (pf.reproduce, {"skill": skill, "frames": demos[0].frames, "start": start, "horizon": 5}),
        (pf.planning.condition_on, {"reference": planned, "points": [], "layout": skill.layout}),
        (pf.track, {"system": system, **following}),
        (control.lqr, {"system": system, **following}),
        (control.solve_batch, {"system": system, **following, "start": start}),
        (control.track_continuous, continuous),
        (control.lqr_continuous, continuous),
    ]
    return [Call(*call) for call in calls]


@pytest.fixture(autouse=True)
def unchecked_annotations() -> Iterator[None]:
    """Disable annotation checks, and make every warning an error."""
    with check_annotations(False), warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def is_finite(value: Any) -> bool:
    """Return whether all floats of a result are finite."""
    if isinstance(value, float):
        return bool(np.isfinite(value))
    if isinstance(value, np.ndarray):
        return value.dtype.kind != "f" or bool(np.isfinite(value).all())
    if is_dataclass(value):
        return all(is_finite(getattr(value, field.name)) for field in fields(value))
    return all(map(is_finite, value)) if isinstance(value, list | tuple) else True


def find_faults(call: Call) -> list[str]:
    """Return the invalid values that give neither a SkillError nor a finite result."""
    assert is_finite(call.function(**call.arguments)), "the arguments to begin with"
    found = []
    for name in call.arguments:
        for kind, value in INVALID.items():
            try:
                result = call.function(**{**call.arguments, name: value})
            except SkillError:
                continue
            except Exception as error:  # noqa: BLE001 - any is a fault, and all are listed
                found.append(f"{name}, {kind}: {type(error).__name__}: {error}")
                continue
            if not is_finite(result):
                found.append(f"{name}, {kind}: a result that is not finite")
            elif kind in NOT_NUMBERS and name not in ANY_VALUE:
                found.append(f"{name}, {kind}: accepted")
    return found


@pytest.mark.parametrize("call", small_calls(), ids=lambda call: call.function.__name__)
def test_public_function_invalid_argument_raises_skill_error(call: Call):
    """No NumPy error, warning or NaN; booleans, text and masked entries are not numbers."""
    assert find_faults(call) == []


def test_skill_function_invalid_argument_raises_skill_error():
    """The same holds for functions of a skill."""
    assert {
        call.function.__name__: found for call in calls_with_a_skill() if (found := find_faults(call))
    } == {}
