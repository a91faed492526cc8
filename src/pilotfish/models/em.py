"""Expectation-maximisation, and an honest account of how it went."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pilotfish.demonstrations import Views
from pilotfish.errors import InvalidInput
from pilotfish.models.segments import select_states
from pilotfish.models.skill import HiddenModel
from pilotfish.models.statistics import Statistics, monotone_statistics
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import MAX_MAGNITUDE, require_count, require_type

MAX_ITERATIONS, MAX_RESTARTS, MAX_THREADS = 1_000_000, 1000, 1024

NUMBER = (int, float, np.integer, np.floating)
MIN_DURATION_VARIANCE = 1e-100  # steps squared
MStep = Callable[[Statistics, HiddenModel | None], HiddenModel]
EStep = Callable[[HiddenModel, Views, Statistics], Statistics]


@dataclass(frozen=True, slots=True)
class EMSettings:
    """How long and how carefully to fit.

    regularisation  added to every variance [unit of x squared]; 0 gives plain maximum likelihood
    tolerance       converged when an iteration gains less than this share of the log-likelihood
    restarts        how many beginnings to try; the most likely result wins
    duration_floor  added to the variance of counted durations; what that of learned ones is kept above, where
                    their law has a width of its own [steps squared]
    threads         how many share the work of an E-step; 0 means all cores that this process may use
    watch           called with (iteration, log-likelihood) after every E-step
    """

    regularisation: float = 1e-5
    tolerance: float = 1e-5
    max_iterations: int = 200
    restarts: int = 1
    duration_regularisation: float = 1.0
    threads: int = 1
    callback: Callable[[int, float], None] | None = None

    def __post_init__(self) -> None:
        for name in ("regularisation", "tolerance"):
            require_type(value := getattr(self, name), name, NUMBER, "give a number")
            if not 0.0 <= value <= MAX_MAGNITUDE:
                raise InvalidInput(f"{name} is {value}, expected a number of at least 0")
        require_type(self.duration_regularisation, "duration_regularisation", NUMBER, "give a number")
        if not MIN_DURATION_VARIANCE <= self.duration_regularisation <= MAX_MAGNITUDE:
            raise InvalidInput(
                f"duration_regularisation is {self.duration_regularisation}, expected a positive variance [steps^2]"
            )
        require_count(self.threads, "threads", MAX_THREADS)
        require_count(self.max_iterations, "max_iterations", MAX_ITERATIONS, 1)
        require_count(self.restarts, "restarts", MAX_RESTARTS, 1)


@dataclass(frozen=True, slots=True)
class Convergence:
    """How a fit ended. reason is a sentence; dropped names the states that lost their data, and when."""

    converged: bool
    iterations: int
    reason: str
    dropped: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class EMRun:
    """The best model met, its statistics, and the log-likelihood before every M-step."""

    model: HiddenModel
    statistics: Statistics
    log_likelihoods: Float[Array, " I"]
    convergence: Convergence


def fit_em(
    initial_statistics: Statistics,
    data: Views,
    m_step: MStep,
    settings: EMSettings,
    e_step: EStep | None = None,
) -> EMRun:
    """Alternate E- and M-steps from a first guess until the likelihood stops rising.

    The log-likelihood never falls along the trace: a step that lowers it - regularisation or partial tying
    can, plain maximum likelihood cannot - is undone and ends the fit. A state left with less than one
    datapoint is dropped and named in the outcome; the trace then begins anew without it.
    e_step is given the model, the data and the statistics before; by default it is further_statistics.
    Raises: NotPositiveDefinite, when a covariance collapses and regularisation is too small to hold it.
    Source: Tanwani 2018, sections 3.1.1, 3.2.1 and 4.2.1.
    """
    e_step = e_step or partial(monotone_statistics, threads=settings.threads)
    if (dropped_states := _has_no_data(initial_statistics)).any():
        rest_run = fit_em(drop_states(initial_statistics, dropped_states), data, m_step, settings, e_step)
        counts = initial_statistics.moments[0].counts
        messages = tuple(
            f"state {k} of {len(counts)}, left with {counts[k]:.2g} datapoints"
            for k in np.flatnonzero(dropped_states)
        )
        return replace(
            rest_run,
            convergence=replace(rest_run.convergence, dropped=messages + rest_run.convergence.dropped),
        )
    run = _iterate_em(initial_statistics, data, m_step, settings, e_step)
    remaining = settings.max_iterations - run.convergence.iterations
    if not remaining or not _has_no_data(run.statistics).any():
        return run
    rest_run = fit_em(run.statistics, data, m_step, replace(settings, max_iterations=remaining), e_step)
    iterations = run.convergence.iterations + rest_run.convergence.iterations
    return replace(rest_run, convergence=replace(rest_run.convergence, iterations=iterations))


def _iterate_em(
    initial_statistics: Statistics, data: Views, m_step: MStep, settings: EMSettings, e_step: EStep
) -> EMRun:
    model: HiddenModel | None = None
    statistics = initial_statistics
    best: EMRun | None = None
    log_likelihoods: list[float] = []
    for iteration in range(1, settings.max_iterations + 1):
        model = m_step(statistics, model)
        statistics = e_step(model, data, statistics)
        _validate_log_likelihood(statistics, iteration)
        gain = statistics.log_likelihood - log_likelihoods[-1] if log_likelihoods else np.inf
        threshold = settings.tolerance * abs(statistics.log_likelihood)
        if best and gain < 0.0:
            reason = f"the next step would have lost {-gain:.3g} nats, as regularisation or partial tying may"
            return replace(best, convergence=Convergence(-gain <= threshold, iteration, reason, ()))
        log_likelihoods.append(statistics.log_likelihood)
        if settings.callback:
            settings.callback(iteration, statistics.log_likelihood)
        gain_text = f"gained {gain:.3g} nats" if best else "had none before it to compare with"
        reason = f"the last of {iteration} iterations {gain_text}"
        best = EMRun(
            model,
            statistics,
            np.array(log_likelihoods),
            Convergence(gain <= threshold, iteration, reason, ()),
        )
        if gain <= threshold or _has_no_data(statistics).any():
            break
    assert best is not None  # settings allow at least one iteration
    return best


def _has_no_data(statistics: Statistics) -> Bool[Array, " K"]:
    """States with less than one datapoint."""
    return np.asarray(statistics.moments[0].counts < 1.0 - 1e-9)


def drop_states(statistics: Statistics, removed: Bool[Array, " K"]) -> Statistics:
    """The statistics of the other states; steps through a state that is gone lead to where it led."""
    transitions = statistics.transitions.copy()
    for k in np.flatnonzero(removed):
        next_probs = np.delete(transitions[k], k)
        if next_probs.sum() > 0.0:
            others = np.delete(np.arange(len(transitions)), k)
            transitions[np.ix_(others, others)] += np.outer(
                transitions[others, k], next_probs / next_probs.sum()
            )
        transitions[k], transitions[:, k] = 0.0, 0.0
    kept = ~removed
    frames = tuple(m[kept] for m in statistics.moments)
    segments = select_states(statistics.segments, kept) if statistics.segments else None
    if segments:
        np.fill_diagonal(transitions, 0.0)  # a visit that was interrupted by a state that is gone
    return Statistics(
        frames,
        statistics.initial_counts[kept],
        transitions[np.ix_(kept, kept)],
        statistics.log_likelihood,
        segments,
    )


def _validate_log_likelihood(statistics: Statistics, iteration: int) -> None:
    if not np.isfinite(statistics.log_likelihood):
        duration_text = (
            f", followed for {len(statistics.segments.uncensored)} steps a visit,"
            if statistics.segments
            else ""
        )
        advice = ", raise max_duration" if statistics.segments else ""
        raise InvalidInput(
            f"the log-likelihood is {statistics.log_likelihood} in iteration {iteration}: the demonstrations"
            f"{duration_text} are impossible under the model; begin from another start (pf.models.KMeans()){advice} or "
            "raise the regularisation"
        )
