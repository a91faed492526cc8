"""From demonstrations to a skill, in one call."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from pilotfish.demonstrations import Demonstration, Views, views
from pilotfish.errors import InvalidInput, NotPositiveDefinite, require_kind
from pilotfish.gaussians import Full, Structure
from pilotfish.models.durations_counted import with_durations
from pilotfish.models.dynamics import Dynamics
from pilotfish.models.em import EMSettings, MStep, Outcome, Run, improve
from pilotfish.models.skill import MOST_STATES, Provenance, Skill
from pilotfish.models.starts import Given, KMeans, Start, TimeBins
from pilotfish.models.statistics import Statistics, maximise, most_likely_chain, most_likely_weights
from pilotfish.types import Array, Float
from pilotfish.validation import require_count

FULL = Full()
TIME_BINS = TimeBins()
DEFAULTS = EMSettings()

Chain = Callable[[Statistics, Dynamics | None], Dynamics]


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A learned skill and how the fit went.

    markov is the model that expectation-maximisation improved, trace its log-likelihood at every iteration.
    For a mixture or a Markov skill, skill and markov are the same.
    """

    skill: Skill
    markov: Skill
    trace: Float[Array, " I"]
    outcome: Outcome


def learn(
    demonstrations: Sequence[Demonstration],
    *,
    states: int,
    rng: np.random.Generator,
    structure: Structure = FULL,
    start: Start = TIME_BINS,
    settings: EMSettings = DEFAULTS,
) -> Fit:
    """A task-parameterised hidden semi-Markov skill: a Markov model is fitted, then durations are counted.

    Raises: InvalidInput, when demonstrations disagree or are too short for so many states;
    NotPositiveDefinite, when regularisation is too small to hold a covariance.
    Source: Tanwani 2018, chapters 3 and 4.
    """
    fit = learn_markov(
        demonstrations, states=states, rng=rng, structure=structure, start=start, settings=settings
    )
    chain = with_durations(fit.markov, views(demonstrations), settings.duration_floor)
    return replace(fit, skill=replace(fit.skill, dynamics=chain))


def learn_markov(
    demonstrations: Sequence[Demonstration],
    *,
    states: int,
    rng: np.random.Generator,
    structure: Structure = FULL,
    start: Start = TIME_BINS,
    settings: EMSettings = DEFAULTS,
) -> Fit:
    """A task-parameterised hidden Markov skill.

    Raises: as learn does.
    """
    require_kind("settings", settings, EMSettings, "pf.EMSettings(...) makes them")
    guess = _guess(start, states, rng, settings.restarts)
    return _learn(
        demonstrations, guess, m_step_of(structure, settings, most_likely_chain), structure.label, settings
    )


def learn_mixture(
    demonstrations: Sequence[Demonstration],
    *,
    states: int,
    rng: np.random.Generator,
    structure: Structure = FULL,
    start: Start = TIME_BINS,
    settings: EMSettings = DEFAULTS,
) -> Fit:
    """A task-parameterised Gaussian mixture: states without an order in time.

    Raises: as learn does.
    """
    require_kind("settings", settings, EMSettings, "pf.EMSettings(...) makes them")
    guess = _guess(start, states, rng, settings.restarts)
    return _learn(
        demonstrations, guess, m_step_of(structure, settings, most_likely_weights), structure.label, settings
    )


def _guess(
    start: Start, states: int, rng: np.random.Generator, restarts: int
) -> Callable[[Views], Statistics]:
    require_kind("start", start, (TimeBins, KMeans, Given, Start), "give an instance, say pf.KMeans()")
    require_count(states, "states", MOST_STATES, 1)
    require_kind("rng", rng, np.random.Generator, "np.random.default_rng(seed) makes one of a seed")
    if restarts > 1 and (start == TIME_BINS or isinstance(start, Given)):
        raise InvalidInput(
            f"{restarts} restarts from the same beginning would all end alike; "
            "use TimeBins(jitter=0.5) or KMeans()"
        )
    return partial(start.guess, states=states, rng=rng)


def m_step_of(structure: Structure, settings: EMSettings, chain: Chain) -> MStep:
    require_kind("structure", structure, Structure, "give an instance, say pf.Full() or pf.SemiTied()")
    require_kind("settings", settings, EMSettings, "pf.EMSettings(...) makes them")
    return partial(maximise, structure=structure, regularisation=settings.regularisation, chain=chain)


def _learn(
    demonstrations: Sequence[Demonstration],
    guess: Callable[[Views], Statistics],
    m_step: MStep,
    label: str,
    settings: EMSettings,
) -> Fit:
    data = views(demonstrations)
    run = _likeliest([guess(data) for _ in range(settings.restarts)], data, m_step, settings)
    skill = learned(demonstrations, run, label, settings)
    return Fit(skill, skill, run.trace, run.outcome)


def learned(demonstrations: Sequence[Demonstration], run: Run, label: str, settings: EMSettings) -> Skill:
    """What a run has found, with the layout, period and frames of the demonstrations, and its provenance."""
    one = demonstrations[0]
    provenance = Provenance(
        demonstrations=tuple(d.name for d in demonstrations),
        datapoints=sum(len(d.x) for d in demonstrations),
        data=_fingerprint(demonstrations),
        structure=label,
        regularisation=settings.regularisation,
        log_likelihood=float(run.trace[-1]),
        iterations=run.outcome.iterations,
        converged=run.outcome.converged,
        library=library_version(),
    )
    model, names = run.model, tuple(f.name for f in one.frames)
    return Skill(model.dynamics, model.means, model.covariances, one.layout, one.period, names, provenance)


def _likeliest(guesses: Sequence[Statistics], data: Views, m_step: MStep, settings: EMSettings) -> Run:
    """The best of the fits from all guesses; a fit that collapses counts only when all do."""
    runs: list[Run] = []
    failed: list[NotPositiveDefinite] = []
    for guess in guesses:
        try:
            runs.append(improve(guess, data, m_step, settings))
        except NotPositiveDefinite as error:
            failed.append(error)
    if not runs:
        raise failed[0]
    best = max(runs, key=lambda run: run.trace[-1])
    if not failed:
        return best
    reason = f"{best.outcome.reason}; {len(failed)} of {len(guesses)} restarts collapsed: {failed[0]}"
    return replace(best, outcome=replace(best.outcome, reason=reason))


def _fingerprint(demonstrations: Sequence[Demonstration]) -> str:
    """SHA-256 of all that is learned from: values, shapes, period and frames of every demonstration."""
    digest = hashlib.sha256()
    for demonstration in demonstrations:
        digest.update(repr((demonstration.x.shape, demonstration.period, demonstration.layout)).encode())
        for array in (demonstration.x, *(a for frame in demonstration.frames for a in (frame.A, frame.b))):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def library_version() -> str:
    try:
        return f"pilotfish {version('pilotfish')}"
    except PackageNotFoundError:  # run from a source tree that was never installed
        return "pilotfish (not installed)"
