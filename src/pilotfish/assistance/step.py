"""One step of the assistance, a pure function of state, command, frames and time.

    hand --mapping, clutch--> command x --filter--> state probabilities
    direct       y = x
    shared       y = x moved towards the corrected command by the authority
    autonomous   y = the plan from the filtered state
    fixture      y = x moved by the authority towards the cart that the hand pulls along the path
    y --transition--> --limits--> target

`kernels.assistance_step` computes all of this but plan and cart. Here are the changes of mode, skill, clutch
and frames, which come first: a plan begins in the state filtered one step ago.

The filter advances once per period of the skill, however often it is called, and its probabilities are
interpolated in between. It stands still while the clutch is open, a command is bad, or control is autonomous.

Faults do not stop the loop. A bad command (wrong width, not finite, no quaternion) holds the target, which
blends to the commands when they return. Missing, stale (None) or impossible frames leave the last situation
in place, and authority goes to zero at its rate. A mode that is not possible, such as autonomous control of
a mixture or a fixture that the skill does not have, leaves the mode as it is. `Target.mode` states the mode
in effect.

Scalars such as a grip follow the operator in direct and shared control, the state of the plan in autonomous
control, and the phase of the cart on a fixture if they switch. After a change of mode or skill the grip
holds until what it follows changes or agrees with it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish import kernels
from pilotfish.assistance.assistant import Assistant
from pilotfish.assistance.coordinates import scalar_columns
from pilotfish.assistance.desired import (
    Corrected,
    first_plan,
    follow_fixture,
    follow_plan,
    plan_scalars,
    start_cart,
    track_literal,
    with_cart_scalars,
)
from pilotfish.assistance.mapping import OperatorMapping, close_clutch, open_map
from pilotfish.assistance.occupancy import resume_filter, start_filter
from pilotfish.assistance.situation import find_situation, update_situation
from pilotfish.assistance.values import AssistanceState, Command, Target
from pilotfish.demonstrations import Frame, Layout
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.kernels import AssistanceInput, AssistanceMemory, is_valid_hand, map_hand
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_number, require_type, short_repr

MIN_STEP, MAX_STEP = 1e-6, 10.0  # s
MODE_NUMBERS = {  # of the kernel, in which a fixture is another correction of shared control
    "direct": kernels.DIRECT,
    "shared": kernels.SHARED,
    "autonomous": kernels.AUTONOMOUS,
    "fixture": kernels.SHARED,
}
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
    require_type(pose, "pose", np.ndarray, "pass np.array(pose)")
    layout = assistant.layout
    is_oriented = bool(layout.orientation_starts)
    if not is_valid_hand(hand := _numbers(pose, layout), is_oriented):
        raise InvalidInput(
            f"pose is {short_repr(pose)}, expected {layout.width} finite numbers with a unit quaternion: "
            f"{', '.join(layout.names)}"
        )
    require_count(skill, "skill", len(assistant.skills) - 1)
    assisted = assistant.skills[skill]
    x = map_hand(open_map(OperatorMapping()), hand, is_oriented)
    E, scalars = layout.tangent.width, x[scalar_columns(layout)].copy()
    memory = AssistanceMemory(
        start_filter(assisted.tables),
        *(x, np.zeros(E), x, np.zeros(E), x, scalars, scalars),
        *(0.0, 0.0, 0.0),
        is_following=False,
    )
    return AssistanceState(
        memory,
        open_map(assistant.mapping),
        True,
        "direct",
        skill,
        find_situation(assisted, frames_observed, frames_actual, assistant.noise),
        None,
        None,
        start_filter(assisted.joint_tables) if assisted.joint_tables else None,
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
    hand, before = _numbers(command.hand, assistant.layout), state
    state = _update_clutch(assistant, state, command.clutch, hand)
    state = _update_scene(assistant, state, command.skill, frames_observed, frames_actual)
    if state.skill != before.skill:
        state = _hold_scalars(assistant, state, _command(assistant, state, hand)[0])
    state = _change_mode(assistant, state, command.mode, hand)
    state, corrected = _corrected_elsewhere(assistant, state, hand, dt)
    has_changed = (before.mode, before.skill) != (state.mode, state.skill)
    skill = assistant.skills[state.skill]
    hand = with_cart_scalars(skill, state.cart, hand)
    memory, covariance, probabilities = kernels.assistance_step(
        state.hand_map,
        state.situation.carried,
        skill.tables,
        assistant.settings[state.skill],
        state.memory,
        _kernel_input(state, hand, corrected, has_changed, dt),
    )
    if state.plan is not None:
        probabilities = np.eye(skill.skill.states)[state.plan.states[state.plan.row]]
    pose, velocity = memory.pose.copy(), memory.velocity.copy()  # the caller may change a target
    target = Target(pose, velocity, covariance, state.mode, memory.authority, probabilities)
    return _with_memory(state, memory), target


def _with_memory(state: AssistanceState, memory: AssistanceMemory) -> AssistanceState:
    """Return the state with another memory, in half the time of `replace`."""
    return AssistanceState(
        memory,
        state.hand_map,
        state.is_clutch_closed,
        state.mode,
        state.skill,
        state.situation,
        state.plan,
        state.cart,
        state.joint,
        state.tracked,
    )


def _kernel_input(
    state: AssistanceState,
    hand: Float[Array, " D"],
    corrected: Corrected | None,
    has_changed: bool,
    dt: float,
) -> AssistanceInput:
    return AssistanceInput(
        hand,
        corrected[0] if corrected else None,
        corrected[1] if corrected else None,
        dt,
        MODE_NUMBERS[state.mode],
        state.is_clutch_closed,
        state.situation.is_current,
        has_changed,
    )


def _numbers(hand: Array, layout: Layout) -> Float[Array, " D"]:
    """Return a hand as the kernel reads it: NaN if it has another width or no numbers."""
    if hand.shape != (layout.width,) or hand.dtype.kind not in "fiu":
        return np.full(layout.width, np.nan)
    return hand if hand.dtype == np.float64 else hand.astype(np.float64)


def _update_scene(
    assistant: Assistant,
    state: AssistanceState,
    number: int,
    frames_observed: Frames | None,
    frames_actual: Frames | None,
) -> AssistanceState:
    """Return the state with the skill and the frames of this step."""
    if number != state.skill and number < len(assistant.skills):
        return _change_skill(assistant, state, number, frames_observed, frames_actual)
    skill = assistant.skills[state.skill]
    situation = update_situation(state.situation, skill, frames_observed, frames_actual, assistant.noise)
    return state if situation is state.situation else replace(state, situation=situation)


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
        memory=replace(state.memory, filter=start_filter(skill.tables)),
        joint=start_filter(skill.joint_tables) if skill.joint_tables else None,
        plan=None,
        cart=None,
        mode="shared" if state.mode in ("autonomous", "fixture") else state.mode,
        tracked=None,
    )


def _update_clutch(
    assistant: Assistant, state: AssistanceState, clutch: bool, hand: Float[Array, " D"]
) -> AssistanceState:
    """Return the state with the clutch as the operator holds it; it closes on a valid hand only."""
    if clutch == state.is_clutch_closed:
        return state
    if not clutch:
        return replace(state, is_clutch_closed=False)
    is_oriented = bool(assistant.layout.orientation_starts)
    if not is_valid_hand(hand, is_oriented):
        return state
    hand_map = close_clutch(assistant.mapping, hand, state.memory.command, is_oriented)
    return replace(state, hand_map=hand_map, is_clutch_closed=True)


def _change_mode(
    assistant: Assistant, state: AssistanceState, mode: str, hand: Float[Array, " D"]
) -> AssistanceState:
    """Return the state in the mode that the operator asks for, if it is possible; scalars hold."""
    if mode == state.mode:
        return state
    skill, memory, joint = assistant.skills[state.skill], state.memory, state.joint
    x, _ = _command(assistant, state, hand)
    plan = first_plan(skill, state) if mode == "autonomous" else None
    cart = start_cart(skill, state.situation, x) if mode == "fixture" else None
    if (mode == "autonomous" and plan is None) or (mode == "fixture" and cart is None):
        return state
    if state.plan is not None:
        reached = int(state.plan.states[state.plan.row])
        memory = replace(memory, filter=resume_filter(skill.tables, reached))
        joint = resume_filter(skill.joint_tables, None) if skill.joint_tables else None
    state = replace(state, mode=mode, plan=plan, cart=cart, memory=memory, joint=joint, tracked=None)
    if plan is not None:
        x = plan_scalars(skill, plan.poses[0], int(plan.states[0]))
    return _hold_scalars(assistant, state, with_cart_scalars(skill, cart, x))


def _hold_scalars(
    assistant: Assistant, state: AssistanceState, commanded: Float[Array, " D"]
) -> AssistanceState:
    """Return the state with scalars that hold at the target, until these commands change."""
    columns, memory = scalar_columns(assistant.layout), state.memory
    held, commands = memory.pose[columns].copy(), commanded[columns].copy()
    return replace(state, memory=replace(memory, held_values=held, held_commands=commands))


def _corrected_elsewhere(
    assistant: Assistant, state: AssistanceState, hand: Float[Array, " D"], dt: float
) -> tuple[AssistanceState, Corrected | None]:
    """Return the pose of the plan, of the cart or of the literal variant, if one of them is in use."""
    corrected: Corrected | None = None
    if state.situation.literal is not None and state.plan is None:
        state, corrected = track_literal(assistant, state, *_command(assistant, state, hand), dt)
    if state.plan is not None:
        starts = assistant.layout.orientation_starts
        state, corrected = follow_plan(assistant.skills[state.skill], state, dt, starts)
    elif state.cart is not None:
        state, corrected = follow_fixture(assistant, state, *_command(assistant, state, hand), dt)
    return state, corrected


def _command(
    assistant: Assistant, state: AssistanceState, hand: Float[Array, " D"]
) -> tuple[Float[Array, " D"], bool]:
    """Return the command of a hand, and whether the hand is followed."""
    is_oriented = bool(assistant.layout.orientation_starts)
    if state.is_clutch_closed and is_valid_hand(hand, is_oriented):
        return map_hand(state.hand_map, hand, is_oriented), True
    return state.memory.command, False
