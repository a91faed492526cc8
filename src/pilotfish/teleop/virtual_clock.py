"""Clock of one site as a function of true time: offset, drift and steps, for tests and for users.

A clock reads, at true time t,

    t + offset + floor(drift t) + sum of the steps until t

in whole nanoseconds. The drift is kept in whole parts per billion, so every reading is exact, after days too.
"""

from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import accumulate

from pilotfish.errors import InvalidInput
from pilotfish.validation import require_count, require_number, require_type, short_repr, shorten_repr

_SECOND = 10**9  # ns
_MAX_TIME = 2**63 - 1  # ns
_MAX_SECONDS, _MAX_DRIFT, _MAX_STEPS = 1e9, 1e5, 100_000


@shorten_repr
@dataclass(frozen=True, slots=True)
class VirtualClock:
    """Clock that is wrong in a known way.

    Attributes:
        offset: Reading at true time 0 [s], to the nearest nanosecond.
        drift_ppm: Rate error [parts per million], to the nearest 0.001; positive for a fast clock.
        steps: True time of each step, 0 or later, and its size [s], in their order.

    Example:
        >>> VirtualClock(offset=3600.0, drift_ppm=100.0, steps=((10.0, -0.5),)).read(10_000_000_000)
        3609501000000
    """

    offset: float = 0.0
    drift_ppm: float = 0.0
    steps: tuple[tuple[float, float], ...] = ()
    _offset: int = field(init=False, repr=False, compare=False)
    _drift: int = field(init=False, repr=False, compare=False)
    _times: tuple[int, ...] = field(init=False, repr=False, compare=False)
    _sums: tuple[int, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        offset = require_number(self.offset, "offset", -_MAX_SECONDS, _MAX_SECONDS)
        drift = require_number(self.drift_ppm, "drift_ppm", -_MAX_DRIFT, _MAX_DRIFT)
        times, sizes = _validate_steps(self.steps)
        object.__setattr__(self, "_offset", round(offset * _SECOND))
        object.__setattr__(self, "_drift", round(drift * 1000))
        object.__setattr__(self, "_times", times)
        object.__setattr__(self, "_sums", tuple(accumulate(sizes, initial=0)))

    def read(self, true_ns: int) -> int:
        """Return what the clock reads [ns], which may be negative.

        Args:
            true_ns: True time [ns], 0 or later.

        Raises:
            InvalidInput: If it is not a whole number from 0 to 2^63 - 1.
        """
        if type(true_ns) is not int or not 0 <= true_ns <= _MAX_TIME:
            true_ns = require_count(true_ns, "true_ns", _MAX_TIME)
        drift = true_ns * self._drift // _SECOND
        return true_ns + self._offset + drift + self._sums[bisect_right(self._times, true_ns)]


def _validate_steps(steps: tuple[tuple[float, float], ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the times and the sizes [ns] of steps."""
    require_type(steps, "steps", tuple, "pass ((time, step), ...)")
    require_count(len(steps), "the number of steps", _MAX_STEPS)
    times: list[int] = []
    sizes: list[int] = []
    for n, step in enumerate(steps):
        require_type(step, f"steps[{n}]", tuple, "pass (time, step)")
        if len(step) != 2:
            raise InvalidInput(f"steps[{n}] is {short_repr(step)}, expected (time, step) in s")
        time = round(require_number(step[0], f"the time of steps[{n}]", 0.0, _MAX_SECONDS) * _SECOND)
        size = require_number(step[1], f"the size of steps[{n}]", -_MAX_SECONDS, _MAX_SECONDS)
        if times and time < times[-1]:
            raise InvalidInput(
                f"steps[{n}] is at {step[0]:g} s, before the step at {steps[n - 1][0]:g} s; sort them by time"
            )
        times.append(time)
        sizes.append(round(size * _SECOND))
    return tuple(times), tuple(sizes)
