"""Random demonstrations with known structure for the tests of models."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import Demonstration, Frame, Layout, Part, Quantity, demonstration, world_frame

MakeDemonstrations = Callable[..., list[Demonstration]]


def layout(width: int) -> Layout:
    return Layout((Part("place", Quantity.SCALAR, width, "m"),))


def random_frame(rng: np.random.Generator, name: str, width: int) -> Frame:
    rotation, _ = np.linalg.qr(rng.normal(size=(width, width)))
    return Frame(name, rotation, rng.normal(size=width))


@pytest.fixture
def make_demonstrations(rng: np.random.Generator) -> MakeDemonstrations:
    """Return a function that samples noisy passages through a row of places, with random frames."""

    def make(lengths=(30, 42, 37), width=2, frames=2, stops=3, noise=0.1) -> list[Demonstration]:
        places = 3.0 * rng.normal(size=(stops, width))
        demos = []
        for m, length in enumerate(lengths):
            stop_indices = np.sort(rng.integers(0, stops, size=length))
            x = places[stop_indices] + noise * rng.normal(size=(length, width))
            demo_frames = [random_frame(rng, f"object {p}", width) for p in range(frames)]
            demos.append(demonstration(x, 0.1, layout(width), tuple(demo_frames), f"passage {m}"))
        return demos

    return make


@pytest.fixture
def make_two_object_demonstrations(rng: np.random.Generator) -> MakeDemonstrations:
    """Return a function that samples movements from one object over a fixed place to another object.

    Objects are placed at random. The frames are those of the objects, the world and distractors.
    """

    def make(count=5, distractors=0, noise=0.05) -> list[Demonstration]:
        return [_record_demonstration(rng, f"passage {m}", distractors, noise) for m in range(count)]

    return make


def _record_demonstration(
    rng: np.random.Generator, name: str, distractors: int, noise: float
) -> Demonstration:
    names = ["object 0", "object 1", *(f"distractor {n}" for n in range(distractors))]
    frame_one, frame_two, *rest = (
        replace(f, b=2.0 * f.b) for f in (random_frame(rng, each, 2) for each in names)
    )
    stops = np.stack(
        [frame_one.A @ [0.3, 0.1] + frame_one.b, [0.0, 5.0], frame_two.A @ [0.0, 0.4] + frame_two.b]
    )
    stops += noise * rng.normal(size=(3, 2))  # noise per demonstration; noise per point is added below
    x = np.repeat(stops, [18, 15, 20], axis=0)
    x = x + 0.3 * noise * rng.normal(size=x.shape)
    return demonstration(x, 0.1, layout(2), (frame_one, frame_two, world_frame(2), *rest), name)
