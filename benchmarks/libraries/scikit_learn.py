"""scikit-learn's GaussianMixture, on what all frames see side by side."""

from pathlib import Path

import numpy as np
from prepared import Answer, Prepared
from problems import Framed, Sequences
from sklearn.mixture import GaussianMixture  # type: ignore[import-not-found]

REGULARISATION = 1e-5  # as pilotfish


def remark() -> str:
    return ""


def fit_mixture(folder: Path) -> Prepared:
    problem = Framed.load(folder)
    precisions = np.linalg.inv(problem.covariances)
    start = {"weights_init": problem.weights, "means_init": problem.means, "precisions_init": precisions}
    settings = {"max_iter": problem.iterations, "reg_covar": REGULARISATION}

    def run() -> GaussianMixture:
        return GaussianMixture(problem.states, **settings, **start).fit(problem.joint)

    def answer(mixture: GaussianMixture) -> Answer:
        log_likelihood = float(mixture.score(problem.joint)) * len(problem.joint)
        return Answer(log_likelihood, remark=f"{mixture.n_iter_} iterations")

    return Prepared(run, answer)


def em_mixture(folder: Path) -> Prepared:
    """Exactly so many iterations: the tolerance is never met."""
    problem = Sequences.load(folder)
    K, (N, D), n = len(problem.initial), problem.x.shape, problem.iterations
    settings = {"max_iter": n, "tol": 0.0, "reg_covar": 0.0 if N >= 4 * K * D else REGULARISATION}
    precisions = np.linalg.inv(problem.covariances)
    start = {"weights_init": problem.initial, "means_init": problem.means, "precisions_init": precisions}

    def run() -> GaussianMixture:
        return GaussianMixture(K, **settings, **start).fit(problem.x)

    return Prepared(run, lambda mixture: Answer(float(mixture.lower_bounds_[-1]) * N, n))
