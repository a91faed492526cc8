"""How many free numbers a model has."""

from pilotfish.gaussians import Structure


def covariance_parameters(structure: Structure, states: int, width: int, frames: int = 1) -> int:
    """Free numbers of all covariances: those of one frame, times the frames."""
    return frames * structure.parameter_count(states, width)


def semi_markov_parameters(structure: Structure, states: int, width: int, frames: int = 1) -> int:
    """Free numbers of a whole semi-Markov skill as the thesis counts them (table 5.1).

    Means and covariances of every frame, K^2 transitions, and a mean and a deviation of each duration.
    """
    gaussians = frames * states * width + covariance_parameters(structure, states, width, frames)
    return gaussians + states**2 + 2 * states
