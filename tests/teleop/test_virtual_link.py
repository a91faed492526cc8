"""Faults of a virtual link have the frequencies and times that its settings state, and are paired by seed."""

import itertools
from dataclasses import replace
from math import inf, sqrt
from typing import Any

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.teleop import LinkSettings, VirtualLink, two_way_link

MS, SECOND = 10**6, 10**9  # ns
PERIOD = 20 * MS
LAST = 10**6 * SECOND
FAULTY = LinkSettings(
    delay=0.2, jitter=0.05, loss=0.2, mean_burst=3.0, duplication=0.1, reordering=0.1, rate=256e3
)


def name(n: int, size: int = 4) -> bytes:
    return n.to_bytes(4, "big").ljust(size, b".")


def number(datagram: bytes) -> int:
    return int.from_bytes(datagram[:4], "big")


def arrivals(link: VirtualLink, count: int, period: int = PERIOD, size: int = 4) -> list[tuple[int, int]]:
    """Send datagrams periodically; return the number of each that arrived, and its time of arrival [ns]."""
    for n in range(count):
        link.send(n * period, name(n, size))
    return drain(link)


def drain(link: VirtualLink) -> list[tuple[int, int]]:
    """Return the number and the time of arrival of everything in transit; it looks into the link."""
    link._advance(LAST)
    found = [(number(datagram), time) for time, _, datagram in sorted(link._arrivals)]
    assert [n for n, _ in found] == [number(datagram) for datagram in link.receive(LAST)]
    return found


def require_balance(link: VirtualLink) -> None:
    c = link.counters
    assert c.sent + c.duplicated == c.delivered + c.lost + c.dropped + c.in_transit


# ------------------------------------------------------------------------------------------------ no fault


def test_link_without_faults_delivers_at_once_in_order(rng):
    link = VirtualLink(LinkSettings(), rng)
    for n in range(5):
        link.send(7, name(n))
    assert [number(d) for d in link.receive(7)] == list(range(5))
    assert link.receive(7) == []
    assert link.counters.bytes_sent == 5 * (4 + 28)


def test_delay_arrival_is_exact_after_a_day(rng):
    link = VirtualLink(LinkSettings(delay=0.1), rng)
    sent = 86_400 * SECOND + 1
    link.send(sent, b"a")
    assert link.receive(sent + 100 * MS - 1) == []
    assert link.receive(sent + 100 * MS) == [b"a"]


# ------------------------------------------------------------------------------------------------ loss


@pytest.mark.parametrize(("loss", "burst"), [(0.05, 1.0), (0.3, 1.0), (0.05, 4.0), (0.3, 2.0), (0.3, 10.0)])
def test_loss_rate_and_mean_burst_equal_settings(rng, loss: float, burst: float):
    """Within four standard deviations; losses of the chain are correlated by 1 - 1/b - p/(1-p)/b."""
    count = 40_000
    lost = np.ones(count, dtype=bool)
    lost[[n for n, _ in arrivals(VirtualLink(LinkSettings(loss=loss, mean_burst=burst), rng), count)]] = False
    correlation = 0.0 if burst == 1.0 else 1.0 - 1.0 / burst - loss / (1.0 - loss) / burst
    deviation = sqrt(loss * (1 - loss) / count * (1 + correlation) / (1 - correlation))
    assert abs(lost.mean() - loss) < 4 * deviation
    lengths = np.array([sum(1 for _ in run) for is_lost, run in itertools.groupby(lost) if is_lost])
    mean = 1.0 / (1.0 - loss) if burst == 1.0 else burst  # of a geometric distribution
    assert abs(lengths.mean() - mean) < 4 * sqrt(mean * (mean - 1) / len(lengths))


def test_first_datagram_is_lost_with_the_stationary_probability(rng):
    """A chain that begins in the good state would lose one tenth of this."""
    settings, count = LinkSettings(loss=0.3, mean_burst=20.0), 2000
    lost = count - sum(len(arrivals(VirtualLink(settings, rng), 1)) for _ in range(count))
    assert abs(lost / count - 0.3) < 4 * sqrt(0.3 * 0.7 / count)


@pytest.mark.parametrize(("loss", "delivered"), [(0.0, 1000), (1.0, 0)])
def test_loss_of_zero_and_one_is_certain(rng, loss: float, delivered: int):
    link = VirtualLink(LinkSettings(loss=loss), rng)
    assert len(arrivals(link, 1000)) == delivered
    assert link.counters.lost == 1000 - delivered


# ------------------------------------------------------------------------------------------------ delay


def test_jitter_is_uniform(rng):
    """Kolmogorov-Smirnov: the largest distance of the distributions exceeds 1.95 / sqrt(n) once in 1000."""
    link = VirtualLink(LinkSettings(delay=0.5, jitter=0.015), rng)
    found = arrivals(link, 5000)
    added = np.sort([time - n * PERIOD - 500 * MS for n, time in found]) / (15 * MS)
    distance = np.abs(added - np.arange(1, 5001) / 5000).max()
    assert added[0] >= 0
    assert added[-1] <= 1
    assert distance < 1.95 / sqrt(5000)


def test_jitter_beyond_the_period_keeps_order_and_largest_delay(rng):
    found = arrivals(VirtualLink(LinkSettings(delay=0.1, jitter=0.2), rng), 3000)
    assert [n for n, _ in found] == list(range(3000))
    assert all(100 * MS <= time - n * PERIOD <= 300 * MS for n, time in found)


def test_reordering_fraction_is_overtaken_by_the_additional_delay(rng):
    """A late datagram is overtaken by the two that are sent within 50 ms."""
    count = 20_000
    found = arrivals(VirtualLink(LinkSettings(delay=0.1, reordering=0.1), rng), count)
    added = np.array([time - n * PERIOD - 100 * MS for n, time in found])
    assert set(added) == {0, 50 * MS}
    assert abs((added > 0).mean() - 0.1) < 4 * sqrt(0.1 * 0.9 / count)
    late = [index for index, value in enumerate(added) if value]
    assert sum(found[index - 1][0] > found[index][0] for index in late) > 0.8 * len(late)


def test_duplication_fraction_has_a_second_copy(rng):
    count = 20_000
    link = VirtualLink(LinkSettings(delay=0.1, duplication=0.1, jitter=0.01), rng)
    found = arrivals(link, count)
    copies = len(found) - count
    assert link.counters.duplicated == copies
    assert abs(copies / count - 0.1) < 4 * sqrt(0.1 * 0.9 / count)
    counts = np.bincount([n for n, _ in found])
    assert set(counts) == {1, 2}
    assert all(time - n * PERIOD <= 120 * MS for n, time in found)
    require_balance(link)


# --------------------------------------------------------------------------------------------- rate and queue


def test_overload_throughput_equals_the_rate(rng):
    """Every 10 ms 1000 bytes are offered, 800 kbit/s; the link carries 256 kbit/s."""
    link, received = VirtualLink(LinkSettings(rate=256e3, queue=20_000), rng), 0
    for n in range(6000):
        link.send(n * 10 * MS, bytes(972))
        received += sum(len(d) + 28 for d in link.receive(n * 10 * MS))
    assert (
        abs(received * 8 / 60.0 - 256e3) < 2 * 8 * 1000 / 60.0
    )  # two datagrams: at the start and at the end
    assert 19_000 < link.counters.largest_queue <= 20_000
    assert link.counters.dropped > 3000
    require_balance(link)


def test_transmission_takes_the_time_of_all_bytes(rng):
    """1000 bytes with headers at 8 kbit/s take one second each, one after the other."""
    link = VirtualLink(LinkSettings(rate=8000.0, delay=0.5, header=40), rng)
    for n in range(3):
        link.send(0, name(n, 960))
    assert drain(link) == [(0, 1500 * MS), (1, 2500 * MS), (2, 3500 * MS)]


def test_idle_link_transmits_at_once_after_a_pause(rng):
    link = VirtualLink(LinkSettings(rate=8000.0, header=0), rng)
    link.send(0, name(0, 1000))
    link.send(10 * SECOND, name(1, 1000))
    assert drain(link) == [(0, SECOND), (1, 11 * SECOND)]


@pytest.mark.parametrize(("size", "kept"), [(999, 2), (1000, 2), (1001, 1)])
def test_full_queue_drops_the_newest(rng, size: int, kept: int):
    """2000 bytes may wait: two of 1000, while a first one is transmitted."""
    link = VirtualLink(LinkSettings(rate=8000.0, queue=2000, header=0), rng)
    link.send(0, name(9, 100))
    for n in range(4):
        link.send(1, name(n, size))
    assert [n for n, _ in drain(link)] == [9, *range(kept)]
    assert link.counters.dropped == 4 - kept
    assert link.counters.largest_queue == kept * size


def test_datagram_larger_than_the_queue_is_dropped_alone(rng):
    link = VirtualLink(LinkSettings(rate=8000.0, queue=1000, header=28), rng)
    link.send(0, name(0, 500), priority=3)
    link.send(0, name(1, 973), priority=0)
    assert [n for n, _ in drain(link)] == [0]
    link.send(LAST, name(2, 972))
    assert link.counters.dropped == 1


def test_stop_overtakes_waiting_pictures_but_not_the_one_in_transmission(rng):
    link = VirtualLink(LinkSettings(rate=8000.0, header=0), rng)
    for n in range(3):
        link.send(0, name(n, 1000), priority=3)
    link.send(500 * MS, name(7, 100), priority=1)
    link.send(500 * MS, name(8, 100), priority=0)
    assert drain(link) == [
        (0, 1000 * MS), (8, 1100 * MS), (7, 1200 * MS), (1, 2200 * MS), (2, 3200 * MS),
    ]  # fmt: skip


def test_datagrams_of_one_instant_leave_by_priority(rng):
    link = VirtualLink(LinkSettings(rate=8000.0, header=0), rng)
    for n in range(8):
        link.send(5, name(n, 100), priority=7 - n)
    assert [n for n, _ in drain(link)] == [7, 6, 5, 4, 3, 2, 1, 0]


def test_stop_displaces_pictures_from_a_full_queue(rng):
    link = VirtualLink(LinkSettings(rate=8000.0, queue=2000, header=0), rng)
    link.send(0, name(0, 1000), priority=3)
    for n in (1, 2):
        link.send(1, name(n, 1000), priority=3)
    link.send(2, name(3, 100), priority=0)
    assert [n for n, _ in drain(link)] == [0, 3, 1]
    assert link.counters.dropped == 1
    assert link.counters.largest_queue == 2000


# ------------------------------------------------------------------------------------------------ outages


def test_outage_loses_what_is_sent_in_flight_or_would_arrive(rng):
    """With a delay of 1 s and an outage from 10 to 12 s, what is sent from 9 to 12 s is lost."""
    link = VirtualLink(LinkSettings(delay=1.0, outages=((10.0, 2.0), (20.0, 0.5))), rng)
    found = {n for n, _ in arrivals(link, 300, period=100 * MS)}
    assert set(range(300)) - found == {*range(90, 120), *range(190, 205)}
    require_balance(link)


def test_outage_within_the_flight_loses_the_datagram(rng):
    """The outage is over before it would arrive."""
    link = VirtualLink(LinkSettings(delay=2.0, outages=((1.0, 0.1),)), rng)
    assert [n for n, _ in arrivals(link, 4, period=600 * MS)] == [2, 3]


def test_queue_empties_into_an_outage(rng):
    link = VirtualLink(LinkSettings(rate=8000.0, header=0, outages=((1.5, 2.0),)), rng)
    for n in range(6):
        link.send(0, name(n, 1000))
    assert drain(link) == [(0, 1 * SECOND), (4, 5 * SECOND), (5, 6 * SECOND)]


def test_datagram_sent_in_an_outage_is_lost_even_if_it_would_wait_until_the_end(rng):
    """The first one is transmitted until 4 s and lost too; the second one would follow at 4 s."""
    link = VirtualLink(LinkSettings(rate=8000.0, header=0, outages=((3.0, 0.5),)), rng)
    link.send(2 * SECOND, name(0, 2000))
    link.send(3100 * MS, name(1, 100))
    link.send(3500 * MS, name(2, 100))
    assert drain(link) == [(2, 4100 * MS)]
    assert link.counters.lost == 2


@pytest.mark.parametrize("silent", [0, 1])
def test_outage_of_one_direction_leaves_the_other(rng, silent: int):
    settings = [LinkSettings(delay=0.1), LinkSettings(delay=0.1)]
    settings[silent] = LinkSettings(delay=0.1, outages=((0.0, 10.0),))
    links = two_way_link(settings[0], settings[1], rng)
    counts = [len(arrivals(link, 100)) for link in links]
    assert counts[silent] == 0
    assert counts[1 - silent] == 100


def test_copies_lost_in_an_outage_are_counted(rng):
    settings = LinkSettings(delay=0.1, jitter=0.3, duplication=1.0, outages=((1.0, 0.2), (3.0, 0.1)))
    link = VirtualLink(settings, rng)
    arrivals(link, 300)
    assert link.counters.lost > 0
    require_balance(link)


# ------------------------------------------------------------------------------------------------ arguments


def test_long_run_keeps_only_what_is_in_transit(rng):
    """Eight virtual minutes with faults: what is in transit is bounded by delay and queue."""
    link, largest, delivered = VirtualLink(replace(FAULTY, outages=((100.0, 10.0),)), rng), 0, 0
    for n in range(25_000):
        link.send(n * PERIOD, b"x" * 100, priority=n % 8)
        delivered += len(link.receive(n * PERIOD))
        largest = max(largest, link.counters.in_transit) if n % 100 == 0 else largest
    assert largest < 40
    assert link.counters.delivered == delivered
    require_balance(link)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"delay": -0.1}, "delay is -0.1"),
        ({"delay": "1"}, "delay is '1', expected a number"),
        ({"jitter": np.nan}, "jitter is nan"),
        ({"loss": 1.1}, "loss is 1.1"),
        ({"duplication": -1}, "duplication"),
        ({"reordering": 2}, "reordering"),
        ({"reordering_delay": inf}, "reordering_delay"),
        ({"loss": 0.5, "mean_burst": 1.5}, "expected at least 2, .* pass 1 for independent"),
        ({"loss": 1.0, "mean_burst": 5.0}, "expected at least infinity"),
        ({"mean_burst": 0.5}, "mean_burst is 0.5"),
        ({"rate": 0.0}, "rate is 0.0"),
        ({"queue": 0}, "queue is 0"),
        ({"queue": 1.5}, "queue is 1.5, expected a whole number"),
        ({"header": -1}, "header is -1"),
        ({"outages": [(1.0, 2.0)]}, "outages has type list"),
        ({"outages": (1.0,)}, r"outages\[0\] has type float"),
        ({"outages": ((1.0, 2.0, 3.0),)}, r"outages\[0\] is .*expected \(start, duration\)"),
        ({"outages": ((1.0, -2.0),)}, r"the duration of outages\[0\]"),
        ({"outages": ((1.0, 2.0), (2.5, 1.0))}, r"outages\[1\] starts at 2.5 s, expected at least 3 s"),
    ],
)
def test_settings_out_of_range_are_refused(settings: dict[str, Any], message: str):
    with pytest.raises(InvalidInput, match=message):
        LinkSettings(**settings)


def test_mean_burst_of_independent_losses_is_accepted(rng):
    link = VirtualLink(LinkSettings(loss=0.2, mean_burst=1.25), rng)
    assert abs(len(arrivals(link, 10_000)) / 10_000 - 0.8) < 4 * sqrt(0.2 * 0.8 / 10_000)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((4, b""), "time_ns is 4, expected a whole number from 5"),
        ((5.0, b""), "time_ns is 5.0"),
        ((2**63, b""), "time_ns"),
        ((5, "text"), "datagram has type str"),
        ((5, bytearray(3)), "datagram has type bytearray"),
        ((5, bytes(65_508)), "datagram has 65508 bytes, expected at most 65507"),
        ((5, b"", 8), "priority is 8"),
        ((5, b"", -1), "priority is -1"),
        ((5, b"", 0.0), "priority is 0.0"),
    ],
)
def test_send_invalid_argument_is_refused_and_not_counted(rng, arguments: tuple[Any, ...], message: str):
    link = VirtualLink(LinkSettings(rate=1e6), rng)
    link.receive(5)
    with pytest.raises(InvalidInput, match=message):
        link.send(*arguments)
    assert link.counters.sent == 0


def test_receive_at_an_earlier_time_is_refused(rng):
    link = VirtualLink(LinkSettings(), rng)
    link.send(5, b"a")
    with pytest.raises(InvalidInput, match="time_ns is 4"):
        link.receive(4)
    assert link.receive(5) == [b"a"]


@pytest.mark.usefixtures("unchecked")
def test_link_arguments_of_other_types_are_refused(rng):
    with pytest.raises(InvalidInput, match="settings has type dict"):
        VirtualLink({}, rng)
    with pytest.raises(InvalidInput, match="rng has type int"):
        VirtualLink(LinkSettings(), 3)
