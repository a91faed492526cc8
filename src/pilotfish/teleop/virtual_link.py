"""One direction of a bad network on a virtual clock, for tests and for users.

A datagram that is sent waits in a queue, is transmitted at the rate of the link, and arrives after the delay:

    queue -> rate -> loss, copies -> delay + jitter (+ reordering delay) -> arrival

Queue. The order is by priority, then by time; the datagram in transmission is never interrupted. All
datagrams of one instant are queued before the first of them is transmitted. If the queue exceeds its size, it
is cut at its tail: a stop displaces waiting pictures, and among equal priorities the newest one is dropped.

Loss. A chain of two states after Gilbert and Elliott loses every datagram in the bad state, and none in the
good one. With loss p and mean burst length b it leaves the bad state with probability 1/b and enters it with
probability p / (1 - p) / b, so its stationary probability is p. Independent losses, b = 1 here, have bursts
of 1 / (1 - p) datagrams. The first datagram is lost with probability p.

Delay. Jitter is uniform from 0 to its largest value. The link keeps the order of transmission: a datagram
arrives no earlier than the one before it. Only late datagrams, chosen with the probability of reordering, are
overtaken. A copy follows its datagram after another jitter, and may arrive behind later datagrams.

Outages. A datagram is lost if it is sent during an outage, or if an outage has a moment in common with its
way, from the start of its transmission to its arrival. Hence datagrams in flight at the start of an outage
are lost, and a queue empties into the outage. For an outage of both directions, give it to both links.

Invariants. Times are whole nanoseconds. Each datagram takes the same number of random numbers from the link's
own generator, at the time when it is sent. Its loss, jitter, reordering and copy therefore depend on the seed
and on its number only, not on sizes, rates or other probabilities: runs with equal seeds are paired.
sent + duplicated = delivered + lost + dropped + in transit.

Source:
    Gilbert 1960, Capacity of a burst-noise channel, with certain loss in the bad state.
"""

from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.validation import require_count, require_number, require_type, short_repr, shorten_repr

MAX_DATAGRAM = 65_507  # bytes: UDP over IPv4
PRIORITIES = 8
SECOND = 10**9  # ns
MAX_TIME = 2**63 - 1  # ns
_MAX_DELAY, _MAX_QUEUE, _MAX_OUTAGES = 1e4, 2**30, 100_000
_DRAWS, _BLOCK = 5, 512  # random numbers per datagram, and datagrams per call of the generator


@shorten_repr
@dataclass(frozen=True, slots=True)
class LinkSettings:
    """Properties of one direction of a link; the default is a link without faults.

    Attributes:
        delay: Time from the end of transmission to arrival [s].
        jitter: Largest additional delay [s], uniform from 0.
        loss: Probability that a datagram is lost, 0 to 1.
        mean_burst: Mean number of consecutive losses; 1 for independent losses, otherwise at least
            1 / (1 - loss), which is the mean of independent losses.
        duplication: Probability that a second copy arrives.
        reordering: Probability that a datagram is late, so that later ones overtake it.
        reordering_delay: Additional delay of a late datagram [s].
        rate: Transmission rate [bit/s], headers included; infinite without a limit.
        queue: Largest number of bytes that wait for transmission, headers included; a larger datagram is
            always dropped. Without a limit of the rate nothing waits.
        header: Bytes of the headers of each datagram; the default is that of IPv4 and UDP.
        outages: Start and duration of each outage [s], in their order.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    mean_burst: float = 1.0
    duplication: float = 0.0
    reordering: float = 0.0
    reordering_delay: float = 0.05
    rate: float = inf
    queue: int = 2**16
    header: int = 28
    outages: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        for name in ("delay", "jitter", "reordering_delay"):
            require_number(getattr(self, name), name, 0.0, _MAX_DELAY)
        for name in ("loss", "duplication", "reordering"):
            require_number(getattr(self, name), name, 0.0, 1.0)
        require_number(self.rate, "rate", 1.0, inf)
        require_count(self.queue, "queue", _MAX_QUEUE, minimum=1)
        require_count(self.header, "header", MAX_DATAGRAM)
        self._require_burst()
        self._require_outages()

    def _require_burst(self) -> None:
        burst = require_number(self.mean_burst, "mean_burst", 1.0, 1e9)
        if burst != 1.0 and burst * (1.0 - self.loss) < 1.0 - 1e-9:
            mean = f"{1.0 / (1.0 - self.loss):.4g}" if self.loss < 1.0 else "infinity"
            raise InvalidInput(
                f"mean_burst is {burst:g} with loss {self.loss:g}, expected at least {mean}, which is the "
                "mean of independent losses; pass 1 for independent losses"
            )

    def _require_outages(self) -> None:
        require_type(self.outages, "outages", tuple, "pass ((start, duration), ...)")
        require_count(len(self.outages), "the number of outages", _MAX_OUTAGES)
        last_end = 0.0
        for n, outage in enumerate(self.outages):
            require_type(outage, f"outages[{n}]", tuple, "pass (start, duration)")
            if len(outage) != 2:
                raise InvalidInput(f"outages[{n}] is {short_repr(outage)}, expected (start, duration) in s")
            start = require_number(outage[0], f"the start of outages[{n}]", 0.0, 1e9)
            duration = require_number(outage[1], f"the duration of outages[{n}]", 0.0, 1e9)
            if start < last_end:
                raise InvalidInput(
                    f"outages[{n}] starts at {start:g} s, expected at least {last_end:g} s, the end of the "
                    "one before; sort and merge them"
                )
            last_end = start + duration


@dataclass(frozen=True, slots=True)
class LinkCounters:
    """What a link did until now.

    Attributes:
        sent: Number of datagrams that were sent.
        delivered: Number of datagrams that arrived, copies included.
        lost: Number of datagrams and copies that were lost, outages included.
        dropped: Number of datagrams that the queue dropped.
        duplicated: Number of copies that were made.
        bytes_sent: Bytes of all datagrams that were sent, with headers.
        largest_queue: Largest number of bytes that waited, with headers.
        in_transit: Number of datagrams and copies that wait or are on their way.
    """

    sent: int
    delivered: int
    lost: int
    dropped: int
    duplicated: int
    bytes_sent: int
    largest_queue: int
    in_transit: int


_Waiting = tuple[
    bytes, bool, int, bool, bool, int
]  # datagram, is lost, jitter, is late, has copy, copy's jitter


class VirtualLink:
    """One direction of a link; the caller passes the time, which never decreases.

    Memory is that of the datagrams in transit: call `receive` regularly.

    Example:
        >>> link = VirtualLink(LinkSettings(delay=0.25), np.random.default_rng(0))
        >>> link.send(0, b"hello")
        >>> link.receive(249_999_999), link.receive(250_000_000)
        ([], [b'hello'])
    """

    __slots__ = (
        "_arrivals", "_busy_until", "_copy_share", "_counter", "_delay", "_delivered", "_draws", "_dropped",
        "_duplicated", "_enter", "_header", "_is_bad", "_jitter", "_largest_queue", "_last_arrival", "_late",
        "_late_share", "_lost", "_outage_ends", "_outage_starts", "_queue", "_rate", "_rng", "_sent",
        "_sent_bytes", "_stay", "_time", "_waiting", "_waiting_bytes", "settings",
    )  # fmt: skip

    def __init__(self, settings: LinkSettings, rng: np.random.Generator) -> None:
        """Make an idle link.

        Args:
            settings: Properties of the link.
            rng: Generator that seeds the link's own; one number is drawn.
        """
        require_type(settings, "settings", LinkSettings, "pass LinkSettings(delay=...)")
        require_type(rng, "rng", np.random.Generator, "pass np.random.default_rng(seed)")
        self.settings = settings
        self._rng = np.random.default_rng(int(rng.integers(2**63)))
        self._draws: Iterator[list[float]] = iter(())
        self._delay, self._jitter = _nanoseconds(settings.delay), _nanoseconds(settings.jitter)
        self._late, self._late_share = _nanoseconds(settings.reordering_delay), settings.reordering
        self._copy_share, self._header = settings.duplication, int(settings.header)
        loss, burst = float(settings.loss), float(settings.mean_burst)
        self._stay = loss if burst == 1.0 else 1.0 - 1.0 / burst
        self._enter = loss if burst == 1.0 else loss / (1.0 - loss) / burst
        self._is_bad: bool | None = None  # before the first datagram
        self._rate = None if settings.rate == inf else float(settings.rate).as_integer_ratio()
        self._queue = int(settings.queue)
        self._outage_starts = [_nanoseconds(start) for start, _ in settings.outages]
        self._outage_ends = [_nanoseconds(start + duration) for start, duration in settings.outages]
        self._waiting: list[deque[_Waiting]] = [deque() for _ in range(PRIORITIES)]
        self._waiting_bytes = self._busy_until = self._time = self._last_arrival = self._counter = 0
        self._arrivals: list[tuple[int, int, bytes]] = []
        self._sent = self._delivered = self._lost = self._dropped = self._duplicated = 0
        self._sent_bytes = self._largest_queue = 0

    @property
    def counters(self) -> LinkCounters:
        """Counters until the time of the last call."""
        in_transit = len(self._arrivals) + sum(map(len, self._waiting))
        return LinkCounters(
            self._sent, self._delivered, self._lost, self._dropped, self._duplicated, self._sent_bytes,
            self._largest_queue, in_transit,
        )  # fmt: skip

    def send(self, time_ns: int, datagram: bytes, priority: int = 0) -> None:
        """Send a datagram.

        Args:
            time_ns: Time [ns], not less than at the last call of `send` or `receive`.
            datagram: Bytes without headers, at most `MAX_DATAGRAM`.
            priority: 0 to 7; 0 is transmitted first.

        Raises:
            InvalidInput: If an argument breaks a condition above.
        """
        self._advance(time_ns)
        if type(datagram) is not bytes or len(datagram) > MAX_DATAGRAM:
            _refuse_datagram(datagram)
        if type(priority) is not int or not 0 <= priority < PRIORITIES:
            require_count(priority, "priority", PRIORITIES - 1)
        row = next(self._draws, None)
        if row is None:
            self._draws = iter(self._rng.random((_BLOCK, _DRAWS)).tolist())
            row = next(self._draws)
        loss, jitter, late, copy, copy_jitter = row
        self._sent += 1
        self._sent_bytes += len(datagram) + self._header
        self._is_bad = loss < (
            self.settings.loss if self._is_bad is None else self._stay if self._is_bad else self._enter
        )
        if self._outage_starts and self._is_out(time_ns, time_ns):
            self._lost += 1
            return
        waiting = (
            datagram, self._is_bad, int(jitter * self._jitter), late < self._late_share,
            copy < self._copy_share, int(copy_jitter * self._jitter),
        )  # fmt: skip
        if self._rate is None:
            self._transmit(time_ns, time_ns, waiting)
        else:
            self._enqueue(waiting, priority)

    def receive(self, time_ns: int) -> list[bytes]:
        """Return the datagrams that arrived since the last call, in the order of arrival.

        Args:
            time_ns: Time [ns], not less than at the last call of `send` or `receive`.

        Raises:
            InvalidInput: If the time decreases or is not a whole number.
        """
        self._advance(time_ns)
        arrivals, received = self._arrivals, []
        while arrivals and arrivals[0][0] <= time_ns:
            received.append(heappop(arrivals)[2])
        self._delivered += len(received)
        return received

    def _advance(self, time_ns: int) -> None:
        """Begin every transmission before a time: datagrams of that very time may still be sent."""
        if type(time_ns) is not int or not self._time <= time_ns <= MAX_TIME:
            require_count(time_ns, "time_ns", MAX_TIME, self._time)
        if self._waiting_bytes:
            while self._waiting_bytes and (start := max(self._busy_until, self._time)) < time_ns:
                waiting = next(queue for queue in self._waiting if queue).popleft()
                size = len(waiting[0]) + self._header
                self._waiting_bytes -= size
                self._busy_until = start + self._transmission_time(size)
                self._transmit(start, self._busy_until, waiting)
        self._time = int(time_ns)

    def _transmission_time(self, size: int) -> int:
        """Return the time that a number of bytes takes [ns], rounded up."""
        assert self._rate is not None
        numerator, denominator = self._rate
        return -(-8 * size * SECOND * denominator // numerator)

    def _enqueue(self, waiting: _Waiting, priority: int) -> None:
        size = len(waiting[0]) + self._header
        if size > self._queue:
            self._dropped += 1
            return
        self._waiting[priority].append(waiting)
        self._waiting_bytes += size
        while self._waiting_bytes > self._queue:
            tail = next(queue for queue in reversed(self._waiting) if queue).pop()
            self._waiting_bytes -= len(tail[0]) + self._header
            self._dropped += 1
        self._largest_queue = max(self._largest_queue, self._waiting_bytes)

    def _transmit(self, start: int, end: int, waiting: _Waiting) -> None:
        """Schedule the arrival of a datagram whose transmission takes from start to end."""
        datagram, is_lost, jitter, is_late, has_copy, copy_jitter = waiting
        arrival = max(end + self._delay + jitter, self._last_arrival)
        if not is_late:
            self._last_arrival = arrival
        else:
            arrival += self._late
        if is_lost:
            self._lost += 1
            return
        self._schedule(start, arrival, datagram)
        if has_copy:
            self._duplicated += 1
            self._schedule(start, arrival + copy_jitter, datagram)

    def _schedule(self, start: int, arrival: int, datagram: bytes) -> None:
        if self._outage_starts and self._is_out(start, arrival):
            self._lost += 1
            return
        self._counter += 1  # datagrams of one instant arrive in the order of transmission
        heappush(self._arrivals, (arrival, self._counter, datagram))

    def _is_out(self, start: int, end: int) -> bool:
        """Return whether an outage has a moment in common with the time from start to end, both included."""
        last = bisect_right(self._outage_starts, end) - 1
        return last >= 0 and self._outage_ends[last] > start


def two_way_link(
    forward: LinkSettings, backward: LinkSettings, rng: np.random.Generator
) -> tuple[VirtualLink, VirtualLink]:
    """Make both directions of a link, with independent generators.

    Args:
        forward: Properties from the operator to the robot.
        backward: Properties from the robot to the operator.
        rng: Generator that seeds both.

    Returns:
        The link from the operator to the robot, and the link back.
    """
    return VirtualLink(forward, rng), VirtualLink(backward, rng)


def _nanoseconds(seconds: float) -> int:
    return round(seconds * SECOND)


def _refuse_datagram(datagram: object) -> None:
    require_type(datagram, "datagram", bytes, "pass bytes")
    assert isinstance(datagram, bytes)
    if len(datagram) > MAX_DATAGRAM:
        raise InvalidInput(f"datagram has {len(datagram)} bytes, expected at most {MAX_DATAGRAM}; split it")
