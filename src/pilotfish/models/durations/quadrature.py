"""Sums over all whole steps s = 1, 2, ... of smooth laws, from a few hundred of them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Bool, Float

MAX_TERMS = 2**22  # steps that are summed one by one, times states; an array of them takes 32 MiB
MAX_CACHED = 16  # rules of at most 2^16 steps one by one are kept

LogWeights = Callable[[Float[Array, " S"]], Float[Array, "S K"]]

LOG_NEGLIGIBLE = -36.0  # log of the share of a law that sums may leave out
NODES = 32  # that stand for a block of steps
MAX_LOG_CHANGE = 60.0  # nats; a law that differs by more within a block is summed step by step there
MIN_EXPONENT, MAX_EXPONENT = 7, 40  # no block begins before step 2^7, none ends after 2^40
BLOCKS_PER_OCTAVE = 4  # blocks between a power of two and the next, of equal length


@dataclass(frozen=True, slots=True, eq=False)
class Quadrature:
    """Steps s, and logarithms of how many whole steps each of them stands for.

    The first `whole` are s = 1 ... whole, each for itself; later ones lie between whole numbers.
    """

    steps: Float[Array, " N"]
    log_counts: Float[Array, " N"]
    single_steps: int


def make_quadrature(log_weights: LogWeights, max_duration: int) -> Quadrature:
    """A rule that sums the laws, their squares of s, and their tails from any step up to longest, to 1e-12.

    Steps are taken one by one up to longest, and on as long as any law is narrow; from there on blocks,
    four to each power of two, are summed by Gauss's rule for equally spaced points: exact for polynomials
    of degree 63, where the density of a law, smooth within a block, is no different.
    Raises: InvalidInput, when a law is so narrow so far beyond longest that the steps up to there, taken one
    by one, would not fit in memory.
    """
    first = max(MIN_EXPONENT, int(max_duration - 1).bit_length())
    edges = np.append(
        np.outer(
            2.0 ** np.arange(first, MAX_EXPONENT), 1.0 + np.arange(BLOCKS_PER_OCTAVE) / BLOCKS_PER_OCTAVE
        ),
        2.0**MAX_EXPONENT,
    )
    at = np.append(edges, float(max_duration))
    log_w = log_weights(at)  # (4 B + 2, K)
    log_w = np.stack([log_w, log_w + 2.0 * np.log(at)[:, None]])  # of squares too
    reference = log_w.max(axis=1)[:, None]
    ends = log_w[:, :-1]
    B = MAX_EXPONENT - first
    octaves = np.stack(
        [ends[:, n : n + BLOCKS_PER_OCTAVE * B : BLOCKS_PER_OCTAVE] for n in range(BLOCKS_PER_OCTAVE + 1)]
    )  # (PARTS + 1, 2, B, K)
    log_length = np.log(edges[:-1:BLOCKS_PER_OCTAVE])[:, None]
    small = ((octaves.max(axis=0) + log_length <= reference + LOG_NEGLIGIBLE) & _is_decaying(octaves)).all(
        axis=0
    )
    changes = np.abs(np.diff(ends[0], axis=0)).reshape(-1, BLOCKS_PER_OCTAVE, ends.shape[2]).max(axis=1)
    rough = (changes > MAX_LOG_CHANGE) & ~small  # (B, K)
    begin = _last_true(rough.any(axis=1)) + 1
    end = max(begin, _last_true(~small.all(axis=1)) + 1)
    if begin:
        _validate_length(first + begin, log_w.shape[2])
    make = _cached_block_quadrature if first + begin <= MAX_CACHED else _block_quadrature
    return make(first + begin, first + end)


def _validate_length(single_steps: int, states: int) -> None:
    if 2**single_steps * states > MAX_TERMS:
        raise InvalidInput(
            f"durations of {states} states reach {2**single_steps} steps and are too narrow there to be summed in "
            f"blocks, expected at most {MAX_TERMS // states} steps; use a longer period"
        )


def _is_decaying(octaves: Float[Array, "E 2 B K"]) -> Bool[Array, "2 B K"]:
    """Whether what lies beyond an octave is no more than it holds: falling at its end as s^-3 or faster."""
    return np.asarray(octaves[-1] - octaves[BLOCKS_PER_OCTAVE // 2] <= -3.0 * np.log(4.0 / 3.0))


def _last_true(those: Bool[Array, " B"]) -> int:
    where = np.flatnonzero(those)
    return int(where[-1]) if len(where) else -1


def single_step_quadrature(max_duration: int) -> Quadrature:
    """For laws under which nothing lasts longer."""
    return Quadrature(np.arange(1.0, max_duration + 1.0), np.zeros(max_duration), max_duration)


@cache
def _cached_block_quadrature(begin: int, end: int) -> Quadrature:
    """Return the rule that was made before; long ones would fill the memory."""
    return _block_quadrature(begin, end)


def _block_quadrature(begin: int, end: int) -> Quadrature:
    """One by one up to 2^begin, then blocks up to 2^end."""
    steps, counts = [np.arange(1.0, 2.0**begin + 1.0)], [np.ones(2**begin)]
    for n in range(begin, end):
        length = 2**n // BLOCKS_PER_OCTAVE
        nodes, weights = gauss_nodes(length)
        steps += [2.0**n + part * length + nodes for part in range(BLOCKS_PER_OCTAVE)]
        counts += [weights] * BLOCKS_PER_OCTAVE
    return Quadrature(np.concatenate(steps), np.log(np.concatenate(counts)), 2**begin)


@cache
def gauss_nodes(length: int) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """Nodes and weights whose weighted sum is that over 1 ... length of any polynomial of degree 63 or less.

    Source: Golub and Welsch 1969, for the polynomials of Chebyshev 1864 and Gram 1883, orthogonal on them.
    """
    n = np.arange(1.0, NODES)
    use_free_name = 0.5 * n * np.sqrt((length**2 - n**2) / (4.0 * n**2 - 1.0))
    nodes, vectors = np.linalg.eigh(np.diag(use_free_name, 1) + np.diag(use_free_name, -1))
    return nodes + 0.5 * (length + 1), length * vectors[0] ** 2
