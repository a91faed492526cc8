"""Operator and robot at two sites: messages, session, and one step of each site as a pure function.

`step_robot` and `step_operator` are the two sites: (state, time, messages) -> (state, messages, action). They
have no sockets, clocks or files. `encode` and `decode` give the bytes of messages, and endpoints seal them.
`VirtualSession` connects both sites by virtual links on a virtual clock.
"""

from pilotfish.teleop.channels import OperatorEndpoint, Peer, RobotEndpoint, operator_endpoint, robot_endpoint
from pilotfish.teleop.codec import Kind, decode, encode, priority
from pilotfish.teleop.controlled_stop import Braking
from pilotfish.teleop.datagram_checks import Audit, Cause
from pilotfish.teleop.delay_contract import ContractLimits
from pilotfish.teleop.endpoints import (
    receive_at_operator,
    receive_at_robot,
    send_from_operator,
    send_from_robot,
)
from pilotfish.teleop.errors import MalformedMessage, SequenceExhausted, Unauthentic, UnsuitableSkill
from pilotfish.teleop.messages import (
    MODES,
    NO_ENVELOPE,
    ROBOT,
    CommandMessage,
    Envelope,
    Hello,
    Mission,
    OutgoingMessage,
    ReceivedMessage,
    Refusal,
    Report,
    ReportedFrame,
    Request,
    SkillPiece,
    SkillState,
    SkillStatus,
    Stop,
    Welcome,
)
from pilotfish.teleop.operator_site import OperatorSite, start_operator, step_operator
from pilotfish.teleop.operator_values import (
    OperatorInput,
    OperatorSettings,
    OperatorView,
    describe_link_drop,
    next_action,
    start_view,
)
from pilotfish.teleop.replay import Difference, Replay, replay_records
from pilotfish.teleop.robot_settings_record import decode_robot_settings, encode_robot_settings
from pilotfish.teleop.robot_site import RobotSite, start_robot
from pilotfish.teleop.robot_step import RobotStep, step_robot
from pilotfish.teleop.robot_values import Alignment, RobotSettings, RobotState, RobotTarget
from pilotfish.teleop.seal import Header, seal_datagram
from pilotfish.teleop.session import (
    CLEARING_ACTIONS,
    TRANSITIONS,
    Action,
    Event,
    Reason,
    SessionState,
    next_state,
)
from pilotfish.teleop.session_record import RECORD_VERSIONS, RobotRecorder, encode_start, encode_step
from pilotfish.teleop.skill_transfer import (
    SkillStore,
    add_piece,
    expect_skills,
    missing_pieces,
    skill_hash,
    split_skill,
)
from pilotfish.teleop.virtual_clock import VirtualClock
from pilotfish.teleop.virtual_link import LinkCounters, LinkSettings, VirtualLink, two_way_link
from pilotfish.teleop.virtual_session import OperatorConnection, VirtualSession
from pilotfish.teleop.watchdog import WatchedTarget, start_watchdog, watch_target

__all__ = [
    "CLEARING_ACTIONS",
    "MODES",
    "NO_ENVELOPE",
    "RECORD_VERSIONS",
    "ROBOT",
    "TRANSITIONS",
    "Action",
    "Alignment",
    "Audit",
    "Braking",
    "Cause",
    "CommandMessage",
    "ContractLimits",
    "Difference",
    "Envelope",
    "Event",
    "Header",
    "Hello",
    "Kind",
    "LinkCounters",
    "LinkSettings",
    "MalformedMessage",
    "Mission",
    "OperatorConnection",
    "OperatorEndpoint",
    "OperatorInput",
    "OperatorSettings",
    "OperatorSite",
    "OperatorView",
    "OutgoingMessage",
    "Peer",
    "Reason",
    "ReceivedMessage",
    "Refusal",
    "Replay",
    "Report",
    "ReportedFrame",
    "Request",
    "RobotEndpoint",
    "RobotRecorder",
    "RobotSettings",
    "RobotSite",
    "RobotState",
    "RobotStep",
    "RobotTarget",
    "SequenceExhausted",
    "SessionState",
    "SkillPiece",
    "SkillState",
    "SkillStatus",
    "SkillStore",
    "Stop",
    "Unauthentic",
    "UnsuitableSkill",
    "VirtualClock",
    "VirtualLink",
    "VirtualSession",
    "WatchedTarget",
    "Welcome",
    "add_piece",
    "decode",
    "decode_robot_settings",
    "describe_link_drop",
    "encode",
    "encode_robot_settings",
    "encode_start",
    "encode_step",
    "expect_skills",
    "missing_pieces",
    "next_action",
    "next_state",
    "operator_endpoint",
    "priority",
    "receive_at_operator",
    "receive_at_robot",
    "replay_records",
    "robot_endpoint",
    "seal_datagram",
    "send_from_operator",
    "send_from_robot",
    "skill_hash",
    "split_skill",
    "start_operator",
    "start_robot",
    "start_view",
    "start_watchdog",
    "step_operator",
    "step_robot",
    "two_way_link",
    "watch_target",
]
