"""pilotfish, by its public functions."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from libraries.pilotfish_streams import from_array, repeated_stream, single_points, worst_case  # noqa: F401 - for the worker
from prepared import Answer, Prepared
from problems import Floats, FrameProblem, Poses, SegmentProblem, Sequences, Tracking

from pilotfish import kernels
from pilotfish.control import Feedback, LinearSystem, Reference, lqr, track
from pilotfish.demonstrations import (
    Demonstration,
    Frame,
    Views,
    demonstration,
    frame,
    frame_from_pose,
    pose_layout,
    position_layout,
    to_sphere,
    views,
)
from pilotfish.gaussians.structures import DenseCovariances, Full
from pilotfish.geometry import Pose
from pilotfish.models import (
    DurationModel,
    Dynamics,
    EMSettings,
    Fit,
    HiddenModel,
    MarkovChain,
    MixtureWeights,
    SemiMarkovChain,
    Statistics,
    TimeBins,
    expected_statistics,
    learn,
    log_emissions,
    maximise_likelihood,
    viterbi,
)
from pilotfish.models.durations import Histogram

PERIOD = 0.1  # s
REGULARISATION = 1e-5

Chain = Callable[[Statistics, Dynamics | None], Dynamics]
EStep = Callable[[HiddenModel, Views], Statistics]


def remark() -> str:
    return f"kernels: {kernels.BACKEND}"


def em_steps(
    model: HiddenModel,
    data: Views,
    iterations: int,
    regularisation: float,
    chain: Chain = MarkovChain.fit,
    e_step: EStep = expected_statistics,
) -> tuple[float, float]:
    """Run E- and M-steps; return the log-likelihoods of the first and the last E-step."""
    trace = []
    for _ in range(iterations):
        statistics = e_step(model, data)
        trace.append(statistics.log_likelihood)
        model = maximise_likelihood(statistics, model, Full(), regularisation, chain)
    return trace[0], trace[-1]


def em(folder: Path) -> Prepared:
    problem = Sequences.load(folder)
    return _em(problem, model_of(problem), MarkovChain.fit)


def em_mixture(folder: Path) -> Prepared:
    problem = Sequences.load(folder)
    chain = model_of(problem)
    mixture = HiddenModel(MixtureWeights(problem.initial), chain.means, chain.covariances)
    return _em(problem, mixture, MixtureWeights.fit)


def em_all_cores(folder: Path) -> Prepared:
    problem = Sequences.load(folder)
    return _em(problem, model_of(problem), MarkovChain.fit, partial(expected_statistics, threads=0))


def em_semi_markov(folder: Path) -> Prepared:
    problem = SegmentProblem.load(folder)
    S, markov = len(problem.durations), model_of(problem)
    chain = SemiMarkovChain(problem.initial, problem.transitions, Histogram(problem.durations))
    model = HiddenModel(chain, markov.means, markov.covariances)
    m_step = partial(
        SemiMarkovChain.fit,
        duration_model=DurationModel(Histogram, max_duration=S),
        min_variance=0.0,
    )
    return _em(problem, model, m_step, partial(expected_statistics, max_duration=S))


def _em(
    problem: Sequences, model: HiddenModel, chain: Chain, e_step: EStep = expected_statistics
) -> Prepared:
    """Prepare EM; with more columns than steps of a state, variances are regularised."""
    data, n, (K, D) = Views(problem.x[None], problem.lengths), problem.iterations, problem.means.shape
    regularisation = 0.0 if len(problem.x) >= 4 * K * D else REGULARISATION
    run = partial(em_steps, model, data, n, regularisation, chain, e_step)
    return Prepared(run, lambda trace: Answer(trace[1], n, begin=trace[0]))


def em_frames(folder: Path) -> Prepared:
    problem = FrameProblem.load(folder)
    data, n = views(demonstrations_of(problem)), problem.iterations
    initial_statistics = TimeBins().initial_statistics(data, problem.states, np.random.default_rng(0))
    model = maximise_likelihood(initial_statistics, None, Full(), REGULARISATION, MarkovChain.fit)
    run = partial(em_steps, model, data, n, REGULARISATION)
    return Prepared(run, lambda trace: Answer(trace[1], n, begin=trace[0]))


def fit_semi_markov(folder: Path) -> Prepared:
    return _fit(folder, learn)


def fit_mixture(folder: Path) -> Prepared:
    return _fit(folder, partial(learn, dynamics="mixture"))


def fit_vast(folder: Path) -> Prepared:
    """Prepare a fit; memory that is allocated after the demonstrations counts as the fit's."""
    problem = Sequences.load(folder)
    demonstrations, states = sequences_of(problem), len(problem.initial)
    settings = EMSettings(max_iterations=problem.iterations)
    del problem
    return Prepared(
        lambda: learn(demonstrations, states=states, rng=np.random.default_rng(0), settings=settings),
        _read_fit,
    )


def fit_poses(folder: Path) -> Prepared:
    problem = Poses.load(folder)
    names = [f"object {p}" for p in range(problem.objects.shape[1])]
    demonstrations = [
        to_sphere(
            demonstration(
                x, PERIOD, pose_layout(), [_object_frame(*pair) for pair in zip(names, objects, strict=True)]
            )
        )
        for x, objects in zip(problem.x, problem.objects, strict=True)
    ]
    run = partial(learn, demonstrations, states=problem.states, rng=np.random.default_rng(0))
    return Prepared(run, _read_fit)


def _object_frame(name: str, pose: Floats) -> Frame:
    return frame_from_pose(name, pose_layout(), Pose(pose[:3], pose[3:]))


def _fit(folder: Path, learner: Callable[..., Fit]) -> Prepared:
    problem = FrameProblem.load(folder)
    settings = EMSettings(max_iterations=problem.iterations)
    demonstrations, rng = demonstrations_of(problem), np.random.default_rng(0)
    run = partial(learner, demonstrations, states=problem.states, rng=rng, settings=settings)
    return Prepared(run, _read_fit)


def _read_fit(fit: Fit) -> Answer:
    return Answer(float(fit.log_likelihoods[-1]), remark=f"{fit.convergence.iterations} iterations")


def decode(folder: Path) -> Prepared:
    """Prepare Viterbi; the answer is the log-probability of the paths, from the kernel."""
    problem = Sequences.load(folder)
    model, demonstrations = model_of(problem), sequences_of(problem)

    def answer(paths: object) -> Answer:
        chain = problem.initial, problem.transitions
        own = [
            kernels.viterbi(log_emissions(model, Views(demo.x[None], np.array([len(demo.x)]))), *chain)
            for demo in demonstrations
        ]
        return Answer(sum(log_probability for _, log_probability in own))

    return Prepared(lambda: [viterbi(model, demo) for demo in demonstrations], answer)


def tracker(folder: Path) -> Prepared:
    return _controller(folder, track)


def regulator(folder: Path) -> Prepared:
    return _controller(folder, lqr)


def _controller(folder: Path, controller: Callable[..., Feedback]) -> Prepared:
    problem = Tracking.load(folder)
    reference = Reference(problem.targets, problem.weights)
    system = LinearSystem(problem.A, problem.B, PERIOD)
    return Prepared(partial(controller, system, reference, problem.control_cost), _read_feedback)


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


def demonstrations_of(problem: FrameProblem) -> list[Demonstration]:
    layout = position_layout(problem.x.shape[-1] // 2, unit="1").differentiate()
    names = [f"frame {p}" for p in range(problem.A.shape[1])]
    return [
        demonstration(x, PERIOD, layout, map(frame, names, A, b), name=f"demonstration {m}")
        for m, (x, A, b) in enumerate(zip(problem.x, problem.A, problem.b, strict=True))
    ]
