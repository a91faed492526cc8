"""Faults R4 and R20 to R25: losses, recordings, skills, narrow links, floods and long runs, by seed.

An empty list means that the fault was survived. R4 is the only one in physics: an operator inserts a hot-stab
at a round trip of 1 s, and a burst loses 30 % of the datagrams in each direction.
"""

import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from assistance import load_demonstrations
from fault_rig import PERIOD, Pilot, Rig, decisions, replay, skill_bytes

import pilotfish as pf
from pilotfish import teleop
from pilotfish.assistance import calibrate_gate, direct_skill
from pilotfish.demonstrations import pose_layout
from pilotfish.environments import TASKS
from pilotfish.io import SessionWriter, encode_assisted_skill, read_session
from pilotfish.simulation import MissionSettings, run_mission, situation_from_seed
from pilotfish.teleop import Action, LinkSettings, Refusal, SessionState, SkillState

TRAINING = 6
FORWARD_RATE, BACKWARD_RATE = 256e3, 768e3  # bit/s, of the satellite link
PICTURE, PICTURES = 1400, 10  # bytes of a datagram of a picture, and how many there are in a second
FLUSH_NS, SECOND = 500_000_000, 1_000_000_000


@cache
def stab_skill() -> bytes:
    """Return the skill of the hot-stab, learned at defaults, with its gate."""
    demonstrations = list(load_demonstrations("stab", 0)[:TRAINING])

    def learn(some: list) -> pf.Skill:  # type: ignore[type-arg]
        return pf.learn(some, rng=np.random.default_rng(0)).skill

    return encode_assisted_skill(learn(demonstrations), gate=calibrate_gate(demonstrations, learn))


def stab_with_losses(seed: int) -> list[str]:
    """R4: 30 % of the datagrams are lost in bursts of five, at a round trip of 1 s, in shared control."""
    task = TASKS["stab"]
    link = LinkSettings(delay=0.5, loss=0.3, mean_burst=5.0)
    result = run_mission(
        stab_skill(),
        task,
        situation_from_seed(task, "test", 0, seed),
        np.random.default_rng([seed, 1]),
        MissionSettings("shared", link, link, jitter=0.5, piece_steps=1),
    )
    return [] if result.outcome.success else [result.outcome.reason]


def interrupted_recording(seed: int) -> list[str]:
    """R20: the recorder is interrupted at a random byte of the file, in the middle of a session."""
    rng = np.random.default_rng(seed)
    broken: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "session.mcap"
        times = np.cumsum(rng.integers(1_000_000, 40_000_000, size=1500)).tolist()
        data = [rng.bytes(int(n)) for n in rng.integers(10, 400, size=len(times))]
        sizes = []
        with SessionWriter(path, flush_every_ns=FLUSH_NS) as writer:
            writer.describe({"task": "stab"})
            for time, each in zip(times, data, strict=True):
                writer.write("robot", time, each)
                sizes.append(_size(path))
        whole = path.read_bytes()
        cut = int(rng.integers(len(whole) // 4, len(whole)))
        path.write_bytes(whole[:cut])
        records = list(read_session(path).records())
    written = [time for time, size in zip(times, sizes, strict=True) if size <= cut]
    expected = list(zip(times, data, strict=True))[: len(records)]
    if [(each.time_ns, each.data) for each in records] != expected:
        broken.append("records differ")
    recovered = records[-1].time_ns if records else 0
    if written and written[-1] - recovered > SECOND:
        broken.append(f"{(written[-1] - recovered) / SECOND:.2f} s are lost")
    return broken


def _size(path: Path) -> int:
    """Return the size of a recording, which has another name while it is open."""
    part = path.with_name(path.name + ".part")
    return part.stat().st_size if part.exists() else path.stat().st_size


def missing_skill(seed: int) -> list[str]:
    """R21: the skill of the mission never arrives."""
    return _without_skill(seed, "missing", Refusal.SKILL_MISSING, SkillState.MISSING)


def half_skill(seed: int) -> list[str]:
    """R21: some pieces of the skill never arrive."""
    return _without_skill(seed, "half", Refusal.SKILL_MISSING, SkillState.PARTIAL)


def wrong_hash(seed: int) -> list[str]:
    """R21: the pieces have another content than the name says."""
    return _without_skill(seed, "hash", Refusal.SKILL_UNUSABLE, SkillState.WRONG_HASH)


def other_version(seed: int) -> list[str]:
    """R21: the skill is of another version, or damaged before it was named."""
    return _without_skill(seed, "version", Refusal.SKILL_UNUSABLE, SkillState.UNREADABLE)


def other_columns(seed: int) -> list[str]:
    """R21: the skill has other columns than the robot."""
    return _without_skill(seed, "columns", Refusal.SKILL_UNUSABLE, SkillState.UNSUITABLE)


def _without_skill(seed: int, kind: str, refusal: Refusal, state: SkillState) -> list[str]:
    rng = np.random.default_rng(seed)
    pilot = Pilot(str(rng.choice(["shared", "autonomous", "fixture"])), is_arming=False)
    link = LinkSettings(delay=float(rng.uniform(0.0, 0.3)))
    rig = Rig(rng, [pilot], forward=link, backward=link, budget=0.8)
    _spoil(rig, kind, rng)
    pilot.actions = (Action.ACQUIRE,)
    rig.run(6.0)
    stood = rig.pose.copy()
    pilot.actions = (Action.ARM,)
    rig.run(2.0)
    report, statuses = rig.views[1].report, rig.views[1].skills
    assert report is not None
    rig.require(report.request_refusal is refusal, f"refused with {report.request_refusal.name}")
    rig.require(statuses[0] is state, f"the skill is {statuses[0].name}")
    rig.require((rig.pose == stood).all().item() and rig.control is SessionState.DISARMED, "the robot moved")
    pilot.mode, pilot.is_arming = "direct", True
    rig.run_until_active()
    rig.run(1.0)
    pilot.mode = "shared"
    rig.run(2.0)
    assisted = [row for row in rig.rows if row.mode != "direct"]
    rig.require(not assisted, "moved in an assisted mode")
    refused = rig.views[1].report
    rig.require(refused is not None and refused.refusal is refusal, "the mode was not refused by name")
    return rig.broken


def _spoil(rig: Rig, kind: str, rng: np.random.Generator) -> None:
    """Spoil the skill that the operator sends."""
    operator = rig.session.operators[1]
    site, data = operator.site, skill_bytes()
    if kind == "missing":
        nameless = tuple(replace(each, hash=bytes(32)) for each in site.pieces[0])
        operator.site = replace(site, pieces=(nameless,))
    elif kind == "half":
        kept = rng.permutation(len(site.pieces[0]))[: len(site.pieces[0]) // 2]
        operator.site = replace(site, pieces=(tuple(site.pieces[0][int(n)] for n in kept),))
    elif kind == "hash":
        n = int(rng.integers(len(site.pieces[0])))
        spoilt = bytearray(site.pieces[0][n].data)
        spoilt[int(rng.integers(len(spoilt)))] ^= 1
        pieces = [replace(each, data=bytes(spoilt)) if each.index == n else each for each in site.pieces[0]]
        operator.site = replace(site, pieces=(tuple(pieces),))
    else:
        if kind == "version":
            other = data.replace(b'"version":1', b'"version":2', 1)
        else:
            grip = pf.demonstrations.Part("grip", pf.demonstrations.Quantity.SCALAR, 1, "1")
            layout = pf.demonstrations.Layout((*pose_layout().parts, grip))
            other = encode_assisted_skill(direct_skill(layout).skill)
        name = teleop.skill_hash(other)
        operator.site = replace(site, pieces=(teleop.split_skill(other),), mission=teleop.Mission(1, (name,)))


def replayed_session(seed: int) -> list[str]:
    """R22: a session with losses, jitter and an outage is given again to a robot's site that starts again."""
    rng = np.random.default_rng(seed)
    link = LinkSettings(
        delay=float(rng.uniform(0.0, 0.5)), jitter=0.1, loss=0.1, mean_burst=3.0, outages=((9.0, 2.0),)
    )
    pilot = Pilot(str(rng.choice(["direct", "shared", "shared", "autonomous"])))
    rig = Rig(rng, [pilot], forward=link, backward=link, budget=1.5)
    rig.run(15.0)
    again = [target[: 7 * 8] for target in replay(rig, rig.inputs)]
    rig.require(again == [row.pose.tobytes() for row in rig.rows], "the commands differ")
    return rig.broken


def narrow_link(seed: int) -> list[str]:
    """R23: 256 and 768 kbit/s with pictures: share of the commands, and priority of a stop."""
    rng = np.random.default_rng(seed)
    delay = float(rng.uniform(0.0, 0.6))
    forward = LinkSettings(delay=delay, rate=FORWARD_RATE, queue=32_000)
    backward = LinkSettings(delay=delay, rate=BACKWARD_RATE, queue=32_000)
    pilot = Pilot("shared")
    rig = Rig(rng, [pilot], forward=forward, backward=backward, budget=2.0 * delay + 0.25)
    rig.run_until_active()
    operator = rig.session.operators[1]
    counters, sizes = operator.forward.counters, 0
    for _ in range(250):
        rig.step()
        sizes += sum(len(each) + forward.header for each in operator.datagrams)
    share = 8.0 * sizes / 5.0 / FORWARD_RATE
    rig.require(share <= 0.25, f"commands take {100.0 * share:.1f} % of the link")
    rig.require(operator.forward.counters.dropped == counters.dropped, "commands were dropped")
    for _ in range(round(5.0 / PERIOD)):  # more pictures than either link can carry
        for _ in range(2):
            operator.forward.send(rig.time_ns, bytes(PICTURE), 7)
            operator.backward.send(rig.time_ns, bytes(PICTURE), 7)
        rig.step()
    rig.require(rig.control is SessionState.ACTIVE, "pictures displaced commands")
    pilot.is_stopping = True
    rig.step()
    sent = rig.time - PERIOD
    while rig.control is not SessionState.STOPPED and rig.time < sent + 5.0:
        rig.step()
    largest = 8.0 * (PICTURE + 2 * 200) / FORWARD_RATE  # a picture in transmission, and the stop
    rig.require(rig.time - PERIOD - sent <= delay + largest + 2.0 * PERIOD, "the stop waited for pictures")
    return rig.broken


def flood(seed: int) -> list[str]:
    """R24: 600 datagrams in every step, copies and noise: the decisions are those without them."""
    results = []
    for is_flooded in (False, True):
        rng, noise = np.random.default_rng(seed), np.random.default_rng([seed, 1])
        rig = Rig(rng, [Pilot("shared")], forward=LinkSettings(delay=0.1), backward=LinkSettings(delay=0.1))
        rig.run_until_active()
        garbage = [noise.bytes(int(n)) for n in noise.integers(0, 300, size=300)]
        sent: list[bytes] = []
        for _ in range(50):
            copies = (sent[:-40] * 40)[:300]  # of datagrams that have arrived
            rig.step((*garbage, *copies) if is_flooded else ())
            sent += rig.session.operators[1].datagrams
        results.append((decisions(rig), rig.broken, len(rig.session.endpoint.audit.last)))
    (plain, broken, _), (flooded, others, remembered) = results
    statements = [*broken, *others]
    if plain != flooded:
        statements.append("the flood changed the motion")
    if remembered > 16:
        statements.append(f"{remembered} causes are remembered")
    return statements


def soak(seed: int) -> list[str]:
    """R25: 20 s with loss and jitter: memory and unexplained transitions; see also `--soak`."""
    rng = np.random.default_rng(seed)
    link = LinkSettings(delay=0.25, jitter=0.05, loss=0.02)
    rig = Rig(rng, [Pilot("shared")], forward=link, backward=link, budget=0.8)
    rig.run_until_active()
    before = len(rig.rows)
    rig.run(20.0)
    others = [row for row in rig.rows[before:] if row.state is not SessionState.ACTIVE]
    rig.require(not others, f"{len(others)} steps outside ACTIVE")
    return rig.broken


SCENARIOS = {
    "R4": stab_with_losses,
    "R20": interrupted_recording,
    "R21, missing": missing_skill,
    "R21, half arrived": half_skill,
    "R21, wrong hash": wrong_hash,
    "R21, other version": other_version,
    "R21, other columns": other_columns,
    "R22": replayed_session,
    "R23": narrow_link,
    "R24": flood,
    "R25": soak,
}
