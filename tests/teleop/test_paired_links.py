"""Runs of a virtual link with equal seeds are paired: a setting changes only what it concerns."""

from dataclasses import replace
from math import inf

import numpy as np

from pilotfish.teleop import LinkSettings, VirtualLink, two_way_link

PERIOD, LAST = 20 * 10**6, 10**15  # ns
FAULTY = LinkSettings(
    delay=0.2, jitter=0.05, loss=0.2, mean_burst=3.0, duplication=0.1, reordering=0.1, rate=256e3
)


def name(n: int, size: int = 4) -> bytes:
    return n.to_bytes(4, "big").ljust(size, b".")


def arrivals(link: VirtualLink) -> list[tuple[int, int]]:
    """Return the number and the time of arrival of everything in transit; it looks into the link."""
    link._advance(LAST)
    return [(int.from_bytes(datagram[:4], "big"), time) for time, _, datagram in sorted(link._arrivals)]


def run(settings: LinkSettings, sizes: np.ndarray, seed: int = 3) -> list[tuple[int, int]]:
    link = VirtualLink(settings, np.random.default_rng(seed))
    for n, size in enumerate(sizes):
        link.send(n * PERIOD, name(n, int(size)), priority=n % 3)
    return arrivals(link)


def test_equal_seeds_give_equal_arrivals_and_others_differ(rng):
    sizes = rng.integers(50, 900, 2000)
    assert run(FAULTY, sizes) == run(FAULTY, sizes)
    assert run(FAULTY, sizes) != run(FAULTY, sizes, seed=4)


def test_faults_of_a_datagram_do_not_depend_on_sizes_or_rates(rng):
    """Lost datagrams and copies are the same ones; without a queue the delays are equal too."""
    small, large = np.full(2000, 50), rng.integers(50, 400, 2000)
    runs = [run(FAULTY, small), run(FAULTY, large), run(replace(FAULTY, rate=inf), small)]
    assert sorted(n for n, _ in runs[0]) == sorted(n for n, _ in runs[1]) == sorted(n for n, _ in runs[2])
    unlimited = replace(FAULTY, rate=inf)
    assert run(unlimited, small) == run(unlimited, large)


def test_faults_of_a_datagram_do_not_depend_on_outages_or_other_probabilities():
    sizes = np.full(2000, 50)
    clean = replace(FAULTY, rate=inf, reordering=0.0, jitter=0.0)
    kept = {n for n, _ in run(clean, sizes)}
    others = (
        replace(clean, jitter=0.01), replace(clean, reordering=0.5), replace(clean, duplication=0.9),
        replace(clean, delay=2.0),
    )  # fmt: skip
    for other in others:
        assert {n for n, _ in run(other, sizes)} == kept
    with_outage = {n for n, _ in run(replace(clean, outages=((10.0, 2.0),)), sizes)}
    assert with_outage == {n for n in kept if not 490 <= n < 600}


def test_more_loss_loses_a_superset():
    sizes = np.full(2000, 50)
    kept = [{n for n, _ in run(LinkSettings(loss=loss), sizes)} for loss in (0.05, 0.1, 0.3)]
    assert kept[0] > kept[1] > kept[2]


def test_directions_are_independent_and_take_two_numbers(rng):
    settings = LinkSettings(loss=0.5)
    other = np.random.default_rng(rng.integers(2**32))
    before = other.bit_generator.state
    forward, backward = two_way_link(settings, settings, other)
    for n in range(200):
        forward.send(n, name(n))
        backward.send(n, name(n))
    assert forward.receive(LAST) != backward.receive(LAST)
    again = np.random.default_rng(0)
    again.bit_generator.state = before
    again.integers(2**63, size=2)
    assert again.bit_generator.state == other.bit_generator.state
