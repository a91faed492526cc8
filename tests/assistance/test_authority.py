"""Authority: where the demonstrations covered, calibrated by leaving one out, and never abrupt."""

from functools import cache

import assisted_task as task
import numpy as np
import pytest
from annotations import check_annotations

import pilotfish as pf
from pilotfish import assistance
from pilotfish.assistance import Command, Gate, initial_state, step_assistance
from pilotfish.assistance.carried import carried_situation
from pilotfish.assistance.coordinates import coordinate_frames, coordinate_skill
from pilotfish.assistance.operator_noise import DEFAULT_NOISE
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle, conjugate, from_rotation_vector, multiply, to_rotation_vector
from pilotfish.kernels import CarriedModel, coverage_distance
from pilotfish.kernels.reference.assistance import limit_authority


@pytest.fixture(autouse=True)
def unchecked():
    """Learn and step without checks of annotations, which are slow here."""
    with check_annotations(False):
        yield


def learn(demonstrations: list[Demonstration]) -> pf.Skill:
    return pf.learn(demonstrations, states=7, rng=np.random.default_rng(0)).skill


@cache
def situation_of(number: int) -> CarriedModel:
    demo, skill = task.demonstrations()[number], task.learn()
    frames = coordinate_frames(list(demo.frames), skill.layout)
    own = coordinate_skill(skill)
    return carried_situation(own, frames, frames, DEFAULT_NOISE.deviations(own.layout))


def test_demonstration_left_out_has_authority():
    """The one left out is neither in the skill nor in the calibration."""
    demos = task.demonstrations()
    values = []
    for m in (1, 4):
        others = [demo for n, demo in enumerate(demos) if n != m]
        gate = assistance.calibrate_gate(others, learn)
        distances = assistance.coverage_distances(learn(others), demos[m])
        values.append([gate.authority(d) for d in distances])
    assert np.median(values) >= 0.8
    assert np.mean(np.array(values) >= 0.5) >= 0.9


@pytest.mark.parametrize("kind", ["50 cm", "90 degrees"])
def test_no_authority_far_from_all_demonstrations_and_the_target_is_direct(rng, kind):
    assistant, dt = task.assistant(), 0.1
    for _ in range(5):
        scene = task.random_scene(rng)
        demo, frames = task.demonstrate(rng, scene), task.scene_frames(scene)
        x = demo.x[rng.integers(len(demo.x))].copy()
        if kind == "50 cm":
            x[:3] += [0.0, 0.0, 0.55] if x[2] > 0.25 else [0.0, 0.0, 0.75]
        else:
            x[3:7] = multiply(x[3:7], from_rotation_vector(np.array([np.pi / 2, 0.0, 0.0])))
        state = initial_state(assistant, demo.x[30], frames, frames)
        for _ in range(60):
            state, target = step_assistance(assistant, state, Command(x), frames, frames, dt)
        assert target.authority <= 0.02
        assert np.linalg.norm(target.pose[:3] - x[:3]) < 1e-3
        assert angle(target.pose[3:7], x[3:7]) < np.radians(0.1)


def test_coverage_judges_position_and_orientation_apart(rng):
    """A tool that is turned as demonstrated is far if its position is far; brute force over the states."""
    situation = situation_of(0)
    for row in task.demonstrations()[0].x[::6]:
        x = row + np.r_[rng.normal(scale=0.03, size=3), np.zeros(row.size - 3)]
        expected = []
        for mean, L_inverse in zip(situation.observed_means, situation.whitening, strict=True):
            relative = multiply(conjugate(mean[3:7]), x[3:7])
            turn = to_rotation_vector(relative if relative[0] >= 0.0 else -relative)
            w = np.tril(L_inverse)[:6, :6] @ np.r_[x[:3] - mean[:3], turn]
            expected.append(max(w[:3] @ w[:3], w[3:] @ w[3:]) / 3.0)
        assert coverage_distance(situation, x, scalars=1) == pytest.approx(np.sqrt(min(expected)))


def test_authority_never_increases_along_rays_away_from_the_movement(rng):
    demo, gate = task.demonstrations()[0], Gate()
    centre = demo.x[:, :3].mean(axis=0)
    checked = 0
    for _ in range(50):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        outermost = int(((demo.x[:, :3] - centre) @ direction).argmax())
        rows = np.tile(demo.x[outermost], (40, 1))
        rows[:, :3] += np.linspace(0.0, 0.8, 40)[:, None] * direction
        values = [gate.authority(coverage_distance(situation_of(0), x, scalars=1)) for x in rows]
        assert values[-1] == 0.0
        assert (np.diff(values) <= 1e-9).all()
        checked += values[0] > 0.5
    assert checked >= 25  # most rays begin where there is authority


def test_gate_falls_smoothly_and_never_rises():
    gate = Gate(1.0, 3.0)
    values = [gate.authority(d) for d in np.linspace(0.0, 4.0, 401)]
    assert values[0] == values[100] == 1.0
    assert values[200] == pytest.approx(0.5)
    assert values[-1] == gate.authority(np.nan) == gate.authority(np.inf) == 0.0
    assert (np.diff(values) <= 0.0).all()


def test_authority_changes_by_at_most_two_per_second(rng):
    value = 0.0
    for _ in range(1000):
        dt = float(rng.uniform(1e-4, 0.2))
        after = limit_authority(value, float(rng.integers(0, 2)), dt)
        assert abs(after - value) <= 2.0 * dt + 1e-12
        assert 0.0 <= after <= 1.0
        value = after


def test_calibration_refuses_two_demonstrations_and_gates_refuse_disorder():
    with pytest.raises(InvalidInput, match="at least 3"):
        assistance.calibrate_gate(task.demonstrations()[:2], learn)
    with pytest.raises(InvalidInput, match="full below none"):
        Gate(3.0, 2.0)
    with pytest.raises(InvalidInput, match="none is nan"):
        Gate(1.0, float("nan"))
