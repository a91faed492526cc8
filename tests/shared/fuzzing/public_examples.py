"""Valid arguments of every public function that takes numbers, arrays or values made of them.

A public function that is not here fails tests/fuzz/test_targets.py: add it with arguments that it accepts.
"""

import importlib
import inspect
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from fuzzing.seeds import FAST_SETTINGS, lines, streams, valve_demonstrations
from pilotfish import control, gaussians, geometry, models, planning, store
from pilotfish import demonstrations as shown
from pilotfish.environments import Manipulation
from pilotfish.models import online

PACKAGES = (
    "geometry",
    "demonstrations",
    "gaussians",
    "models",
    "models.online",
    "control",
    "planning",
    "store",
    "environments",
    "plots",
    "validation",
)
Arguments = dict[str, Any]
Examples = dict[str, Arguments]

# Functions that are not here, and why. Those of pilotfish.kernels are in tests/fuzz/test_kernels.py.
EXCLUDED: Mapping[str, str] = {
    **{
        f"demonstrations.{name}": "a target of its own: see targets.py"
        for name in shown.__all__
        if "read" in name
    },
    **{f"store.{name}": "a target of its own: see targets.py" for name in store.__all__ if "code" in name},
    **{f"store.open_{kind}": "reads with what decodes" for kind in ("skill", "stream", "kept")},
    **{f"store.save_{kind}": "writes what encodes" for kind in ("skill", "stream")},
    "store.content_hash": "takes a skill alone",
    "store.synthetic_valve": "takes randomness alone",
    "store.whole_file": "takes a path alone",
    "demonstrations.write_folder": "writes recordings, which come from `demonstration`",
    "demonstrations.require_replaceable": "takes a path alone",
    "demonstrations.pose_layout": "takes nothing",
    **{
        f"demonstrations.{name}": "a check that `demonstration` and decoders call"
        for name in ("require_magnitudes", "require_name", "require_period")
    },
    "models.relevance": "takes a skill and recordings alone, and a second",
    "models.improve": "takes functions; `learn` calls it",
    "models.maximise": "takes functions; `learn` calls it",
    "environments.view_of": "takes a name alone",
    "plots.state_colour": "takes a number of a state alone",
    **{
        f"validation.{name}": "takes a path alone"
        for name in (
            "is_file",
            "is_folder",
            "is_link",
            "open_regular_file",
            "path_exists",
            "read_file",
            "resolve_path",
        )
    },
}


def public_functions() -> Iterator[str]:
    """Every public function of the packages, such as geometry.quaternion_exp."""
    for package in PACKAGES:
        module = importlib.import_module(f"pilotfish.{package}")
        for name in module.__all__:
            if inspect.isfunction(getattr(module, name)):
                yield f"{package}.{name}"


def function_named(name: str) -> Callable[..., Any]:
    """The function; manipulation.step and manipulation.reset are methods of an environment."""
    if name.startswith("manipulation."):
        return getattr(_fresh_environment(), name.removeprefix("manipulation."))  # type: ignore[no-any-return]
    package, _, function = name.rpartition(".")
    return getattr(importlib.import_module(f"pilotfish.{package}"), function)  # type: ignore[no-any-return]


@cache
def _environment() -> Manipulation:
    return Manipulation("valve")


def _fresh_environment() -> Manipulation:
    _environment().reset(seed=0)
    return _environment()


def examples(package: str) -> Examples:
    """Arguments of the functions of one package, by name."""
    made = {
        "geometry": _geometry,
        "demonstrations": _demonstrations,
        "gaussians": _gaussians,
        "models": _models,
        "models.online": _online,
        "control": _control,
        "planning": _planning,
        "store": dict,
        "environments": _environments,
        "plots": _plots,
        "validation": _validation,
    }[package]()
    return {f"{package}.{name}" if "." not in name else name: given for name, given in made.items()}


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)


def _unit(*shape: int) -> np.ndarray:
    q = _rng().normal(size=(*shape, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def _geometry() -> Examples:
    q, p, v = _unit(5), _unit(5)[::-1].copy(), 0.3 * _rng().normal(size=(5, 3))
    x, flat = np.hstack([v, q]), 0.3 * _rng().normal(size=(5, 6))
    R = geometry.rotation_matrix(q)
    of_q = (
        "conjugate",
        "unwrap_quaternions",
        "left_multiplication_matrix",
        "quaternion_log",
        "normalise",
        "rotation_matrix",
    )
    of_v = ("skew_matrix", "quaternion_exp", "inverse_right_jacobian", "right_jacobian")
    return {
        **{name: {"q": q} for name in of_q},
        **{name: {"v": v} for name in of_v},
        **{name: {"p": p, "q": q} for name in ("angle", "multiply", "relative_rotation_vector")},
        **{
            name: {"v": flat, "orientation_starts": (3,)} for name in ("exp_map_jacobian", "log_map_jacobian")
        },
        "parallel_transport": {"d": flat, "orientation_starts": (3,)},
        "exp_map": {"base": x, "v": flat, "orientation_starts": (3,)},
        "log_map": {"base": x, "x": x[::-1].copy(), "orientation_starts": (3,)},
        "quaternion_from_rotation_matrix": {"R": R},
        "inverse_right_jacobian_derivative": {"v": v, "w": v[::-1].copy()},
        "karcher_mean": {"x": x, "shares": np.full(5, 0.2), "orientation_starts": (3,)},
        "pose": {"position": v[0], "quaternion": q[0]},
        "tangent_slices": {"width": 7, "orientation_starts": (3,)},
    }


def _demonstrations() -> Examples:
    demos = valve_demonstrations()
    demo, layout = demos[0], shown.pose_layout()
    given = demo.frames[0]
    A, b = np.stack([given.A] * len(demo.x)), np.stack([given.b] * len(demo.x))
    place = geometry.pose(given.b[:3], demo.x[0, 3:])
    return {
        "diagnose": {"demonstrations": demos},
        "unwrap_orientations": {"x": demo.x, "layout": layout},
        "demonstration": {"x": demo.x, "period": 0.1, "layout": layout, "frames": demo.frames, "name": "a"},
        "frame": {"name": "a", "A": given.A, "b": given.b},
        "moving_frame": {"name": "a", "A": A, "b": b},
        "frame_from_pose": {"name": "a", "layout": layout, "pose": place},
        "moving_frame_from_poses": {"name": "a", "layout": layout, "poses": [place, place]},
        "to_sphere": {"demo": demo},
        "position_layout": {"axes": 2, "unit": "m"},
        "validate_orientation_starts": {"label": "a", "A": given.A, "b": given.b, "orientation_starts": (3,)},
        "resample": {"demo": demo, "steps": 9},
        "tangent_map": {"A": given.A, "orientation_starts": (3,)},
        "views": {"demonstrations": demos},
        "add_derivatives": {"demo": demo},
        "world_frame": {"width": 3},
    }


def _gaussians() -> Examples:
    rng = _rng()
    root = rng.normal(size=(3, 3, 3))
    S = root @ root.transpose(0, 2, 1) + np.eye(3)
    means, x, shares = rng.normal(size=(3, 3)), rng.normal(size=(6, 3)), rng.dirichlet(np.ones(3), 6)
    g = gaussians.Gaussian(means[0], S[0])
    inputs, seen = np.array([0]), x[:, :1].copy()
    mixture = gaussians.GaussianMixture(np.full(3, 1 / 3), means, S)
    given = gaussians.conditional_gaussians(means, S, inputs)
    poses = np.hstack([x[:5], _unit(5)])
    curved = np.stack([np.eye(6)] * 2)
    point = gaussians.RiemannianGaussian(poses[0], curved[0], (3,))
    turned = gaussians.riemannian_conditional_gaussians(poses[:2], curved, inputs, (3,))
    return {
        "cholesky": {"covariances": S},
        "precision_cholesky": {"covariances": S},
        "component_correlation": {"covariances": S},
        "condition": {"g": g, "columns": np.array([1]), "value": np.array([0.5])},
        "conditional_gaussians": {"means": means, "covariances": S, "inputs": inputs},
        "confidence_radius": {"width": 3, "probability": 0.95},
        "ellipse": {"g": gaussians.Gaussian(means[0, :2], S[0, :2, :2]), "radius": 1.0, "points": 20},
        "in_confidence_region": {"g": g, "x": x, "probability": 0.9},
        "log_density": {"g": g, "x": x},
        "log_input_densities": {"given": given, "x": seen},
        "marginal": {"g": g, "columns": np.array([0, 2])},
        "moments": {"x": x, "shares": shares},
        "moments_from_sums": {
            "origins": means,
            "counts": np.ones(3),
            "offsets": means,
            "scatter_matrices": S,
        },
        "principal_components": {"S": S, "factors": np.array([1, 2, 1])},
        "product": {"gaussians": [g, gaussians.Gaussian(means[1], S[1])]},
        "regress": {"mixture": mixture, "inputs": inputs, "x": seen},
        "regress_means": {"mixture": mixture, "inputs": inputs, "x": seen},
        "regress_with_responsibilities": {"given": given, "x": seen, "shares": shares},
        "riemannian_conditional_gaussians": {
            "means": poses[:2],
            "covariances": curved,
            "inputs": inputs,
            "orientation_starts": (3,),
        },
        "riemannian_log_density": {"g": point, "x": poses},
        "riemannian_log_input_densities": {"given": turned, "x": seen},
        "riemannian_product": {"gaussians": [point, point]},
        "riemannian_regress_with_responsibilities": {
            "given": turned,
            "x": seen,
            "shares": np.full((6, 2), 0.5),
        },
        "sample": {"g": g, "count": 4, "rng": rng},
        "tangent_gaussian": {"g": point, "point": poses[1]},
        "tangent_moments": {"x": poses, "shares": np.full((5, 2), 0.5), "orientation_starts": (3,)},
        "affine_transform": {"g": g, "A": S[0], "b": means[1]},
    }


def _learned() -> tuple[Any, ...]:
    """Recordings, and a fit of a semi-Markov skill to them."""
    demos = tuple(shown.add_derivatives(demo) for demo in lines())
    return demos, models.learn(demos, states=3, rng=_rng(), settings=FAST_SETTINGS)


def _adapted(skill: models.Skill) -> models.AdaptedSkill:
    eye, zero = np.eye(skill.width), np.zeros(skill.width)
    return models.adapt(skill, [shown.frame(name, eye, zero) for name in skill.frame_names])


def _candidate(states: int) -> models.Candidate:
    return models.Candidate(states, gaussians.Full(), "gaussian", models.learn)


def _models() -> Examples:
    demos, fit = _learned()
    skill, data = fit.skill, shown.views(demos)
    adapted = _adapted(skill)
    observed = models.log_state_likelihoods(adapted, demos[0].x)
    labels = np.arange(len(data.x[0])) % 3
    statistics, counted = (
        models.expected_statistics(skill, data),
        models.expected_statistics(fit.markov_skill, data),
    )
    full, inputs, seen = gaussians.Full(), np.array([0]), demos[0].x[:, :1].copy()
    learning = {"demonstrations": demos, "states": 3, "rng": _rng(), "settings": FAST_SETTINGS}
    chain = {"dynamics": skill.dynamics, "log_observed": observed}
    valve = [shown.add_derivatives(demo) for demo in valve_demonstrations()]
    framed = models.learn(valve, states=2, rng=_rng(), settings=FAST_SETTINGS).skill
    frame_relevance = models.relevance(framed, valve)
    frames = [shown.frame(name, np.eye(14), np.zeros(14)) for name in framed.frame_names]
    counts = {"structure": full, "states": 3, "width": 4, "frames": 2}
    return {
        "adapt": {"skill": framed, "frames": frames, "relevance": np.ones((2, 2))},
        "as_mixture": {"model": _adapted(models.learn_mixture(**learning).skill)},
        "bic": {"log_likelihood": -10.0, "parameters": 5, "datapoints": 30},
        "covariance_freedom": {"structure": full, "covariances": skill.covariances},
        "fitted_parameters": {"structure": full, "covariances": skill.covariances},
        "covariance_parameters": counts,
        "semi_markov_parameters": counts,
        "filtered_regression": {"model": adapted, "inputs": inputs, "x": seen},
        "smoothed_regression": {"model": adapted, "inputs": inputs, "x": seen},
        "free_dynamics": {"dynamics": skill.dynamics},
        "free_parameters": {"skill": skill, "structure": full},
        "further_statistics": {"model": skill, "views": data, "before": statistics},
        "labelled_statistics": {"views": data, "labels": labels, "states": 3},
        "learn": learning,
        "learn_markov": learning,
        "learn_mixture": learning,
        "learn_semi_markov": {**learning, "duration_model": models.DurationModel()},
        "log_emissions": {"model": skill, "data": data},
        "log_likelihood": {"model": skill, "demonstrations": demos, "max_duration": 20},
        "log_likelihood_of_states": {"model": adapted, "x": demos[0].x},
        "markov_forward": {"chain": fit.markov_skill.dynamics, "log_observed": observed, "horizon": 20},
        "semi_markov_forward": {"chain": skill.dynamics, "log_observed": observed, "horizon": 20},
        "matched_accuracy": {"found": labels, "labels": labels[::-1].copy()},
        "matching": {"found": labels, "labels": labels[::-1].copy()},
        "normalised_mutual_information": {"found": labels, "labels": labels[::-1].copy()},
        "most_likely_chain": {"statistics": counted},
        "most_likely_weights": {"statistics": counted},
        "most_likely_semi_markov": {
            "statistics": statistics,
            "previous": None,
            "duration_model": models.DurationModel(),
            "min_variance": 1.0,
        },
        "most_probable_states": {**chain, "horizon": 20},
        "filtered_state_probs": {**chain, "horizon": 20},
        "smoothed_state_probs": chain,
        "align_quaternion_signs": {"start": demos[0].x[0], "model": adapted},
        "remove_distractors": {"demonstrations": valve, "frame_relevance": frame_relevance},
        "runs": {"states": labels},
        "sample_states": {"dynamics": skill.dynamics, "horizon": 12, "rng": _rng()},
        "select": {
            "demonstrations": demos,
            "candidates": [_candidate(2)],
            "rng": _rng(),
            "settings": FAST_SETTINGS,
        },
        "statistics": {"model": skill, "views": data, "max_duration": 20},
        "viterbi": {"model": skill, "demonstration": demos[0]},
        "with_durations": {"model": fit.markov_skill, "data": data, "min_variance": 1.0},
    }


def _online() -> Examples:
    demos, fit = _learned()
    model = streams()[6]
    settings, scales = model.settings, online.estimate_scales(fit.skill)
    same = [online.scale_demonstration(demo, scales) for demo in demos]
    _, assigned = online.observe_stream(model, lines()[0].x)
    return {
        "begin_demonstration": {"model": model},
        "begin_from": {"skill": fit.skill, "demonstrations": demos, "settings": settings},
        "identities_now": {"assignments": assigned},
        "observe": {"model": model, "x": np.array([0.1, 0.2])},
        "observe_stream": {"model": model, "x": lines()[0].x},
        "observe_demonstration": {"model": model, "demonstration": lines()[0]},
        "online_model": {
            "settings": settings,
            "layout": model.layout,
            "period": 0.1,
            "frame_names": ("a", "b"),
        },
        "penalties_from": {"skill": fit.skill, "demonstrations": demos, "explained": 0.9},
        "read_out": {"model": model, "note": "a"},
        "scaled": {"shown": demos[0], "scales": scales},
        "scales_from": {"skill": fit.skill},
        "unscaled": {
            "skill": models.learn(same, states=3, rng=_rng(), settings=FAST_SETTINGS).skill,
            "scales": scales,
        },
    }


def _control() -> Examples:
    system, still = control.double_integrator(2, 0.1), control.continuous_double_integrator(2)
    targets, weights = np.linspace(0.0, 1.0, 24).reshape(6, 4), np.stack([np.eye(4)] * 6)
    reference = control.Reference(targets, weights, 0.1)
    follow = {"system": system, "reference": reference, "control_cost": 0.5}
    smooth = {"system": still, "reference": reference, "control_cost": 0.5, "period": 0.1}
    rng, n = _rng(), 4
    base = geometry.pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    axes = rng.normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    chain = control.SerialChain(base, 0.3 * rng.normal(size=(n, 3)), _unit(n), axes, base)
    q = 0.3 * rng.normal(size=n)
    span = np.full(n, 2.5)
    limits = control.arm_limits(-span, span, span, 10.0 * span)
    soft = control.impedance(np.zeros(n))
    tool = control.forward_kinematics(chain, q)
    reading = control.ArmState(
        q, np.zeros(n), tool.position, tool.quaternion, control.jacobian(chain, q), np.zeros(n)
    )
    target = control.ToolTarget(tool.position + 0.01, tool.quaternion, np.zeros(6))
    return {
        "arm_limits": {"lower": -span, "upper": span, "velocity": span, "torque": span},
        "continuous_double_integrator": {"axes": 2},
        "double_integrator": {"axes": 2, "period": 0.1},
        "discretise": {"system": still, "period": 0.1},
        "forward_kinematics": {"chain": chain, "q": q},
        "jacobian": {"chain": chain, "q": q},
        "tool_poses": {"chain": chain, "q": np.stack([q, q])},
        "impedance": {
            "posture": np.zeros(n),
            "stiffness": (1000.0, 40.0),
            "damping": (60.0, 3.0),
            "posture_stiffness": 10.0,
            "joint_damping": 1.0,
            "force_limit": 60.0,
            "moment_limit": 12.0,
            "min_singular_value": 0.05,
            "limit_margin": 0.1,
            "limit_stiffness": 100.0,
        },
        "impedance_torque": {"impedance": soft, "limits": limits, "reading": reading, "target": target},
        "posture_torque": {
            "stiffness": 5.0,
            "damping": np.ones(n),
            "limits": limits,
            "reading": reading,
            "posture": np.zeros(n),
        },
        "inverse_kinematics": {
            "chain": chain,
            "target": tool,
            "start": q + 0.1,
            "limits": limits,
            "posture": np.zeros(n),
            "steps": 20,
        },
        "lqr": {**follow, "reference": control.Reference(targets[:1].repeat(6, axis=0), weights, 0.1)},
        "lqr_continuous": {
            **smooth,
            "reference": control.Reference(targets[:1].repeat(6, axis=0), weights),
        },
        "solve_batch": {**follow, "start": targets[0]},
        "track": follow,
        "track_continuous": {**smooth, "terminal": np.eye(4)},
    }


def _planning() -> Examples:
    demos, fit = _learned()
    model, start = _adapted(fit.skill), demos[0].x[0]
    point = planning.via_point("position", [0.5, 0.1], time=0.4, deviation=0.01)
    reference = planning.plan(model, start, horizon=10)
    curved = [shown.add_derivatives(shown.to_sphere(demo)) for demo in valve_demonstrations()]
    turning = _adapted(models.learn(curved, states=2, rng=_rng(), settings=FAST_SETTINGS).skill)
    turned = planning.via_point("orientation", [1.0, 0.0, 0.0, 0.0], time=0.4, deviation=0.1)
    here = planning.tangent_chart(turning)
    states = np.array([0, 0, 1, 1, 2])
    return {
        "tangent_chart": {"model": turning, "at": turning.means[0]},
        "expected_plan": {"model": model, "horizon": 10, "covariance_regularisation": 1e-3},
        "moving_frame_reference": {
            "now": model,
            "later": model,
            "states": states,
            "covariance_regularisation": 1e-3,
        },
        "observations": {"points": [point], "layout": model.layout, "states": demos[0].x, "period": 0.1},
        "via_point_to_tangent": {"point": turned, "chart": here},
        "plan": {"model": model, "start": start, "horizon": 10, "covariance_regularisation": 1e-3},
        "plan_through": {
            "model": model,
            "start": start,
            "points": [point],
            "horizon": 10,
            "covariance_regularisation": 1e-3,
        },
        "planned_states": {"model": model, "start": start, "horizon": 10},
        "reference": {"model": model, "states": states, "covariance_regularisation": 1e-3},
        "condition_on": {"reference": reference, "points": [point], "layout": model.layout},
        "via_point": {"what": "position", "value": [0.5, 0.1], "time": 0.4, "deviation": [0.01, 0.02]},
    }


def _environments() -> Examples:
    q = _unit(2)
    cell = _fresh_environment()
    action = np.array([0.6, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0, 0.5])
    return {
        "rotation_vector_in_world": {"q": q[0], "p": q[1]},
        "manipulation.step": {"action": action},
        "manipulation.reset": {"options": {"situation": cell.task.draw(_rng())}},
    }


def _plots() -> Examples:
    demos, fit = _learned()
    model, start = _adapted(fit.skill), demos[0].x[0]
    reference = planning.plan(model, start, horizon=10)
    motion = control.track(control.double_integrator(2, model.period), reference, 1.0).rollout(start)
    feedback = control.track(control.double_integrator(2, model.period), reference, 1.0)
    point = planning.via_point("position", [0.5, 0.1], time=0.4, deviation=0.01)
    states = planning.planned_states(model, start, horizon=10)
    tied = models.learn(
        demos, states=3, rng=_rng(), settings=FAST_SETTINGS, structure=gaussians.SemiTied()
    ).skill
    valve = [shown.add_derivatives(demo) for demo in valve_demonstrations()]
    frame_relevance = models.relevance(
        models.learn(valve, states=2, rng=_rng(), settings=FAST_SETTINGS).skill, valve
    )
    chosen = models.select(demos, [_candidate(2), _candidate(3)], rng=_rng(), settings=FAST_SETTINGS)
    return {
        "basis_vectors": {"skill": tied},
        "component_correlations": {"skills": [fit.skill, tied]},
        "demonstrations_seen": {"skill": fit.skill, "demonstrations": demos},
        "deviations": {"skill": fit.skill, "columns": ["position x"]},
        "forward_variable": {"skill": fit.skill, "horizon": 10, "log_observed": np.zeros((1, 3))},
        "frame_relevance": {"frame_relevance": frame_relevance},
        "gains": {"feedback": feedback, "layout": model.layout},
        "growth": {"models": [streams()[6]]},
        "likelihood_trace": {"fits": [fit]},
        "model_sizes": {"selection": chosen},
        "reproduction": {
            "skill": model,
            "motion": motion,
            "frames": [shown.world_frame(4)],
            "points": [point],
        },
        "state_graph": {"skill": fit.skill, "least": 0.01},
        "tracked_coordinates": {
            "skill": model,
            "states": states,
            "motion": motion,
            "columns": ["position x"],
        },
        "via_points": {
            "layout": model.layout,
            "motion": motion,
            "points": [point],
            "columns": ["position x"],
        },
    }


def _validation() -> Examples:
    return {
        "escape": {"text": "a"},
        "finite_array": {"value": np.eye(2), "label": "x"},
        "float_array": {"value": np.eye(2), "label": "x", "columns": 2},
        "require_bounded": {"numbers": np.eye(2), "label": "x"},
        "require_shapes_agree": {"a": np.eye(2), "b": np.ones(2)},
        "numeric_array": {"value": [[1.0, 2.0], [3.0, 4.0]], "label": "x"},
        "require_count": {"value": 3, "label": "x", "maximum": 5},
        "require_number": {"value": 3.0, "label": "x"},
        "require_printable": {"text": "a", "label": "x"},
        "nearest_name": {"name": "a", "known": ["ab", "b"]},
        "first_duplicate": {"items": ["a", "b", "a"]},
        "short_list": {"items": ["a", "b"]},
        "short_repr": {"value": [1, "a", None]},
    }
