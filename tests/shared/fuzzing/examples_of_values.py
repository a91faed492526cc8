"""Valid arguments of the public functions of geometry, demonstrations, gaussians and validation."""

import numpy as np

from fuzzing.seeds import gripper_demonstrations, valve_demonstrations
from pilotfish import demonstrations, gaussians, geometry

Examples = dict[str, dict[str, object]]


def new_rng() -> np.random.Generator:
    return np.random.default_rng(0)


def unit_quaternions(*shape: int) -> np.ndarray:
    q = new_rng().normal(size=(*shape, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def geometry_examples() -> Examples:
    q, p, v = unit_quaternions(5), unit_quaternions(5)[::-1].copy(), 0.3 * new_rng().normal(size=(5, 3))
    x, flat = np.hstack([v, q]), 0.3 * new_rng().normal(size=(5, 6))
    R = geometry.rotation_matrix(q)
    of_q = (
        "conjugate",
        "unwrap_quaternions",
        "left_multiplication_matrix",
        "quaternion_log",
        "to_rotation_vector",
        "normalise",
        "rotation_matrix",
    )
    of_v = (
        "from_rotation_vector",
        "quaternion_exp",
        "inverse_right_jacobian",
        "right_jacobian",
    )
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
        "karcher_mean": {"x": x, "weights": np.full(5, 0.2), "orientation_starts": (3,)},
        "rotation_vector_in_world": {"p": p[0], "q": q[0]},
        "minimum_jerk": {"s": np.linspace(-0.1, 1.1, 7)},
        "pose": {"position": v[0], "quaternion": q[0]},
        "tangent_slices": {"width": 7, "orientation_starts": (3,)},
    }


def demonstrations_examples() -> Examples:
    demos, gripper = valve_demonstrations(), gripper_demonstrations()
    demo, layout = demos[0], demonstrations.pose_layout()
    given, plane = demo.frames[0], demonstrations.position_layout(2)
    A, b = np.stack([given.A] * len(demo.x)), np.stack([given.b] * len(demo.x))
    place = geometry.pose(given.b[:3], demo.x[0, 3:])
    return {
        "diagnose": {"demonstrations": demos},
        "demonstrations.Layout.distance_unit": {"self": layout, "columns": slice(3, 7)},
        "demonstrations.Layout.distances": {
            "self": layout,
            "columns": slice(3, 7),
            "x": demo.x,
            "y": demo.x[0],
        },
        "unwrap_orientations": {"x": demo.x, "layout": layout},
        "demonstration": {"x": demo.x, "period": 0.1, "layout": layout, "frames": demo.frames, "name": "a"},
        "frame": {"name": "a", "A": given.A, "b": given.b},
        "moving_frame": {"name": "a", "A": A, "b": b},
        "planar_frame": {
            "name": "a",
            "layout": plane,
            "position": np.zeros(2),
            "angle": 0.5,
        },
        "to_quaternions": {"values": np.zeros((2, 3)), "representation": "rpy", "label": "orientation"},
        "frame_from_pose": {"name": "a", "layout": layout, "pose": place},
        "moving_frame_from_poses": {"name": "a", "layout": layout, "poses": [place, place]},
        "has_opposite_sign": {"q": demo.x[:, 3:7], "reference": -demos[1].x[:, 3:7]},
        "common_switches": {"demonstrations": gripper, "names": ["grip"]},
        "demonstrations.Layout.rate_column": {"self": gripper[0].layout, "column": 4},
        "switching_columns": {
            "x": np.vstack([held.x for held in gripper]),
            "layout": gripper[0].layout,
        },
        "to_sphere": {"demo": demo},
        "position_layout": {"axes": 2, "unit": "m"},
        "resample": {"demo": demo, "steps": 9},
        "resample_to_period": {"demo": demo, "period": 0.04},
        "views": {"demonstrations": demos},
        "add_derivatives": {"demo": demo},
        "world_frame": {"width": 3},
    }


def gaussians_examples() -> Examples:
    rng = new_rng()
    root = rng.normal(size=(3, 3, 3))
    S = root @ root.transpose(0, 2, 1) + np.eye(3)
    means, x, shares = rng.normal(size=(3, 3)), rng.normal(size=(6, 3)), rng.dirichlet(np.ones(3), 6)
    g = gaussians.Gaussian(means[0], S[0])
    inputs, x_inputs = np.array([0]), x[:, :1].copy()
    mixture = gaussians.GaussianMixture(np.full(3, 1 / 3), means, S)
    conditionals = gaussians.conditional_gaussians(means, S, inputs)
    poses = np.hstack([x[:5], unit_quaternions(5)])
    curved = np.stack([np.eye(6)] * 2)
    point = gaussians.RiemannianGaussian(poses[0], curved[0], (3,))
    on_sphere = gaussians.conditional_gaussians(poses[:2], curved, inputs, (3,))
    return {
        "cholesky": {"covariances": S},
        "precision_cholesky": {"covariances": S},
        "condition": {"g": g, "columns": np.array([1]), "value": np.array([0.5])},
        "conditional_gaussians": {
            "means": poses[:2],
            "covariances": curved,
            "inputs": inputs,
            "orientation_starts": (3,),
        },
        "gaussians.Gaussian.ellipse": {
            "self": gaussians.Gaussian(means[0, :2], S[0, :2, :2]),
            "radius": 1.0,
            "points": 20,
        },
        "gaussians.Gaussian.in_confidence_region": {"self": g, "x": x, "probability": 0.9},
        "log_density": {"g": g, "x": x},
        "gaussians.ConditionalGaussians.log_input_densities": {"self": on_sphere, "x": x_inputs},
        "marginal": {"g": g, "columns": np.array([0, 2])},
        "gaussians.Moments.from_data": {"x": x, "responsibilities": shares},
        "gaussians.Moments.from_sums": {
            "origins": means,
            "counts": np.ones(3),
            "deviation_sums": means,
            "scatter_matrices": S,
        },
        "product": {"gaussians": [g, gaussians.Gaussian(means[1], S[1])]},
        "gaussians.GaussianMixture.regress": {"self": mixture, "inputs": inputs, "x": x_inputs},
        "gaussians.GaussianMixture.regress_means": {"self": mixture, "inputs": inputs, "x": x_inputs},
        "regress_with_responsibilities": {
            "conditionals": conditionals,
            "x": x_inputs,
            "responsibilities": shares,
        },
        "gaussians.RiemannianGaussian.log_density": {"self": point, "x": poses},
        "gaussians.RiemannianGaussian.product": {"gaussians": [point, point]},
        "sample": {"g": g, "count": 4, "rng": rng},
        "gaussians.RiemannianGaussian.tangent_gaussian": {"self": point, "point": poses[1]},
        "gaussians.TangentMoments.from_data": {
            "x": poses,
            "responsibilities": np.full((5, 2), 0.5),
            "orientation_starts": (3,),
        },
        "affine_transform": {"g": g, "A": S[0], "b": means[1]},
    }


def structures_examples() -> Examples:
    root = new_rng().normal(size=(3, 3, 3))
    return {"component_correlation": {"covariances": root @ root.transpose(0, 2, 1) + np.eye(3)}}


def validation_examples() -> Examples:
    return {
        "require_table": {"value": {"a": 1}, "label": "x", "needed": ["a"], "optional": ["b"]},
        "finite_array": {"value": np.eye(2), "label": "x"},
        "float_array": {"value": np.eye(2), "label": "x", "columns": 2},
        "require_bounded": {"numbers": np.eye(2), "label": "x"},
        "require_shapes_agree": {"a": np.eye(2), "b": np.ones(2)},
        "numeric_array": {"value": [[1.0, 2.0], [3.0, 4.0]], "label": "x"},
        "require_type": {"value": 3, "label": "x", "types": int, "fix": "pass a number"},
        "require_name": {"name": "cup", "label": "x"},
        "require_period": {"value": 0.1, "label": "x"},
        "require_count": {"value": 3, "label": "x", "maximum": 5},
        "require_number": {"value": 3.0, "label": "x"},
        "require_printable": {"text": "a", "label": "x"},
        "nearest_name": {"name": "a", "known": ["ab", "b"]},
        "first_duplicate": {"items": ["a", "b", "a"]},
        "short_list": {"items": ["a", "b"]},
        "short_repr": {"value": [1, "a", None]},
    }
