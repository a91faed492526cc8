"""hmmlearn's GaussianHMM: maximum likelihood, without priors unless the function name has default."""

from pathlib import Path

import numpy as np
from hmmlearn.hmm import GaussianHMM  # type: ignore[import-not-found]
from prepared import Answer, Prepared
from problems import Sequences


def remark() -> str:
    return ""


def model_of(problem: Sequences, implementation: str, **priors: float) -> GaussianHMM:
    """Return the initial model; without a tolerance, all iterations are run."""
    settings = {"n_iter": problem.iterations, "tol": -np.inf, "init_params": ""}
    model = GaussianHMM(len(problem.initial), "full", implementation=implementation, **settings, **priors)
    model.startprob_, model.transmat_ = problem.initial, problem.transitions
    model.means_, model.covars_ = problem.means, problem.covariances
    return model


def em(folder: Path) -> Prepared:
    return _em(folder, "log", covars_prior=0.0)


def em_scaling(folder: Path) -> Prepared:
    return _em(folder, "scaling", covars_prior=0.0)


def em_default(folder: Path) -> Prepared:
    return _em(folder, "log")


def em_default_scaling(folder: Path) -> Prepared:
    return _em(folder, "scaling")


def _em(folder: Path, implementation: str, **priors: float) -> Prepared:
    problem = Sequences.load(folder)
    n = problem.iterations

    def run() -> GaussianHMM:
        return model_of(problem, implementation, **priors).fit(problem.x, problem.lengths)

    def answer(model: GaussianHMM) -> Answer:
        begin = model_of(problem, implementation, **priors).score(problem.x, problem.lengths)
        return Answer(float(model.monitor_.history[-1]), n, begin=float(begin))

    return Prepared(run, answer)


def decode(folder: Path) -> Prepared:
    problem = Sequences.load(folder)
    model = model_of(problem, "log", covars_prior=0.0)
    return Prepared(
        lambda: model.decode(problem.x, problem.lengths), lambda decoded: Answer(float(decoded[0]))
    )
