"""Valid messages of the teleoperation protocol, fixed and drawn at random."""

from random import Random

import numpy as np
from hypothesis import strategies as st

from pilotfish.teleop.codec import Kind
from pilotfish.teleop.messages import (
    MAX_FRAMES,
    MAX_MISSION,
    MODES,
    PIECE_SIZE,
    CommandMessage,
    Envelope,
    Hello,
    Message,
    Mission,
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
from pilotfish.teleop.session import Action, Reason, SessionState

U32 = st.integers(0, 2**32 - 1)
NUMBERS = st.floats(width=32, allow_nan=False, allow_infinity=False)
TIMES = st.floats(0.0, width=32, allow_nan=False, allow_infinity=False)
SHARES = st.floats(0.0, 1.0, width=32)
HASHES = st.binary(min_size=32, max_size=32)
MODE = st.sampled_from(MODES)


def numbers(length: int) -> st.SearchStrategy[tuple[float, ...]]:
    return st.tuples(*[NUMBERS] * length)


@st.composite
def poses(draw: st.DrawFn) -> tuple[float, ...]:
    """Draw a pose with a unit quaternion in double precision."""
    q = np.array(draw(st.tuples(*[st.floats(-1.0, 1.0)] * 4)))
    norm = np.linalg.norm(q)
    unit = q / norm if norm > 1e-3 else np.array([1.0, 0.0, 0.0, 0.0])
    return (*draw(numbers(3)), *map(float, unit))


@st.composite
def envelopes(draw: st.DrawFn) -> Envelope:
    lower = draw(st.tuples(*[st.floats(-100.0, 100.0, width=32)] * 3))
    upper = tuple(float(np.float32(low + draw(st.floats(0.125, 50.0, width=32)))) for low in lower)
    modes = draw(st.sets(MODE))
    return Envelope(draw(TIMES), lower, upper, draw(TIMES), tuple(mode for mode in MODES if mode in modes))


@st.composite
def pieces(draw: st.DrawFn) -> SkillPiece:
    size = draw(st.integers(1, 5 * PIECE_SIZE))
    index = draw(st.integers(0, (size - 1) // PIECE_SIZE))
    length = min(PIECE_SIZE, size - index * PIECE_SIZE)
    return SkillPiece(draw(HASHES), size, index, draw(st.binary(min_size=length, max_size=length)))


FRAMES = st.lists(st.builds(ReportedFrame, U32, poses()), max_size=MAX_FRAMES).map(tuple)
SKILL_INDICES = st.integers(0, MAX_MISSION - 1)
REPORTS = st.builds(
    Report,
    **dict.fromkeys(("number", "lease", "request", "stop", "mission", "command", "stale"), U32),
    **{name: st.booleans() for name in Report.__annotations__ if name.startswith("is_")},
    **dict.fromkeys(("command_age", "loop_age", "budget", "jitter", "envelope_left"), TIMES),
    **dict.fromkeys(("grip", "authority", "probability"), SHARES),
    **{name: poses() for name in ("pose", "target")},
    state=st.sampled_from(SessionState),
    reason=st.sampled_from(Reason),
    mode=MODE,
    refusal=st.sampled_from(Refusal),
    request_refusal=st.sampled_from(Refusal),
    skill=SKILL_INDICES,
    holder=st.integers(0, 2**16 - 1),
    twist=numbers(6),
    covariance=numbers(21),
    misalignment=st.tuples(TIMES, TIMES),
    skill_state=st.integers(0, 2**16 - 1),
    frames=FRAMES,
)
MESSAGES: dict[Kind, st.SearchStrategy[Message]] = {
    Kind.HELLO: st.just(Hello()),
    Kind.WELCOME: st.builds(Welcome, st.integers(0, 2**64 - 1), U32, TIMES, TIMES),
    Kind.COMMAND: st.builds(
        CommandMessage,
        U32,
        U32,
        U32,
        st.integers(0, 65535).map(lambda milliseconds: milliseconds / 1000),
        poses(),
        numbers(6),
        SHARES,
        st.booleans(),
        st.booleans(),
        MODE,
        SKILL_INDICES,
    ),
    Kind.REQUEST: st.builds(Request, U32, st.sampled_from(Action), TIMES, TIMES, envelopes()),
    Kind.STOP: st.builds(Stop, U32),
    Kind.MISSION: st.builds(Mission, U32, st.lists(HASHES, max_size=MAX_MISSION).map(tuple)),
    Kind.SKILL_PIECE: pieces(),
    Kind.SKILL_STATUS: st.builds(
        SkillStatus, HASHES, st.sampled_from(SkillState), st.integers(0, 2**1024 - 1)
    ),
    Kind.REPORT: REPORTS,
}

POSE = (0.4, -0.1, 0.3, 0.5, -0.5, 0.5, 0.5)
FRAME = ReportedFrame(0xCBF43926, POSE)
EXAMPLES: dict[Kind, Message] = {
    Kind.HELLO: Hello(),
    Kind.WELCOME: Welcome(2**63 + 5, 3, 3.0, 0.5),
    Kind.COMMAND: CommandMessage(7, 5, 2, 1.25, POSE, (0.125,) * 6, 0.5, True, False, "shared", 1),
    Kind.REQUEST: Request(
        4, Action.AUTHORISE, 2.0, 0.25, Envelope(20.0, (-1.0,) * 3, (1.0,) * 3, 4.0, ("shared", "autonomous"))
    ),
    Kind.STOP: Stop(9),
    Kind.MISSION: Mission(2, (bytes(range(32)), b"\xff" * 32)),
    Kind.SKILL_PIECE: SkillPiece(bytes(32), 1000, 1, b"x" * 40),
    Kind.SKILL_STATUS: SkillStatus(bytes(32), SkillState.PARTIAL, 1 << 1023 | 1),
    Kind.REPORT: Report(
        **{name: n for n, name in enumerate(("number", "lease", "request", "stop", "mission", "command"), 1)},
        **{name: name == "is_authorised" for name in Report.__annotations__ if name.startswith("is_")},
        **dict.fromkeys(("command_age", "loop_age", "budget", "jitter", "envelope_left"), 0.5),
        **dict.fromkeys(("grip", "authority", "probability"), 0.25),
        state=SessionState.HOLD,
        reason=Reason.LINK_LOST,
        mode="fixture",
        refusal=Refusal.BUDGET,
        request_refusal=Refusal.NONE,
        skill=2,
        holder=1,
        stale=3,
        pose=POSE,
        twist=(0.5,) * 6,
        target=POSE,
        covariance=(0.125,) * 21,
        misalignment=(0.5, 0.25),
        skill_state=2,
        frames=(FRAME, FRAME),
    ),
}


def mutate(data: bytes, rng: Random) -> bytes:
    """Return bytes of the same length after one to five edits."""
    edited = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5))):
        if not edited:
            break
        start = rng.randrange(len(edited))
        what = rng.randrange(4)
        if what == 0:
            edited[start] ^= 1 << rng.randrange(8)
        elif what == 1:
            edited[start] = rng.randrange(256)
        elif what == 2:
            special = rng.choice(("0000807f", "000080ff", "0000c07f", "ffffffff", "00000080", "01000000"))
            edited[start : start + 4] = bytes.fromhex(special)[: len(edited) - start]
        else:
            length = rng.randrange(1, 9)
            edited[start : start + length] = rng.randbytes(min(length, len(edited) - start))
    return bytes(edited)
