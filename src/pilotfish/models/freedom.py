"""How many numbers of a learned skill were free for the data to choose."""

from dataclasses import fields

import numpy as np

from pilotfish.gaussians import Structure
from pilotfish.models.duration_laws import DurationLaw
from pilotfish.models.durations import HistogramDurations
from pilotfish.models.dynamics import Dynamics, MarkovChain, SemiMarkovChain, Weights, final_states
from pilotfish.models.size import covariance_freedom
from pilotfish.models.skill import Skill
from pilotfish.types import Array, Float


def free_parameters(skill: Skill, structure: Structure, law: DurationLaw | None = None) -> int:
    """Degrees of freedom of all that was learned: means, covariances, probabilities and durations.

    Of every frame: the means, three numbers for an orientation of S^3, and what the structure leaves free,
    shared directions once. Of the dynamics, as free_dynamics says.
    """
    P, K, _ = map(int, skill.means.shape)
    tangents = int(skill.covariances[0].dense.shape[-1])
    gaussians = P * K * tangents + covariance_freedom(structure, skill.covariances)
    return gaussians + free_dynamics(skill.dynamics, law)


def free_dynamics(dynamics: Dynamics, law: DurationLaw | None = None) -> int:
    """Degrees of freedom of how states follow one another, and of how long they last.

    Of probabilities that sum to one, one is not free. A probability of zero counts as known beforehand: a
    left-right start allows only what it shows, and expectation-maximisation never makes the rest possible.
    Durations of final states, which are never left, say nothing and count nothing. law is the family that
    they were learned in, for one that holds some of them, as NegativeBinomial(1.0) does; else all count.
    """
    match dynamics:
        case Weights():
            return _free(dynamics.weights[None])
        case MarkovChain():
            return _free(dynamics.initial[None]) + _free(dynamics.transitions)
        case SemiMarkovChain():
            chain = _free(dynamics.initial[None]) + _free(dynamics.transitions)
            return chain + _free_durations(dynamics, law)


def _free(rows: Float[Array, "R C"]) -> int:
    """Possible entries, less one in each row that sums to one; a row of zeros has none."""
    possible = np.count_nonzero(rows, axis=1)
    return int(np.maximum(possible - 1, 0).sum())


def _free_durations(chain: SemiMarkovChain, law: DurationLaw | None) -> int:
    left = ~final_states(chain)
    if isinstance(chain.durations, HistogramDurations):
        return _free(chain.durations.probabilities.T[left])
    states = int(left.sum())
    return law.parameter_count(states, 1) if law else len(fields(chain.durations)) * states
