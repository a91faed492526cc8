"""Valid arguments of the public functions of control, planning, environments and plots."""

from functools import cache
from pathlib import Path

import numpy as np

from fuzzing.examples_of_models import adapt_in_world, candidate, learn_lines
from fuzzing.examples_of_values import Examples, new_rng, unit_quaternions
from fuzzing.seeds import FAST_SETTINGS, streams, valve_demonstrations
from pilotfish import control, demonstrations, gaussians, geometry, kernels, models, planning
from pilotfish.environments import Manipulation, stack_measurements
from pilotfish.environments.robots import ROBOTS


@cache
def _environment() -> Manipulation:
    return Manipulation("valve")


def new_environment() -> Manipulation:
    _environment().reset(seed=0)
    return _environment()


def control_examples() -> Examples:
    system, still = control.double_integrator(2, 0.1), control.continuous_double_integrator(2)
    targets, weights = np.linspace(0.0, 1.0, 24).reshape(6, 4), np.stack([np.eye(4)] * 6)
    reference = control.Reference(targets, weights, 0.1)
    follow = {"system": system, "reference": reference, "control_cost": 0.5}
    smooth = {"system": still, "reference": reference, "control_cost": 0.5, "period": 0.1}
    rng, n = new_rng(), 4
    base = geometry.pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    axes = rng.normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    chain = control.SerialChain(base, 0.3 * rng.normal(size=(n, 3)), unit_quaternions(n), axes, base)
    q = 0.3 * rng.normal(size=n)
    span = np.full(n, 2.5)
    limits = control.arm_limits(-span, span, span, 10.0 * span)
    soft = control.impedance(np.zeros(n))
    tool = chain.forward_kinematics(q)
    reading = kernels.ArmState(q, np.zeros(n), tool.position, tool.quaternion, chain.jacobian(q), np.zeros(n))
    target = kernels.ToolTarget(tool.position + 0.01, tool.quaternion, np.zeros(6))
    return {
        "arm_limits": {"lower": -span, "upper": span, "velocity": span, "torque": span},
        "continuous_double_integrator": {"axes": 2},
        "double_integrator": {"axes": 2, "period": 0.1},
        "discretise": {"system": still, "period": 0.1},
        "control.SerialChain.forward_kinematics": {"self": chain, "q": q},
        "control.SerialChain.jacobian": {"self": chain, "q": q},
        "control.SerialChain.tool_poses": {"self": chain, "q": np.stack([q, q])},
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
            "max_iterations": 20,
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


def planning_examples() -> Examples:
    demos, fit = learn_lines()
    adapted, start = adapt_in_world(fit.skill), demos[0].x[0]
    frames = [demonstrations.world_frame(4)]
    via_point = planning.via_point("position", [0.5, 0.1], time=0.4, deviation=0.01)
    reference = planning.plan(adapted, start, horizon=10)
    on_sphere = [
        demonstrations.add_derivatives(demonstrations.to_sphere(demo)) for demo in valve_demonstrations()
    ]
    skill_on_sphere = models.learn(on_sphere, states=2, rng=new_rng(), settings=FAST_SETTINGS).skill
    adapted_on_sphere = adapt_in_world(skill_on_sphere)
    planning.via_point("orientation", [1.0, 0.0, 0.0, 0.0], time=0.4, deviation=0.1)
    motion = control.Motion(demos[0].x, np.zeros((len(demos[0].x) - 1, 2)), demos[0].period)
    pose_motion = control.Motion(on_sphere[0].x, np.zeros((len(on_sphere[0].x) - 1, 7)), 0.1)
    poses = {
        name: geometry.pose([0.1, 0.2, 0.3], [1.0, 0.0, 0.0, 0.0]) for name in skill_on_sphere.frame_names
    }
    now = {name: geometry.pose([0.1, 0.2, 0.35], [1.0, 0.0, 0.0, 0.0]) for name in poses}
    np.array([0, 0, 1, 1, 2])
    x = on_sphere[0].x[0]
    return {
        "tangent_chart": {"model": adapted_on_sphere, "base_pose": adapted_on_sphere.means[0]},
        "moving_frames": {"skill": skill_on_sphere, "previous_poses": poses, "current_poses": now, "x": x},
        "observe_via_points": {
            "points": [via_point],
            "layout": adapted.layout,
            "states": demos[0].x,
            "period": 0.1,
        },
        "plan": {
            "adapted": adapted,
            "start": start,
            "horizon": 10,
            "via_points": [via_point],
            "covariance_regularisation": 1e-3,
        },
        "plan_states": {"adapted": adapted, "start": start, "horizon": 10, "via_points": [via_point]},
        "condition_on": {"reference": reference, "points": [via_point], "layout": adapted.layout},
        "via_point": {"name": "position", "value": [0.5, 0.1], "time": 0.4, "deviation": [0.01, 0.02]},
        "default_control_cost": {"adapted": adapted},
        "default_covariance_regularisation": {"adapted": adapted},
        "motion_notes": {
            "skill": fit.skill,
            "reproduction": planning.reproduce(fit.skill, frames, start, horizon=10),
            "frames": frames,
        },
        "mean_demonstration_length": {"skill": fit.skill},
        "largest_acceleration": {"motion": motion, "layout": demos[0].layout},
        **{
            f"end_{quantity}_error": {"motion": pose_motion, "demonstration": on_sphere[0]}
            for quantity in ("position", "orientation")
        },
        "mean_squared_error": {"motion": motion, "demonstration": demos[0]},
        "reproduce": {
            "skill": fit.skill,
            "frames": frames,
            "start": start,
            "horizon": 10,
            "via_points": [via_point],
            "control_cost": 0.1,
            "covariance_regularisation": 1e-3,
        },
        "reproduce_adapted": {
            "adapted": adapted,
            "start": start,
            "horizon": 10,
            "via_points": [via_point],
            "control_cost": 0.1,
            "covariance_regularisation": 1e-3,
        },
        "time_warped_distance": {"x": demos[0].x[:6], "y": demos[0].x[3:8]},
        "default_candidates": {"demonstrations": demos},
        "held_out_errors": {
            "candidate": candidate(2),
            "training": demos,
            "held_out": demos[:1],
            "rng": new_rng(),
            "settings": FAST_SETTINGS,
        },
        "select_by_reproduction": {
            "demonstrations": demos,
            "candidates": [candidate(2)],
            "rng": new_rng(),
            "settings": FAST_SETTINGS,
        },
        "reproduce_demonstration": {"skill": fit.skill, "demonstration": demos[0]},
        "reproduce_step": {
            "skill": skill_on_sphere,
            "previous_poses": poses,
            "current_poses": now,
            "x": x,
            "states": np.array([0, 0, 1, 1]),
        },
    }


def environments_examples() -> Examples:
    cell = new_environment()
    now = cell.cell.measure_progress()
    periods = [{**now, "turned": turned} for turned in (0.0, 0.2, 0.4)]
    action = np.array([0.6, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0, 0.5])
    return {
        "explain_failure": {
            "progress": cell.task.progress,
            "history": stack_measurements(periods),
            "outcome": cell.cell.outcome(),
        },
        "stack_measurements": {"measurements": periods},
        "manipulation.step": {"action": action},
        "manipulation.reset": {"options": {"situation": cell.task.sample_situation(new_rng())}},
    }


def robots_examples() -> Examples:
    robot = ROBOTS["ur5e"]
    start = robot.chain.tool_poses(robot.posture)
    text = Path(__file__).parents[3] / "examples" / "arm.urdf"
    return {
        "chain_with_tool": {"robot": robot, "tool_length": 0.1},
        "joint_trajectory": {
            "robot": robot,
            "poses": np.stack([start, start]),
            "period": 0.1,
            "controller_period": 0.01,
            "tool_length": 0.0,
            "start": robot.posture,
        },
        "robot_from_description": {"data": text.read_bytes(), "name": "arm.urdf", "end_effector": "tool0"},
    }


def plots_examples() -> Examples:
    demos, fit = learn_lines()
    model, start = adapt_in_world(fit.skill), demos[0].x[0]
    reference = planning.plan(model, start, horizon=10)
    motion = control.track(control.double_integrator(2, model.period), reference, 1.0).rollout(start)
    feedback = control.track(control.double_integrator(2, model.period), reference, 1.0)
    point = planning.via_point("position", [0.5, 0.1], time=0.4, deviation=0.01)
    states = planning.plan_states(model, start, horizon=10)[1]
    tied = models.learn(
        demos, states=3, rng=new_rng(), settings=FAST_SETTINGS, structure=gaussians.structures.SemiTied()
    ).skill
    valve = [demonstrations.add_derivatives(demo) for demo in valve_demonstrations()]
    frame_relevance = models.relevance(
        models.learn(valve, states=2, rng=new_rng(), settings=FAST_SETTINGS).skill, valve
    )
    chosen = models.select(demos, [candidate(2), candidate(3)], rng=new_rng(), settings=FAST_SETTINGS)
    return {
        "basis_vectors": {"skill": tied},
        "covariance_correlations": {"skills": [fit.skill, tied]},
        "demonstrations_in_frames": {"skill": fit.skill, "demonstrations": demos},
        "state_deviations": {"skill": fit.skill, "columns": ["position x"]},
        "forward_variable": {"skill": fit.skill, "horizon": 10, "log_observed": np.zeros((1, 3))},
        "frame_relevance": {"frame_relevance": frame_relevance},
        "feedback_gains": {"feedback": feedback, "layout": model.layout},
        "online_clusters": {"models": [streams()[6]]},
        "likelihood_trace": {"fits": [fit]},
        "model_selection": {"selection": chosen},
        "reproduction_selection": {
            "selection": planning.select_by_reproduction(
                demos, [candidate(2)], rng=new_rng(), settings=FAST_SETTINGS
            )
        },
        "reproduction": {
            "skill": model,
            "motion": motion,
            "frames": [demonstrations.world_frame(4)],
            "points": [point],
        },
        "state_graph": {"skill": fit.skill, "min_probability": 0.01},
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
