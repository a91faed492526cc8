"""Faults R1 to R8 and R19 of the link, each as a function of a seed that returns what did not hold.

An empty list means that the fault was survived. Parameters such as delays, modes and moments are random.
"""

import numpy as np
from fault_rig import (
    PERIOD,
    PERIOD_NS,
    ROUNDING,
    SECOND,
    Pilot,
    Rig,
    Row,
    decisions,
    path,
    replay,
    with_outage,
)

from pilotfish import teleop
from pilotfish.teleop import Action, LinkSettings, Reason, SessionState

FOLLOWING = ("direct",) * 4 + ("shared",) * 5 + ("fixture",)  # modes that follow the hand, and how often
START_TIME = 6.0  # s, by which a session without delay is active
WIDE = teleop.Envelope(60.0, (-5.0,) * 3, (5.0,) * 3, 1e3, teleop.MODES)
SETTLED = 0.5  # s for a stop from .25 m/s at 2 m/s^2, and more


def outage_of_both(seed: int) -> list[str]:
    """R1: 10 s without a link, in a mode that follows the operator."""
    return _outage(seed, forward=True, backward=True)


def outage_forward(seed: int) -> list[str]:
    """R19: 10 s in which commands do not arrive, but reports do."""
    return _outage(seed, forward=True, backward=False)


def outage_backward(seed: int) -> list[str]:
    """R19: 10 s in which reports do not arrive, but commands do."""
    return _outage(seed, forward=False, backward=True)


def _outage(seed: int, *, forward: bool, backward: bool) -> list[str]:
    rng = np.random.default_rng(seed)
    delay, jitter = rng.uniform(0.0, 0.5), rng.uniform(0.1, 0.5)
    start = START_TIME + 8.0 * delay + rng.uniform(1.0, 4.0)
    clear = LinkSettings(delay=delay)
    lossy = with_outage(clear, start, 10.0)
    rig = Rig(
        rng,
        [Pilot(str(rng.choice(FOLLOWING)))],
        forward=lossy if forward else clear,
        backward=lossy if backward else clear,
        budget=2.0 * delay + 0.1,
        jitter=jitter,
    )
    rig.run_until_active()
    rig.run(start + 10.0 + delay - rig.time)
    lost = next((row for row in rig.rows if row.state is SessionState.HOLD and row.time > start), None)
    if lost is None:
        return [*rig.broken, "the loss was not declared"]
    last = max(row.time for n, row in enumerate(rig.rows) if row.time < lost.time and _is_new(rig, n))
    rig.require(
        lost.time - last <= jitter + 3.0 * PERIOD + ROUNDING, f"declared after {lost.time - last:.3f} s"
    )
    if not forward:  # commands arrive, but the report that they name becomes too old
        rig.require(lost.time <= start + 2.0 * delay + 0.1 + 2.0 * jitter + 4.0 * PERIOD, "declared late")
    later = [row for row in rig.rows if lost.time + SETTLED < row.time < start + 10.0]
    rig.require(all(row.state is SessionState.HOLD for row in later), "not held through the outage")
    rig.require(all(row.reason is Reason.LINK_LOST for row in later), "another reason was latched")
    rig.require(_stands(later), "the robot moved in the outage")
    return rig.broken


def _is_new(rig: Rig, n: int) -> bool:
    return n > 0 and rig.rows[n].command > rig.rows[n - 1].command


def _stands(rows: list[Row]) -> bool:
    return all((row.pose == rows[0].pose).all() for row in rows)


def outage_autonomous(seed: int) -> list[str]:
    """R2: 30 s without a link under an envelope: to the end, or to an edge in time, space or likelihood."""
    rng = np.random.default_rng(seed)
    kind = ("plan", "time", "volume", "likelihood")[seed % 4]
    delay, start = rng.uniform(0.0, 0.5), START_TIME + 6.0
    mode = str(rng.choice(["autonomous", "shared", "direct"]))
    envelope = {
        "plan": WIDE,
        "time": teleop.Envelope(float(rng.uniform(0.3, 3.0)), WIDE.lower, WIDE.upper, 1e3, teleop.MODES),
        "volume": WIDE,
        "likelihood": teleop.Envelope(
            60.0, WIDE.lower, WIDE.upper, float(rng.uniform(0.01, 0.1)), teleop.MODES
        ),
    }[kind]
    link = with_outage(LinkSettings(delay=delay), start, 30.0)
    pilot = Pilot(mode, envelope=envelope)
    rig = Rig(rng, [pilot], forward=link, backward=link, budget=2.0 * delay + 0.1)
    if kind == "volume":
        middle = path(6)[len(path(6)) // 2, :3]
        half = rng.uniform(0.05, 0.12)
        pilot.envelope = teleop.Envelope(60.0, tuple(middle - half), tuple(middle + half), 1e3, teleop.MODES)
    rig.run_until_active()
    rig.run(start + 29.0 - rig.time)
    alone = [row for row in rig.rows if row.state is SessionState.CONTINUING]
    expected = {
        "plan": (Reason.PLAN_ENDED,),
        "time": (Reason.ENVELOPE_TIME_OVER, Reason.PLAN_ENDED),
        "volume": (Reason.ENVELOPE_VOLUME_LEFT, Reason.PLAN_ENDED),
        "likelihood": (Reason.ENVELOPE_LIKELIHOOD_LOW,),
    }[kind]
    rig.require(rig.rows[-1].reason in (*expected, Reason.LINK_LOST), f"held for {rig.rows[-1].reason.name}")
    if kind == "plan":
        rig.require(bool(alone) or mode == "autonomous", "the robot did not go on")
    if kind == "time" and alone:
        duration = alone[-1].time - alone[0].time
        rig.require(duration <= envelope.duration + PERIOD + ROUNDING, f"went on for {duration:.2f} s")
    if kind == "volume" and alone:
        inside = [row for row in rig.rows if row.time > alone[0].time]
        low, high = np.array(pilot.envelope.lower), np.array(pilot.envelope.upper)
        entered = (alone[0].pose[:3] >= low).all() and (alone[0].pose[:3] <= high).all()
        stays = all(
            (row.pose[:3] >= low - 1e-4).all() and (row.pose[:3] <= high + 1e-4).all() for row in inside
        )
        rig.require(stays or not entered, "the robot left the volume")
    rig.require(_stands(rig.rows[-25:]), "the robot does not stand at the end")
    return rig.broken


def link_returns(seed: int) -> list[str]:
    """R3: a link keeps commands back for 3 s, then delivers them; then the operator is not aligned."""
    rng = np.random.default_rng(seed)
    delay = rng.uniform(0.0, 0.5)
    link = LinkSettings(delay=delay)
    pilot = Pilot(str(rng.choice(FOLLOWING)))
    rig = Rig(rng, [pilot], forward=link, backward=link, budget=2.0 * delay + 0.1)
    rig.run_until_active()
    rig.run(rng.uniform(1.0, 4.0))
    held: list[bytes] = []
    forward, pilot.is_arming = rig.session.operators[1].forward, False
    for _ in range(150):
        held += forward.receive(rig.time_ns)
        rig.step()
    rig.require(rig.control is SessionState.HOLD, "not held while commands are kept back")
    stood, applied = rig.pose.copy(), rig.session.site.commands.number
    rig.step(held)
    rig.run(2.0)
    newer = rig.session.site.commands.number
    rig.require(bool(held) and newer >= applied, "no command was kept back")
    rig.require((rig.pose == stood).all() and rig.control is SessionState.HOLD, "moved before it was armed")
    pilot.offset = rng.normal(size=3)
    pilot.offset *= 0.2 / np.linalg.norm(pilot.offset)
    pilot.is_arming = True
    rig.run(2.0 + 4.0 * delay)
    rig.require((rig.pose == stood).all(), "moved before it was aligned")
    rig.require(rig.control is SessionState.ALIGNING, f"not aligning but {rig.control.name}")
    pilot.offset = np.zeros(3)
    rig.run_until_active()
    return rig.broken


def reordering_and_copies(seed: int) -> list[str]:
    """R5: a fifth of the datagrams late and copied: the motion is that of the stream without them."""
    rng = np.random.default_rng(seed)
    link = LinkSettings(
        delay=rng.uniform(0.0, 0.5), jitter=0.05, duplication=0.2, reordering=0.2, reordering_delay=0.1
    )
    rig = Rig(rng, [Pilot(str(rng.choice(FOLLOWING)))], forward=link, backward=link, budget=1.5)
    rig.run_until_active()
    rig.run(4.0)
    newest, cleaned = 0, []
    for time, received, robot in rig.inputs:
        kept = []
        for each in received:
            if isinstance(each.message, teleop.CommandMessage):
                if each.message.number <= newest:
                    continue
                newest = each.message.number
            kept.append(each)
        cleaned.append((time, tuple(kept), robot))
    rig.require(replay(rig, cleaned) == replay(rig, rig.inputs), "old commands changed the motion")
    rig.require(rig.session.operators[1].forward.counters.duplicated > 0, "nothing was copied")
    return rig.broken


def clocks(seed: int) -> list[str]:
    """R6: operator's clock off by an hour, with drift and steps, robot's clock off by an hour."""
    results = []
    for skewed in (False, True):
        rng = np.random.default_rng(seed)
        link = LinkSettings(delay=0.3, jitter=0.05, loss=0.05)
        steps = ((2.0, 1800.0), (5.0, -3600.0), (7.0, 0.5))
        clock = teleop.VirtualClock(3600.0, 100.0, steps) if skewed else teleop.VirtualClock()
        robot_clock = teleop.VirtualClock(3600.0) if skewed else teleop.VirtualClock()
        rig = Rig(
            rng,
            [Pilot(str(rng.choice([*FOLLOWING, "autonomous", "autonomous"])), envelope=WIDE)],
            forward=link,
            backward=link,
            budget=0.8,
            clocks=(robot_clock, clock),
        )
        rig.run_until_active()
        rig.run(5.0)
        results.append((decisions(rig), [received for _, received, _ in rig.inputs], rig.broken))
    (plain, received, broken), (skewed_decisions, skewed_heard, others) = results
    same = plain == skewed_decisions and received == skewed_heard
    return [*broken, *others, *([] if same else ["decisions differ"])]


def constant_delay(seed: int) -> list[str]:
    """R7: 2 s of constant delay refuse nothing; then delays beyond B + J refuse everything."""
    return keep_delay(seed, 18.0)


def keep_delay(seed: int, seconds: float) -> list[str]:
    """Run R7 with its constant delay for some virtual seconds."""
    rng = np.random.default_rng(seed)
    jitter = float(rng.uniform(0.1, 0.5))
    link = LinkSettings(delay=1.0)
    rig = Rig(rng, [Pilot("shared")], forward=link, backward=link, budget=2.1, jitter=jitter)
    rig.run_until_active()
    rig.run(seconds)
    rig.require(rig.session.site.commands.stale == 0, "commands were refused at a constant delay")
    rig.require(rig.control is SessionState.ACTIVE, "the session did not stay active")
    forward = rig.session.operators[1].forward
    kept: list[tuple[int, list[bytes]]] = []
    stale, applied = rig.session.site.commands.stale, rig.session.site.commands.number
    extra = round((0.1 + jitter) * SECOND) + 2 * PERIOD_NS
    for _ in range(100):  # a further delay, so that every command is older than B + J
        kept.append((rig.time_ns + extra, forward.receive(rig.time_ns)))
        due = [datagram for time, held in kept if time <= rig.time_ns for datagram in held]
        kept = [each for each in kept if each[0] > rig.time_ns]
        rig.step(due)
    arrived = rig.session.site.commands.stale - stale
    rig.require(rig.session.site.commands.number == applied, "a command beyond B + J was applied")
    rig.require(arrived > 50, f"{arrived} commands were refused, expected nearly all")
    return rig.broken


def growing_round_trip(seed: int) -> list[str]:
    """R8: the round trip grows past B, but not past B + J."""
    rng = np.random.default_rng(seed)
    is_authorised = bool(seed % 2)
    link = LinkSettings(delay=0.2)
    pilot = Pilot("shared", envelope=WIDE if is_authorised else teleop.NO_ENVELOPE)
    rig = Rig(rng, [pilot], forward=link, backward=link, budget=0.6, jitter=0.4)
    rig.run_until_active()
    rig.run(2.0)
    pilot.is_arming, forward = False, rig.session.operators[1].forward
    extra = round(rng.uniform(0.22, 0.35) * SECOND)
    kept: list[tuple[int, list[bytes]]] = []
    for _ in range(150):
        kept.append((rig.time_ns + extra, forward.receive(rig.time_ns)))
        due = [datagram for time, held in kept if time <= rig.time_ns for datagram in held]
        kept = [each for each in kept if each[0] > rig.time_ns]
        rig.step(due)
    states = {row.state for row in rig.rows[-60:]}
    report = rig.views[1].report
    assert report is not None
    if is_authorised:
        went_on = any(row.state is SessionState.CONTINUING for row in rig.rows)
        rig.require(went_on, "did not go on under the envelope")
        rig.require(SessionState.ACTIVE not in states, "still follows the operator")
        return rig.broken
    rig.require(states == {SessionState.HOLD}, f"states are {states}")
    rig.require(report.reason is Reason.ROUND_TRIP_EXCEEDED, f"reported {report.reason.name}")
    pilot.actions = (Action.ARM,)
    rig.run(2.0)
    rig.require(rig.control is SessionState.HOLD, "ARM cleared what a new agreement must clear")
    return rig.broken


SCENARIOS = {
    "R1": outage_of_both,
    "R2": outage_autonomous,
    "R3": link_returns,
    "R5": reordering_and_copies,
    "R6": clocks,
    "R7": constant_delay,
    "R8": growing_round_trip,
    "R19, forward": outage_forward,
    "R19, backward": outage_backward,
}
