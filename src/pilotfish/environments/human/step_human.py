"""One step of a simulated person: move and wait, or track, then dwell, then the next subtask.

Move and wait. Without a usable picture of the tool in motion, a person makes an open-loop sub-movement, waits
until its effect is visible (rest_time + reaction_time + round_trip), and corrects. The first sub-movement of
a subtask starts at once: while the hand still moves, the person expects the tool where the hand will rest.

Tracking. A moving goal is followed in closed loop by the crossover model, as long as the round-trip time is
at most max_tracking_delay. Above it, the person moves and waits for the predicted goal.

Invariants. Each random draw belongs to one sub-movement. The hand never jumps: sub-movements add up, and the
change to tracking makes the present pose of the hand the new rest pose. Events happen at steps: what is due
between two steps happens at the second.
"""

from dataclasses import replace
from math import inf

import numpy as np

from pilotfish.environments.human.crossover_model import (
    TIME_TOLERANCE,
    Sample,
    append_sample,
    goal_velocity,
    tracking_velocity,
)
from pilotfish.environments.human.demonstration_plan import (
    DemonstrationPlan,
    Observation,
    Subtask,
    within_tolerance,
)
from pilotfish.environments.human.human_state import HumanState, Phase, next_subtask
from pilotfish.environments.human.motor_noise import aim_submovement
from pilotfish.environments.human.pose_offsets import (
    add_offset,
    clip_offset,
    offset_norms,
    pose_difference,
)
from pilotfish.environments.human.submovements import (
    Submovement,
    final_hand_pose,
    hand_pose,
    remaining_displacement,
    submovement_duration,
)
from pilotfish.geometry import Pose


def step_human(
    plan: DemonstrationPlan,
    state: HumanState,
    time: float,
    observation: Observation,
    rng: np.random.Generator,
) -> HumanState:
    """Return the state of the person at a later time.

    Args:
        plan: What the person does.
        state: State after the last step.
        time: Time of this step [s].
        observation: Picture that arrives at this time.
        rng: Generator of the motor noise.

    Source:
        Ferrell 1965, IEEE Trans. Human Factors in Electronics 6, for move and wait; McRuer & Jex 1967, the
        same, 8(3), for tracking.
    """
    time = float(time)  # comparisons of NumPy numbers do not give bool
    before, state = state, _advance_hand(state, time)
    if not state.done and time >= state.dwell_end - TIME_TOLERANCE:
        state = next_subtask(state, len(plan.subtasks))
    if not state.done:
        subtask = plan.subtasks[state.subtask]
        now = Sample(time, observation.tool, subtask.goal(observation.frames))
        if subtask.tracking:
            state = replace(state, samples=append_sample(state.samples, now, plan.human_model.tau_e))
        if state.phase is Phase.TRACKING:
            state = _track_goal(plan, state, now, time - before.time)
        else:
            state = _move_and_wait(plan, state, now, rng)
    distance = float(np.linalg.norm(state.hand.position - before.hand.position))
    return replace(state, path_length=state.path_length + distance)


def _advance_hand(state: HumanState, time: float) -> HumanState:
    """Move the hand along its sub-movements; completed ones at the front become part of the rest pose."""
    rest_pose, submovements = state.rest_pose, state.submovements
    while submovements and submovements[0].end <= time:
        rest_pose, submovements = add_offset(rest_pose, submovements[0].displacement), submovements[1:]
    hand = hand_pose(rest_pose, submovements, time)
    return replace(state, time=time, hand=hand, rest_pose=rest_pose, submovements=submovements)


def _move_and_wait(
    plan: DemonstrationPlan, state: HumanState, now: Sample, rng: np.random.Generator
) -> HumanState:
    """Wait while a movement is under way or its effect is not visible; otherwise react."""
    subtask, human_model = plan.subtasks[state.subtask], plan.human_model
    if subtask.passing and state.n_attempts and _submovement_nearly_done(subtask, state):
        return next_subtask(replace(state, grip=subtask.grip), len(plan.subtasks))
    if state.dwell_end < inf and not subtask.tracking:
        return state
    settled = now.time >= state.rest_time + human_model.reaction_time + plan.round_trip - TIME_TOLERANCE
    watching = (
        subtask.tracking and now.time < state.subtask_start + human_model.reaction_time - TIME_TOLERANCE
    )
    if watching or (state.n_attempts and not settled):
        return state
    if settled:
        lead = clip_offset(
            pose_difference(now.tool, state.hand), human_model.max_lead, human_model.max_angular_lead
        )
        return _react_to_observation(plan, replace(state, lead=lead), now, settled, rng)
    expected = add_offset(final_hand_pose(state.rest_pose, state.submovements), -state.lead)
    return _react_to_observation(plan, state, replace(now, tool=expected), settled, rng)


def _submovement_nearly_done(subtask: Subtask, state: HumanState) -> bool:
    distance, angle = offset_norms(remaining_displacement(state.submovements, state.time))
    return distance <= subtask.position_tolerance and angle <= subtask.angle_tolerance


def _react_to_observation(
    plan: DemonstrationPlan, state: HumanState, now: Sample, settled: bool, rng: np.random.Generator
) -> HumanState:
    """Start the dwell, tracking, the next subtask or a sub-movement, by the observed or expected tool."""
    subtask = plan.subtasks[state.subtask]
    reached = (settled or subtask.passing) and within_tolerance(now.tool, now.goal, subtask)
    if reached and state.dwell_end == inf:
        state = replace(state, dwell_end=now.time + subtask.dwell, grip=subtask.grip)
    if (
        subtask.tracking
        and plan.round_trip <= plan.human_model.max_tracking_delay
        and (reached or state.n_attempts)
    ):
        return replace(state, phase=Phase.TRACKING, rest_pose=state.hand, submovements=())
    if _is_timed_out(plan, state):
        return next_subtask(replace(state, n_timeouts=state.n_timeouts + 1), len(plan.subtasks))
    predicted_goal = _predict_goal(plan, state, now)
    if within_tolerance(now.tool, predicted_goal, subtask):
        return state
    return _start_submovement(plan, state, replace(now, goal=predicted_goal), rng)


def _is_timed_out(plan: DemonstrationPlan, state: HumanState) -> bool:
    return state.dwell_end == inf and state.time - state.subtask_start > plan.human_model.timeout


def _predict_goal(plan: DemonstrationPlan, state: HumanState, now: Sample) -> Pose:
    """Return the pose of a moving goal at the next observation, at its present velocity."""
    if not state.samples:
        return now.goal
    subtask, human_model = plan.subtasks[state.subtask], plan.human_model
    displacement = human_model.gain * pose_difference(now.tool, now.goal)
    cycle = submovement_duration(human_model, displacement, subtask.speed_factor)
    cycle += human_model.reaction_time + plan.round_trip
    return Pose(now.goal.position + cycle * goal_velocity(state.samples), now.goal.quaternion)


def _start_submovement(
    plan: DemonstrationPlan, state: HumanState, now: Sample, rng: np.random.Generator
) -> HumanState:
    human_model, speed_factor = plan.human_model, plan.subtasks[state.subtask].speed_factor
    hand_end = final_hand_pose(state.rest_pose, state.submovements)
    displacement = aim_submovement(human_model, hand_end, now.tool, now.goal, rng)
    duration = submovement_duration(human_model, displacement, speed_factor)
    submovement = Submovement(displacement, now.time, duration)
    return replace(
        state,
        submovements=(*state.submovements, submovement),
        rest_time=max(state.rest_time, submovement.end),
        n_attempts=state.n_attempts + 1,
        n_submovements=state.n_submovements + 1,
    )


def _track_goal(plan: DemonstrationPlan, state: HumanState, now: Sample, elapsed: float) -> HumanState:
    """Move the hand by the tracking velocity; the goal is reached after a reaction time within tolerance."""
    subtask, human_model = plan.subtasks[state.subtask], plan.human_model
    if plan.round_trip > human_model.max_tracking_delay:
        return replace(state, phase=Phase.MOVE_AND_WAIT)
    if _is_timed_out(plan, state):
        return next_subtask(replace(state, n_timeouts=state.n_timeouts + 1), len(plan.subtasks))
    hand = _tracking_hand_pose(plan, state, now, elapsed)
    near_since = min(state.near_since, now.time) if within_tolerance(now.tool, now.goal, subtask) else inf
    state = replace(state, hand=hand, rest_pose=hand, near_since=near_since, rest_time=now.time)
    if state.dwell_end == inf and now.time - near_since >= human_model.reaction_time - TIME_TOLERANCE:
        return replace(state, dwell_end=now.time + subtask.dwell, grip=subtask.grip)
    return state


def _tracking_hand_pose(plan: DemonstrationPlan, state: HumanState, now: Sample, elapsed: float) -> Pose:
    """Return the next pose of the hand, whose lead over the tool is limited."""
    human_model, speed_factor = plan.human_model, plan.subtasks[state.subtask].speed_factor
    velocity = tracking_velocity(human_model, state.samples, plan.round_trip, speed_factor)
    hand = add_offset(state.hand, elapsed * velocity)
    delay = speed_factor * (human_model.tau_e + plan.round_trip)
    max_offset = (
        human_model.max_lead + human_model.peak_speed * delay,
        human_model.max_angular_lead + human_model.peak_angular_speed * delay,
    )
    return add_offset(now.tool, clip_offset(pose_difference(now.tool, hand), *max_offset))
