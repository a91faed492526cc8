"""Transfers between modes, variants, skills and clutch states at random instants: the target never jumps.

The modes are direct, carried, literal (the second skill), autonomous and fixture. The hand repeats a
demonstration, the robot acts in another scene, and the modes disagree by centimetres.
"""

import os
from collections import Counter
from dataclasses import dataclass, replace
from functools import cache

import assisted_task as task
import numpy as np
import pytest
from annotations import check_annotations

from pilotfish import assistance
from pilotfish.assistance import Command, initial_state, step_assistance
from pilotfish.geometry import Pose, log_map

DT, AT_CHANGE = 0.02, 0.005  # s; the step at a change is that of a fast loop
STARTS = (3,)
FREE = assistance.Limits(speed=1e3, acceleration=1e6, angular_speed=1e3, angular_acceleration=1e6)
LIMITS = assistance.Limits()
MODES = {
    "direct": ("direct", 0),
    "carried": ("shared", 0),
    "literal": ("shared", 1),
    "autonomous": ("autonomous", 0),
    "fixture": ("fixture", 0),
}
CHANGES = int(os.environ.get("PILOTFISH_CHANGES", "100"))
PAIRS = {(before, after) for before in MODES for after in MODES}


@pytest.fixture(autouse=True)
def unchecked():
    """Run the loops without checks of annotations, which the tests of the parts have."""
    with check_annotations(False):
        yield


@cache
def two_skills(limits):
    literal = task.assistant(literal=True).skills[0]
    return assistance.make_assistant([task.assistant().skills[0], literal], limits=limits)


@dataclass(frozen=True)
class Instant:
    """A change: motion before it, then targets, and what the mode requests without transition."""

    modes: tuple[str, str]
    pose: np.ndarray
    velocity: np.ndarray
    targets: list
    requested: list


def interpolate(rows, time):
    """Return the hand at a time; the movement goes to its end and back, again and again."""
    s = time / task.PERIOD % (2 * len(rows) - 2)
    s = min(s, 2 * len(rows) - 2 - s)
    n = min(int(s), len(rows) - 2)
    hand = (1.0 - s + n) * rows[n] + (s - n) * rows[n + 1]
    hand[3:7] /= np.linalg.norm(hand[3:7])
    return hand


def change_at_random(rng, name, clutch):
    """Return another mode, or, one time of four, the clutch moved in the same mode."""
    if not clutch or rng.random() < 0.25:
        return name, not clutch
    return str(rng.choice([other for other in MODES if other != name])), True


def random_instants(rng, limits, count):
    """Yield changes at random instants of one run, each in the state that the last one left."""
    assistant, scene = two_skills(limits), task.random_scene(rng)
    observed, rows = task.scene_frames(scene), task.demonstrate(rng, scene).x
    actual = task.scene_frames([Pose(p.position + 0.05 * rng.normal(size=3), p.quaternion) for p in scene])
    before, clutch, time = "direct", True, 0.0
    state = initial_state(assistant, rows[0], observed, actual)
    for _ in range(count):
        name, clutch = change_at_random(rng, before, clutch)
        mode, skill = MODES[name]
        free = None  # the same state without a transition: its target is what the mode requests
        instant = Instant((before, name), state.memory.pose, state.memory.velocity, [], [])
        for _ in range(min(2 + rng.geometric(0.15), 30)):
            dt = DT if instant.targets else AT_CHANGE
            time += dt
            command = Command(interpolate(rows, time), mode, clutch, skill)
            if free is not None:
                free, wanted = step_assistance(assistant, free, command, observed, actual, dt)
                instant.requested.append(wanted.pose)
            state, target = step_assistance(assistant, state, command, observed, actual, dt)
            if not instant.targets and limits is FREE:
                free = replace(state, memory=replace(state.memory, blend_duration=0.0))
            instant.targets.append(target)
        yield instant
        before = name


def require_continuous(instant):
    """Assert that the target goes on at the change, and blends slowly to what the mode requests."""
    step = log_map(instant.pose, instant.targets[0].pose, STARTS)
    expected = np.zeros(7) if instant.requested else instant.velocity * AT_CHANGE  # limits keep it moving
    assert np.linalg.norm((step - expected)[:3]) <= 1e-3, instant.modes
    assert np.linalg.norm((step - expected)[3:6]) <= np.radians(0.1), instant.modes
    offsets = [
        log_map(wanted, target.pose, STARTS)[:6]
        for wanted, target in zip(instant.requested, instant.targets[1:], strict=False)
    ]
    for v in np.diff(offsets, axis=0) / DT:
        assert np.linalg.norm(v[:3]) <= 0.25 * 1.01, instant.modes
        assert np.linalg.norm(v[3:]) <= 1.0 * 1.01, instant.modes


def require_limits(instant):
    """Assert that speed and acceleration are within their limits."""
    velocities = np.array([instant.velocity, *(target.velocity for target in instant.targets)])
    times = np.full(len(instant.targets), DT)
    times[0] = AT_CHANGE
    for columns, speed, acceleration in (
        (slice(0, 3), LIMITS.speed, LIMITS.acceleration),
        (slice(3, 6), LIMITS.angular_speed, LIMITS.angular_acceleration),
    ):
        v = velocities[:, columns]
        assert np.linalg.norm(v, axis=1).max() <= speed * (1.0 + 1e-9)
        assert (np.linalg.norm(np.diff(v, axis=0), axis=1) <= acceleration * times * (1.0 + 1e-9)).all()


def test_target_never_jumps_at_a_change_without_limits(rng):
    for instant in random_instants(rng, FREE, 12):
        require_continuous(instant)


def test_target_never_jumps_at_a_change_within_the_limits(rng):
    for instant in random_instants(rng, LIMITS, 12):
        require_continuous(instant)
        require_limits(instant)


@pytest.mark.slow  # PILOTFISH_CHANGES=1000 takes minutes
@pytest.mark.parametrize("limits", [FREE, LIMITS], ids=["without limits", "within limits"])
def test_target_never_jumps_at_many_changes(limits):
    pairs = Counter()
    for instant in random_instants(np.random.default_rng(7), limits, CHANGES):
        require_continuous(instant)
        if limits is LIMITS:
            require_limits(instant)
        pairs[instant.modes] += 1
    assert set(pairs) == PAIRS  # of one mode to itself: the clutch
