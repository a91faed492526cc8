"""Colours are distinct, also for colour-blind readers."""

from itertools import combinations

import numpy as np
import pytest

from pilotfish import plots
from pilotfish.plots.style import AXIS_COLOURS, MAX_STATES, STATE_COLOURS, state_dash

# Linear RGB as perceived by a protanope, deuteranope and tritanope: Machado, Oliveira & Fernandes 2009,
# IEEE TVCG 15(6), table 1, severity 1.
COLOUR_VISION = {
    "all": np.eye(3),
    "no red": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "no green": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "no blue": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lab(colour: str, vision: np.ndarray) -> np.ndarray:
    """Return CIELAB coordinates of a hex colour as an eye perceives it."""
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = XYZ @ np.clip(vision @ linear, 0.0, 1.0) / XYZ.sum(axis=1)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("vision", COLOUR_VISION)
@pytest.mark.parametrize("colours", [STATE_COLOURS, tuple(AXIS_COLOURS.values())], ids=["states", "axes"])
def test_colours_every_vision_are_distinct(vision: str, colours: tuple[str, ...]):
    """Any two colours differ by 15 or more in CIELAB, six times the perceptible difference, for every eye."""
    coordinates = [lab(colour, COLOUR_VISION[vision]) for colour in colours]
    assert min(float(np.linalg.norm(a - b)) for a, b in combinations(coordinates, 2)) >= 15.0


def test_state_colour_and_dash_are_unique():
    """Colour and dash together differ for all allowed states."""
    styles = {(plots.state_colour(k), state_dash(k)) for k in range(MAX_STATES)}
    assert len(styles) == MAX_STATES
