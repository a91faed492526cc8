"""One step of the operator's site, a pure function of state, time, messages and what the operator does.

Every step sends one command. Requests, stops, the mission and the pieces of skills are repeated until the
robot reports that they arrived. Repetition counts steps, and no message holds a time: the clock of this site
only measures the round trip for the display, and cannot change what is sent.

The predicted robot is the assistance with the same skill in the local scene, that is, with the frames of the
last report. It answers the operator's hand without delay.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from pilotfish.assistance import (
    AssistanceState,
    Assistant,
    Command,
    direct_skill,
    initial_state,
    make_assistant,
    step_assistance,
)
from pilotfish.demonstrations import Frame
from pilotfish.errors import SkillError
from pilotfish.geometry import Pose, rotation_vector_in_world
from pilotfish.teleop.delay_contract import SECOND
from pilotfish.teleop.messages import (
    CommandMessage,
    Message,
    Mission,
    ReceivedMessage,
    Report,
    Request,
    SkillPiece,
    SkillState,
    SkillStatus,
    Stop,
    require_received,
)
from pilotfish.teleop.operator_values import OperatorInput, OperatorSettings, OperatorView
from pilotfish.teleop.robot_reports import frame_number
from pilotfish.teleop.robot_site import MAX_TIME_NS
from pilotfish.teleop.robot_skills import make_frames
from pilotfish.teleop.session import MOVING
from pilotfish.teleop.skill_transfer import missing_pieces, skill_hash, split_skill
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_type, shorten_repr

MAX_ROUND_TRIPS = 100
MAX_SENT = 4096  # commands whose time of sending is remembered
MAX_VALID = 65.535  # s
MISSION_STEPS = 25


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Predicted robot.

    Attributes:
        assistant: Direct control, then the skills of the mission.
        frames: Frames of the last report, with the names of the skills.
        poses: Their poses by name.
        state: State of the assistance; None while the robot does not move.
        pose: Predicted pose and scalars.
        authority: Authority of the assistance.
    """

    assistant: Assistant
    frames: tuple[Frame, ...] | None
    poses: dict[str, Pose]
    state: AssistanceState | None
    pose: Float[Array, " D"]
    authority: float = 0.0


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class OperatorSite:
    """State of the operator's site; `start_operator` makes the first one.

    Attributes:
        pieces: Pieces of each skill of the mission.
        mission: Mission that the robot shall have.
        prediction: Predicted robot.
        steps: Number of steps.
        sent: Numbers and times of the last commands, oldest first.
        hand: Hand of the step before; None before the first.
        report: Last report; None before the first.
        report_time: When it arrived, on this site's clock [ns].
        reports: Number of reports that arrived.
        first_report: Number of the first report.
        round_trips: Measured round-trip times [s].
        requests: Requests that the robot has not answered, oldest first.
        request_number: Number of the last request.
        request_step: Step in which the oldest request was sent last.
        stop_number: Number of the last stop.
        statuses: Last state of each skill at the robot.
    """

    pieces: tuple[tuple[SkillPiece, ...], ...]
    mission: Mission
    prediction: Prediction
    steps: int = 0
    sent: tuple[tuple[int, int], ...] = ()
    hand: Float[Array, " 7"] | None = None
    report: Report | None = None
    report_time: int = 0
    reports: int = 0
    first_report: int = 0
    round_trips: tuple[float, ...] = ()
    requests: tuple[Request, ...] = ()
    request_number: int = 0
    request_step: int = -1_000_000
    stop_number: int = 0
    statuses: dict[bytes, SkillStatus] = field(default_factory=dict)


def start_operator(settings: OperatorSettings) -> OperatorSite:
    """Return the state before the first step.

    Args:
        settings: Settings.

    Raises:
        SkillError: If a skill of the mission cannot be used.
    """
    require_type(settings, "settings", OperatorSettings, "OperatorSettings(decode_skill, skills) makes one")
    skills = [direct_skill(settings.layout), *map(settings.decode_skill, settings.skills)]
    assistant = make_assistant(skills, limits=settings.limits)
    pose = np.zeros(assistant.layout.width)
    pose[3] = 1.0
    return OperatorSite(
        pieces=tuple(split_skill(data) for data in settings.skills),
        mission=Mission(1, tuple(skill_hash(data) for data in settings.skills)),
        prediction=Prediction(assistant, None, {}, None, pose),
    )


def step_operator(
    settings: OperatorSettings,
    site: OperatorSite,
    time_ns: int,
    received: tuple[ReceivedMessage, ...],
    given: OperatorInput,
) -> tuple[OperatorSite, tuple[Message, ...], OperatorView]:
    """Return the next state, the messages to be sent and what is displayed.

    Args:
        settings: Settings.
        site: State of the step before.
        time_ns: Time on the operator's clock [ns]; it is used for display only.
        received: Messages of the robot, in the order of their arrival.
        given: What the operator does.

    Raises:
        InvalidInput: If an argument has another type.
    """
    require_type(settings, "settings", OperatorSettings, "OperatorSettings(decode_skill, skills) makes one")
    require_type(site, "site", OperatorSite, "start_operator makes one")
    require_type(given, "given", OperatorInput, "OperatorInput(hand) makes one")
    require_count(time_ns, "time_ns", MAX_TIME_NS, minimum=-MAX_TIME_NS)
    require_received(received)
    for each in received:
        if isinstance(each.message, Report):
            site = _receive_report(site, each.message, time_ns)
        elif isinstance(each.message, SkillStatus):
            site = replace(site, statuses={**site.statuses, each.message.hash: each.message})
    site = replace(site, steps=site.steps + 1)
    site, outgoing = _send_requests(settings, site, given)
    site, command = _command(settings, site, given)
    outgoing += [command, *_skill_messages(settings, site)]
    sent = (*site.sent[-MAX_SENT + 1 :], (command.number, time_ns))
    site = replace(site, prediction=_predict(settings, site, given), hand=given.hand, sent=sent)
    return site, tuple(outgoing), _view(site, time_ns)


def _receive_report(site: OperatorSite, report: Report, time_ns: int) -> OperatorSite:
    """Return the state with a report, unless a newer one arrived before."""
    before = site.report
    if before is not None and report.number <= before.number:
        return site
    sent, round_trips = site.sent, site.round_trips
    if before is None or report.command > before.command:
        sent = tuple(each for each in sent if each[0] >= report.command)
        if sent and sent[0][0] == report.command:
            measured = (time_ns - sent[0][1]) / SECOND - report.command_age
            round_trips = (*round_trips[-MAX_ROUND_TRIPS + 1 :], measured)
    return replace(
        site,
        report=report,
        report_time=time_ns,
        reports=site.reports + 1,
        first_report=site.first_report or report.number,
        round_trips=round_trips,
        sent=sent,
        requests=tuple(request for request in site.requests if request.number > report.request),
    )


def _send_requests(
    settings: OperatorSettings, site: OperatorSite, given: OperatorInput
) -> tuple[OperatorSite, list[Message]]:
    """Return the state with new requests, and what is to be sent: a stop at every step, requests in turn."""
    requests, number = list(site.requests), site.request_number
    for action in given.actions:
        number += 1
        requests.append(Request(number, action, settings.budget, settings.jitter, given.envelope))
    site = replace(
        site,
        requests=tuple(requests),
        request_number=number,
        stop_number=site.stop_number + given.is_stopping,
    )
    outgoing: list[Message] = []
    if site.stop_number and (site.report is None or site.report.stop < site.stop_number):
        outgoing.append(Stop(site.stop_number))
    if requests and (given.actions or site.steps - site.request_step >= settings.repeat_steps):
        outgoing += requests
        site = replace(site, request_step=site.steps)
    return site, outgoing


def _command(
    settings: OperatorSettings, site: OperatorSite, given: OperatorInput
) -> tuple[OperatorSite, CommandMessage]:
    hand = given.hand
    before = hand if site.hand is None else site.hand
    twist = np.append(hand[:3] - before[:3], rotation_vector_in_world(before[3:], hand[3:]))
    report = site.report
    command = CommandMessage(
        number=site.steps,
        report=report.number if report else 0,
        lease=report.lease if report else 0,
        valid=min(settings.budget + settings.jitter, MAX_VALID),
        pose=tuple(hand.tolist()),
        twist=tuple((twist / settings.command_period).tolist()),
        grip=float(given.grip),
        is_clutch_closed=given.is_clutch_closed,
        is_dead_man_pressed=given.is_dead_man_pressed,
        mode=given.mode,
        skill=given.skill,
    )
    return site, command


def _skill_messages(settings: OperatorSettings, site: OperatorSite) -> list[Message]:
    """Return the mission until the robot has it, then one missing piece at a time."""
    report, mission = site.report, site.mission
    if report is None or report.holder != settings.number or not mission.skills:
        return []
    if report.mission != mission.number:
        return [mission] if site.steps % MISSION_STEPS == 0 else []
    if site.steps % settings.piece_steps:
        return []
    turn = site.steps // settings.piece_steps
    for name, pieces in zip(mission.skills, site.pieces, strict=True):
        status = site.statuses.get(name)
        if status is None or status.state in (SkillState.MISSING, SkillState.PARTIAL):
            missing = missing_pieces(status, len(pieces)) if status else tuple(range(len(pieces)))
            if missing:
                return [pieces[missing[turn % len(missing)]]]
    return []


def _predict(settings: OperatorSettings, site: OperatorSite, given: OperatorInput) -> Prediction:
    """Return the predicted robot after this step; it stands at the reported target while the robot rests."""
    prediction, report = site.prediction, site.report
    if report is None:
        return prediction
    prediction = _update_frames(prediction, report)
    assistant, frames = prediction.assistant, prediction.frames
    scalars = [report.grip] * (assistant.layout.width - 7)
    index = min(given.skill + 1, len(assistant.skills) - 1)
    if report.state not in MOVING or frames is None or not settings.is_predicting:
        pose = np.array([*report.target, *scalars])
        return replace(prediction, state=None, pose=pose, authority=0.0)
    try:
        state = prediction.state or initial_state(assistant, prediction.pose, frames, frames, skill=index)
    except SkillError:
        return replace(prediction, state=None, pose=np.array([*report.target, *scalars]))
    hand = np.append(given.hand, [given.grip] * len(scalars))
    command = Command(hand, given.mode, given.is_clutch_closed, index)
    state, target = step_assistance(assistant, state, command, frames, frames, settings.command_period)
    return replace(prediction, state=state, pose=target.pose, authority=target.authority)


def _update_frames(prediction: Prediction, report: Report) -> Prediction:
    """Return the prediction with the frames of a report; they are the same objects while they rest."""
    names = {
        frame_number(name): name for skill in prediction.assistant.skills for name in skill.skill.frame_names
    }
    poses = {
        names[each.name]: Pose(np.array(each.pose[:3]), np.array(each.pose[3:]))
        for each in report.frames
        if each.name in names
    }
    same = poses.keys() == prediction.poses.keys() and all(
        (poses[n].position == prediction.poses[n].position).all()
        and (poses[n].quaternion == prediction.poses[n].quaternion).all()
        for n in poses
    )
    if same:
        return prediction
    frames = make_frames(prediction.assistant, poses) if poses else None
    return replace(prediction, frames=frames, poses=poses)


def _view(site: OperatorSite, time_ns: int) -> OperatorView:
    report, prediction = site.report, site.prediction
    expected = report.number - site.first_report + 1 if report else 0
    statuses = [site.statuses.get(name) for name in site.mission.skills]
    return OperatorView(
        report=report,
        report_age=(time_ns - site.report_time) / SECOND if report else 0.0,
        round_trips=site.round_trips,
        lost_reports=expected - site.reports,
        frames=prediction.poses,
        predicted=prediction.pose[:7],
        predicted_authority=prediction.authority,
        skills=tuple(status.state if status else SkillState.MISSING for status in statuses),
        waiting=len(site.requests),
        command=site.steps,
        is_mission_known=report is not None
        and (not site.mission.skills or report.mission == site.mission.number),
    )
