"""Random hands, frames, modes, clutch, skills and times: the target is finite and within its limits."""

import os

import assisted_task as task
import numpy as np
import pytest
from annotations import check_annotations

import pilotfish as pf
from pilotfish import assistance
from pilotfish.assistance import Command, initial_state, step_assistance
from pilotfish.geometry import angle

INPUTS = int(os.environ.get("PILOTFISH_INPUTS", "5000"))
SCENE = task.random_scene(np.random.default_rng(5))
FRAMES = task.scene_frames(SCENE)
ROWS = task.demonstrate(np.random.default_rng(6), SCENE).x


@pytest.fixture(autouse=True)
def unchecked():
    """Run the loops without checks of annotations, which the tests of the parts have."""
    with check_annotations(False):
        yield


def random_hand(rng) -> np.ndarray:
    """Return a hand of any magnitude, near the demonstration, or not finite, or of another width."""
    hand = rng.normal(size=8) * 10.0 ** rng.uniform(-3, 6)
    if rng.random() < 0.6:
        hand = ROWS[rng.integers(len(ROWS))] + 10.0 ** rng.uniform(-6, 0) * rng.normal(size=8)
    if rng.random() < 0.1:
        hand = rng.choice([np.nan, np.inf, 0.0, 1e300, -1e-300], size=8)
    return hand[: rng.integers(0, 8)] if rng.random() < 0.05 else hand


def random_frames(rng) -> list[pf.Frame] | None:
    scale = 10.0 ** rng.uniform(-3, 8)
    random = [pf.Frame(f.name, f.A * rng.normal(), f.b + scale * rng.normal(size=8)) for f in FRAMES]
    choices = [FRAMES, None, random, FRAMES[:1], task.scene_frames(task.random_scene(rng))]
    return choices[rng.integers(len(choices))]


def run_random_inputs(rng, count, share_of_frames):
    """Assert that no target of a run is not finite, or breaks the limits."""
    skills = [task.assistant(kind).skills[0] for kind in ("flat", "sphere")]
    limits = assistance.Limits()
    assistant = assistance.make_assistant(skills, limits=limits)
    state, before = initial_state(assistant, ROWS[0], FRAMES, FRAMES), ROWS[0]
    observed = actual = FRAMES
    mode, modes = "direct", set()
    for _ in range(count):
        if rng.random() < share_of_frames:
            observed, actual = random_frames(rng), random_frames(rng)
        if rng.random() < 0.05:
            mode = str(rng.choice(assistance.MODES))
        dt = 10.0 ** rng.uniform(-5, 0)
        command = Command(random_hand(rng), mode, bool(rng.random() < 0.9), int(rng.random() < 0.005))
        state, target = step_assistance(assistant, state, command, observed, actual, dt)
        for array in (target.pose, target.velocity, target.covariance, target.probabilities):
            assert np.isfinite(array).all()
        assert 0.0 <= target.authority <= 1.0
        assert np.isclose(target.probabilities.sum(), 1.0)
        assert np.linalg.norm(target.pose[:3] - before[:3]) <= limits.speed * dt + 1e-9
        assert angle(target.pose[3:7], before[3:7]) <= limits.angular_speed * dt + 1e-6
        before = target.pose
        modes.add(target.mode)
    return modes


def test_random_inputs_never_give_nan_and_never_step(rng):
    run_random_inputs(rng, 150, 0.02)


@pytest.mark.slow  # PILOTFISH_INPUTS=100000 takes minutes
def test_many_random_inputs_never_give_nan_and_never_step():
    assert run_random_inputs(np.random.default_rng(11), INPUTS, 0.001) == set(assistance.MODES)
