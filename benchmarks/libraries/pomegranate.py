"""pomegranate's DenseHMM in double precision; it also learns the final state."""

from pathlib import Path

import numpy as np
import torch  # type: ignore[import-not-found]
from pomegranate.distributions import Normal  # type: ignore[import-not-found]
from pomegranate.hmm import DenseHMM  # type: ignore[import-not-found]
from prepared import Answer, Prepared
from problems import Sequences

torch.set_num_threads(1)
torch.set_default_dtype(torch.float64)


def remark() -> str:
    return f"torch {torch.__version__}"


def model_of(problem: Sequences, iterations: int) -> DenseHMM:
    """Return the initial model, in which sequences may end in any state."""
    normals = [
        Normal(m, c, covariance_type="full") for m, c in zip(problem.means, problem.covariances, strict=True)
    ]
    return DenseHMM(
        normals,
        edges=problem.transitions,
        starts=problem.initial,
        ends=np.ones(len(problem.initial)),
        max_iter=iterations,
        tol=0.0,
    )


def em(folder: Path) -> Prepared:
    problem = Sequences.load(folder)
    M, n = len(problem.lengths), problem.iterations
    x = torch.tensor(problem.x.reshape(M, -1, problem.x.shape[1]))  # all are of one length
    known: list[Answer] = []

    def run() -> DenseHMM:
        return model_of(problem, n).fit(x)

    def answer(_: object) -> Answer:
        if not known:
            begin = model_of(problem, n).log_probability(x).sum()
            end = model_of(problem, n - 1).fit(x).log_probability(x).sum()
            known.append(Answer(float(end), n, begin=float(begin)))
        return known[0]

    return Prepared(run, answer)
