"""Learn a task-parameterised skill (TP-GMM, TP-HMM or TP-HSMM) from demonstrations.

A semi-Markov skill is learned in two ways, both after the fit of a Markov skill:

    durations=None           counts the durations along the Viterbi paths of the Markov skill (Tanwani 2018,
                             section 3.2). Cheap, and enough for movements that go once from left to right.
    durations=DurationModel  continues with EM over states and durations together, censored segments included
                             (Yu 2010). The likelihood of the semi-Markov model is maximised.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from pilotfish.demonstrations import Demonstration, Views, views
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures import CovarianceStructure, Full
from pilotfish.models.durations import Gaussian, Segments
from pilotfish.models.dynamics import MarkovChain, MixtureWeights
from pilotfish.models.em import (
    Convergence,
    EMSettings,
    FitDynamics,
    MStep,
    expected_statistics,
    fit_em,
    maximise_likelihood,
)
from pilotfish.models.initialisation import FromModel, Initialisation, KMeans, TimeBins
from pilotfish.models.semi_markov import TAIL_PROBABILITY, DurationModel, SemiMarkovChain
from pilotfish.models.skill import MAX_STATES, HiddenModel, Provenance, Skill
from pilotfish.models.statistics import Statistics
from pilotfish.models.viterbi_durations import count_durations
from pilotfish.types import Array, Float
from pilotfish.validation import require_count, require_type

DEFAULT_STRUCTURE = Full()
DEFAULT_INITIALISATION = TimeBins()
DEFAULT_SETTINGS = EMSettings()
MIN_RELATIVE_DEVIATION = 0.5  # of the durations with which EM of a semi-Markov skill begins
FIT_DYNAMICS: dict[str, FitDynamics] = {
    MixtureWeights.name: MixtureWeights.fit,
    MarkovChain.name: MarkovChain.fit,
    SemiMarkovChain.name: MarkovChain.fit,
}


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A learned skill, and how the fit went.

    Attributes:
        skill: The skill.
        markov_skill: The Markov skill that a semi-Markov fit begins with; otherwise the same as `skill`.
        convergence: How expectation-maximisation ended.
    """

    skill: Skill
    markov_skill: Skill
    convergence: Convergence

    @property
    def log_likelihoods(self) -> Float[Array, " I"]:
        """Return the log-likelihood after every iteration of expectation-maximisation [nats]."""
        return self.convergence.log_likelihoods


def learn(
    demonstrations: Sequence[Demonstration],
    *,
    states: int,
    rng: np.random.Generator,
    dynamics: str = SemiMarkovChain.name,
    durations: DurationModel | None = None,
    structure: CovarianceStructure = DEFAULT_STRUCTURE,
    initialisation: Initialisation = DEFAULT_INITIALISATION,
    settings: EMSettings = DEFAULT_SETTINGS,
) -> Fit:
    """Learn a task-parameterised skill by expectation-maximisation.

    Args:
        demonstrations: Recordings of one task with the same frames, columns and period.
        states: Number of states K.
        rng: Source of randomness of the initialisation.
        dynamics: "semi-markov" (TP-HSMM), "markov" (TP-HMM) or "mixture" (TP-GMM).
        durations: How durations of a semi-Markov skill are fitted together with the states, in O(T K (K + L))
            per iteration. By default they are counted along the Viterbi paths of the Markov skill.
        structure: Covariance structure of the states.
        initialisation: Initial statistics. `FromModel` with a semi-Markov model continues its fit if
            `durations` is given.
        settings: Settings of expectation-maximisation.

    Returns:
        The skill, the Markov skill before it, and how the fit ended.

    Raises:
        InvalidInput: If an argument is wrong, the demonstrations disagree or are too short, or segments
            longer than `durations.max_duration` are needed.
        NotPositiveDefinite: If a covariance collapses; raise `settings.regularisation`.

    Example:
        >>> import numpy as np
        >>> import pilotfish as pf
        >>> x = np.random.default_rng(0).normal(size=(20, 1)) + np.repeat([[0.0], [5.0]], 10, axis=0)
        >>> layout = pf.demonstrations.position_layout(1)
        >>> demonstration = pf.demonstration(x, 0.1, layout, ())
        >>> pf.learn([demonstration], states=2, rng=np.random.default_rng(0)).skill.states
        2

    Source:
        Tanwani 2018, chapters 3 and 4; Yu 2010, the explicit-duration model; Guedon 2003 for right-censored
        last segments.
    """
    require_type(settings, "settings", EMSettings, "pf.models.EMSettings(...) makes one")
    require_type(
        durations, "durations", (DurationModel, type(None)), "pf.models.DurationModel(...) makes one"
    )
    require_type(dynamics, "dynamics", str, "give a name")
    if dynamics not in FIT_DYNAMICS:
        names = ", ".join(map(repr, FIT_DYNAMICS))
        raise InvalidInput(f"dynamics is {dynamics!r}, expected one of {names}")
    if durations and dynamics != SemiMarkovChain.name:
        raise InvalidInput(
            f'durations is given with dynamics={dynamics!r}, expected dynamics="semi-markov"; leave one out'
        )
    _validate_initialisation(initialisation, states, rng, settings.restarts)
    initialise = partial(initialisation.initial_statistics, states=states, rng=rng)
    m_step = _make_m_step(structure, settings, FIT_DYNAMICS[dynamics])
    if durations:
        return _learn_durations(
            demonstrations, initialisation, initialise, m_step, durations, structure, settings
        )
    data = views(demonstrations)
    fit = _learn_steps(demonstrations, data, initialise, m_step, structure, settings)
    if dynamics != SemiMarkovChain.name:
        return fit
    chain = count_durations(fit.markov_skill, data, settings.duration_regularisation)
    return replace(fit, skill=replace(fit.skill, dynamics=chain))


def _validate_initialisation(
    initialisation: Initialisation, states: int, rng: np.random.Generator, restarts: int
) -> None:
    require_type(
        initialisation,
        "initialisation",
        (TimeBins, KMeans, FromModel, Initialisation),
        "give an instance, such as pf.models.KMeans()",
    )
    require_count(states, "states", MAX_STATES, 1)
    require_type(rng, "rng", np.random.Generator, "np.random.default_rng(seed) makes one of a seed")
    if restarts > 1 and (initialisation == DEFAULT_INITIALISATION or isinstance(initialisation, FromModel)):
        raise InvalidInput(
            f"restarts is {restarts}, expected 1, as this initialisation is the same every time; use "
            "TimeBins(jitter=0.5) or KMeans()"
        )


def _make_m_step(structure: CovarianceStructure, settings: EMSettings, fit_dynamics: FitDynamics) -> MStep:
    require_type(
        structure,
        "structure",
        CovarianceStructure,
        "give an instance, such as pf.structures.Full() or pf.structures.SemiTied()",
    )
    return partial(
        maximise_likelihood,
        structure=structure,
        regularisation=settings.regularisation,
        fit_dynamics=fit_dynamics,
    )


def _learn_steps(
    demonstrations: Sequence[Demonstration],
    data: Views,
    initialise: Callable[[Views], Statistics],
    m_step: MStep,
    structure: CovarianceStructure,
    settings: EMSettings,
) -> Fit:
    """Fit a mixture or a Markov skill; of several restarts the most likely."""
    candidates = [initialise(data) for _ in range(settings.restarts)]
    model, convergence = _fit_restarts(candidates, data, m_step, settings)
    skill = _make_skill(demonstrations, model, convergence, structure, settings)
    return Fit(skill, skill, convergence)


def _learn_durations(
    demonstrations: Sequence[Demonstration],
    initialisation: Initialisation,
    initialise: Callable[[Views], Statistics],
    markov_m_step: MStep,
    durations: DurationModel,
    structure: CovarianceStructure,
    settings: EMSettings,
) -> Fit:
    """Fit states and durations together, from a given semi-Markov model or after a Markov fit."""
    data = views(demonstrations)
    if isinstance(initialisation, FromModel) and initialisation.model.dynamics.durations is not None:
        initial_statistics = initialise(data)
        one_iteration = replace(settings, max_iterations=1, callback=None)
        model, _, convergence = fit_em(initial_statistics, data, markov_m_step, one_iteration)
        markov_skill = _make_skill(demonstrations, model, convergence, structure, settings)
        dropped: tuple[str, ...] = ()
    else:
        fit = _learn_steps(demonstrations, data, initialise, markov_m_step, structure, settings)
        markov_skill, dropped = fit.markov_skill, fit.convergence.dropped
        initial_statistics = _widen_durations(
            markov_skill, data, durations.max_duration, settings.duration_regularisation
        )
    fit_chain = partial(
        SemiMarkovChain.fit, duration_model=durations, min_variance=settings.duration_regularisation
    )
    m_step = _make_m_step(structure, settings, fit_chain)
    e_step = partial(expected_statistics, max_duration=durations.max_duration, threads=settings.threads)
    model, _, convergence = fit_em(initial_statistics, data, m_step, settings, e_step)
    skill = _make_skill(demonstrations, model, convergence, structure, settings)
    return Fit(skill, markov_skill, replace(convergence, dropped=dropped + convergence.dropped))


def _widen_durations(
    markov_skill: Skill, data: Views, max_duration: int | None, min_variance: float
) -> Statistics:
    """Return the statistics of the Markov skill with its segments spread over many lengths.

    EM over durations starts from a standard deviation of at least half the mean: narrow durations would keep
    the segmentation of the Markov skill.
    """
    statistics = expected_statistics(markov_skill, data)
    counted = count_durations(markov_skill, data, min_variance).durations
    widened = Gaussian(counted.means, np.maximum(counted.deviations, MIN_RELATIVE_DEVIATION * counted.means))
    limit = min(max_duration or widened.max_duration(TAIL_PROBABILITY), int(data.lengths.max()))
    transition_counts = statistics.transitions * (1.0 - np.eye(len(statistics.initial_counts)))
    table = np.exp(widened.log_table(limit))
    counts = table / table.sum(axis=0) * (statistics.initial_counts + transition_counts.sum(axis=0))
    return replace(statistics, transitions=transition_counts, segments=Segments.all_uncensored(counts))


def _fit_restarts(
    candidates: Sequence[Statistics], data: Views, m_step: MStep, settings: EMSettings
) -> tuple[HiddenModel, Convergence]:
    """Fit from every initialisation; a fit whose covariance collapses fails only if all do."""
    results: list[tuple[HiddenModel, Convergence]] = []
    failures: list[NotPositiveDefinite] = []
    for initial_statistics in candidates:
        try:
            model, _, convergence = fit_em(initial_statistics, data, m_step, settings)
            results.append((model, convergence))
        except NotPositiveDefinite as error:
            failures.append(error)
    if not results:
        raise failures[0]
    model, convergence = max(results, key=lambda result: result[1].log_likelihoods[-1])
    if not failures:
        return model, convergence
    failed = f"{len(failures)} of {len(candidates)} restarts collapsed: {failures[0]}"
    return model, replace(convergence, reason=f"{convergence.reason}; {failed}")


def _make_skill(
    demonstrations: Sequence[Demonstration],
    model: HiddenModel,
    convergence: Convergence,
    structure: CovarianceStructure,
    settings: EMSettings,
) -> Skill:
    """Add layout, period and frames of the demonstrations, and the provenance, to a model."""
    first_demonstration = demonstrations[0]
    provenance = Provenance(
        demonstrations=tuple(d.name for d in demonstrations),
        datapoints=sum(len(d.x) for d in demonstrations),
        data=_hash_demonstrations(demonstrations),
        structure=structure.label,
        regularisation=settings.regularisation,
        log_likelihood=float(convergence.log_likelihoods[-1]),
        iterations=convergence.iterations,
        converged=convergence.converged,
        library=library_version(),
    )
    return Skill(
        model.dynamics,
        model.means,
        model.covariances,
        first_demonstration.layout,
        first_demonstration.period,
        tuple(frame.name for frame in first_demonstration.frames),
        provenance,
    )


def _hash_demonstrations(demonstrations: Sequence[Demonstration]) -> str:
    """Return the SHA-256 of values, shapes, periods and frames of all demonstrations."""
    digest = hashlib.sha256()
    for demonstration in demonstrations:
        digest.update(repr((demonstration.x.shape, demonstration.period, demonstration.layout)).encode())
        for array in (demonstration.x, *(a for frame in demonstration.frames for a in (frame.A, frame.b))):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def library_version() -> str:
    """Return the name and version of this library for the provenance of a skill."""
    try:
        return f"pilotfish {version('pilotfish')}"
    except PackageNotFoundError:  # run from a source tree that was never installed
        return "pilotfish (not installed)"
