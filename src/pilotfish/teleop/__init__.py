"""Operator and robot at two sites: messages, session, and one step of each site as a pure function.

The package has no sockets, clocks or files. `messages` are values; `codec` and `seal` turn them into
datagrams. `step_robot` and `step_operator` are the two sites.
"""

from pilotfish.teleop.channels import (
    OperatorEndpoint,
    Peer,
    RobotEndpoint,
    operator_endpoint,
    robot_endpoint,
)
from pilotfish.teleop.codec import Kind, decode, encode, priority
from pilotfish.teleop.datagram_checks import Audit, Cause
from pilotfish.teleop.endpoints import (
    receive_at_operator,
    receive_at_robot,
    send_from_operator,
    send_from_robot,
)
from pilotfish.teleop.errors import MalformedMessage, SequenceExhausted, Unauthentic, UnsuitableSkill
from pilotfish.teleop.messages import (
    CommandMessage,
    Envelope,
    Heard,
    Hello,
    Mission,
    Refusal,
    Report,
    ReportedFrame,
    Request,
    Said,
    SkillPiece,
    SkillState,
    SkillStatus,
    Stop,
    Welcome,
)
from pilotfish.teleop.session import Action, Reason, SessionState
from pilotfish.teleop.skill_transfer import (
    SkillStore,
    add_piece,
    expect_skills,
    missing_pieces,
    skill_hash,
    split_skill,
)

__all__ = [
    "Action",
    "Audit",
    "Cause",
    "CommandMessage",
    "Envelope",
    "Heard",
    "Hello",
    "Kind",
    "MalformedMessage",
    "Mission",
    "OperatorEndpoint",
    "Peer",
    "Reason",
    "Refusal",
    "Report",
    "ReportedFrame",
    "Request",
    "RobotEndpoint",
    "Said",
    "SequenceExhausted",
    "SessionState",
    "SkillPiece",
    "SkillState",
    "SkillStatus",
    "SkillStore",
    "Stop",
    "Unauthentic",
    "UnsuitableSkill",
    "Welcome",
    "add_piece",
    "decode",
    "encode",
    "expect_skills",
    "missing_pieces",
    "operator_endpoint",
    "priority",
    "receive_at_operator",
    "receive_at_robot",
    "robot_endpoint",
    "send_from_operator",
    "send_from_robot",
    "skill_hash",
    "split_skill",
]
