"""Faults R12 to R18 of payloads, peers and perception, each as a function of a seed.

An empty list means that the fault was survived.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import nan

import numpy as np
from fault_rig import (
    PERIOD,
    PERIOD_NS,
    ROUNDING,
    Pilot,
    Rig,
    Row,
    decisions,
    path,
)

from pilotfish import teleop
from pilotfish.assistance import AssistedSkill
from pilotfish.geometry import Pose
from pilotfish.teleop import Action, LinkSettings, Reason, SessionState

Inject = Callable[[Rig], Sequence[bytes]]
MODES_OF_HAND = ("direct", "shared")
DRIVER_NS = 5_000_000  # ns between two steps of the arm's driver


def compare_with_intruder(seed: int, intruder: Callable[[np.random.Generator], Inject]) -> list[str]:
    """Return what differs between a session with an intruder and the same session without.

    The links have no random delays: a welcome that answers a repeated hello would use some of their numbers.
    """
    results = []
    for is_attacked in (False, True):
        rng = np.random.default_rng(seed)
        link = LinkSettings(delay=float(rng.uniform(0.0, 0.3)))
        pilot = Pilot(str(rng.choice([*MODES_OF_HAND, "autonomous"])))
        rig = Rig(rng, [pilot], forward=link, backward=link, budget=0.8)
        inject = intruder(np.random.default_rng([seed, 1])) if is_attacked else None
        rig.run(7.0, inject)
        results.append((decisions(rig), rig.broken, rig.session.endpoint.audit, rig.control))
    (plain, broken, _, state), (attacked, others, audit, _) = results
    statements = [*broken, *others]
    if state is not SessionState.ACTIVE:
        statements.append(f"the session is in {state.name}")
    if plain != attacked:
        statements.append("the intruder changed the motion")
    if not sum(audit.counts):
        statements.append("nothing was audited")
    return statements


def corrupt_payloads(seed: int) -> list[str]:
    """R12: corrupt, truncated, extended and random datagrams, ten in every step."""

    def make(rng: np.random.Generator) -> Inject:
        captured: list[bytes] = []

        def inject(rig: Rig) -> list[bytes]:
            captured.extend(tap(rig))
            del captured[:-50]
            return [mutate(rng, captured) for _ in range(10)]

        return inject

    return compare_with_intruder(seed, make)


def mutate(rng: np.random.Generator, captured: Sequence[bytes]) -> bytes:
    """Return a changed datagram: flipped bits, another length, or random bytes of a right length."""
    kind = int(rng.integers(4))
    if not captured or kind == 0:
        return rng.bytes(int(rng.integers(0, 400)))
    data = bytearray(captured[int(rng.integers(len(captured)))])
    if kind == 1:
        return bytes(data[: int(rng.integers(len(data)))])
    if kind == 2:
        return bytes(data) + rng.bytes(int(rng.integers(1, 40)))
    for place in rng.permutation(len(data))[: int(rng.integers(1, 6))]:
        data[place] ^= 1 << int(rng.integers(8))
    return bytes(data)


def tap(rig: Rig) -> list[bytes]:
    """Return the datagrams that the operators sent in the last step."""
    return [datagram for operator in rig.session.operators.values() for datagram in operator.datagrams]


def stranger(seed: int) -> list[str]:
    """R13: a peer with a wrong key, under the operator's number or another, says what an operator says."""

    def make(rng: np.random.Generator) -> Inject:
        number = int(rng.choice([1, 7]))
        site = teleop.start_operator(teleop.OperatorSettings(_refuse, number=number))
        endpoint = teleop.operator_endpoint(number, rng.bytes(32), rng.bytes(32))
        given = teleop.OperatorInput(path(6)[50], mode="direct", actions=tuple(Action), is_stopping=True)

        def inject(rig: Rig) -> list[bytes]:
            nonlocal site, endpoint
            site, outgoing, _ = teleop.step_operator(
                teleop.OperatorSettings(_refuse, number=number), site, rig.time_ns, (), given
            )
            site = replace(site, requests=())
            # The stranger read boot and connection on the wire.
            operator = rig.session.operators[1].endpoint
            endpoint = replace(endpoint, boot=operator.boot, connection=max(1, operator.connection))
            endpoint, datagrams = teleop.send_from_operator(endpoint, outgoing)
            return list(datagrams)

        return inject

    return compare_with_intruder(seed, make)


def _refuse(data: bytes) -> AssistedSkill:
    raise AssertionError(f"{len(data)} bytes of a skill that was not sent")


def replayed_traffic(seed: int) -> list[str]:
    """R14: everything that the operator sent is sent again later, in another order."""

    def make(rng: np.random.Generator) -> Inject:
        captured: list[bytes] = []

        def inject(rig: Rig) -> list[bytes]:
            captured.extend(tap(rig))
            old = captured[:-100]
            return [old[int(n)] for n in rng.integers(len(old), size=10)] if old else []

        return inject

    return compare_with_intruder(seed, make)


def non_finite(seed: int) -> list[str]:
    """R15: non-finite numbers with a right seal, then from the robot's own sensors."""
    rng = np.random.default_rng(seed)
    pilot = Pilot(str(rng.choice(MODES_OF_HAND)))
    rig = Rig(rng, [pilot])
    rig.run_until_active()
    rig.run(1.0)
    applied = rig.session.site.commands.number
    for _ in range(20):
        rig.step_robot([_bad_command(rig, rng)])
        rig.time_ns += PERIOD_NS
    rig.require(rig.session.site.commands.number <= applied + 1, "a command that is not finite was applied")
    rig.require(bool(sum(rig.session.endpoint.audit.counts)), "nothing was audited")
    rig.run_until_active()
    rig.run(1.0)
    pilot.is_arming = False
    bad = rig.sense()
    field = str(rng.choice(["pose", "twist"]))
    values = getattr(bad, field).copy()
    values[int(rng.integers(len(values)))] = rng.choice([nan, np.inf, -np.inf])
    for _ in range(50):
        rig.step(robot=replace(bad, **{field: values}))
    control = rig.session.site.control
    rig.require(control.state is SessionState.HOLD, f"the robot is in {control.state.name}")
    rig.require(control.reason is Reason.PERCEPTION_LOST, f"held for {control.reason.name}")
    return rig.broken


def _bad_command(rig: Rig, rng: np.random.Generator) -> bytes:
    """Return a command of the operator with a number that is not finite, under the right seal."""
    operator = rig.session.operators[1]
    site, outgoing, _ = teleop.step_operator(
        operator.settings, operator.site, rig.time_ns, (), rig.pilots[1].act(rig.views[1])
    )
    operator.site = site
    command = next(each for each in outgoing if isinstance(each, teleop.CommandMessage))
    payload = bytearray(teleop.encode(command))
    place = 14 + 4 * int(rng.integers(14))  # pose, twist and grip, in single precision
    payload[place : place + 4] = np.float32(rng.choice([nan, np.inf, -np.inf])).tobytes()
    endpoint = operator.endpoint
    header = teleop.Header(
        teleop.Kind.COMMAND, endpoint.number, endpoint.boot, endpoint.connection, endpoint.sequence
    )
    operator.endpoint = replace(endpoint, sequence=endpoint.sequence + 1)
    return teleop.seal_datagram(endpoint.key, header, bytes(payload))


def too_far_and_fast(seed: int) -> list[str]:
    """R16: the hand leaves the workspace and jumps by metres."""
    rng = np.random.default_rng(seed)
    limits = replace(
        teleop.RobotSettings(_refuse).limits,
        lower=path(6)[:, :3].min(axis=0) - 0.05,
        upper=path(6)[:, :3].max(axis=0) + 0.05,
    )
    pilot = Pilot("direct")
    rig = Rig(rng, [pilot], limits=limits)
    rig.run_until_active()
    rig.run(0.5)
    flags = []
    for _ in range(30):
        pilot.offset = rng.normal(size=3) * rng.choice([0.5, 3.0, 1e5])
        rig.run(0.2)
        report = rig.views[1].report
        flags.append(report is not None and report.is_limited)
    rig.require(any(flags), "no limit was reported")
    positions = np.array([row.pose[:3] for row in rig.rows])
    inside = (positions >= limits.lower - ROUNDING) & (positions <= limits.upper + ROUNDING)
    rig.require(bool(inside.all()), "the target left the workspace")
    velocities = np.array([row.velocity for row in rig.rows])
    change = np.linalg.norm(np.diff(velocities, axis=0), axis=1) / PERIOD
    rig.require(
        bool((change <= limits.acceleration + 1e-6).all()), f"accelerates at {change.max():.1f} m/s^2"
    )
    return rig.broken


def faults_of_assistance(seed: int) -> list[str]:
    """R17: frames disappear, are not finite or are impossible, in shared control."""
    rig, undisturbed = _assisted_session(seed), _assisted_session(seed)
    undisturbed.run(3.0)
    began = rig.rows[-1]
    rig.require(began.authority > 0.5, f"authority is {began.authority:.2f} before the fault")
    true_frames = rig.frames
    assert true_frames is not None
    names = list(true_frames)
    bad_pose = Pose(np.array([nan, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    rig.frames = [
        None,
        {names[0]: bad_pose, names[1]: true_frames[names[1]]},
        {names[0]: Pose(np.zeros(3), np.zeros(4)), names[1]: true_frames[names[1]]},
        {names[0]: true_frames[names[0]]},
        {},
    ][seed % 5]
    rig.run(1.0)
    faded = next((row.time for row in rig.rows if row.time > began.time and row.authority == 0.0), None)
    rig.require(
        faded is not None and faded - began.time <= 0.5 + 2.0 * PERIOD, "authority is not 0 after .5 s"
    )
    rig.frames = true_frames
    rig.run(2.0)
    returned, expected = rig.rows[-1].authority, undisturbed.rows[-1].authority
    rig.require(abs(returned - expected) < 1e-6, f"authority is {returned:.3f}, not {expected:.3f} again")
    _require_smooth(rig, rig.rows[-200:])
    return rig.broken


def _assisted_session(seed: int) -> Rig:
    """Return a session in shared control at a moment at which the operator is assisted."""
    rng = np.random.default_rng(seed)
    rig = Rig(rng, [Pilot("shared", demonstration=6)])
    rig.run_until_active()
    rig.run(rng.uniform(2.0, 4.0))
    for _ in range(100):  # between two states the authority is low
        if rig.rows[-1].authority > 0.5:
            break
        rig.step()
    return rig


def _require_smooth(rig: Rig, rows: Sequence[Row]) -> None:
    velocities = np.array([row.velocity for row in rows])
    change = np.linalg.norm(np.diff(velocities, axis=0), axis=1) / PERIOD
    limit = rig.settings.limits.acceleration
    rig.require(bool((change <= limit + 1e-6).all()), f"the target snaps at {change.max():.1f} m/s^2")


def racing_operators(seed: int) -> list[str]:
    """R18: two operators and an observer ask for control at once, again and again."""
    rng = np.random.default_rng(seed)
    pilots = [Pilot("direct", number=1), Pilot("direct", number=2), Pilot("direct", number=3)]
    link = LinkSettings(delay=float(rng.uniform(0.0, 0.3)), jitter=0.05)
    rig = Rig(
        rng, pilots, forward=link, backward=link, budget=0.9, skills=(), operators=(1, 2), observers=(3,)
    )
    for pilot in pilots:
        pilot.is_arming = False
    for _ in range(60):
        for pilot in pilots:
            requested = [Action.ACQUIRE, Action.RELEASE, Action.ARM, Action.DISARM, Action.AUTHORISE]
            pilot.actions = (Action.ACQUIRE, *map(Action, rng.choice(requested, size=2)))
        rig.run(0.2)
        rig.require(rig.session.site.control.holder in (0, 1, 2), "an observer has control")
    holders = {row.lease: set[int]() for row in rig.rows}
    for row in rig.rows:
        holders[row.lease].add(row.holder)
    rig.require(all(len(each) == 1 for each in holders.values()), "a lease had two holders")
    rig.require(len(holders) > 2, "control never changed")
    pilots[2].is_stopping = True
    rig.run(1.0)
    rig.require(rig.control is SessionState.STOPPED, "the observer's stop had no effect")
    return rig.broken


SCENARIOS = {
    "R12": corrupt_payloads,
    "R13": stranger,
    "R14": replayed_traffic,
    "R15": non_finite,
    "R16": too_far_and_fast,
    "R17": faults_of_assistance,
    "R18": racing_operators,
}
