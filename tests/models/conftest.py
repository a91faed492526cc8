"""Small worlds that the laws of models are tried in."""

from collections.abc import Callable

import numpy as np
import pytest

from pilotfish.demonstrations import Demonstration, Frame, Layout, Part, Quantity, demonstration

Scene = Callable[..., list[Demonstration]]


def layout(width: int) -> Layout:
    return Layout((Part("place", Quantity.SCALAR, width, "m"),))


def random_frame(rng: np.random.Generator, name: str, width: int) -> Frame:
    turn, _ = np.linalg.qr(rng.normal(size=(width, width)))
    return Frame(name, turn, rng.normal(size=width))


@pytest.fixture
def scene(rng: np.random.Generator) -> Scene:
    """Noisy passages through a row of places, seen from random frames: a stand-in with known truth."""

    def make(lengths=(30, 42, 37), width=2, frames=2, stops=3, noise=0.1) -> list[Demonstration]:
        places = 3.0 * rng.normal(size=(stops, width))
        demos = []
        for m, length in enumerate(lengths):
            visits = np.sort(rng.integers(0, stops, size=length))
            x = places[visits] + noise * rng.normal(size=(length, width))
            frames_here = [random_frame(rng, f"object {p}", width) for p in range(frames)]
            demos.append(demonstration(x, 0.1, layout(width), tuple(frames_here), f"passage {m}"))
        return demos

    return make
