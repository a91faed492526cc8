"""Degrees of freedom of a learned skill."""

from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models.semi_markov import DurationModel
from pilotfish.models.size import covariance_degrees_of_freedom
from pilotfish.models.skill import Skill


def degrees_of_freedom(
    skill: Skill, structure: CovarianceStructure, durations: DurationModel | None = None
) -> int:
    """Return the number of free parameters: means, covariances, probabilities and durations.

    Of every frame: the means, with three numbers for an orientation of S^3, and what the structure leaves
    free, shared directions once. Of the dynamics: see `degrees_of_freedom` of the dynamics.

    Args:
        skill: The learned skill.
        structure: Covariance structure with which it was learned.
        durations: Duration model with which it was learned, if its options fix parameters.
    """
    P, K, _ = map(int, skill.means.shape)
    tangent_dimension = int(skill.covariances[0].dense.shape[-1])
    gaussians = P * K * tangent_dimension + covariance_degrees_of_freedom(structure, skill.covariances)
    fixed = durations.fixed_parameters if durations else 0
    return gaussians + skill.dynamics.degrees_of_freedom(fixed)
