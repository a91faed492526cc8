"""Colours of the page: those of `pilotfish.plots`, which cannot be imported without matplotlib.

A test compares them with `plots/style.py`. Only axes differ, since viser gives handles colours of their own.
"""

import numpy as np

from pilotfish.types import Array, UInt8

Colour = tuple[int, int, int]

STATE_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#332288", "#882255")
AXIS_COLOURS = {"x": "#FF2060", "y": "#20C060", "z": "#2080FF"}  # of the handles: red, green, blue
MOTION, DEMONSTRATION = "#000000", "#737373"  # black, and 45 per cent of white


def rgb(colour: str) -> Colour:
    """Return red, green and blue of a colour such as #0072B2."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def linear_rgb(colour: str) -> Colour:
    """Return a colour such as #0072B2 in linear light, which viser expects of the points of a line."""
    red, green, blue = (round(255.0 * _to_linear(value / 255.0)) for value in rgb(colour))
    return red, green, blue


def _to_linear(value: float) -> float:
    """Return the linear light of a value of sRGB, IEC 61966-2-1."""
    return value / 12.92 if value <= 0.04045 else float(((value + 0.055) / 1.055) ** 2.4)


def cycle_colour(index: int) -> str:
    """Return the colour of a state, or of a demonstration without a skill; colours repeat after eight."""
    return STATE_COLOURS[index % len(STATE_COLOURS)]


def demonstration_colour(index: int, *, beside_skill: bool) -> str:
    """Return the colour of a demonstration: grey beside the states of a skill, else one of its own."""
    return DEMONSTRATION if beside_skill else cycle_colour(index)


def state_colours(states: int) -> UInt8[Array, "K 3"]:
    """Return the colour of each state."""
    return np.array([rgb(cycle_colour(k)) for k in range(states)], dtype=np.uint8).reshape(states, 3)
