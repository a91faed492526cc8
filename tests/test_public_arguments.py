"""Arguments of public functions that cannot be: each gives a SkillError or a finite result, nothing else."""

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

HOSTILE: dict[str, Any] = {
    "truth": True,
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
    "square vanishes": 1e-155,
    "largest": 1e308,
    "smallest": 5e-324,
    "words": ["a"] * 4,
}
NEVER_NUMBERS = ("truth", "text", "masked", "hidden mask", "complex", "words")
AS_THEY_ARE = {"what", "name", "first", "last"}  # arguments that text or a truth value suits


@dataclass(frozen=True)
class Call:
    """A function, and arguments that it takes."""

    function: Callable[..., Any]
    arguments: dict[str, Any]


def small_calls() -> list[Call]:
    """Functions of numbers and small arrays."""
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
        (geometry.skew_matrix, {"v": v}),
        (geometry.right_jacobian, {"v": v}),
        (geometry.inverse_right_jacobian, {"v": v}),
        (geometry.inverse_right_jacobian_derivative, {"v": v, "w": v}),
        (geometry.relative_rotation_vector, {"p": q, "q": q}),
        (geometry.log_map, {"base": q, "x": q, **turn}),
        (geometry.exp_map, {"base": q, "v": v, **turn}),
        (geometry.parallel_transport, {"d": v, **turn}),
        (geometry.exp_map_jacobian, {"v": v, **turn}),
        (geometry.log_map_jacobian, {"v": v, **turn}),
        (geometry.karcher_mean, {"x": q[None], "shares": np.ones(1), **turn}),
        (gaussians.cholesky, {"covariances": np.eye(2)[None]}),
        (gaussians.precision_cholesky, {"covariances": np.eye(2)[None]}),
        (gaussians.log_density, {"g": g, "x": rows}),
        (gaussians.affine_transform, {"g": g, "A": np.eye(2), "b": np.zeros(2)}),
        (gaussians.product, {"gaussians": [g, g]}),
        (gaussians.marginal, {"g": g, "columns": column}),
        (gaussians.condition, {"g": g, "columns": column, "value": np.zeros(1)}),
        (gaussians.sample, {"g": g, "count": 3, "rng": np.random.default_rng(0)}),
        (gaussians.confidence_radius, {"width": 2, "probability": 0.9}),
        (gaussians.in_confidence_region, {"g": g, "x": rows, "probability": 0.9}),
        (gaussians.ellipse, {"g": g, "radius": 1.0, "points": 9}),
        (gaussians.moments, {"x": rows, "shares": np.ones((3, 1))}),
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
        (pf.via_point, {"what": "position", "value": v, "time": 0.5, "deviation": 0.1}),
    ]
    return [Call(*call) for call in calls]


def calls_with_a_skill() -> list[Call]:
    """Functions that need demonstrations, a skill or a plan of one."""
    rng = np.random.default_rng(0)
    shown = pf.store.synthetic_valve(rng)[:2]
    skill = pf.learn(shown, states=2, rng=rng, settings=pf.models.EMSettings(max_iterations=2)).skill
    here, start = pf.adapt(skill, shown[0].frames), shown[0].x[0]
    planned, system = pf.plan(here, start, horizon=5), pf.control.double_integrator(7, 0.1)
    learning = {"demonstrations": shown, "states": 2, "rng": rng}
    states, following = np.zeros(3, dtype=np.int64), {"reference": planned, "control_cost": 1.0}
    continuous = {"system": control.continuous_double_integrator(7), **following, "period": 0.1}
    plan = {"model": here, "start": start, "horizon": 5}
    calls: list[tuple[Callable[..., Any], dict[str, Any]]] = [
        (pf.learn, learning),
        (pf.learn, {**learning, "dynamics": "markov"}),
        (pf.learn, {**learning, "dynamics": "mixture"}),
        (pf.learn, {**learning, "durations": pf.models.DurationModel()}),
        (pf.adapt, {"skill": skill, "frames": shown[0].frames}),
        (pf.plan, {**plan, "covariance_regularisation": 1e-3}),
        (planning.planned_states, plan),
        (pf.plan, {"model": here, "horizon": 5, "covariance_regularisation": 1e-3}),
        (planning.reference_from_states, {"model": here, "states": states, "covariance_regularisation": 0.1}),
        (
            planning.moving_frame_reference,
            {"now": here, "later": here, "states": states, "covariance_regularisation": 0.1},
        ),
        (pf.PLAN_THROUGH, {**plan, "points": [], "covariance_regularisation": 1e-3}),
        (pf.planning.condition_on, {"reference": planned, "points": [], "layout": skill.layout}),
        (pf.track, {"system": system, **following}),
        (control.lqr, {"system": system, **following}),
        (control.solve_batch, {"system": system, **following, "start": start}),
        (control.track_continuous, continuous),
        (control.lqr_continuous, continuous),
    ]
    return [Call(*call) for call in calls]


@pytest.fixture(autouse=True)
def as_a_user_runs_it() -> Iterator[None]:
    """Without the checker of annotations, and with every warning an error."""
    with check_annotations(False), warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def finite(value: Any) -> bool:
    """Whether all floats of a result are finite."""
    if isinstance(value, float):
        return bool(np.isfinite(value))
    if isinstance(value, np.ndarray):
        return value.dtype.kind != "f" or bool(np.isfinite(value).all())
    if is_dataclass(value):
        return all(finite(getattr(value, field.name)) for field in fields(value))
    return all(map(finite, value)) if isinstance(value, list | tuple) else True


def faults(call: Call) -> list[str]:
    """What came of hostile arguments that is neither a SkillError nor a finite result of a number."""
    assert finite(call.function(**call.arguments)), "the arguments to begin with"
    found = []
    for name in call.arguments:
        for kind, value in HOSTILE.items():
            try:
                result = call.function(**{**call.arguments, name: value})
            except SkillError:
                continue
            except Exception as error:  # noqa: BLE001 - any is a fault, and all are listed
                found.append(f"{name}, {kind}: {type(error).__name__}: {error}")
                continue
            if not finite(result):
                found.append(f"{name}, {kind}: a result that is not finite")
            elif kind in NEVER_NUMBERS and name not in AS_THEY_ARE:
                found.append(f"{name}, {kind}: accepted")
    return found


@pytest.mark.parametrize("call", small_calls(), ids=lambda call: call.function.__name__)
def test_unusable_argument_is_refused_as_a_skill_error(call: Call):
    """No error of NumPy, no warning, no NaN; booleans, text and masked entries are no numbers."""
    assert faults(call) == []


def test_unusable_argument_about_a_skill_is_refused_as_a_skill_error():
    """As for small arrays."""
    assert {call.function.__name__: found for call in calls_with_a_skill() if (found := faults(call))} == {}
