"""pilotfish, by its public functions."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from prepared import Answer, Prepared
from problems import Framed, Sequences, Tracking

from pilotfish import kernels
from pilotfish.control import Feedback, LinearSystem, Reference, regulate, track
from pilotfish.demonstrations import Demonstration, Views, demonstration, frame, position_layout, views
from pilotfish.gaussians import DenseCovariances, Full
from pilotfish.models import (
    EMSettings,
    Fit,
    HiddenModel,
    MarkovChain,
    Statistics,
    TimeBins,
    learn,
    learn_mixture,
    log_emissions,
    maximise,
    most_likely_chain,
    statistics,
    viterbi,
)

PERIOD = 0.1  # s
REGULARISATION = 1e-5


def remark() -> str:
    return f"kernels: {kernels.ACTIVE}"


def em_steps(model: HiddenModel, data: Views, iterations: int, regularisation: float) -> Statistics:
    """E- and M-steps by turns; the statistics of the last E-step."""
    for _ in range(iterations):
        sums = statistics(model, data)
        model = maximise(sums, model, Full(), regularisation, most_likely_chain)
    return sums


def em(folder: Path) -> Prepared:
    problem = Sequences.load(folder)
    data, n = Views(problem.x[None], problem.lengths), problem.iterations
    run = partial(em_steps, model_of(problem), data, n, regularisation=0.0)
    return Prepared(run, lambda sums: Answer(sums.log_likelihood, n))


def em_frames(folder: Path) -> Prepared:
    problem = Framed.load(folder)
    data, n = views(demonstrations_of(problem)), problem.iterations
    guess = TimeBins().guess(data, problem.states, np.random.default_rng(0))
    model = maximise(guess, None, Full(), REGULARISATION, most_likely_chain)
    run = partial(em_steps, model, data, n, REGULARISATION)
    return Prepared(run, lambda sums: Answer(sums.log_likelihood, n))


def fit_semi_markov(folder: Path) -> Prepared:
    return _fit(folder, learn)


def fit_mixture(folder: Path) -> Prepared:
    return _fit(folder, learn_mixture)


def _fit(folder: Path, learner: Callable[..., Fit]) -> Prepared:
    problem = Framed.load(folder)
    settings = EMSettings(max_iterations=problem.iterations)
    shown, rng = demonstrations_of(problem), np.random.default_rng(0)
    run = partial(learner, shown, states=problem.states, rng=rng, settings=settings)
    return Prepared(run, _read_fit)


def _read_fit(fit: Fit) -> Answer:
    return Answer(float(fit.trace[-1]), remark=f"{fit.outcome.iterations} iterations")


def decode(folder: Path) -> Prepared:
    """The answer is the log-probability of the paths, which the kernel below viterbi tells."""
    problem = Sequences.load(folder)
    model, shown = model_of(problem), sequences_of(problem)

    def answer(paths: object) -> Answer:
        chain = problem.initial, problem.transitions
        own = [
            kernels.viterbi(log_emissions(model, Views(demo.x[None], np.array([len(demo.x)]))), *chain)
            for demo in shown
        ]
        return Answer(sum(path.log_probability for path in own))

    return Prepared(lambda: [viterbi(model, demo) for demo in shown], answer)


def tracker(folder: Path) -> Prepared:
    return _controller(folder, track)


def regulator(folder: Path) -> Prepared:
    return _controller(folder, regulate)


def _controller(folder: Path, controller: Callable[..., Feedback]) -> Prepared:
    problem = Tracking.load(folder)
    reference = Reference(problem.targets, problem.weights)
    system = LinearSystem(problem.A, problem.B, PERIOD)
    return Prepared(partial(controller, system, reference, problem.effort), _read_feedback)


def _read_feedback(feedback: Feedback) -> Answer:
    targets = feedback.reference.targets[:-1, :, None]
    constant = feedback.feedforwards + (feedback.gains @ targets)[..., 0]  # u = constant - gain x
    return Answer(float(np.sqrt((feedback.gains**2).sum() + (constant**2).sum())))


def model_of(problem: Sequences) -> HiddenModel:
    chain = MarkovChain(problem.initial, problem.transitions)
    return HiddenModel(chain, problem.means[None], (DenseCovariances(problem.covariances),))


def sequences_of(problem: Sequences) -> list[Demonstration]:
    layout = position_layout(problem.x.shape[1], unit="1")
    pieces = np.split(problem.x, np.cumsum(problem.lengths)[:-1])
    return [demonstration(piece, PERIOD, layout) for piece in pieces]


def demonstrations_of(problem: Framed) -> list[Demonstration]:
    layout = position_layout(problem.x.shape[-1] // 2, unit="1").differentiated()
    names = [f"frame {p}" for p in range(problem.A.shape[1])]
    return [
        demonstration(x, PERIOD, layout, map(frame, names, A, b), name=f"demonstration {m}")
        for m, (x, A, b) in enumerate(zip(problem.x, problem.A, problem.b, strict=True))
    ]
