"""Expectation-maximisation (EM) of task-parameterised mixtures, HMMs and HSMMs (TP-GMM, TP-HMM, TP-HSMM).

Model. Demonstrations are observed from P frames at once: x_t^p is datapoint t in the coordinates of frame p.
A state k has one Gaussian in every frame, and its emission density is the product over the frames,

    b_k(x_t) = prod_p N(x_t^p | mu_k^p, Sigma_k^p),

so that one state sequence explains the data in all frames together.

E-step (3.8-3.15, 3.22). Forward-backward gives gamma_t(k) = p(state k at t | data), the expected transitions
and, for a semi-Markov chain, the expected segments by length. They are summed over all demonstrations into
`Statistics`: counts sum_t gamma_t(k), and for each frame the means and scatter matrices that gamma weights.

M-step (3.12-3.17, 3.23-3.25). Means are the weighted means. The weighted sample covariances, raised by
`regularisation` on the diagonal, are the input of the covariance structure (full, semi-tied, factor
analysers, ...). Initial and transition probabilities and durations are fitted by the `fit` of their class.

Convergence. Plain maximum likelihood never lowers the log-likelihood. Regularisation, partial tying and a
covariance structure that is fitted iteratively can: such a step is undone and ends the fit. A state with less
than one datapoint is dropped, and EM restarts from the statistics of the other states.

Keep in step: the maximum duration of a semi-Markov E-step must not shrink from one iteration to the next, or
the likelihood may fall although the M-step is exact; see `semi_markov.py`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import add
from typing import ClassVar

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Moments, TangentMoments
from pilotfish.gaussians.structures import Covariances, CovarianceStructure
from pilotfish.models.partitions import Partitions
from pilotfish.models.semi_markov import TAIL_PROBABILITY, Dynamics
from pilotfish.models.skill import HiddenModel, Skill
from pilotfish.models.statistics import Statistics
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import MAX_MAGNITUDE, require_count, require_type, shorten_repr

MIN_GAIN = 1e-3  # nats per datapoint: EM has converged below it
MIN_DURATION_VARIANCE = 1e-100  # steps^2
NUMBER = (int, float, np.integer, np.floating)

FitDynamics = Callable[[Statistics, Dynamics | None], Dynamics]
MStep = Callable[[Statistics, HiddenModel | None], HiddenModel]
Data = Views | Partitions[Views]
EStep = Callable[[HiddenModel, Data, Statistics], Statistics]


@shorten_repr
@dataclass(frozen=True, slots=True)
class EMSettings:
    """Settings of expectation-maximisation.

    Attributes:
        regularisation: Added to every variance [unit of x squared]; 0 gives plain maximum likelihood. None
            takes a fraction of the scale of each part, see `demonstration_statistics.py`.
        tolerance: EM has converged when an iteration raises the log-likelihood by less than this fraction of
            it. None applies `min_gain` instead, which no unit changes.
        min_gain: EM has converged when an iteration raises the log-likelihood by less than this [nats per
            datapoint]. None is 0.5 where `learn` compares initialisations, and 0.001 elsewhere: later
            iterations fit few demonstrations more closely than the task, and differ with the period.
        max_iterations: Upper bound of the number of iterations.
        restarts: Number of initialisations; the fit with the highest log-likelihood is kept.
        duration_regularisation: Lower bound of the variance of durations that have a free width; added to the
            variance of durations counted along Viterbi paths [steps^2]. None is 1 for fitted durations, and
            adds a tenth of the mean duration, squared, to counted ones.
        threads: Number of threads of an E-step; 0 uses all cores.
        callback: Called with (iteration, log-likelihood) after every E-step.
    """

    MAX_ITERATIONS: ClassVar[int] = 1_000_000
    MAX_RESTARTS: ClassVar[int] = 1000
    MAX_THREADS: ClassVar[int] = 1024

    regularisation: float | None = None
    tolerance: float | None = None
    min_gain: float | None = None
    max_iterations: int = 200
    restarts: int = 1
    duration_regularisation: float | None = None
    threads: int = 1
    callback: Callable[[int, float], None] | None = None

    def __post_init__(self) -> None:
        for name in ("regularisation", "tolerance", "min_gain"):
            if (value := getattr(self, name)) is None:
                continue
            require_type(value, name, NUMBER, "give a number")
            if not 0.0 <= value <= MAX_MAGNITUDE:
                raise InvalidInput(f"{name} is {value}, expected a number of at least 0")
        if (variance := self.duration_regularisation) is not None:
            require_type(variance, "duration_regularisation", NUMBER, "give a number")
            if not MIN_DURATION_VARIANCE <= variance <= MAX_MAGNITUDE:
                raise InvalidInput(
                    f"duration_regularisation is {variance}, expected a positive variance [steps^2]"
                )
        require_count(self.threads, "threads", self.MAX_THREADS)
        require_count(self.max_iterations, "max_iterations", self.MAX_ITERATIONS, 1)
        require_count(self.restarts, "restarts", self.MAX_RESTARTS, 1)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Convergence:
    """How a fit ended.

    Attributes:
        log_likelihoods: Log-likelihood after every iteration, never decreasing [nats].
        converged: Whether the last iteration gained less than the tolerance.
        iterations: Number of iterations, including one that was undone and those before a state was dropped.
        reason: Why EM stopped, as a sentence.
        dropped: The states that lost their data, each described in a few words.
    """

    log_likelihoods: Float[Array, " I"]
    converged: bool
    iterations: int
    reason: str
    dropped: tuple[str, ...]


def fit_em(
    initial_statistics: Statistics,
    data: Data,
    m_step: MStep,
    settings: EMSettings,
    e_step: EStep | None = None,
) -> tuple[HiddenModel, Statistics, Convergence]:
    """Alternate M- and E-steps until the log-likelihood converges.

    Args:
        initial_statistics: Statistics of the first M-step.
        data: Demonstrations as every frame sees them, in parts or together.
        m_step: Function from statistics and the previous model to a model.
        settings: Tolerance, iterations, threads and callback.
        e_step: Function from a model, the data and the previous statistics to statistics; the default is
            `expected_statistics`.

    Returns:
        The model of highest log-likelihood, its statistics, and how the fit ended.

    Raises:
        NotPositiveDefinite: If a covariance collapses; raise the regularisation.
        InvalidInput: If the demonstrations are impossible under the model.

    Source:
        Tanwani 2018, sections 3.1.1, 3.2.1 and 4.2.1.
    """
    e_step = e_step or partial(expected_statistics, threads=settings.threads)
    dropped: tuple[str, ...] = ()
    iterations = 0
    while True:
        if (empty := _is_empty(initial_statistics)).any():
            counts = initial_statistics.moments[0].counts
            dropped += tuple(
                f"state {k} of {len(counts)}, left with {counts[k]:.2g} datapoints"
                for k in np.flatnonzero(empty)
            )
            initial_statistics = initial_statistics.drop_states(empty)
            continue
        remaining = replace(settings, max_iterations=settings.max_iterations - iterations)
        model, statistics, convergence = _iterate_em(initial_statistics, data, m_step, remaining, e_step)
        iterations += convergence.iterations
        if iterations >= settings.max_iterations or not _is_empty(statistics).any():
            return model, statistics, replace(convergence, iterations=iterations, dropped=dropped)
        initial_statistics = statistics


def _iterate_em(
    statistics: Statistics, data: Data, m_step: MStep, settings: EMSettings, e_step: EStep
) -> tuple[HiddenModel, Statistics, Convergence]:
    """Iterate until convergence, a fall of the log-likelihood, or a state without data."""
    model: HiddenModel | None = None
    best: tuple[HiddenModel, Statistics, Convergence] | None = None
    log_likelihoods: list[float] = []
    for iteration in range(1, settings.max_iterations + 1):
        model = m_step(statistics, model)
        statistics = e_step(model, data, statistics)
        _validate_log_likelihood(statistics, iteration)
        gain = statistics.log_likelihood - log_likelihoods[-1] if log_likelihoods else np.inf
        threshold = _convergence_threshold(statistics, settings)
        if best and gain < 0.0:
            reason = f"the next step would have lost {-gain:.3g} nats, as regularisation or partial tying may"
            trace = np.array(log_likelihoods)
            return best[0], best[1], Convergence(trace, -gain <= threshold, iteration, reason, ())
        log_likelihoods.append(statistics.log_likelihood)
        if settings.callback:
            settings.callback(iteration, statistics.log_likelihood)
        gain_text = f"gained {gain:.3g} nats" if best else "had none before it to compare with"
        reason = f"the last of {iteration} iterations {gain_text}"
        convergence = Convergence(np.array(log_likelihoods), gain <= threshold, iteration, reason, ())
        best = model, statistics, convergence
        if convergence.converged or _is_empty(statistics).any():
            break
    assert best is not None  # max_iterations is at least 1
    return best


def expected_statistics(
    model: HiddenModel | Skill,
    views: Data,
    previous: Statistics | None = None,
    *,
    max_duration: int | None = None,
    threads: int = 1,
    complete: bool = False,
) -> Statistics:
    """Compute the expected statistics of all demonstrations under a model: the E-step.

    Args:
        model: Dynamics and Gaussians of the states.
        views: Demonstrations as every frame sees them. The statistics of parts are added in their order.
        previous: Statistics of the previous EM iteration; segments of a semi-Markov model are considered at
            least up to the same length, so that the likelihood does not fall.
        max_duration: Longest segment of a semi-Markov model [steps]. By default every segment is longer with
            a probability of at most 1e-8. The longest demonstration is an upper bound in any case.
        threads: Number of threads; 0 uses all cores. The result does not depend on it.
        complete: Whether every demonstration of a Markov model ends in its last state.

    Returns:
        The statistics, with the log-likelihood of the demonstrations.

    Raises:
        NotPositiveDefinite: If a covariance of the model is not positive definite.
    """
    if max_duration is None and previous and previous.segments and model.dynamics.durations is not None:
        default = model.dynamics.durations.max_duration(TAIL_PROBABILITY)
        max_duration = max(default, len(previous.segments.uncensored))
    if not isinstance(views, Views):
        compute = partial(
            _statistics_of_part, model=model, max_duration=max_duration, threads=threads, complete=complete
        )
        return reduce(add, views.map(compute))
    factors = [c.precision_cholesky("the covariance of state") for c in model.covariances]
    W = factors[0][None] if len(factors) == 1 else np.stack(factors)  # copying one large factor would be felt
    emissions = kernels.Emissions(model.means, W, views.orientation_starts)
    step, segments = model.dynamics.e_step(
        views.x,
        views.lengths,
        emissions,
        max_duration=max_duration,
        threads=threads,
        final=last_state(len(model.dynamics.initial)) if complete else None,
    )
    starts = views.orientation_starts
    frames: list[Moments | TangentMoments] = [
        TangentMoments(step.counts, means, sums, scatter_matrices, starts)
        if starts
        else Moments.from_sums(means, step.counts, sums, scatter_matrices)
        for means, sums, scatter_matrices in zip(
            model.means, step.deviation_sums, step.scatter_matrices, strict=True
        )
    ]
    log_likelihood = float(step.log_likelihoods.sum())
    return Statistics(tuple(frames), step.initial_counts, step.transition_counts, log_likelihood, segments)


def _statistics_of_part(
    views: Views, model: HiddenModel | Skill, max_duration: int | None, threads: int, complete: bool
) -> Statistics:
    return expected_statistics(model, views, max_duration=max_duration, threads=threads, complete=complete)


def last_state(states: int) -> Float[Array, " K"]:
    """Return 1 for the last of a number of states and 0 for the others."""
    return np.asarray(np.eye(states)[-1])


def maximise_likelihood(
    statistics: Statistics,
    previous: HiddenModel | None,
    structure: CovarianceStructure,
    regularisation: float | Float[Array, " E"],
    fit_dynamics: FitDynamics,
) -> HiddenModel:
    """Compute the model of maximum likelihood for expected statistics: the M-step.

    Args:
        statistics: Expected statistics.
        previous: Model of the previous iteration, from which iterative structures and durations continue.
        structure: Covariance structure of the states.
        regularisation: Added to the diagonal of every sample covariance before the structure is imposed [unit
            of x squared]: one variance for all columns, or one for each.
        fit_dynamics: M-step of the dynamics, such as `MarkovChain.fit`.

    Returns:
        The model.
    """
    before: tuple[Covariances | None, ...] = (
        previous.covariances if previous else (None,) * len(statistics.moments)
    )
    covariances = []
    for m, previous_covariances in zip(statistics.moments, before, strict=True):
        sample_covariances = m.scatter_matrices / m.counts[:, None, None] + regularisation * np.eye(
            m.scatter_matrices.shape[2]
        )
        symmetric = 0.5 * (sample_covariances + sample_covariances.transpose(0, 2, 1))
        covariances.append(structure.estimate(m.counts, symmetric, previous_covariances))
    return HiddenModel(
        fit_dynamics(statistics, previous.dynamics if previous else None),
        np.stack([m.means for m in statistics.moments]),
        tuple(covariances),
    )


def _convergence_threshold(statistics: Statistics, settings: EMSettings) -> float:
    """Return the gain of log-likelihood below which EM has converged [nats]."""
    if settings.tolerance is not None:
        return settings.tolerance * abs(statistics.log_likelihood)
    min_gain = MIN_GAIN if settings.min_gain is None else settings.min_gain
    return min_gain * float(statistics.moments[0].counts.sum())


def _is_empty(statistics: Statistics) -> Bool[Array, " K"]:
    """Return whether each state has less than one datapoint."""
    return np.asarray(statistics.moments[0].counts < 1.0 - 1e-9)


def _validate_log_likelihood(statistics: Statistics, iteration: int) -> None:
    if np.isfinite(statistics.log_likelihood):
        return
    limit, advice = "", ""
    if statistics.segments:
        limit = f" with segments of at most {len(statistics.segments.uncensored)} steps"
        advice = "raise max_duration, "
    raise InvalidInput(
        f"the log-likelihood is {statistics.log_likelihood} in iteration {iteration}: the demonstrations are "
        f"impossible under the model{limit}; {advice}use another initialisation (pf.models.KMeans()) or "
        "raise the regularisation"
    )
