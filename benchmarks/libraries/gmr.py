"""gmr's GMM, on the coordinates in all frames side by side."""

from pathlib import Path

import numpy as np
from gmr import GMM  # type: ignore[import-not-found]
from prepared import Answer, Prepared
from problems import Floats, FrameProblem


def remark() -> str:
    return ""


def fit_mixture(folder: Path) -> Prepared:
    """Prepare a fit; gmr adds nothing to variances and does not report its iterations."""
    problem = FrameProblem.load(folder)

    def run() -> GMM:
        start = (
            problem.weights.copy(),
            problem.means.copy(),
            problem.covariances.copy(),
        )  # it modifies them
        return GMM(problem.states, *start).from_samples(problem.joint, n_iter=problem.iterations)

    return Prepared(run, lambda mixture: Answer(log_likelihood(mixture, problem.joint)))


def log_likelihood(mixture: GMM, x: Floats) -> float:
    terms = []
    for weight, mean, covariance in zip(mixture.priors, mixture.means, mixture.covariances, strict=True):
        L = np.linalg.cholesky(covariance)
        squares = (np.linalg.solve(L, (x - mean).T) ** 2).sum(axis=0)
        log_norm = np.log(np.diag(L)).sum() + 0.5 * len(mean) * np.log(2 * np.pi)
        terms.append(np.log(weight) - 0.5 * squares - log_norm)
    return float(np.logaddexp.reduce(terms, axis=0).sum())
