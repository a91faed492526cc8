"""A virtual clock reads what the formula of its module states, exactly."""

from fractions import Fraction
from math import floor
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pilotfish.errors import InvalidInput
from pilotfish.teleop import VirtualClock

SECOND = 10**9
DAY = 86_400 * SECOND


@pytest.mark.parametrize("time", [0, 1, 12_345, DAY])
def test_clock_without_errors_reads_true_time(time: int):
    assert VirtualClock().read(time) == time


def test_hour_of_offset_and_drift_are_exact_after_a_day():
    """100 parts per million of a day are 8.64 s."""
    clock = VirtualClock(offset=-3600.0, drift_ppm=100.0)
    assert clock.read(0) == -3600 * SECOND
    assert clock.read(DAY) == DAY - 3600 * SECOND + 8_640_000_000


def test_slow_clock_loses_one_nanosecond_in_ten_thousand():
    clock = VirtualClock(drift_ppm=-100.0)
    assert [clock.read(t) for t in (0, 1, 10_000, 10_001)] == [0, 0, 9_999, 9_999]


def test_drift_is_rounded_to_the_nearest_part_per_billion():
    """1.001 ppm times 1000 is a little less than 1001 in floating point."""
    assert int(1.001 * 1000) == 1000
    assert VirtualClock(drift_ppm=1.001).read(SECOND) == SECOND + 1001


def test_steps_take_effect_at_their_times_and_add_up():
    clock = VirtualClock(steps=((1.0, 5.0), (2.0, -7.5), (2.0, 0.5)))
    readings = [clock.read(t) - t for t in (0, SECOND - 1, SECOND, 2 * SECOND - 1, 2 * SECOND, DAY)]
    assert readings == [0, 0, 5 * SECOND, 5 * SECOND, -2 * SECOND, -2 * SECOND]


@given(
    st.integers(0, 2**63 - 1),
    st.integers(-(10**8), 10**8),
    st.lists(st.tuples(st.integers(0, 10**6), st.integers(-3600, 3600)), max_size=4),
)
def test_reading_equals_the_formula_in_fractions(time: int, drift_ppb: int, steps: list[tuple[int, int]]):
    steps.sort()
    clock = VirtualClock(3600.0, drift_ppb / 1000.0, tuple((float(t), float(s)) for t, s in steps))
    drift = floor(Fraction(drift_ppb, SECOND) * time)
    stepped = sum(size for at, size in steps if at * SECOND <= time) * SECOND
    assert clock.read(time) == time + 3600 * SECOND + drift + stepped


@given(st.integers(0, 2**62), st.integers(0, 10**6), st.integers(-(10**8), 10**8))
def test_clock_without_steps_never_goes_back(time: int, later: int, drift_ppb: int):
    clock = VirtualClock(drift_ppm=drift_ppb / 1000.0)
    assert clock.read(time + later) >= clock.read(time)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"offset": np.nan}, "offset is nan"),
        ({"offset": 1e10}, "offset is"),
        ({"drift_ppm": 2e5}, "drift_ppm is"),
        ({"steps": [(1.0, 2.0)]}, "steps has type list"),
        ({"steps": (3.0,)}, r"steps\[0\] has type float"),
        ({"steps": ((3.0,),)}, r"steps\[0\] is \(3.0,\), expected \(time, step\)"),
        ({"steps": ((-1.0, 2.0),)}, r"the time of steps\[0\]"),
        ({"steps": ((1.0, np.inf),)}, r"the size of steps\[0\]"),
        ({"steps": ((2.0, 1.0), (1.0, 1.0))}, r"steps\[1\] is at 1 s, before the step at 2 s"),
    ],
)
def test_invalid_clock_is_refused(arguments: dict[str, Any], message: str):
    with pytest.raises(InvalidInput, match=message):
        VirtualClock(**arguments)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("time", [-1, 2**63, 1.0, "1", None, True])
def test_invalid_time_is_refused(time: Any):
    with pytest.raises(InvalidInput, match="true_ns is"):
        VirtualClock().read(time)
