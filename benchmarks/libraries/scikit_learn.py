"""scikit-learn's GaussianMixture, on what all frames see side by side."""

from pathlib import Path

import numpy as np
from prepared import Answer, Prepared
from problems import Framed
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
