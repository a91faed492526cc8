"""chadhmm's GaussianHSMM, without the likelihood that its fit evaluates in each iteration."""

from pathlib import Path

import torch  # type: ignore[import-not-found]
from chadhmm.hsmm import GaussianHSMM  # type: ignore[import-not-found]
from prepared import Answer, Prepared
from problems import SegmentProblem
from torch.distributions import Categorical, MultivariateNormal  # type: ignore[import-not-found]

torch.set_num_threads(1)
torch.set_default_dtype(torch.float64)


def remark() -> str:
    return f"torch {torch.__version__}"


def model_of(problem: SegmentProblem) -> GaussianHSMM:
    (S, K), D = problem.durations.shape, problem.means.shape[1]
    model = GaussianHSMM(K, D, S, min_covar=0.0, seed=0)
    tensor = torch.tensor
    model._params.update(
        {
            "pi": Categorical(logits=tensor(problem.initial).log()),
            "A": Categorical(logits=tensor(problem.transitions).log()),
            "D": Categorical(logits=tensor(problem.durations.T).log()),
            "emission_pdf": MultivariateNormal(tensor(problem.means), tensor(problem.covariances)),
        }
    )
    return model


def em_semi_markov(folder: Path) -> Prepared:
    """Prepare emissions, forward-backward and M-step, as in its fit."""
    problem = SegmentProblem.load(folder)
    x, n = torch.tensor(problem.x), problem.iterations
    lengths = problem.lengths.tolist()

    def run() -> tuple[GaussianHSMM, object]:
        model = model_of(problem)
        observations = model.to_observations(x, lengths)
        for _ in range(n):
            model._params.update(model._estimate_model_params(observations, None))
            observations.log_probs = [model.map_emission(sequence) for sequence in observations.sequence]
        return model, observations

    def answer(result: tuple[GaussianHSMM, object]) -> Answer:
        model, observations = result
        start = model_of(problem)
        begin = log_likelihood(start, start.to_observations(x, lengths))
        return Answer(log_likelihood(model, observations), n, begin=begin)

    return Prepared(run, answer)


def log_likelihood(model: GaussianHSMM, observations: object) -> float:
    """Return the log-likelihood over states and remaining durations; its own score sums over states only."""
    return float(sum(alpha[-1].flatten().logsumexp(0) for alpha in model._forward(observations)))
