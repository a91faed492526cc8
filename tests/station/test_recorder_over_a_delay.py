"""Over a slow link a person sees what happens late, and takes the time that it costs."""

import numpy as np
import pytest

from pilotfish.environments import TASKS, people
from pilotfish.geometry import Pose
from pilotfish.station.recorder import delayed, shown

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.5])
def test_every_picture_comes_so_late(delay):
    """At each look the leader is given the picture of so many seconds ago, and the first one until then."""
    given = []

    def watch(time: float, seen: people.Seen) -> people.Wish:
        given.append((time, float(seen.tool.position[0])))  # a tool whose place tells the time
        return people.Wish(seen.tool, 0.0, 0, False)

    leader = delayed(watch, delay)
    for look in range(60):
        time = 0.02 * look
        leader(time, people.Seen(Pose(np.array([time, 0.0, 0.0]), UPRIGHT), {}))
    for time, pictured in given:
        assert pictured == pytest.approx(max(time - delay, 0.0), abs=1e-9)


@pytest.mark.slow
def test_who_sees_late_moves_and_waits():
    """The same valve is opened with half a second of delay too, in longer than without."""
    times = [next(iter(shown(TASKS["valve"], 1, 0, delay=delay)))[0].seconds for delay in (0.0, 0.5)]
    assert times[1] > times[0] + 2 * 0.5  # at least four acts, each with a look at what came of it
