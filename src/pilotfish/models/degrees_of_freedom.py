"""Degrees of freedom and parameter counts of learned skills.

Degrees of freedom belong in an information criterion: parameters that change no covariance do not count,
such as rotations of latent factors and the lengths of shared vectors. Parameter counts are what tables of
the literature give.
"""

import numpy as np

from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models.duration_model import DurationModel
from pilotfish.models.skill import HiddenModel, Skill


def degrees_of_freedom(
    skill: HiddenModel | Skill, structure: CovarianceStructure, durations: DurationModel | None = None
) -> int:
    """Return the degrees of freedom of means, covariances, probabilities and durations.

    A mean has three degrees of freedom for an orientation on S^3. A probability of zero counts as given: a
    left-right initialisation allows only the transitions that it sets, and EM keeps zeros. Durations of final
    states, which are never left, do not count.

    Args:
        skill: Learned skill, or its model alone.
        structure: Covariance structure that it was learned with.
        durations: Duration model that it was learned with, if its options fix parameters.
    """
    P, K, _ = map(int, skill.means.shape)
    means = P * K * int(skill.covariances[0].dense.shape[-1])
    covariances = sum(structure.fitted(c).degrees_of_freedom(*c.dense.shape[:2]) for c in skill.covariances)
    fixed = durations.fixed_parameters if durations else 0
    return means + covariances + skill.dynamics.degrees_of_freedom(fixed)


def semi_markov_parameter_count(
    structure: CovarianceStructure, states: int, width: int, frames: int = 1
) -> int:
    """Return the number of parameters of a TP-HSMM as the thesis counts them (table 5.1).

    They are means and covariances of every frame, K^2 transitions, and mean and deviation of each duration.

    Args:
        structure: Covariance structure.
        states: Number of states K.
        width: Number of columns D.
        frames: Number of frames P.
    """
    gaussians = frames * (states * width + structure.parameter_count(states, width))
    return gaussians + states**2 + 2 * states


def bic(log_likelihood: float, parameters: int, datapoints: int) -> float:
    """Return the Bayesian information criterion, -2 log-likelihood + parameters log(datapoints).

    Rows of one demonstration are correlated and carry less information than independent ones. The criterion
    therefore penalises large models too little.

    Args:
        log_likelihood: Log-likelihood of all datapoints [nats].
        parameters: Degrees of freedom.
        datapoints: Number of datapoints.

    Source:
        Schwarz 1978, Estimating the dimension of a model.
    """
    return -2.0 * log_likelihood + parameters * float(np.log(datapoints))
