"""Operator and robot at two sites: messages, session, and one step of each site as a pure function.

`step_robot` and `step_operator` are the two sites: (state, time, messages) -> (state, messages, action). They
have no sockets, clocks or files. `encode` and `decode` give the bytes of messages, and endpoints seal them.
`VirtualSession` connects both sites by virtual links on a virtual clock.
"""

from pilotfish.teleop.channels import (
    OperatorEndpoint,
    Peer,
    RobotEndpoint,
    operator_endpoint,
    robot_endpoint,
)
from pilotfish.teleop.codec import Kind, decode, encode, priority
from pilotfish.teleop.controlled_stop import Braking
from pilotfish.teleop.delay_contract import ContractLimits
from pilotfish.teleop.endpoints import (
    receive_at_operator,
    receive_at_robot,
    send_from_operator,
    send_from_robot,
)
from pilotfish.teleop.errors import MalformedMessage
from pilotfish.teleop.messages import (
    MODES,
    NO_ENVELOPE,
    ROBOT,
    CommandMessage,
    Envelope,
    Heard,
    Mission,
    Refusal,
    Report,
    Request,
    Said,
    SkillPiece,
    SkillState,
    SkillStatus,
    Stop,
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
from pilotfish.teleop.virtual_clock import VirtualClock
from pilotfish.teleop.virtual_link import LinkCounters, LinkSettings, VirtualLink, two_way_link
from pilotfish.teleop.virtual_session import OperatorConnection, VirtualSession
from pilotfish.teleop.watchdog import WatchedTarget, start_watchdog, watch_target

__all__ = [
    "CLEARING_ACTIONS",
    "MODES",
    "NO_ENVELOPE",
    "ROBOT",
    "TRANSITIONS",
    "Action",
    "Alignment",
    "Braking",
    "CommandMessage",
    "ContractLimits",
    "Envelope",
    "Event",
    "Header",
    "Heard",
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
    "Peer",
    "Reason",
    "Refusal",
    "Report",
    "Request",
    "RobotEndpoint",
    "RobotSettings",
    "RobotSite",
    "RobotState",
    "RobotStep",
    "RobotTarget",
    "Said",
    "SessionState",
    "SkillPiece",
    "SkillState",
    "SkillStatus",
    "Stop",
    "VirtualClock",
    "VirtualLink",
    "VirtualSession",
    "WatchedTarget",
    "decode",
    "describe_link_drop",
    "encode",
    "next_action",
    "next_state",
    "operator_endpoint",
    "priority",
    "receive_at_operator",
    "receive_at_robot",
    "robot_endpoint",
    "seal_datagram",
    "send_from_operator",
    "send_from_robot",
    "start_operator",
    "start_robot",
    "start_view",
    "start_watchdog",
    "step_operator",
    "step_robot",
    "two_way_link",
    "watch_target",
]
