"""Intention: against enumeration, on demonstrations left out, and what it refuses."""

from dataclasses import replace
from functools import cache
from itertools import pairwise, product

import assisted_task as task
import numpy as np
import pytest
from scipy.stats import multivariate_normal

import pilotfish as pf
from pilotfish import assistance
from pilotfish.assistance import IntentionCalibration, intention_filter, start_intention, step_intention
from pilotfish.assistance.intention import SWITCH
from pilotfish.assistance.occupancy import RESET
from pilotfish.demonstrations import Demonstration, Frame, Layout, Part, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.models import MarkovChain

pytestmark = pytest.mark.usefixtures("unchecked")  # annotations cost several times the steps

NOISE = assistance.OperatorNoise()
POINT = Layout((Part("position", Quantity.POSITION, 3, "m"),))
WORLD = [Frame("world", np.eye(3), np.zeros(3))]


def chain_skill(rng: np.random.Generator) -> pf.Skill:
    """Return a skill of two states of a point, in one frame."""
    batch = task.learn(dynamics="mixture")
    spread = rng.normal(size=(1, 2, 3, 3)) * 0.02
    return replace(
        batch,
        dynamics=MarkovChain(rng.dirichlet(np.ones(2)), rng.dirichlet(np.ones(2), size=2)),
        means=0.05 * rng.normal(size=(1, 2, 3)),
        covariances=(DenseCovariances(spread[0] @ spread[0].swapaxes(-1, -2) + 1e-4 * np.eye(3)),),
        layout=POINT,
        frame_names=("world",),
        regularisation=None,
        demonstrated=None,
        endpoints=None,
    )


def enumerated_log_density(skill: pf.Skill, x: np.ndarray, tempering: float) -> float:
    """Return log p(x_1 .. x_T), summed over all sequences of states, with tempered densities."""
    K = skill.states
    initial = (1.0 - RESET) * skill.dynamics.initial + RESET / K
    steps = (1.0 - RESET) * skill.dynamics.transitions + RESET / K
    S = NOISE.position**2 * np.eye(3)
    total = 0.0
    for path in product(range(K), repeat=len(x)):
        weight = initial[path[0]] * np.prod([steps[i, j] for i, j in pairwise(path)])
        for k, row in zip(path, x, strict=True):
            density = multivariate_normal.pdf(row, skill.means[0, k], skill.covariances[0].dense[k] + S)
            weight *= (density * (2.0 * np.pi) ** 1.5) ** tempering  # the constant that is left out
        total += weight
    return float(np.log(total))


@pytest.mark.parametrize("tempering", [1.0, 0.3])
def test_probabilities_equal_enumeration_of_state_sequences(rng, tempering):
    skills, level = [chain_skill(rng) for _ in range(2)], 8.0
    x = 0.05 * rng.normal(size=(5, 3))
    intention = intention_filter(
        [assistance.assisted_skill(s) for s in skills], IntentionCalibration(tempering * level, tempering)
    )
    state, expected, before = start_intention(intention, WORLD), np.full(3, 1.0 / 3.0), np.zeros(2)
    for t in range(1, len(x) + 1):
        state, result = step_intention(intention, state, x[t - 1], WORLD)
        so_far = np.array([enumerated_log_density(skill, x[:t], tempering) for skill in skills])
        expected = (1.0 - SWITCH) * expected + SWITCH / 3.0
        expected *= np.exp(np.append(so_far - before, tempering * level))
        expected, before = expected / expected.sum(), so_far
        np.testing.assert_allclose([*result.skills, result.none], expected, rtol=1e-9)
        assert result.unsure == pytest.approx(1.0 - expected[:2].max())


def reversed_task(demo: Demonstration) -> Demonstration:
    """Return the movement from the end to the start: the same poses in another order."""
    return replace(demo, x=demo.x[::-1].copy())


def learn(demos: list[Demonstration]) -> pf.Skill:
    return pf.learn(demos, states=7, rng=np.random.default_rng(0)).skill


@cache
def tasks() -> tuple[list[Demonstration], list[Demonstration]]:
    demos = list(task.demonstrations())
    return demos, [reversed_task(demo) for demo in demos]


@cache
def calibration() -> IntentionCalibration:
    return assistance.calibrate_intention([demos[:4] for demos in tasks()], learn)


@cache
def prepared() -> tuple[assistance.AssistedSkill, ...]:
    """Return the skills of both tasks, without the last demonstration of either."""
    return tuple(assistance.assisted_skill(learn(demos[:-1])) for demos in tasks())


def follow(intention, x, frames) -> list[assistance.Intention]:
    state, results = start_intention(intention, frames), []
    for row in x:
        state, result = step_intention(intention, state, row, frames)
        results.append(result)
    return results


def test_demonstration_left_out_is_recognised_among_two_skills():
    intention = intention_filter(prepared(), calibration())
    for n, demos in enumerate(tasks()):
        demo = demos[-1]
        results = follow(intention, demo.x, list(demo.frames))
        right = np.array([result.skills[n] for result in results])
        assert right[-1] > 0.9
        assert np.mean(right[len(right) // 4 :] > 0.5) > 0.9
        assert all(np.isclose(r.skills.sum() + r.none, 1.0) for r in results)
        assert all(np.isclose(p.sum(), 1.0) for r in results for p in r.states)
        assert results[0].states[n].argmax() != results[-1].states[n].argmax()


def test_operator_who_changes_the_task_is_followed():
    """First the one task, then the other, in the same scene."""
    intention = intention_filter(prepared(), calibration())
    demo = tasks()[0][-1]
    results = follow(intention, np.vstack([demo.x, demo.x[::-1]]), list(demo.frames))
    assert results[len(demo.x) - 1].skills.argmax() == 0
    assert results[-1].skills[1] > 0.5


def test_unrelated_motion_is_unsure(rng):
    intention = intention_filter(prepared(), calibration())
    demo = tasks()[0][-1]
    x = demo.x.copy()
    x[:, :3] = x[::-1, [1, 2, 0]] + np.array([0.3, 0.3, 0.3])
    results = follow(intention, x, list(demo.frames))
    assert results[-1].none > 0.9
    assert results[-1].unsure > 0.9


def test_duplicated_skill_has_equal_probabilities_and_is_unsure():
    skill = prepared()[0]
    intention = intention_filter([skill, skill], calibration())
    demo = tasks()[0][-1]
    for result in follow(intention, demo.x, list(demo.frames)):
        assert result.skills[0] == result.skills[1]
        assert result.unsure >= 0.5
    assert result.none < 0.1


def test_stale_frames_teach_nothing():
    intention = intention_filter(prepared(), calibration())
    demo = tasks()[0][-1]
    state = start_intention(intention, list(demo.frames))
    for row in demo.x[:40]:
        state, known = step_intention(intention, state, row, list(demo.frames))
    for row in demo.x[40:]:
        state, stale = step_intention(intention, state, row, None)
    assert known.unsure < stale.unsure
    assert stale.skills.argmax() == known.skills.argmax()
    assert stale.none > known.none


@pytest.mark.parametrize("size", [1.0, 1e3, 1e9])
def test_far_commands_keep_probabilities(rng, size):
    intention = intention_filter(prepared(), calibration())
    demo = tasks()[0][-1]
    x = demo.x[:20].copy()
    x[:, :3] += size * rng.normal(size=(20, 3))
    for result in follow(intention, x, list(demo.frames)):
        probs = np.append(result.skills, result.none)
        assert np.isfinite(probs).all()
        assert probs.sum() == pytest.approx(1.0)
    assert result.none > 0.9


def test_wrong_input_is_refused():
    skills, demo = prepared(), tasks()[0][-1]
    intention, frames = intention_filter(skills, calibration()), list(demo.frames)
    state = start_intention(intention, frames)
    with pytest.raises(InvalidInput, match="pose"):
        step_intention(intention, state, np.full(8, np.nan), frames)
    with pytest.raises(InvalidInput, match="missing"):
        start_intention(intention, frames[:1])
    with pytest.raises(InvalidInput, match="skills is empty"):
        intention_filter([], calibration())
    with pytest.raises(InvalidInput, match="level"):
        IntentionCalibration(np.nan, 0.5)
    with pytest.raises(InvalidInput, match="tempering"):
        IntentionCalibration(0.0, 0.0)
    with pytest.raises(InvalidInput, match="at least 3"):
        assistance.calibrate_intention([tasks()[0][:2]], learn)
    slower = replace(skills[0], skill=replace(skills[0].skill, period=0.2))
    with pytest.raises(InvalidInput, match="periods"):
        intention_filter([slower, skills[1]], calibration())
    with pytest.raises(InvalidInput, match="state has 2 skills, expected 1"):
        step_intention(intention_filter(skills[:1], calibration()), state, demo.x[0], frames)
