"""Valid arguments of the public functions of teleop."""

import numpy as np
from teleop_endpoints import KEYS, PEERS, connect, new_operator, new_robot
from teleop_messages import EXAMPLES

from fuzzing.examples_of_values import Examples
from pilotfish.teleop import (
    Braking,
    Event,
    Kind,
    OperatorInput,
    OperatorSettings,
    OutgoingMessage,
    Reason,
    ReceivedMessage,
    RobotSettings,
    RobotState,
    RobotTarget,
    SessionState,
    SkillStore,
    Stop,
    encode_robot_settings,
    encode_start,
    expect_skills,
    send_from_operator,
    send_from_robot,
    split_skill,
    start_operator,
    start_robot,
    start_view,
    start_watchdog,
    step_robot,
)
from pilotfish.teleop.codec import encode


def teleop_examples() -> Examples:
    robot, operator = connect(new_robot(), new_operator())
    _, to_robot = send_from_operator(operator, [EXAMPLES[Kind.COMMAND]])
    _, ((_, to_operator),) = send_from_robot(robot, [OutgoingMessage(1, EXAMPLES[Kind.REPORT])])
    (piece,) = split_skill(b"skill")
    store = expect_skills(SkillStore(), [piece.hash])
    settings = RobotSettings(bytes.decode)  # type: ignore[arg-type]
    state = RobotState(np.array([0.6, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0]), np.zeros(6), 0.0, {})
    step = step_robot(settings, start_robot(settings, 0, state), 0, (), state)
    sensed = RobotState(np.array([0.6, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0]), np.zeros(6), 0.0, {})
    rest = RobotTarget(sensed.pose, np.zeros(6), 0.0)
    own, received = OperatorSettings(bytes.decode), (ReceivedMessage(1, Stop(1)),)  # type: ignore[arg-type]
    return {
        "start_robot": {"settings": settings, "time_ns": 0, "robot": sensed},
        "step_robot": {
            "settings": settings,
            "site": start_robot(settings, 0, sensed),
            "time_ns": 20_000_000,
            "received": received,
            "robot": sensed,
        },
        "start_operator": {"settings": own},
        "step_operator": {
            "settings": own,
            "site": start_operator(own),
            "time_ns": 20_000_000,
            "received": (ReceivedMessage(0, EXAMPLES[Kind.REPORT]),),
            "given": OperatorInput(sensed.pose),
        },
        "next_action": {"view": start_view(), "number": 1, "needs_skill": True},
        "describe_link_drop": {"report": EXAMPLES[Kind.REPORT]},
        "next_state": {"state": SessionState.HOLD, "reason": Reason.LINK_LOST, "event": Event.ARM},
        "start_watchdog": {"target": rest, "time_ns": 0},
        "watch_target": {
            "before": start_watchdog(rest, 0),
            "time_ns": 20_000_000,
            "target": rest,
            "braking": Braking(),
            "max_silence": 60_000_000,
        },
        "encode_robot_settings": {"settings": settings},
        "decode_robot_settings": {"text": encode_robot_settings(settings), "decode_skill": bytes.decode},
        "encode_start": {"robot": state},
        "encode_step": {"received": (), "robot": state, "step": step},
        "replay_records": {"settings": settings, "records": [("robot/start", 0, encode_start(state)[1])]},
        "encode": {"message": EXAMPLES[Kind.COMMAND]},
        "decode": {"kind": 3, "payload": encode(EXAMPLES[Kind.COMMAND])},
        "priority": {"kind": 3},
        "robot_endpoint": {"peers": PEERS, "boot": 7, "max_budget": 3.0, "max_jitter": 0.5},
        "operator_endpoint": {"number": 1, "key": KEYS[1], "seed": bytes(32)},
        "receive_at_robot": {"endpoint": robot, "datagrams": to_robot},
        "receive_at_operator": {"endpoint": operator, "datagrams": (to_operator,)},
        "send_from_robot": {"endpoint": robot, "outgoing": (OutgoingMessage(1, EXAMPLES[Kind.REPORT]),)},
        "send_from_operator": {"endpoint": operator, "messages": (EXAMPLES[Kind.COMMAND],)},
        "skill_hash": {"data": b"skill"},
        "split_skill": {"data": b"skill"},
        "missing_pieces": {"status": store.status(piece.hash), "n": 1},
        "expect_skills": {"store": store, "hashes": [piece.hash]},
        "add_piece": {"store": store, "piece": piece, "decode_skill": bytes.decode},
    }
