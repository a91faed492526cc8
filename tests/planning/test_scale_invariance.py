"""The same movement in another unit, or sampled at another rate, is reproduced in the same way."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from reaches import HOME, make_reaches

from pilotfish.models import EMSettings, TimeBins, adapt, learn
from pilotfish.planning import default_control_cost, default_covariance_regularisation, reproduce


@cache
def motion(unit: float, states: int | None = None) -> np.ndarray:
    """Return the positions [m] and the gripper of a reproduction in an unseen situation."""
    skill = learn(make_reaches(0, unit=unit), states=states, rng=np.random.default_rng(0)).skill
    situation = make_reaches(1, count=1, unit=unit)[0]
    x = reproduce(skill, situation.frames).motion.x
    return np.hstack([x[:, :3] / unit, x[:, 3:4], x[:, 4:7] / unit])


@pytest.mark.parametrize("states", [None, 7])
@pytest.mark.parametrize("unit", [1000.0, 1.0 / 0.0254], ids=["mm", "inch"])
def test_reproduce_unit_of_length_has_no_effect(unit: float, states: int | None):
    expected, found = motion(1.0, states=states), motion(unit, states=states)
    extent = np.ptp(expected[:, :3], axis=0).max()
    np.testing.assert_allclose(found[:, :4], expected[:, :4], atol=1e-6 * extent)


def rate_difference(rate: float, seed: int = 0, **options: Any) -> float:
    """Return the largest distance at equal times to the motion learned at 30 Hz, over the extent."""
    time = np.linspace(0.0, 1.0, 91)

    def sample(rate: float) -> np.ndarray:
        demos = make_reaches(seed, rate=rate, duration=9.0)
        skill = learn(demos, rng=np.random.default_rng(0), **options).skill
        x = reproduce(skill, make_reaches(seed + 1, count=1, rate=rate, duration=9.0)[0].frames).motion.x
        return np.stack([np.interp(time, np.linspace(0.0, 1.0, len(x)), c) for c in x[:, :3].T], axis=1)

    reference = sample(30.0)
    extent = np.linalg.norm(np.ptp(reference, axis=0))
    return float(np.linalg.norm(sample(rate) - reference, axis=1).max() / extent)


@pytest.mark.parametrize("rate", [10.0, 200.0])
def test_reproduce_rate_of_recording_with_equal_states_changes_motion_by_less_than_a_hundredth(rate: float):
    """Durations, costs and the weight of the end point do not depend on the rate.

    One iteration from time bins gives the same states at every rate.
    """
    options = {"initialisation": TimeBins(), "settings": EMSettings(max_iterations=1)}
    assert rate_difference(rate, **options) < 0.01


@pytest.mark.parametrize(("rate", "seed"), [(10.0, 0), (200.0, 0), (200.0, 10), (200.0, 20)])
def test_reproduce_rate_of_recording_changes_motion_by_less_than_a_hundredth(rate: float, seed: int):
    """Initialisations compared with all rows give 0.4 %, 4.8 % and 6.4 % at 200 Hz; resampled, 0.3 to 0.6 %.

    Of twelve differences (six seeds, both rates) two exceed 1 %: 1.1 % and 1.7 %.
    """
    assert rate_difference(rate, seed) < 0.01


def test_default_costs_equal_multiples_of_scales(rng):
    """R is .01 (s / s'^2)^2, and the covariance regularisation (s / 1000)^2."""
    demos = make_reaches(0)
    skill = learn(demos, states=4, rng=rng).skill
    adapted, scales = adapt(skill, demos[0].frames), skill.demonstrated.scales
    x = np.concatenate([d.x for d in demos])
    spread = np.sqrt(((x[:, :3] - x[:, :3].mean(axis=0)) ** 2).sum(axis=1).mean())
    speed = np.sqrt((x[:, 4:7] ** 2).sum(axis=1).mean())
    np.testing.assert_allclose(scales[:3], spread)
    expected = 0.01 * (spread / speed**2) ** 2
    np.testing.assert_allclose(np.diag(default_control_cost(adapted))[:3], expected)
    np.testing.assert_allclose(default_covariance_regularisation(adapted), (scales / 1000.0) ** 2)


def test_reproduce_begins_at_home():
    assert np.linalg.norm(motion(1.0)[0, :3] - HOME) < 0.02
