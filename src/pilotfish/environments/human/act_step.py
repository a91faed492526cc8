"""One step of a person at work: look, move, wait, look again, or follow a moving goal; stay; go on."""

from dataclasses import replace
from math import inf

import numpy as np

from pilotfish.environments.human.acts import (
    DemonstrationPlan,
    HandCommand,
    Observation,
    Subtask,
    within_tolerance,
)
from pilotfish.environments.human.aiming import aim_submovement
from pilotfish.environments.human.crossover import (
    TIME_TOLERANCE,
    Sample,
    append_sample,
    goal_velocity,
    tracking_velocity,
)
from pilotfish.environments.human.doing import HumanState, Phase, next_subtask
from pilotfish.environments.human.movements import (
    Submovement,
    duration,
    final_hand_pose,
    hand_pose,
    remaining_displacement,
)
from pilotfish.environments.human.offsets import add_offset, clip_offset, offset_norms, pose_difference
from pilotfish.geometry import Pose


def step_human(
    plan: DemonstrationPlan,
    state: HumanState,
    time: float,
    observation: Observation,
    rng: np.random.Generator,
) -> tuple[HumanState, HandCommand]:
    """The person at a later time, having seen the picture that arrives then, and what the hand asks.

    Looks and endings fall on steps: what is due between two happens at the second.
    Source: Ferrell 1965, IEEE Trans. Human Factors in Electronics 6, for moving and waiting; McRuer &
    Jex 1967, the same 8(3), for tracking.
    """
    time = float(time)  # comparing numbers of NumPy gives no plain True
    then, state = state, _advance_hand(state, time)
    if state.phase is not Phase.DONE and time >= state.dwell_end - TIME_TOLERANCE:
        state = next_subtask(state, len(plan.subtasks))
    if state.phase is not Phase.DONE:
        subtask = plan.subtasks[state.subtask]
        now = Sample(time, observation.tool, subtask.goal(observation.frames))
        if subtask.tracking:
            state = replace(state, samples=append_sample(state.samples, now, plan.human_model.tau_e))
        if state.phase is Phase.TRACKING:
            state = _track_goal(plan, state, now, time - then.time)
        else:
            state = _move_and_wait(plan, state, now, rng)
    travelled = float(np.linalg.norm(state.hand.position - then.hand.position))
    state = replace(state, path_length=state.path_length + travelled)
    return state, HandCommand(state.hand, state.grip, state.subtask, state.phase is Phase.DONE)


def _advance_hand(state: HumanState, time: float) -> HumanState:
    """The hand where its moves have taken it; moves that are over, and none is before them, become rest."""
    rest_pose, submovements = state.rest_pose, state.submovements
    while submovements and submovements[0].end <= time:
        rest_pose, submovements = add_offset(rest_pose, submovements[0].displacement), submovements[1:]
    return replace(
        state,
        time=time,
        hand=hand_pose(rest_pose, submovements, time),
        rest_pose=rest_pose,
        submovements=submovements,
    )


def _move_and_wait(
    plan: DemonstrationPlan, state: HumanState, now: Sample, rng: np.random.Generator
) -> HumanState:
    """Nothing while a movement is under way or its effect not yet seen, and a look at what came of it then.

    The first look at an act is at once: a hand that is still moving will take the tool where it was aimed.
    """
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
    """What the person decides on seeing or, unsettled, expecting the tool there.

    The goal is reached; or track it; or give up; or aim again.
    """
    subtask = plan.subtasks[state.subtask]
    there = (settled or subtask.passing) and within_tolerance(now.tool, now.goal, subtask)
    if there and state.dwell_end == inf:
        state = replace(state, dwell_end=now.time + subtask.dwell, grip=subtask.grip)
    if (
        subtask.tracking
        and plan.round_trip <= plan.human_model.max_tracking_delay
        and (there or state.n_attempts)
    ):
        return replace(state, phase=Phase.TRACKING, rest_pose=state.hand, submovements=())
    if _timed_out(plan, state):
        return next_subtask(replace(state, n_timeouts=state.n_timeouts + 1), len(plan.subtasks))
    predicted_goal = _predict_goal(plan, state, now)
    return (
        state
        if within_tolerance(now.tool, predicted_goal, subtask)
        else _start_submovement(plan, state, replace(now, goal=predicted_goal), rng)
    )


def _timed_out(plan: DemonstrationPlan, state: HumanState) -> bool:
    return state.dwell_end == inf and state.time - state.subtask_start > plan.human_model.timeout


def _predict_goal(plan: DemonstrationPlan, state: HumanState, now: Sample) -> Pose:
    """Where a moving goal will be seen at the next look, as long as it keeps its speed."""
    if not state.samples:
        return now.goal
    subtask, human_model = plan.subtasks[state.subtask], plan.human_model
    cycle = duration(human_model, human_model.gain * pose_difference(now.tool, now.goal), subtask.speed)
    cycle += human_model.reaction_time + plan.round_trip
    return Pose(now.goal.position + cycle * goal_velocity(state.samples), now.goal.quaternion)


def _start_submovement(
    plan: DemonstrationPlan, state: HumanState, now: Sample, rng: np.random.Generator
) -> HumanState:
    """The person as the next sub-movement begins."""
    human_model, speed = plan.human_model, plan.subtasks[state.subtask].speed
    displacement = aim_submovement(
        human_model, final_hand_pose(state.rest_pose, state.submovements), now.tool, now.goal, rng
    )
    move = Submovement(displacement, now.time, duration(human_model, displacement, speed))
    return replace(
        state,
        submovements=(*state.submovements, move),
        rest_time=max(state.rest_time, move.end),
        n_attempts=state.n_attempts + 1,
        n_submovements=state.n_submovements + 1,
    )


def _track_goal(plan: DemonstrationPlan, state: HumanState, now: Sample, elapsed: float) -> HumanState:
    """The hand moved on by the speed that the error asks for.

    The goal is reached when it has stayed within tolerance for a reaction time.
    """
    subtask, human_model = plan.subtasks[state.subtask], plan.human_model
    if plan.round_trip > human_model.max_tracking_delay:
        return replace(state, phase=Phase.MOVE_AND_WAIT)
    if _timed_out(plan, state):
        return next_subtask(replace(state, n_timeouts=state.n_timeouts + 1), len(plan.subtasks))
    hand = _tracking_hand_pose(plan, state, now, elapsed)
    near_since = min(state.near_since, now.time) if within_tolerance(now.tool, now.goal, subtask) else inf
    state = replace(state, hand=hand, rest_pose=hand, near_since=near_since, rest_time=now.time)
    if state.dwell_end == inf and now.time - near_since >= human_model.reaction_time - TIME_TOLERANCE:
        return replace(state, dwell_end=now.time + subtask.dwell, grip=subtask.grip)
    return state


def _tracking_hand_pose(plan: DemonstrationPlan, state: HumanState, now: Sample, elapsed: float) -> Pose:
    """Where tracking takes the hand: ahead of the tool by at most the lean and the way gone in the delay."""
    human_model, share = plan.human_model, plan.subtasks[state.subtask].speed
    speed = tracking_velocity(human_model, state.samples, plan.round_trip, share)
    hand = add_offset(state.hand, elapsed * speed)
    delay = share * (human_model.tau_e + plan.round_trip)
    furthest = (
        human_model.max_lead + human_model.peak_speed * delay,
        human_model.max_angular_lead + human_model.peak_angular_speed * delay,
    )
    return add_offset(now.tool, clip_offset(pose_difference(now.tool, hand), *furthest))
