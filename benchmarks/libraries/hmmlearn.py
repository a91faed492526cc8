"""hmmlearn's GaussianHMM: maximum likelihood, its priors switched off."""

from pathlib import Path

import numpy as np
from hmmlearn.hmm import GaussianHMM  # type: ignore[import-not-found]
from prepared import Answer, Prepared
from problems import Sequences


def remark() -> str:
    return ""


def model_of(problem: Sequences, implementation: str) -> GaussianHMM:
    """The starting model. No tolerance: every iteration asked for is done; covars_prior=0 adds nothing."""
    settings = {"n_iter": problem.iterations, "tol": -np.inf, "init_params": "", "covars_prior": 0.0}
    model = GaussianHMM(len(problem.initial), "full", implementation=implementation, **settings)
    model.startprob_, model.transmat_ = problem.initial, problem.transitions
    model.means_, model.covars_ = problem.means, problem.covariances
    return model


def em(folder: Path, implementation: str = "log") -> Prepared:
    problem = Sequences.load(folder)
    n = problem.iterations

    def run() -> GaussianHMM:
        return model_of(problem, implementation).fit(problem.x, problem.lengths)

    return Prepared(run, lambda model: Answer(float(model.monitor_.history[-1]), n))


def em_scaling(folder: Path) -> Prepared:
    return em(folder, "scaling")


def decode(folder: Path) -> Prepared:
    problem = Sequences.load(folder)
    model = model_of(problem, "log")
    return Prepared(
        lambda: model.decode(problem.x, problem.lengths), lambda decoded: Answer(float(decoded[0]))
    )
