"""A model that grows with a stream, as its kernel reads it: penalties, and one row of numbers a cluster."""

from dataclasses import dataclass, field, fields
from enum import IntEnum

import numpy as np

from pilotfish.types import Array, Float, Int

MAX_VALUE = 1e100  # of a number that is observed: its square must not overflow


class Weighting(IntEnum):
    """What a cluster's weight becomes with every datapoint (5.15, 5.16, and a constant step)."""

    COUNT = 0
    EXPONENTIAL_DECAY = 1
    CONSTANT = 2


@dataclass(frozen=True, slots=True)
class StreamParameters:
    """What decides where a datapoint goes and what it changes; letters are the thesis'.

    forget_below  a cluster whose weight falls below it is forgotten; 0 forgets none
    spare         directions that a subspace remembers beyond its dimension d
    directions    d is at most this
    clusters      there are at most so many: the lightest makes room
    batch         subspaces stay as they are while so many datapoints are assigned
    """

    cluster: float  # lambda
    dimension: float  # lambda_1
    transition: float  # lambda_2
    new_transition: float  # lambda_3
    bandwidth: float  # b_m
    merge_distance: float
    weighting: int
    weight: float  # the discount zeta of a trace, or the constant weight
    forget_below: float
    extra_directions: int
    max_dimension: int
    clusters: int
    batch: int
    numbers: Float[Array, " 13"] = field(init=False, repr=False, compare=False)  # all of the above, in order

    def __post_init__(self) -> None:
        values = [getattr(self, one.name) for one in fields(self) if one.init]
        object.__setattr__(self, "numbers", np.array(values, dtype=np.float64))


class ClusterColumn(IntEnum):
    """What stands in the first columns of a cluster's row; a block for each frame follows."""

    CLUSTER_ID = 0  # in order of birth, never used again
    WEIGHT = 1
    POINTS = 2
    DEMONSTRATION_STARTS = 3  # demonstrations that began in it
    SEGMENTS = 4  # complete ones
    MEAN_DURATION = 5  # their mean length, in steps
    SQUARED_DEVIATIONS = 6  # sum of their squared deviations from it
    CENSORED = 7  # visits cut off by the end of a demonstration
    MEAN_CENSORED_DURATION = 8  # their mean length


class StreamCounter(IntEnum):
    """What is known of the stream as a whole."""

    CURRENT = 0  # row of the last datapoint's cluster, or -1 where a demonstration begins
    STEPS = 1  # how long it has stayed there
    NEXT_CLUSTER_ID = 2  # identity of the next cluster
    POINTS = 3
    PREVIOUS = 4  # row of the cluster whose visit came right before this one; -1 where none did
    PREVIOUS_STEPS = 5  # how long that visit was


@dataclass(frozen=True, slots=True, eq=False)
class StreamState:
    """K clusters, each seen from P frames; a frame's subspace has room for C directions, a multiple of four.

    clusters[k] holds the numbers of StreamColumn, then for each frame, end to end: its dimension d, its
    directions r >= d, its mean, the variances along them (C), mean squared distances to the subspaces of
    their first 0 ... C, and the directions themselves (D x C), orthonormal columns. What lies beyond r is
    zero; mean and distances are filled up with zeros to a multiple of four, so that the kernel works on
    rows as they are. counts[i, j] datapoints in j came right after one in i.
    """

    head: Float[Array, " 6"]
    clusters: Float[Array, "K R"]
    transition_counts: Float[Array, "K K"]
    frames: int
    width: int
    capacity: int

    def blocks(self) -> Float[Array, "K P S"]:
        """The frames' part of the rows. This and all below are views."""
        length = block_length(self.width, self.capacity)
        return self.clusters[:, len(ClusterColumn) :].reshape(len(self.clusters), self.frames, length)

    @property
    def dimensions(self) -> Float[Array, "K P"]:
        return self.blocks()[:, :, 0]

    @property
    def ranks(self) -> Float[Array, "K P"]:
        return self.blocks()[:, :, 1]

    @property
    def means(self) -> Float[Array, "K P D"]:
        return self.blocks()[:, :, 2 : 2 + self.width]

    @property
    def variances(self) -> Float[Array, "K P C"]:
        begin = 2 + round_up_to_four(self.width)
        return self.blocks()[:, :, begin : begin + self.capacity]

    @property
    def distances(self) -> Float[Array, "K P _"]:
        begin = 2 + round_up_to_four(self.width) + self.capacity
        return self.blocks()[:, :, begin : begin + self.capacity + 1]

    @property
    def bases(self) -> Float[Array, "K P D C"]:
        flat = self.blocks()[:, :, block_length(self.width, self.capacity) - self.width * self.capacity :]
        return flat.reshape(*flat.shape[:2], self.width, self.capacity)


def empty_stream(frames: int, width: int) -> StreamState:
    """Before the first datapoint."""
    return zero_stream(0, frames, width, 0)


def zero_stream(clusters: int, frames: int, width: int, capacity: int) -> StreamState:
    """A state of so many clusters, all zeros, where a demonstration begins."""
    rows = np.zeros((clusters, stream_row_length(frames, width, capacity)))
    transition_counts = np.zeros((clusters, clusters))
    return StreamState(empty_counters(), rows, transition_counts, frames, width, capacity)


def empty_counters() -> Float[Array, " 6"]:
    return np.array([-1.0, 0.0, 0.0, 0.0, -1.0, 0.0])


def round_up_to_four(size: int) -> int:
    """The least multiple of four that is not less."""
    return (size + 3) // 4 * 4


def stream_row_length(frames: int, width: int, capacity: int) -> int:
    return len(ClusterColumn) + frames * block_length(width, capacity)


def block_length(width: int, capacity: int) -> int:
    return 2 + round_up_to_four(width) + capacity + (capacity + 4) + width * capacity


@dataclass(frozen=True, slots=True, eq=False)
class StreamStep:
    """What N datapoints made of a model.

    identities  the cluster that took each
    costs       what its assignment cost (5.26-5.28)
    changes     how the loss at it changed with its update: never more than 0, but for rounding
    gone        a row for each cluster that is no more: at which datapoint, its identity, and the identity
                that it was merged into, or -1 when it was forgotten
    """

    state: StreamState
    cluster_ids: Int[Array, " N"]
    costs: Float[Array, " N"]
    loss_changes: Float[Array, " N"]
    removed: Int[Array, "M 3"]
