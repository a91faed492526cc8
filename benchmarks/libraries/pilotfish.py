"""pilotfish, by its public functions."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from libraries.pilotfish_streams import endless, from_array, one_by_one, worst_case  # noqa: F401 - for the worker
from prepared import Answer, Prepared
from problems import Floats, Framed, Poses, Sequences, Tracking, Visits

from pilotfish import kernels
from pilotfish.control import Feedback, LinearSystem, Reference, regulate, track
from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    Views,
    demonstration,
    frame,
    frame_from_pose,
    on_sphere,
    pose_layout,
    position_layout,
    views,
)
from pilotfish.gaussians import DenseCovariances, Full
from pilotfish.geometry import Pose
from pilotfish.models import (
    Dynamics,
    EMSettings,
    Fit,
    HiddenModel,
    Histogram,
    HistogramDurations,
    MarkovChain,
    SemiMarkovChain,
    Statistics,
    TimeBins,
    Timing,
    Weights,
    learn,
    learn_mixture,
    log_emissions,
    maximise,
    most_likely_chain,
    most_likely_semi_markov,
    most_likely_weights,
    statistics,
    viterbi,
)

PERIOD = 0.1  # s
REGULARISATION = 1e-5

Chain = Callable[[Statistics, Dynamics | None], Dynamics]
EStep = Callable[[HiddenModel, Views], Statistics]


def remark() -> str:
    return f"kernels: {kernels.ACTIVE}"


def em_steps(
    model: HiddenModel,
    data: Views,
    iterations: int,
    regularisation: float,
    chain: Chain = most_likely_chain,
    e_step: EStep = statistics,
) -> tuple[float, float]:
    """E- and M-steps by turns; the log-likelihood in the first E-step and in the last."""
    trace = []
    for _ in range(iterations):
        sums = e_step(model, data)
        trace.append(sums.log_likelihood)
        model = maximise(sums, model, Full(), regularisation, chain)
    return trace[0], trace[-1]


def em(folder: Path) -> Prepared:
    problem = Sequences.load(folder)
    return _em(problem, model_of(problem), most_likely_chain)


def em_mixture(folder: Path) -> Prepared:
    problem = Sequences.load(folder)
    chain = model_of(problem)
    mixture = HiddenModel(Weights(problem.initial), chain.means, chain.covariances)
    return _em(problem, mixture, most_likely_weights)


def em_all_cores(folder: Path) -> Prepared:
    problem = Sequences.load(folder)
    return _em(problem, model_of(problem), most_likely_chain, partial(statistics, threads=0))


def em_visits(folder: Path) -> Prepared:
    problem = Visits.load(folder)
    S, shown = len(problem.durations), model_of(problem)
    chain = SemiMarkovChain(problem.initial, problem.transitions, HistogramDurations(problem.durations))
    model = HiddenModel(chain, shown.means, shown.covariances)
    m_step = partial(most_likely_semi_markov, timing=Timing(law=Histogram(), longest=S), floor=0.0)
    return _em(problem, model, m_step, partial(statistics, longest=S))


def _em(problem: Sequences, model: HiddenModel, chain: Chain, e_step: EStep = statistics) -> Prepared:
    """With more columns than steps to fill them, something has to be added to variances."""
    data, n, (K, D) = Views(problem.x[None], problem.lengths), problem.iterations, problem.means.shape
    added = 0.0 if len(problem.x) >= 4 * K * D else REGULARISATION
    run = partial(em_steps, model, data, n, added, chain, e_step)
    return Prepared(run, lambda trace: Answer(trace[1], n, begin=trace[0]))


def em_frames(folder: Path) -> Prepared:
    problem = Framed.load(folder)
    data, n = views(demonstrations_of(problem)), problem.iterations
    guess = TimeBins().guess(data, problem.states, np.random.default_rng(0))
    model = maximise(guess, None, Full(), REGULARISATION, most_likely_chain)
    run = partial(em_steps, model, data, n, REGULARISATION)
    return Prepared(run, lambda trace: Answer(trace[1], n, begin=trace[0]))


def fit_semi_markov(folder: Path) -> Prepared:
    return _fit(folder, learn)


def fit_mixture(folder: Path) -> Prepared:
    return _fit(folder, learn_mixture)


def fit_vast(folder: Path) -> Prepared:
    """Demonstrations are what a user has; all that is allocated after them counts as the fit's."""
    problem = Sequences.load(folder)
    shown, states = sequences_of(problem), len(problem.initial)
    settings = EMSettings(max_iterations=problem.iterations)
    del problem
    return Prepared(
        lambda: learn(shown, states=states, rng=np.random.default_rng(0), settings=settings), _read_fit
    )


def fit_poses(folder: Path) -> Prepared:
    problem = Poses.load(folder)
    names = [f"object {p}" for p in range(problem.objects.shape[1])]
    shown = [
        on_sphere(
            demonstration(x, PERIOD, pose_layout(), [_stand(*told) for told in zip(names, seen, strict=True)])
        )
        for x, seen in zip(problem.x, problem.objects, strict=True)
    ]
    run = partial(learn, shown, states=problem.states, rng=np.random.default_rng(0))
    return Prepared(run, _read_fit)


def _stand(name: str, place: Floats) -> Frame:
    return frame_from_pose(name, pose_layout(), Pose(place[:3], place[3:]))


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
