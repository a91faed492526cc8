"""Sums of smooth functions over all whole steps s = 1, 2, ..., evaluated at a few hundred of them.

Heavy-tailed duration distributions reach far beyond the recordings, up to 2^40 steps here. Sums take steps
one by one up to a power of two and as long as a distribution is narrow. Beyond, every octave is divided into
four blocks of equally spaced steps. Gauss quadrature for the discrete uniform measure (Gram-Chebyshev
polynomials) sums a block with 32 nodes exactly for polynomials of degree 63. The last octaves are left out
where they hold less than e^-36 of the sum.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import shorten_repr

MAX_TERMS = 2**22  # single steps times states; an array of them takes 32 MiB
MAX_CACHED = 16  # quadratures of at most 2^16 single steps are cached

LogWeights = Callable[[Float[Array, " S"]], Float[Array, "S K"]]

LOG_NEGLIGIBLE = -36.0  # log of the relative weight that sums may leave out
NODES = 32  # of a block
MAX_LOG_CHANGE = 60.0  # nats within a block; a larger change is summed step by step
MIN_EXPONENT, MAX_EXPONENT = 7, 40  # no block begins before step 2^7, none ends after 2^40
BLOCKS_PER_OCTAVE = 4  # blocks between a power of two and the next, of equal length


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Quadrature:
    """Nodes and weights of a sum over s = 1, 2, ...

    Attributes:
        steps: Nodes; the first `single_steps` are s = 1, 2, ..., later ones lie between whole numbers.
        log_counts: Log of the weight of each node: the number of whole steps that it stands for.
        single_steps: Number of steps that are summed one by one.
    """

    steps: Float[Array, " N"]
    log_counts: Float[Array, " N"]
    single_steps: int


def make_quadrature(log_weights: LogWeights, max_duration: int) -> Quadrature:
    """Choose nodes that sum the weights, s^2 times them, and their tails to a relative error of 1e-12.

    Args:
        log_weights: Unnormalised log-probabilities of all states.
        max_duration: Tails from s = 1 .. max_duration are summed; these steps are single steps.

    Raises:
        InvalidInput: If a distribution is so narrow so far beyond max_duration that the single steps up to
            it do not fit in memory.
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
            f"durations of {states} states reach {2**single_steps} steps and are too narrow to be summed in "
            f"blocks, expected at most {MAX_TERMS // states} steps; use a longer period"
        )


def _is_decaying(octaves: Float[Array, "E 2 B K"]) -> Bool[Array, "2 B K"]:
    """Return whether weights fall as s^-3 or faster at the end of an octave: its tail is smaller."""
    return np.asarray(octaves[-1] - octaves[BLOCKS_PER_OCTAVE // 2] <= -3.0 * np.log(4.0 / 3.0))


def _last_true(flags: Bool[Array, " B"]) -> int:
    indices = np.flatnonzero(flags)
    return int(indices[-1]) if len(indices) else -1


def single_step_quadrature(max_duration: int) -> Quadrature:
    """Return the steps 1 .. max_duration, for distributions with bounded support."""
    return Quadrature(np.arange(1.0, max_duration + 1.0), np.zeros(max_duration), max_duration)


@cache
def _cached_block_quadrature(begin: int, end: int) -> Quadrature:
    """Return the same as `_block_quadrature`; long quadratures are not cached, to save memory."""
    return _block_quadrature(begin, end)


def _block_quadrature(begin: int, end: int) -> Quadrature:
    """Return single steps up to 2^begin, then blocks up to 2^end."""
    steps, log_counts = [np.arange(1.0, 2.0**begin + 1.0)], [np.zeros(2**begin)]
    for n in range(begin, end):
        length = 2**n // BLOCKS_PER_OCTAVE
        nodes, weights = gauss_nodes(length)
        steps += [2.0**n + part * length + nodes for part in range(BLOCKS_PER_OCTAVE)]
        log_counts += [np.log(weights)] * BLOCKS_PER_OCTAVE
    return Quadrature(np.concatenate(steps), np.concatenate(log_counts), 2**begin)


@cache
def gauss_nodes(length: int) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """Compute nodes and weights that sum polynomials up to degree 63 over 1 .. length exactly.

    Source:
        Golub & Welsch 1969, for the polynomials of Chebyshev 1864 and Gram 1883.
    """
    n = np.arange(1.0, NODES)
    off_diagonal = 0.5 * n * np.sqrt((length**2 - n**2) / (4.0 * n**2 - 1.0))
    nodes, vectors = np.linalg.eigh(np.diag(off_diagonal, 1) + np.diag(off_diagonal, -1))
    return nodes + 0.5 * (length + 1), length * vectors[0] ** 2
