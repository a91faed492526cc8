"""Fixtures: demonstrations in space and in a plane, and skills learned from them."""

from collections.abc import Sequence

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    add_derivatives,
    demonstration,
    frame,
    position_layout,
    to_sphere,
)
from pilotfish.geometry import quaternion_exp, rotation_matrix
from pilotfish.models import Skill, learn

STEPS, PERIOD = 30, 0.1


def learned(demonstrations: Sequence[Demonstration]) -> Skill:
    return learn(demonstrations, states=3, rng=np.random.default_rng(0)).skill


@pytest.fixture(scope="session")
def reaches(reach_demonstrations: tuple[Demonstration, ...]) -> tuple[Demonstration, ...]:
    """Return five reaches for a cup, with velocities."""
    return tuple(add_derivatives(demo) for demo in reach_demonstrations)


@pytest.fixture(scope="session")
def reach_skill(reaches: tuple[Demonstration, ...]) -> Skill:
    return learned(reaches)


@pytest.fixture(scope="session")
def sphere_skill(reach_demonstrations: tuple[Demonstration, ...]) -> Skill:
    """Return a skill with orientations on S^3."""
    return learned([add_derivatives(to_sphere(demo)) for demo in reach_demonstrations])


@pytest.fixture(scope="session")
def strokes() -> tuple[Demonstration, ...]:
    """Return four strokes in a plane from an origin to an object that turns, with velocities."""
    rng, layout = np.random.default_rng(2), position_layout(2)
    share = np.linspace(0.0, 1.0, STEPS)[:, None]
    strokes = []
    for m in range(4):
        turn = rotation_matrix(quaternion_exp(np.array([0.0, 0.0, 0.2 * rng.normal()])))[:2, :2]
        goal = np.array([0.5, 0.2]) + 0.1 * rng.normal(size=2)
        x = share**2 * (3.0 - 2.0 * share) * goal + 0.002 * rng.normal(size=(STEPS, 2))
        frames = [frame("origin", np.eye(2), np.zeros(2)), frame("object", turn, goal)]
        strokes.append(add_derivatives(demonstration(x, PERIOD, layout, frames, f"stroke {m}")))
    return tuple(strokes)


@pytest.fixture(scope="session")
def stroke_skill(strokes: tuple[Demonstration, ...]) -> Skill:
    return learned(strokes)
