"""One step of the assistance, a pure function of state, command, frames and time.

    hand --mapping, clutch--> command x --filter--> state probabilities
    direct       y = x
    shared       y = x moved towards the corrected command by the authority
    autonomous   y = the plan from the filtered state
    y --transition--> --limits--> target

The filter advances once per period of the skill, however often it is called, and its probabilities are
interpolated in between. It stands still while the clutch is open, a command is bad, or control is autonomous.

Faults do not stop the loop. A bad command (wrong width, not finite, no quaternion) holds the target, which
blends to the commands when they return. Missing, stale (None) or impossible frames leave the last situation
in place, and authority goes to zero at its rate. A mode that is not possible, such as autonomous control of
a mixture, leaves the mode as it is; `Target.mode` states the mode in effect.

Scalars such as a grip follow the operator in direct and shared control, and the state of the plan in
autonomous control. When the operator returns, the grip holds until the operator changes it or agrees with it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.assistance.assistant import Assistant
from pilotfish.assistance.coordinates import scalar_columns
from pilotfish.assistance.desired import desired_pose, first_plan
from pilotfish.assistance.grip import hold_scalars
from pilotfish.assistance.identification import (
    advance_identification,
    begin_identification,
    resume_identification,
)
from pilotfish.assistance.limits import TargetMotion, follow_desired
from pilotfish.assistance.mapping import (
    OPEN_CLUTCH,
    Clutch,
    OperatorMapping,
    close_clutch,
    is_valid_hand,
    map_hand,
)
from pilotfish.assistance.situation import find_situation, update_situation
from pilotfish.assistance.transition import Transition, begin_transition
from pilotfish.assistance.values import AssistanceState, Command, Target
from pilotfish.demonstrations import Frame
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number, require_type, short_repr

MIN_STEP, MAX_STEP = 1e-6, 10.0  # s
Frames = Sequence[Frame]


def initial_state(
    assistant: Assistant,
    pose: Float[Array, " D"],
    frames_observed: Frames,
    frames_actual: Frames,
    *,
    skill: int = 0,
) -> AssistanceState:
    """Return the state before the first step, after checking the frames.

    Args:
        assistant: Skills and settings.
        pose: Pose and scalars of the robot, in the coordinates of the skill.
        frames_observed: Frames that the operator sees.
        frames_actual: Frames of the actual objects.
        skill: Index of the skill in use.

    Raises:
        InvalidInput: If the pose or a frame cannot be used, or the skill does not exist.
        NotPositiveDefinite: If a covariance is singular in these frames.
    """
    require_type(assistant, "assistant", Assistant, "make_assistant([assisted_skill(skill)]) makes one")
    layout = assistant.layout
    if not is_valid_hand(pose, layout):
        raise InvalidInput(
            f"pose is {short_repr(pose)}, expected {layout.width} finite numbers with a unit quaternion: "
            f"{', '.join(layout.names)}"
        )
    require_count(skill, "skill", len(assistant.skills) - 1)
    assisted = assistant.skills[skill]
    x = map_hand(OperatorMapping(), OPEN_CLUTCH, pose, layout)
    E, scalars = layout.tangent.width, x[scalar_columns(layout)]
    return AssistanceState(
        x,
        Clutch(True, OPEN_CLUTCH.shift, OPEN_CLUTCH.turn),
        False,
        "direct",
        skill,
        find_situation(assisted, frames_observed, frames_actual, assistant.noise),
        begin_identification(assisted),
        0.0,
        Transition(np.zeros(E), 0.0, 0.0),
        TargetMotion(x, np.zeros(E), x),
        hold_scalars(scalars, scalars),
        None,
        None,
    )


def step_assistance(
    assistant: Assistant,
    state: AssistanceState,
    command: Command,
    frames_observed: Frames | None,
    frames_actual: Frames | None,
    dt: float,
) -> tuple[AssistanceState, Target]:
    """Return the next state and the target of the robot.

    Args:
        assistant: Skills and settings.
        state: State of the step before.
        command: What the operator wants; a bad hand holds the target.
        frames_observed: Frames that the operator saw when making the command; None if they are stale.
        frames_actual: Frames of the actual objects; None if they are stale.
        dt: Time since the step before [s].

    Raises:
        InvalidInput: If dt is not from 1 us to 10 s, or an argument has another type. Bad hands and frames
            are not refused.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> demonstrations = pf.io.synthetic_valve(rng)
        >>> skill = pf.learn(demonstrations, states=5, rng=rng).skill
        >>> assistant = pf.assistance.make_assistant([pf.assistance.assisted_skill(skill)])
        >>> observed = actual = demonstrations[0].frames
        >>> hand = demonstrations[0].x[0, :7]
        >>> state = pf.assistance.initial_state(assistant, hand, observed, actual)
        >>> command = pf.assistance.Command(hand, mode="shared")
        >>> state, target = pf.assistance.step_assistance(assistant, state, command, observed, actual, 0.01)
        >>> target.mode
        'shared'

    Source:
        Tanwani 2018, section 6.3, with the corrections of docs/assistance.md.
    """
    require_type(assistant, "assistant", Assistant, "make_assistant([assisted_skill(skill)]) makes one")
    require_type(state, "state", AssistanceState, "initial_state makes one")
    require_type(command, "command", Command, "pass Command(hand, mode)")
    dt = require_number(dt, "dt", MIN_STEP, MAX_STEP)
    before = state
    state = _read_command(assistant, state, command, frames_observed, frames_actual)
    skill = assistant.skills[state.skill]
    if state.following and state.mode != "autonomous":
        state = replace(
            state,
            identification=advance_identification(
                state.identification, skill, state.situation, state.command, dt
            ),
        )
    state = _change_mode(assistant, state, command.mode)
    state, desired, covariance = desired_pose(assistant, state, dt)
    changed = (before.mode, before.skill, before.following) != (state.mode, state.skill, state.following)
    starts = assistant.layout.orientation_starts
    transition = replace(state.transition, elapsed=state.transition.elapsed + dt)
    if changed:
        transition = begin_transition(desired, state.motion.pose, starts)
    motion = follow_desired(assistant.limits, state.motion, transition.blend(desired, starts), dt, starts)
    state = replace(state, transition=transition, motion=motion)
    if state.mode == "autonomous" and state.plan is not None:
        probabilities = np.eye(skill.skill.states)[state.plan.states[state.plan.row]]
    else:
        probabilities = state.identification.probabilities(skill.skill.period, dt)[0]
    return state, Target(motion.pose, motion.velocity, covariance, state.mode, state.authority, probabilities)


def _read_command(
    assistant: Assistant,
    state: AssistanceState,
    command: Command,
    frames_observed: Frames | None,
    frames_actual: Frames | None,
) -> AssistanceState:
    """Return the state with the command, the clutch, the skill and the situation of this step."""
    layout, clutch, x = assistant.layout, state.clutch, state.command
    following = command.clutch and is_valid_hand(command.hand, layout)
    if following:
        if not clutch.closed:
            clutch = close_clutch(assistant.mapping, command.hand, x, layout)
        x = map_hand(assistant.mapping, clutch, command.hand, layout)
    elif not command.clutch:
        clutch = replace(clutch, closed=False)
    state = replace(state, clutch=clutch, command=x, following=following)
    if command.skill != state.skill and command.skill in range(len(assistant.skills)):
        return _change_skill(assistant, state, command.skill, frames_observed, frames_actual)
    skill = assistant.skills[state.skill]
    situation = update_situation(state.situation, skill, frames_observed, frames_actual, assistant.noise)
    return replace(state, situation=situation)


def _change_skill(
    assistant: Assistant,
    state: AssistanceState,
    number: int,
    frames_observed: Frames | None,
    frames_actual: Frames | None,
) -> AssistanceState:
    """Return the state with another skill; the old one stays if the frames of the new one are missing."""
    skill = assistant.skills[number]
    try:
        if frames_observed is None or frames_actual is None:
            return replace(state, situation=replace(state.situation, is_current=False, given=()))
        situation = find_situation(skill, frames_observed, frames_actual, assistant.noise)
    except SkillError:
        return replace(state, situation=replace(state.situation, is_current=False, given=()))
    return replace(
        state,
        skill=number,
        situation=situation,
        identification=begin_identification(skill),
        plan=None,
        mode="shared" if state.mode == "autonomous" else state.mode,
        tracked=None,
    )


def _change_mode(assistant: Assistant, state: AssistanceState, mode: str) -> AssistanceState:
    """Return the state in the mode that the operator asks for, if it is possible."""
    if mode == state.mode:
        return state
    skill, columns = assistant.skills[state.skill], scalar_columns(assistant.layout)
    held = hold_scalars(state.motion.pose[columns], state.command[columns])
    if mode == "autonomous":
        plan = first_plan(skill, state)
        return replace(state, mode=mode, plan=plan, scalars=held, tracked=None) if plan else state
    identification = state.identification
    if state.plan is not None:
        reached = int(state.plan.states[state.plan.row])
        identification = resume_identification(identification, skill, reached)
    return replace(state, mode=mode, plan=None, scalars=held, identification=identification, tracked=None)
