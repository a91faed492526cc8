"""The desired pose of autonomous control, of virtual fixtures and of literal shared control.

They are not in the kernel, which blends towards them and applies the limits.
"""

from dataclasses import replace

import numpy as np

from pilotfish.assistance.assistant import Assistant, AssistedSkill
from pilotfish.assistance.autonomous import (
    AutonomousPlan,
    occupied_state,
    plan_again,
    plan_motion,
    remaining_states,
)
from pilotfish.assistance.coordinates import pose_width
from pilotfish.assistance.situation import Situation
from pilotfish.assistance.tracking import lqr_gains
from pilotfish.assistance.values import AssistanceState
from pilotfish.assistance.virtual_fixture import FixtureState, nearest_phase, start_fixture, step_fixture
from pilotfish.errors import SkillError
from pilotfish.geometry import exp_map, log_map
from pilotfish.kernels import advance_filter
from pilotfish.models import adapt
from pilotfish.types import Array, Float

Corrected = tuple[Float[Array, " D"], Float[Array, "E E"]]


def track_literal(
    assistant: Assistant, state: AssistanceState, x: Float[Array, " D"], is_followed: bool, dt: float
) -> tuple[AssistanceState, Corrected | None]:
    """Return the state of the literal variant and, in shared control, the pose of its LQR.

    The LQR tracks the product of the regressions; if there is none, it stands at the command.

    Args:
        assistant: Skills and settings.
        state: State with the situation and the mode of this step.
        x: Command.
        is_followed: Whether the command is a new one, which the filter observes.
        dt: Time of the step [s].
    """
    skill, literal, joint = assistant.skills[state.skill], state.situation.literal, state.joint
    assert literal is not None
    assert joint is not None
    assert skill.joint_tables is not None
    period, S = skill.skill.period, np.diag(assistant.noise.deviations(assistant.layout) ** 2)
    if is_followed:
        joint = advance_filter(skill.joint_tables, joint, literal.log_likelihoods(x), period, dt)
        state = replace(state, joint=joint)
    if state.mode != "shared":
        return replace(state, tracked=None), None
    try:
        desired, spread = literal.correct(x, joint.probabilities(period, dt))
    except SkillError:
        return state, (x, S)
    starts, width = assistant.layout.orientation_starts, pose_width(assistant.layout)
    pose, velocity = state.tracked or (state.memory.pose, state.memory.velocity)
    position_gain, velocity_gain = lqr_gains(np.linalg.inv(spread), assistant.control_cost, dt)
    error = log_map(desired, pose, starts)[:width]
    u = -position_gain @ error - velocity_gain @ velocity[:width]
    step = np.zeros_like(velocity)
    step[:width] = dt * velocity[:width] + 0.5 * dt**2 * u
    velocity = velocity.copy()
    velocity[:width] += dt * u
    pose = exp_map(pose, step, starts)
    S[:width, :width] = spread
    return replace(state, tracked=(pose, velocity)), (pose, S)


def follow_plan(
    skill: AssistedSkill, state: AssistanceState, dt: float, starts: tuple[int, ...]
) -> tuple[AssistanceState, Corrected]:
    """Return the state, and the pose of the plan with the fused covariance of its state.

    The plan is made again if the frames have changed.

    Args:
        skill: Prepared skill.
        state: State with the situation of this step.
        dt: Time of the step [s].
        starts: First column of each quaternion.
    """
    plan = state.plan
    assert plan is not None
    changed = plan.frames is not state.situation.actual and state.situation.is_current
    if changed and plan.row > 0:  # at most once per period, or a scene that always changes would stop it
        try:
            adapted = adapt(skill.skill, state.situation.actual)
            plan = plan_again(adapted, plan, state.situation.actual)
        except SkillError:
            plan = replace(plan, frames=state.situation.actual)  # impossible frames: go on as planned
    plan = replace(plan, elapsed=plan.elapsed + dt)
    k = int(plan.states[plan.row])
    pose = plan_scalars(skill, plan.pose(starts), k)
    return replace(state, plan=plan, tracked=None), (pose, state.situation.carried.fused_covariances[k])


def start_cart(skill: AssistedSkill, situation: Situation, x: Float[Array, " D"]) -> FixtureState | None:
    """Return the cart at the phase that is nearest to a command; None if there can be none.

    Args:
        skill: Prepared skill.
        situation: The skill in the present frames.
        x: Command.
    """
    if skill.fixture is None:
        return None
    try:
        phase = nearest_phase(skill.fixture, x, situation.observed)
        return start_fixture(skill.fixture, situation.observed, phase)
    except SkillError:
        return None


def follow_fixture(
    assistant: Assistant, state: AssistanceState, x: Float[Array, " D"], is_followed: bool, dt: float
) -> tuple[AssistanceState, Corrected]:
    """Return the state, and the pose of the cart on the path in the actual scene with its covariance.

    While no hand is followed the cart stands.

    Args:
        assistant: Skills and settings.
        state: State with the situation of this step.
        x: Command.
        is_followed: Whether the command is a new one.
        dt: Time of the step [s].
    """
    fixture, cart, situation = assistant.skills[state.skill].fixture, state.cart, state.situation
    assert fixture is not None
    assert cart is not None
    layout, velocity = assistant.layout, np.zeros(assistant.layout.tangent.width)
    if is_followed:
        width = pose_width(layout)
        velocity[:width] = log_map(state.memory.command, x, layout.orientation_starts)[:width] / dt
    try:
        cart, target = step_fixture(
            fixture,
            cart,
            x if is_followed else cart.mean,
            velocity,
            situation.actual,
            dt,
            observed_frames=situation.observed,
        )
    except SkillError:
        return state, (x, np.diag(assistant.noise.deviations(layout) ** 2))
    return replace(state, cart=cart, tracked=None), (target.mean, target.covariance)


def with_cart_scalars(
    skill: AssistedSkill, cart: FixtureState | None, hand: Float[Array, " D"]
) -> Float[Array, " D"]:
    """Return a hand with the switches, such as the grip, at the phase of the cart.

    Args:
        skill: Prepared skill.
        cart: Cart; None leaves the hand as it is.
        hand: Pose and scalars of the hand; a bad one stays bad.
    """
    if cart is None or skill.fixture is None or not skill.fixture.switches or not np.isfinite(hand).all():
        return hand
    hand = hand.copy()
    for switch in skill.fixture.switches:
        hand[switch.column] = switch.value_at(cart.grip_phase)
    return hand


def plan_scalars(skill: AssistedSkill, planned: Float[Array, " D"], state: int) -> Float[Array, " D"]:
    """Return a planned pose with each switch at the value of its state.

    Args:
        skill: Prepared skill.
        planned: Pose and scalars of the plan.
        state: State of the plan.
    """
    pose = planned.copy()
    for column, low, high in zip(skill.switches, *skill.levels, strict=True):
        means = np.array([m[state, column] for m in skill.skill.means]).mean()
        pose[column] = high if means > 0.5 * (low + high) else low
    return pose


def first_plan(skill: AssistedSkill, state: AssistanceState) -> AutonomousPlan | None:
    """Return the plan from the filtered state; None if there can be none.

    Args:
        skill: Prepared skill.
        state: State of the assistance.
    """
    if not skill.can_plan:
        return None
    k, age = occupied_state(state.memory.filter.belief)
    try:
        states = remaining_states(skill.skill.dynamics, k, age)
        adapted, memory = adapt(skill.skill, state.situation.actual), state.memory
        return plan_motion(adapted, states, memory.pose, memory.velocity, state.situation.actual)
    except SkillError:
        return None
