"""Memory: a reader keeps one recording, so that a data set larger than memory can be read."""

import tracemalloc
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from laboratory_files import random_episodes, robomimic_demo, write_bag, write_lerobot_v3, write_robomimic

from pilotfish.demonstrations import Recording
from pilotfish.io.readers import lerobot, robomimic, ros_bags

Rng = np.random.Generator
STEPS, COUNT = 8000, 8


def lerobot_set(path: Path, rng: Rng) -> Iterator[Recording]:
    write_lerobot_v3(path, random_episodes(rng, (STEPS,) * COUNT), row_group=700)
    return lerobot.read(path)


def robomimic_set(path: Path, rng: Rng) -> Iterator[Recording]:
    write_robomimic(path, {f"demo_{n}": robomimic_demo(rng, STEPS) for n in range(COUNT)})
    return robomimic.read(path)


def bags(path: Path, rng: Rng) -> Iterator[Recording]:
    path.mkdir()
    for n in range(COUNT):
        write_bag(path / f"{n}", "mcap", rng.normal(size=(20, 7)))
    return ros_bags.read(path)


@pytest.mark.parametrize("write", [lerobot_set, robomimic_set, bags])
def test_read_releases_recording_before_next(write: Callable[..., Iterator[Recording]], rng, tmp_path: Path):
    recordings, alive = write(tmp_path / "set", rng), []
    for recording in recordings:
        alive.append(weakref.ref(recording.signals[0].values))
        del recording
        assert [reference() is None for reference in alive[:-1]] == [True] * (len(alive) - 1)
    assert len(alive) == COUNT


@pytest.mark.parametrize("write", [lerobot_set, robomimic_set])
def test_read_peak_is_below_a_few_recordings(write: Callable[..., Iterator[Recording]], rng, tmp_path: Path):
    """NumPy's memory of all recordings together is COUNT times that of one; the peak is below half of it."""
    recordings = write(tmp_path / "set", rng)
    tracemalloc.start()
    total = 0
    for recording in recordings:
        total += sum(signal.values.nbytes for signal in recording.signals)
        del recording
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < total / 2
