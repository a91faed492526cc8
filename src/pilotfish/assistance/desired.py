"""The desired pose of each mode, before transition and limits."""

from dataclasses import replace

import numpy as np

from pilotfish.assistance.assistant import Assistant, AssistedSkill
from pilotfish.assistance.authority import coverage_distance, limit_authority
from pilotfish.assistance.autonomous import AutonomousPlan, occupied_state, plan_motion, remaining_states
from pilotfish.assistance.coordinates import pose_width, scalar_columns
from pilotfish.assistance.grip import follow_scalars, plan_scalars
from pilotfish.assistance.tracking import lqr_gains
from pilotfish.assistance.values import AssistanceState
from pilotfish.errors import SkillError
from pilotfish.geometry import exp_map, log_map
from pilotfish.models import adapt
from pilotfish.types import Array, Float


def desired_pose(
    assistant: Assistant, state: AssistanceState, dt: float
) -> tuple[AssistanceState, Float[Array, " D"], Float[Array, "E E"]]:
    """Return the state, the desired pose of the mode and its covariance.

    Args:
        assistant: Skills and settings.
        state: State with the command and situation of this step.
        dt: Time of the step [s].
    """
    skill, columns = assistant.skills[state.skill], scalar_columns(assistant.layout)
    if state.mode == "autonomous":
        state, desired = _follow_plan(skill, state, dt, assistant.layout.orientation_starts)
        return (
            replace(state, authority=limit_authority(state.authority, 0.0, dt)),
            desired,
            _covariance(state),
        )
    scalars, values = follow_scalars(state.scalars, state.command[columns])
    state = replace(state, scalars=scalars)
    state, desired, covariance = _correct(assistant, state, dt)
    desired[columns] = values
    return state, desired, covariance


def _correct(
    assistant: Assistant, state: AssistanceState, dt: float
) -> tuple[AssistanceState, Float[Array, " D"], Float[Array, "E E"]]:
    """Return the authority, and the command moved by it towards the corrected one."""
    skill, starts = assistant.skills[state.skill], assistant.layout.orientation_starts
    x, situation = state.command, state.situation
    allowed = 0.0
    if state.mode == "shared" and situation.is_current:
        whitened = situation.carried.deviations(x)
        allowed = skill.gate.authority(coverage_distance(whitened, pose_width(assistant.layout)))
    authority = limit_authority(state.authority, allowed, dt)
    state = replace(state, authority=authority)
    S = np.diag(assistant.noise.deviations(assistant.layout) ** 2)
    if state.mode != "shared":
        return replace(state, tracked=None), x.copy(), S
    probabilities = state.identification.probabilities(skill.skill.period, dt)
    try:
        if situation.literal is None:
            corrected, covariance = situation.carried.correct(x, probabilities[0])
        else:
            state, corrected, covariance = _track_literal(assistant, state, probabilities[1], dt)
    except SkillError:
        return state, x.copy(), S
    step = log_map(x, corrected, starts)
    desired = exp_map(x, authority * step, starts)
    return state, desired, authority * covariance + (1.0 - authority) * S


def _track_literal(
    assistant: Assistant, state: AssistanceState, probabilities: Float[Array, " K"], dt: float
) -> tuple[AssistanceState, Float[Array, " D"], Float[Array, "E E"]]:
    """Return the pose of the LQR after a step towards the product of the regressions."""
    assert state.situation.literal is not None
    starts, width = assistant.layout.orientation_starts, pose_width(assistant.layout)
    desired, spread = state.situation.literal.correct(state.command, probabilities)
    pose, velocity = state.tracked or (state.motion.pose, state.motion.velocity)
    position_gain, velocity_gain = lqr_gains(np.linalg.inv(spread), assistant.control_cost, dt)
    error = log_map(desired, pose, starts)[:width]
    u = -position_gain @ error - velocity_gain @ velocity[:width]
    step = np.zeros_like(velocity)
    step[:width] = dt * velocity[:width] + 0.5 * dt**2 * u
    velocity = velocity.copy()
    velocity[:width] += dt * u
    pose = exp_map(pose, step, starts)
    covariance = np.diag(assistant.noise.deviations(assistant.layout) ** 2)
    covariance[:width, :width] = spread
    return replace(state, tracked=(pose, velocity)), pose, covariance


def _follow_plan(
    skill: AssistedSkill, state: AssistanceState, dt: float, starts: tuple[int, ...]
) -> tuple[AssistanceState, Float[Array, " D"]]:
    """Return the state and the pose of the plan, planned again if the frames have changed."""
    plan = state.plan
    assert plan is not None
    changed = plan.frames is not state.situation.actual and state.situation.is_current
    if changed and plan.row > 0:  # at most once per period, or a scene that always changes would stop it
        try:
            plan = _plan_again(skill, state, plan)
        except SkillError:
            plan = replace(plan, frames=state.situation.actual)  # impossible frames: go on as planned
    plan = replace(plan, elapsed=plan.elapsed + dt)
    desired = plan_scalars(skill, plan.pose(starts), int(plan.states[plan.row]))
    return replace(state, plan=plan), desired


def _covariance(state: AssistanceState) -> Float[Array, "E E"]:
    """Return the fused covariance of the state that the plan has reached."""
    assert state.plan is not None
    covariances = state.situation.carried.fused_covariances
    return np.asarray(covariances[state.plan.states[state.plan.row]])


def first_plan(skill: AssistedSkill, state: AssistanceState) -> AutonomousPlan | None:
    """Return the plan from the filtered state; None if there can be none.

    Args:
        skill: Prepared skill.
        state: State of the assistance.
    """
    if not skill.can_plan:
        return None
    k, age = occupied_state(state.identification.beliefs[0])
    try:
        states = remaining_states(skill.skill.dynamics, k, age)
        adapted, motion = adapt(skill.skill, state.situation.actual), state.motion
        return plan_motion(adapted, states, motion.pose, motion.velocity, state.situation.actual)
    except SkillError:
        return None


def _plan_again(skill: AssistedSkill, state: AssistanceState, plan: AutonomousPlan) -> AutonomousPlan:
    """Return the plan for the actual frames from the row that the plan has reached."""
    adapted, row = adapt(skill.skill, state.situation.actual), plan.row
    again = plan_motion(
        adapted, plan.states[row:], plan.poses[row], plan.velocities[row], state.situation.actual
    )
    return replace(again, elapsed=plan.phase)
