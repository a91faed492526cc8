"""From demonstrations to a skill, in one call."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from pilotfish.demonstrations import Demonstration, Views, views
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures import CovarianceStructure, Full
from pilotfish.models.durations.counted import count_durations
from pilotfish.models.dynamics import Dynamics
from pilotfish.models.em import Convergence, EMRun, EMSettings, MStep, fit_em
from pilotfish.models.skill import MAX_STATES, Provenance, Skill
from pilotfish.models.starts import FromModel, Initialisation, KMeans, TimeBins
from pilotfish.models.statistics import Statistics, fit_markov_chain, fit_mixture_weights, maximise_likelihood
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_type

DEFAULT_STRUCTURE = Full()
DEFAULT_INITIALISATION = TimeBins()
DEFAULT_SETTINGS = EMSettings()

DynamicsStep = Callable[[Statistics, Dynamics | None], Dynamics]


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A learned skill and how the fit went.

    markov is the model that expectation-maximisation improved, trace its log-likelihood at every iteration.
    For a mixture or a Markov skill, skill and markov are the same.
    """

    skill: Skill
    markov_skill: Skill
    log_likelihoods: Float[Array, " I"]
    convergence: Convergence


def learn(
    demonstrations: Sequence[Demonstration],
    *,
    states: int,
    rng: np.random.Generator,
    structure: CovarianceStructure = DEFAULT_STRUCTURE,
    initialisation: Initialisation = DEFAULT_INITIALISATION,
    settings: EMSettings = DEFAULT_SETTINGS,
) -> Fit:
    """A task-parameterised hidden semi-Markov skill: a Markov model is fitted, then durations are counted.

    Raises: InvalidInput, when demonstrations disagree or are too short for so many states;
    NotPositiveDefinite, when regularisation is too small to hold a covariance.
    Source: Tanwani 2018, chapters 3 and 4.
    """
    fit = learn_markov(
        demonstrations,
        states=states,
        rng=rng,
        structure=structure,
        initialisation=initialisation,
        settings=settings,
    )
    chain = count_durations(fit.markov_skill, views(demonstrations), settings.duration_regularisation)
    return replace(fit, skill=replace(fit.skill, dynamics=chain))


def learn_markov(
    demonstrations: Sequence[Demonstration],
    *,
    states: int,
    rng: np.random.Generator,
    structure: CovarianceStructure = DEFAULT_STRUCTURE,
    initialisation: Initialisation = DEFAULT_INITIALISATION,
    settings: EMSettings = DEFAULT_SETTINGS,
) -> Fit:
    """A task-parameterised hidden Markov skill.

    Raises: as learn does.
    """
    require_type(settings, "settings", EMSettings, "pf.models.EMSettings(...) makes them")
    initialise = _validate_start(initialisation, states, rng, settings.restarts)
    return _fit(
        demonstrations,
        initialise,
        make_m_step(structure, settings, fit_markov_chain),
        structure.label,
        settings,
    )


def learn_mixture(
    demonstrations: Sequence[Demonstration],
    *,
    states: int,
    rng: np.random.Generator,
    structure: CovarianceStructure = DEFAULT_STRUCTURE,
    initialisation: Initialisation = DEFAULT_INITIALISATION,
    settings: EMSettings = DEFAULT_SETTINGS,
) -> Fit:
    """A task-parameterised Gaussian mixture: states without an order in time.

    Raises: as learn does.
    """
    require_type(settings, "settings", EMSettings, "pf.models.EMSettings(...) makes them")
    initialise = _validate_start(initialisation, states, rng, settings.restarts)
    return _fit(
        demonstrations,
        initialise,
        make_m_step(structure, settings, fit_mixture_weights),
        structure.label,
        settings,
    )


def _validate_start(
    initialisation: Initialisation, states: int, rng: np.random.Generator, restarts: int
) -> Callable[[Views], Statistics]:
    require_type(
        initialisation,
        "initialisation",
        (TimeBins, KMeans, FromModel, Initialisation),
        "give an instance, say pf.models.KMeans()",
    )
    require_count(states, "states", MAX_STATES, 1)
    require_type(rng, "rng", np.random.Generator, "np.random.default_rng(seed) makes one of a seed")
    if restarts > 1 and (initialisation == DEFAULT_INITIALISATION or isinstance(initialisation, FromModel)):
        raise InvalidInput(
            f"{restarts} restarts from the same beginning would all end alike; "
            "use TimeBins(jitter=0.5) or KMeans()"
        )
    return partial(initialisation.initial_statistics, states=states, rng=rng)


def make_m_step(structure: CovarianceStructure, settings: EMSettings, chain: DynamicsStep) -> MStep:
    require_type(
        structure,
        "structure",
        CovarianceStructure,
        "give an instance, say pf.structures.Full() or pf.structures.SemiTied()",
    )
    require_type(settings, "settings", EMSettings, "pf.models.EMSettings(...) makes them")
    return partial(
        maximise_likelihood, structure=structure, regularisation=settings.regularisation, chain=chain
    )


def _fit(
    demonstrations: Sequence[Demonstration],
    initialise: Callable[[Views], Statistics],
    m_step: MStep,
    label: str,
    settings: EMSettings,
) -> Fit:
    data = views(demonstrations)
    run = _fit_restarts([initialise(data) for _ in range(settings.restarts)], data, m_step, settings)
    skill = make_skill(demonstrations, run, label, settings)
    return Fit(skill, skill, run.log_likelihoods, run.convergence)


def make_skill(
    demonstrations: Sequence[Demonstration], run: EMRun, label: str, settings: EMSettings
) -> Skill:
    """What a run has found, with the layout, period and frames of the demonstrations, and its provenance."""
    first_demonstration = demonstrations[0]
    provenance = Provenance(
        demonstrations=tuple(d.name for d in demonstrations),
        datapoints=sum(len(d.x) for d in demonstrations),
        data=_hash_demonstrations(demonstrations),
        structure=label,
        regularisation=settings.regularisation,
        log_likelihood=float(run.log_likelihoods[-1]),
        iterations=run.convergence.iterations,
        converged=run.convergence.converged,
        library=library_version(),
    )
    model, names = run.model, tuple(f.name for f in first_demonstration.frames)
    return Skill(
        model.dynamics,
        model.means,
        model.covariances,
        first_demonstration.layout,
        first_demonstration.period,
        names,
        provenance,
    )


def _fit_restarts(
    initial_candidates: Sequence[Statistics], data: Views, m_step: MStep, settings: EMSettings
) -> EMRun:
    """The best of the fits from all guesses; a fit that collapses counts only when all do."""
    runs: list[EMRun] = []
    failed: list[NotPositiveDefinite] = []
    for initialise in initial_candidates:
        try:
            runs.append(fit_em(initialise, data, m_step, settings))
        except NotPositiveDefinite as error:
            failed.append(error)
    if not runs:
        raise failed[0]
    best = max(runs, key=lambda run: run.log_likelihoods[-1])
    if not failed:
        return best
    reason = f"{best.convergence.reason}; {len(failed)} of {len(initial_candidates)} restarts collapsed: {failed[0]}"
    return replace(best, convergence=replace(best.convergence, reason=reason))


def _hash_demonstrations(demonstrations: Sequence[Demonstration]) -> str:
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
