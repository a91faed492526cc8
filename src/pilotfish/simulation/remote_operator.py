"""Simulated operator at the far end of a link: what the person looks at, does with the hand, and asks for.

What is displayed decides how a person works. In direct control it is the robot as it was last reported, in
which the effect of a movement appears after the round trip: the person moves and waits. In shared control and
on a fixture the person brings the hand to the goal in the local scene, which has no delay, and looks at
the predicted robot as well. As long as this is within 2 cm and 10 degrees of the hand, the person trusts the
assistance with the rest. Beyond that the person works with the predicted robot, and so corrects an assistance
that leads elsewhere. On a fixture the hand is always trusted. In autonomous control the person only watches.
In every mode the person waits at the end until the robot is reported at rest.

The person also operates the session: takes control, arms, moves the hand to the robot where they are apart,
and clears the reason of a hold after a reaction time. Simplification: the hand is where the person means it
to be, without an arm that is guided.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import TypeVar

import numpy as np

from pilotfish.environments import Task
from pilotfish.environments.human import (
    DemonstrationPlan,
    HumanModel,
    HumanState,
    Observation,
    initial_state,
    step_human,
)
from pilotfish.geometry import Pose, from_rotation_vector, multiply, rotation_vector_in_world
from pilotfish.simulation.recording import ARM_LAG, OBSERVATION_PERIOD
from pilotfish.teleop import (
    NO_ENVELOPE,
    Action,
    Envelope,
    OperatorInput,
    OperatorView,
    Reason,
    Report,
    SessionState,
    SkillState,
    next_action,
)
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

S = TypeVar("S")
LOCAL = ("shared", "fixture")  # modes in which the person works in the local scene, without delay
CLICK_TIME = 0.5  # s from what is displayed to the action that it calls for
ALIGNING_SPEED = 0.08  # m/s, at which the hand returns to the robot
ALIGNING_RATE = 0.4  # rad/s
NEAR, NEAR_ANGLE = 0.03, 0.2  # m and rad: so near the person leaves the hand where it is
AT_REST = 0.01  # m/s
TRUSTED_DISTANCE, TRUSTED_ANGLE = 0.02, 0.175  # m, rad
STALE = 0.5  # s: the person stops when what is displayed is older
IDLE = OperatorInput(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), is_dead_man_pressed=False)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RemoteOperator:
    """What a simulated operator does, apart from the state.

    Attributes:
        plan: Person, subtasks of the task, and the delay after which effects appear.
        number: Number of the operator in the session.
        mode: Mode of the commands once the session is active.
        envelope: What is authorised when control begins; of duration 0 for nothing.
        is_local: Whether the person works in the local scene.
        aside: Displacement of everything that the person aims at [m].
    """

    plan: DemonstrationPlan
    number: int
    mode: str
    envelope: Envelope
    is_local: bool
    aside: Float[Array, " 3"]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class RemoteOperatorState:
    """State of a simulated operator.

    Attributes:
        human: State of the person; None before the first report.
        wait_until: When the person reacts to the session next [s].
        is_authorised: Whether the envelope was sent.
        began: When the session was active first [s]; infinite before.
        ended: When the person knew that the motion had ended [s]; infinite before.
        was_active: Whether the session was active in the last report.
        last_command: Number of the command that ends the motion; 0 before.
    """

    human: HumanState | None
    wait_until: float = 0.0
    is_authorised: bool = False
    began: float = inf
    ended: float = inf
    was_active: bool = False
    last_command: int = 0


def make_remote_operator(
    task: Task[S],
    situation: S,
    *,
    human_model: HumanModel,
    mode: str,
    round_trip: float,
    number: int = 1,
    envelope: Envelope = NO_ENVELOPE,
    aside: Float[Array, " 3"] | None = None,
) -> RemoteOperator:
    """Return an operator who follows the script of a task.

    Args:
        task: Task from `TASKS`.
        situation: Situation of the task.
        human_model: Parameters of the person.
        mode: Mode of the commands.
        round_trip: Round-trip time of the link [s].
        number: Number of the operator.
        envelope: What is authorised when control begins.
        aside: Displacement of everything that the person aims at [m]; None for none.
    """
    is_local = mode in LOCAL
    delay = ARM_LAG if is_local else ARM_LAG + round_trip
    plan = DemonstrationPlan(human_model, task.demonstration_script(situation), delay)
    return RemoteOperator(
        plan, number, mode, envelope, is_local, np.zeros(3) if aside is None else np.asarray(aside)
    )


def step_remote_operator(
    operator: RemoteOperator,
    state: RemoteOperatorState,
    time: float,
    view: OperatorView,
    rng: np.random.Generator,
) -> tuple[RemoteOperatorState, OperatorInput]:
    """Return the next state, and what the operator does; the dead-man switch is open before the first report.

    Args:
        operator: What the operator does.
        state: State of the step before.
        time: Time [s].
        view: What is displayed.
        rng: Generator of the motor noise.
    """
    report = view.report
    if report is None:
        return state, IDLE
    if state.human is None:
        state = replace(state, human=initial_state(_pose(report.target), time, report.grip))
    human = state.human
    assert human is not None
    state, actions = _operate_session(operator, state, time, view, report)
    is_active = report.state is SessionState.ACTIVE and view.report_age < STALE
    if is_active:
        state = _work(operator, state, time, view, rng)
    elif report.state in (SessionState.ALIGNING, SessionState.CONTINUING):
        state = replace(state, human=_align_hand(human, report))
    state = _watch_end(operator, replace(state, was_active=is_active), time, view, report)
    human = state.human or human
    return state, OperatorInput(
        np.append(human.hand.position, human.hand.quaternion),
        human.grip,
        operator.mode,
        actions=actions,
        envelope=operator.envelope,
    )


def _operate_session(
    operator: RemoteOperator,
    state: RemoteOperatorState,
    time: float,
    view: OperatorView,
    report: Report,
) -> tuple[RemoteOperatorState, tuple[Action, ...]]:
    """Return the state, and the action that the display calls for, after the time of a click."""
    is_holder = report.holder == operator.number
    state = replace(state, is_authorised=state.is_authorised and is_holder)
    if time < state.wait_until or view.waiting:
        return state, ()
    if is_holder and operator.envelope.duration > 0.0 and not state.is_authorised:
        return replace(state, is_authorised=True), (Action.AUTHORISE,)
    is_assisted = operator.mode != "direct"
    needs_skill = is_assisted or operator.envelope.duration > 0.0
    action = next_action(view, operator.number, needs_skill=needs_skill)
    lacks_skill = is_assisted and any(each is not SkillState.READY for each in view.skills)
    if action is None or (action is Action.ARM and lacks_skill) or state.ended < inf:
        return state, ()
    return replace(state, wait_until=time + CLICK_TIME), (action,)


def _work(
    operator: RemoteOperator,
    state: RemoteOperatorState,
    time: float,
    view: OperatorView,
    rng: np.random.Generator,
) -> RemoteOperatorState:
    """Return the state after a step of the task; the person starts from the hand where it is."""
    human, report = state.human, view.report
    assert human is not None
    assert report is not None
    if not state.was_active:
        human = replace(
            human,
            time=time,
            rest_pose=human.hand,
            submovements=(),
            rest_time=time,
            subtask_start=time,
            n_attempts=0,
            dwell_end=inf,
            near_since=inf,
            samples=(),
        )
        state = replace(state, began=min(state.began, time))
    if operator.mode != "autonomous" and view.frames and not human.done:
        tool = _displayed_tool(operator, human, view, report)
        frames = {
            name: Pose(pose.position + operator.aside, pose.quaternion) for name, pose in view.frames.items()
        }
        human = step_human(operator.plan, human, time, Observation(tool, frames), rng)
    return replace(state, human=human)


def _displayed_tool(operator: RemoteOperator, human: HumanState, view: OperatorView, report: Report) -> Pose:
    if not operator.is_local:
        return _pose(report.pose)
    predicted, hand = _pose(view.predicted), human.hand
    distance = float(np.linalg.norm(predicted.position - hand.position))
    turn = float(np.linalg.norm(rotation_vector_in_world(hand.quaternion, predicted.quaternion)))
    is_trusted = distance <= TRUSTED_DISTANCE and turn <= TRUSTED_ANGLE
    return hand if operator.mode == "fixture" or is_trusted else predicted


def _align_hand(human: HumanState, report: Report) -> HumanState:
    """Return the person with the hand moved a little towards the robot, unless it is near."""
    distance, angle = report.misalignment
    if distance <= NEAR and angle <= NEAR_ANGLE:
        return human
    hand, goal = human.hand, _pose(report.target)
    offset = goal.position - hand.position
    turn = rotation_vector_in_world(hand.quaternion, goal.quaternion)
    step = min(1.0, ALIGNING_SPEED * OBSERVATION_PERIOD / max(float(np.linalg.norm(offset)), 1e-9))
    part = min(1.0, ALIGNING_RATE * OBSERVATION_PERIOD / max(float(np.linalg.norm(turn)), 1e-9))
    moved = Pose(hand.position + step * offset, multiply(from_rotation_vector(part * turn), hand.quaternion))
    return replace(human, hand=moved, rest_pose=moved, submovements=())


def _watch_end(
    operator: RemoteOperator,
    state: RemoteOperatorState,
    time: float,
    view: OperatorView,
    report: Report,
) -> RemoteOperatorState:
    """Return the state with the time when the person knows that the motion has ended and the robot rests."""
    if state.ended < inf or state.began == inf:
        return state
    is_at_rest = float(np.linalg.norm(report.twist[:3])) < AT_REST
    if report.reason is Reason.PLAN_ENDED and is_at_rest:
        return replace(state, ended=time)
    if report.state is not SessionState.ACTIVE:
        return state
    if operator.mode == "autonomous":
        is_ended = report.mode == "autonomous" and not report.is_plan_moving and is_at_rest
        return replace(state, ended=time) if is_ended else state
    assert state.human is not None
    if state.human.done and not state.last_command:
        return replace(state, last_command=view.command + 1)
    if state.last_command and report.command >= state.last_command and is_at_rest:
        return replace(state, ended=time)
    return state


def _pose(numbers: Sequence[float] | Float[Array, " 7"]) -> Pose:
    values = np.asarray(numbers, dtype=float)
    return Pose(values[:3], values[3:7])
