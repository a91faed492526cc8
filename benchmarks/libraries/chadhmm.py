"""chadhmm's GaussianHSMM. Its fit also evaluates a likelihood each time, which is left out here."""

from pathlib import Path

import torch  # type: ignore[import-not-found]
from chadhmm.hsmm import GaussianHSMM  # type: ignore[import-not-found]
from prepared import CommandResult, Prepared
from problems import SegmentProblem
from torch.distributions import Categorical, MultivariateNormal  # type: ignore[import-not-found]

torch.set_num_threads(1)
torch.set_default_dtype(torch.float64)


def print_note() -> str:
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


def em_visits(folder: Path) -> Prepared:
    """Emissions, forward-backward and M-step, as its fit does them."""
    problem = SegmentProblem.load(folder)
    x, n = torch.tensor(problem.x), problem.iterations
    lengths = problem.lengths.tolist()

    def run() -> tuple[GaussianHSMM, object]:
        model = model_of(problem)
        seen = model.to_observations(x, lengths)
        for _ in range(n):
            model._params.update(model._estimate_model_params(seen, None))
            seen.log_probs = [model.map_emission(one) for one in seen.sequence]
        return model, seen

    def answer(result: tuple[GaussianHSMM, object]) -> CommandResult:
        model, seen = result
        start = model_of(problem)
        begin = log_likelihood(start, start.to_observations(x, lengths))
        return CommandResult(log_likelihood(model, seen), n, begin=begin)

    return Prepared(run, answer)


def log_likelihood(model: GaussianHSMM, seen: object) -> float:
    """Over all states and rests of duration at each last step; its own score sums over the states alone."""
    return float(sum(alpha[-1].flatten().logsumexp(0) for alpha in model._forward(seen)))
