"""How states follow one another: not at all, as a Markov chain, or as a semi-Markov chain with durations."""

from dataclasses import dataclass

import numpy as np

from pilotfish.models.durations.values import Durations
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import require_type


@dataclass(frozen=True, slots=True, eq=False)
class MixtureWeights:
    """No dynamics: every datapoint draws its state anew with these probabilities (a mixture)."""

    weights: Float[Array, " K"]


@dataclass(frozen=True, slots=True, eq=False)
class MarkovChain:
    """transitions[i, j] is the probability of state j one step after state i; rows sum to one."""

    initial: Float[Array, " K"]
    transitions: Float[Array, "K K"]


@dataclass(frozen=True, slots=True)
class Censoring:
    """What recordings cut off.

    first  a recording begins inside a visit, of which only the rest was seen; else it begins with a visit
    last   a recording may end inside a visit, of which only the beginning was seen; else it ends with one
    """

    left: bool = False
    right: bool = True

    def __post_init__(self) -> None:
        for name in ("left", "right"):
            require_type(getattr(self, name), name, (bool, np.bool_), "give True or False")


RIGHT_CENSORED = Censoring()


@dataclass(frozen=True, slots=True, eq=False)
class SemiMarkovChain:
    """transitions[i, j] is the probability that a visit to j follows a visit to i.

    The diagonal is zero. A row of zeros is a final state: once there, the skill stays. initial says which
    state the first step is in; whether a visit begins with it, or goes on, censoring says.
    """

    initial: Float[Array, " K"]
    transitions: Float[Array, "K K"]
    durations: Durations
    censoring: Censoring = RIGHT_CENSORED


Dynamics = MixtureWeights | MarkovChain | SemiMarkovChain


def final_states(chain: SemiMarkovChain) -> Bool[Array, " K"]:
    """Whether a state is never left."""
    return np.asarray(~chain.transitions.any(axis=1))
