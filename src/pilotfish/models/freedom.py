"""How many numbers of a learned skill were free for the data to choose."""

from dataclasses import fields

import numpy as np

from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models.durations.distributions import DurationDistribution
from pilotfish.models.durations.values import HistogramDurations
from pilotfish.models.dynamics import Dynamics, MarkovChain, MixtureWeights, SemiMarkovChain, final_states
from pilotfish.models.size import covariance_degrees_of_freedom
from pilotfish.models.skill import Skill
from pilotfish.types import Array, Float


def degrees_of_freedom(
    skill: Skill, structure: CovarianceStructure, distribution: DurationDistribution | None = None
) -> int:
    """Degrees of freedom of all that was learned: means, covariances, probabilities and durations.

    Of every frame: the means, three numbers for an orientation of S^3, and what the structure leaves free,
    shared directions once. Of the dynamics, as free_dynamics says.
    """
    P, K, _ = map(int, skill.means.shape)
    tangent_dimension = int(skill.covariances[0].dense.shape[-1])
    gaussians = P * K * tangent_dimension + covariance_degrees_of_freedom(structure, skill.covariances)
    return gaussians + dynamics_degrees_of_freedom(skill.dynamics, distribution)


def dynamics_degrees_of_freedom(dynamics: Dynamics, distribution: DurationDistribution | None = None) -> int:
    """Degrees of freedom of how states follow one another, and of how long they last.

    Of probabilities that sum to one, one is not free. A probability of zero counts as known beforehand: a
    left-right start allows only what it shows, and expectation-maximisation never makes the rest possible.
    Durations of final states, which are never left, say nothing and count nothing. law is the family that
    they were learned in, for one that holds some of them, as NegativeBinomial(1.0) does; else all count.
    """
    match dynamics:
        case MixtureWeights():
            return _free_probabilities(dynamics.weights[None])
        case MarkovChain():
            return _free_probabilities(dynamics.initial[None]) + _free_probabilities(dynamics.transitions)
        case SemiMarkovChain():
            chain = _free_probabilities(dynamics.initial[None]) + _free_probabilities(dynamics.transitions)
            return chain + _duration_degrees_of_freedom(dynamics, distribution)


def _free_probabilities(rows: Float[Array, "R C"]) -> int:
    """Possible entries, less one in each row that sums to one; a row of zeros has none."""
    possible = np.count_nonzero(rows, axis=1)
    return int(np.maximum(possible - 1, 0).sum())


def _duration_degrees_of_freedom(chain: SemiMarkovChain, distribution: DurationDistribution | None) -> int:
    not_final = ~final_states(chain)
    if isinstance(chain.durations, HistogramDurations):
        return _free_probabilities(chain.durations.probabilities.T[not_final])
    states = int(not_final.sum())
    return distribution.parameter_count(states, 1) if distribution else len(fields(chain.durations)) * states
