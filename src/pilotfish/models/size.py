"""How many free numbers a model has."""

from collections.abc import Sequence

from pilotfish.gaussians.structures import Covariances, CovarianceStructure


def covariance_parameter_count(
    structure: CovarianceStructure, states: int, width: int, frames: int = 1
) -> int:
    """Numbers that all covariances are made of: those of one frame, times the frames."""
    return frames * structure.parameter_count(states, width)


def covariance_degrees_of_freedom(structure: CovarianceStructure, covariances: Sequence[Covariances]) -> int:
    """Degrees of freedom of covariances that were learned with this structure, over all frames.

    These, not the parameters, belong in an information criterion: numbers that change no covariance fit
    nothing, such as turns of factors among themselves and lengths of shared vectors.
    """
    return sum(structure.fitted(c).degrees_of_freedom(*c.dense.shape[:2]) for c in covariances)


def fitted_covariance_parameter_count(
    structure: CovarianceStructure, covariances: Sequence[Covariances]
) -> int:
    """Numbers that covariances learned with this structure are made of, over all frames."""
    return sum(structure.fitted(c).parameter_count(*c.dense.shape[:2]) for c in covariances)


def semi_markov_parameter_count(
    structure: CovarianceStructure, states: int, width: int, frames: int = 1
) -> int:
    """Free numbers of a whole semi-Markov skill as the thesis counts them (table 5.1).

    Means and covariances of every frame, K^2 transitions, and a mean and a deviation of each duration.
    """
    gaussians = frames * states * width + covariance_parameter_count(structure, states, width, frames)
    return gaussians + states**2 + 2 * states
