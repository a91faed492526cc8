"""Expectation-maximisation, and an honest account of how it went."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pilotfish.demonstrations import Views
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.models.skill import HiddenModel
from pilotfish.models.statistics import Statistics, further_statistics
from pilotfish.models.visits import of_states
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import LARGEST_MAGNITUDE, require_count

MOST_ITERATIONS, MOST_RESTARTS, MOST_THREADS = 1_000_000, 1000, 1024

NUMBER = (int, float, np.integer, np.floating)
SMALLEST_FLOOR = 1e-100  # steps squared
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
    duration_floor: float = 1.0
    threads: int = 1
    watch: Callable[[int, float], None] | None = None

    def __post_init__(self) -> None:
        for name in ("regularisation", "tolerance"):
            require_kind(name, value := getattr(self, name), NUMBER, "give a number")
            if not 0.0 <= value <= LARGEST_MAGNITUDE:
                raise InvalidInput(f"{name} is {value}, expected a number of at least 0")
        require_kind("duration_floor", self.duration_floor, NUMBER, "give a number")
        if not SMALLEST_FLOOR <= self.duration_floor <= LARGEST_MAGNITUDE:
            raise InvalidInput(
                f"duration_floor is {self.duration_floor}, expected a positive variance [steps^2]"
            )
        require_count(self.threads, "threads", MOST_THREADS)
        require_count(self.max_iterations, "max_iterations", MOST_ITERATIONS, 1)
        require_count(self.restarts, "restarts", MOST_RESTARTS, 1)


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a fit ended. reason is a sentence; dropped names the states that lost their data, and when."""

    converged: bool
    iterations: int
    reason: str
    dropped: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """The best model met, its statistics, and the log-likelihood before every M-step."""

    model: HiddenModel
    sums: Statistics
    trace: Float[Array, " I"]
    outcome: Outcome


def improve(
    guess: Statistics,
    data: Views,
    m_step: MStep,
    settings: EMSettings,
    e_step: EStep | None = None,
) -> Run:
    """Alternate E- and M-steps from a first guess until the likelihood stops rising.

    The log-likelihood never falls along the trace: a step that lowers it - regularisation or partial tying
    can, plain maximum likelihood cannot - is undone and ends the fit. A state left with less than one
    datapoint is dropped and named in the outcome; the trace then begins anew without it.
    e_step is given the model, the data and the statistics before; by default it is further_statistics.
    Raises: NotPositiveDefinite, when a covariance collapses and regularisation is too small to hold it.
    Source: Tanwani 2018, sections 3.1.1, 3.2.1 and 4.2.1.
    """
    e_step = e_step or partial(further_statistics, threads=settings.threads)
    if (empty := _empty(guess)).any():
        rest = improve(without(guess, empty), data, m_step, settings, e_step)
        mass = guess.moments[0].mass
        lost = tuple(
            f"state {k} of {len(mass)}, left with {mass[k]:.2g} datapoints" for k in np.flatnonzero(empty)
        )
        return replace(rest, outcome=replace(rest.outcome, dropped=lost + rest.outcome.dropped))
    run = _climb(guess, data, m_step, settings, e_step)
    left = settings.max_iterations - run.outcome.iterations
    if not left or not _empty(run.sums).any():
        return run
    rest = improve(run.sums, data, m_step, replace(settings, max_iterations=left), e_step)
    iterations = run.outcome.iterations + rest.outcome.iterations
    return replace(rest, outcome=replace(rest.outcome, iterations=iterations))


def _climb(guess: Statistics, data: Views, m_step: MStep, settings: EMSettings, e_step: EStep) -> Run:
    model: HiddenModel | None = None
    sums = guess
    best: Run | None = None
    trace: list[float] = []
    for iteration in range(1, settings.max_iterations + 1):
        model = m_step(sums, model)
        sums = e_step(model, data, sums)
        _refuse_impossible(sums, iteration)
        gain = sums.log_likelihood - trace[-1] if trace else np.inf
        small = settings.tolerance * abs(sums.log_likelihood)
        if best and gain < 0.0:
            reason = f"the next step would have lost {-gain:.3g} nats, as regularisation or partial tying may"
            return replace(best, outcome=Outcome(-gain <= small, iteration, reason, ()))
        trace.append(sums.log_likelihood)
        if settings.watch:
            settings.watch(iteration, sums.log_likelihood)
        gained = f"gained {gain:.3g} nats" if best else "had none before it to compare with"
        reason = f"the last of {iteration} iterations {gained}"
        best = Run(model, sums, np.array(trace), Outcome(gain <= small, iteration, reason, ()))
        if gain <= small or _empty(sums).any():
            break
    assert best is not None  # settings allow at least one iteration
    return best


def _empty(sums: Statistics) -> Bool[Array, " K"]:
    """States with less than one datapoint."""
    return np.asarray(sums.moments[0].mass < 1.0 - 1e-9)


def without(sums: Statistics, gone: Bool[Array, " K"]) -> Statistics:
    """The statistics of the other states; steps through a state that is gone lead to where it led."""
    transitions = sums.transitions.copy()
    for k in np.flatnonzero(gone):
        onward = np.delete(transitions[k], k)
        if onward.sum() > 0.0:
            others = np.delete(np.arange(len(transitions)), k)
            transitions[np.ix_(others, others)] += np.outer(transitions[others, k], onward / onward.sum())
        transitions[k], transitions[:, k] = 0.0, 0.0
    kept = ~gone
    frames = tuple(m[kept] for m in sums.moments)
    visits = of_states(sums.visits, kept) if sums.visits else None
    if visits:
        np.fill_diagonal(transitions, 0.0)  # a visit that was interrupted by a state that is gone
    return Statistics(frames, sums.first[kept], transitions[np.ix_(kept, kept)], sums.log_likelihood, visits)


def _refuse_impossible(sums: Statistics, iteration: int) -> None:
    if not np.isfinite(sums.log_likelihood):
        shorter = f", followed for {len(sums.visits.whole)} steps a visit," if sums.visits else ""
        longer = ", raise longest" if sums.visits else ""
        raise InvalidInput(
            f"the log-likelihood is {sums.log_likelihood} in iteration {iteration}: the demonstrations"
            f"{shorter} are impossible under the model; begin from another start (pf.KMeans()){longer} or "
            "raise the regularisation"
        )
