"""Reaches from a place near home to a cup that moves, smooth in time and of any period and unit."""

import numpy as np

from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    Layout,
    Part,
    Quantity,
    add_derivatives,
    demonstration,
    position_layout,
)
from pilotfish.geometry.minimum_jerk import minimum_jerk

DURATION = 3.0  # s
GRIPPER = Part("gripper", Quantity.SCALAR, 1, "1")
HOME = np.array([0.1, 0.0, 0.3])


def make_reach(
    rng: np.random.Generator,
    name: str,
    *,
    rate: float = 20.0,
    unit: float = 1.0,
    duration: float = DURATION,
) -> Demonstration:
    """Return a reach over a bow to a random cup, where the gripper closes after four fifths of the time.

    Args:
        rng: Source of the cup and of the deviations.
        name: Name of the demonstration.
        rate: Rows per second.
        unit: Number of units in a metre.
        duration: Duration of the movement [s].
    """
    cup = np.array([0.6, 0.0, 0.1]) + rng.uniform(-0.2, 0.2, size=3)
    start = HOME + 0.01 * rng.normal(size=3)
    bow = np.array([0.0, 0.0, 0.15]) + 0.01 * rng.normal(size=3)
    time = np.linspace(0.0, 1.0, round(duration * rate) + 1)
    progress = minimum_jerk(time)[:, None]
    positions = start + progress * (cup - start) + np.sin(np.pi * progress) ** 2 * bow
    layout = Layout((*position_layout(3).parts, GRIPPER))
    x = np.hstack([unit * positions, (time > 0.8)[:, None]])
    offset = np.append(unit * cup, 0.0)
    frames = (Frame("world", np.eye(4), np.zeros(4)), Frame("cup", np.eye(4), offset))
    return add_derivatives(demonstration(x, 1.0 / rate, layout, frames, name))


def make_reaches(
    seed: int, count: int = 5, *, rate: float = 20.0, unit: float = 1.0, duration: float = DURATION
) -> list[Demonstration]:
    """Return several reaches; the same seed gives the same movements at every rate and in every unit."""
    rng = np.random.default_rng(seed)
    return [make_reach(rng, f"reach {n}", rate=rate, unit=unit, duration=duration) for n in range(count)]
