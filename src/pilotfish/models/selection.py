"""Candidates of a model selection, and their log-likelihood on demonstrations that were held out.

`planning.select_by_reproduction` compares the same candidates by the motions that they make.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models.active_bounds import structure_notes
from pilotfish.models.degrees_of_freedom import bic, degrees_of_freedom
from pilotfish.models.duration_model import DurationModel
from pilotfish.models.em import EMSettings
from pilotfish.models.initialisation import Initialisation
from pilotfish.models.learn import DEFAULT_SETTINGS, default_structure, learn
from pilotfish.models.learning_problem import Fit
from pilotfish.models.semi_markov import SemiMarkovChain
from pilotfish.models.sequences import log_likelihood
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, require_type, shorten_repr

VITERBI = "viterbi"  # durations counted along Viterbi paths


@shorten_repr
@dataclass(frozen=True, slots=True)
class Candidate:
    """Arguments of `learn` that are compared, and two choices that only a reproduction depends on.

    `Candidate()` is the configuration of `learn` and `reproduce` without arguments.

    Attributes:
        states: Number of states; None is the default of `learn`.
        structure: Covariance structure; None is the default of `learn`.
        dynamics: "semi-markov", "markov" or "mixture".
        durations: How durations of a semi-Markov skill are fitted; by default they are counted.
        initialisation: Initial statistics of expectation-maximisation; None is the default of `learn`.
        frames: "equal", or "relevance" to weight each frame by its relevance at each state.
        control_cost_factor: Factor of the default control cost.
    """

    states: int | None = None
    structure: CovarianceStructure | None = None
    dynamics: str = SemiMarkovChain.name
    durations: DurationModel | None = None
    initialisation: Initialisation | None = None
    frames: Literal["equal", "relevance"] = "equal"
    control_cost_factor: float = 1.0

    def __post_init__(self) -> None:
        if self.frames not in ("equal", "relevance"):
            raise InvalidInput(f'frames is {self.frames!r}, expected "equal" or "relevance"')
        if require_number(self.control_cost_factor, "control_cost_factor") <= 0.0:
            raise InvalidInput(
                f"control_cost_factor is {self.control_cost_factor}, expected a positive number"
            )

    @property
    def fitted_structure(self) -> CovarianceStructure:
        """The covariance structure that `learn` uses."""
        return self.structure or default_structure(self.states, self.dynamics)

    @property
    def dynamics_label(self) -> str:
        """Name of the duration distribution, "viterbi", "markov" or "mixture"."""
        if self.dynamics != SemiMarkovChain.name:
            return self.dynamics
        return self.durations.distribution.name if self.durations else VITERBI

    @property
    def label(self) -> str:
        """States, structure and dynamics, for tables."""
        states = "default" if self.states is None else self.states
        label = f"{states} states, {self.fitted_structure.label}, {self.dynamics_label}"
        label += ", frames by relevance" if self.frames == "relevance" else ""
        factor = self.control_cost_factor
        return label if factor == 1.0 else f"{label}, control cost x {factor:g}"

    def learn(
        self, demonstrations: Sequence[Demonstration], *, rng: np.random.Generator, settings: EMSettings
    ) -> Fit:
        """Learn a skill with these arguments.

        Args:
            demonstrations: Recordings of one task.
            rng: Source of randomness of the initialisation.
            settings: Settings of expectation-maximisation.

        Returns:
            The skill, and how the fit ended.
        """
        return learn(
            demonstrations,
            states=self.states,
            rng=rng,
            dynamics=self.dynamics,
            durations=self.durations,
            structure=self.structure,
            initialisation=self.initialisation,
            settings=settings,
        )


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """Result of one candidate.

    Attributes:
        candidate: The candidate.
        states: Number of states of the model of all demonstrations, without states that collapsed.
        parameters: Degrees of freedom of that model.
        log_likelihood: Log-likelihood of all demonstrations under that model [nats].
        bic: Bayesian information criterion; lower is better.
        held_out: Log-likelihood per datapoint of each demonstration under the model of the others [nats].
        notes: Active bounds of that model, and too few datapoints for its covariances.
    """

    candidate: Candidate
    states: int
    parameters: int
    log_likelihood: float
    bic: float
    held_out: Float[Array, " M"]
    notes: tuple[str, ...] = ()

    @property
    def held_out_mean(self) -> float:
        """Mean of the held-out log-likelihood over demonstrations [nats per datapoint]."""
        return float(self.held_out.mean())

    @property
    def standard_error(self) -> float:
        """Standard error of that mean."""
        return _standard_error(self.held_out)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """Scores of all candidates, in the order given.

    Attributes:
        scores: Results of the candidates that could be learned.
        failures: Candidates that could not be learned, each with the reason.
    """

    scores: tuple[Score, ...]
    failures: tuple[tuple[Candidate, str], ...]

    @property
    def best(self) -> Score:
        """Score with the fewest parameters among those that are not significantly worse on held-out data.

        A score is not significantly lower if its mean loss against the highest score is at most the standard
        error of that loss, paired by demonstration.

        Raises:
            InvalidInput: If every candidate failed.

        Source:
            Breiman et al. 1984, the one-standard-error rule; here on paired differences.
        """
        reference = self.highest_held_out
        losses = [reference.held_out - score.held_out for score in self.scores]
        eligible = [
            score
            for score, loss in zip(self.scores, losses, strict=True)
            if score is reference or (np.isfinite(loss).all() and loss.mean() <= _standard_error(loss))
        ]
        return min(eligible, key=lambda score: (score.parameters, -score.held_out_mean))

    @property
    def highest_held_out(self) -> Score:
        """Score with the highest held-out log-likelihood.

        Raises:
            InvalidInput: If every candidate failed.
        """
        if not self.scores:
            reasons = {reason for _, reason in self.failures}
            raise InvalidInput(f"no candidate could be learned: {'; '.join(sorted(reasons))}")
        return max(self.scores, key=lambda score: score.held_out_mean)

    @property
    def lowest_bic(self) -> Score:
        """Score with the lowest Bayesian information criterion.

        Raises:
            InvalidInput: If every candidate failed.
        """
        _ = self.highest_held_out
        return min(self.scores, key=lambda score: score.bic)


def select(
    demonstrations: Sequence[Demonstration],
    candidates: Sequence[Candidate],
    *,
    rng: np.random.Generator,
    settings: EMSettings = DEFAULT_SETTINGS,
    callback: Callable[[Candidate], None] | None = None,
) -> Selection:
    """Score every candidate by leave-one-out cross-validation over demonstrations.

    Each candidate is learned from all demonstrations, and without each of them in turn. All candidates use
    the same seeds, so the score of one does not depend on the others. Log-likelihoods multiply the densities
    of all
    frames: compare only candidates with the same frames, columns and units.

    Args:
        demonstrations: At least two.
        candidates: Models to compare; one that collapses or needs more data is reported as a failure.
        rng: Source of the seeds.
        settings: Settings of expectation-maximisation.
        callback: Called with each candidate when it is finished.

    Returns:
        Scores and failures. The cost is one fit more than there are demonstrations, for each candidate.

    Raises:
        InvalidInput: If there are fewer than two demonstrations or no candidates.
    """
    require_selection(demonstrations, candidates)
    seeds = rng.integers(2**63, size=len(demonstrations) + 1).tolist()
    scores: list[Score] = []
    failures: list[tuple[Candidate, str]] = []
    for candidate in candidates:
        try:
            scores.append(_score_candidate(candidate, demonstrations, seeds, settings))
        except (InvalidInput, NotPositiveDefinite) as error:
            failures.append((candidate, str(error)))
        if callback:
            callback(candidate)
    return Selection(tuple(scores), tuple(failures))


def require_selection(demonstrations: Sequence[Demonstration], candidates: Sequence[Candidate]) -> None:
    """Check that there are candidates, and demonstrations to hold out.

    Args:
        demonstrations: Demonstrations of a selection.
        candidates: Candidates of a selection.

    Raises:
        InvalidInput: If there are fewer than two demonstrations or no candidates.
    """
    if len(demonstrations) < 2:
        raise InvalidInput(
            f"{len(demonstrations)} demonstration was given, expected at least two: one is held out in turn"
        )
    if not candidates:
        raise InvalidInput("candidates is empty, expected at least one; give pf.models.Candidate(...)")
    for candidate in candidates:
        require_type(candidate, "candidates", Candidate, "pf.models.Candidate(states, structure) makes one")


def _score_candidate(
    candidate: Candidate, demonstrations: Sequence[Demonstration], seeds: Sequence[int], settings: EMSettings
) -> Score:
    if candidate.frames != "equal" or candidate.control_cost_factor != 1.0:
        raise InvalidInput(
            f"the likelihood does not depend on the frames and the control cost of {candidate.label!r}; "
            "leave them out, or select by reproduction"
        )

    def fit_candidate(training: Sequence[Demonstration], seed: int) -> Fit:
        return candidate.learn(training, rng=np.random.default_rng(seed), settings=settings)

    fit = fit_candidate(demonstrations, seeds[-1])
    skill, notes = fit.skill, fit.active_bounds + structure_notes(fit.skill)
    held_out = []
    for m, (demo, seed) in enumerate(zip(demonstrations, seeds[:-1], strict=True)):
        others = fit_candidate([*demonstrations[:m], *demonstrations[m + 1 :]], seed).skill
        held_out.append(float(log_likelihood(others, [demo])[0]) / len(demo.x))
    total = float(log_likelihood(skill, demonstrations).sum())
    count = degrees_of_freedom(skill, candidate.fitted_structure, candidate.durations)
    criterion = bic(total, count, sum(len(demo.x) for demo in demonstrations))
    return Score(candidate, skill.states, count, total, criterion, np.array(held_out), notes)


def _standard_error(values: Float[Array, " M"]) -> float:
    """Return the standard error of the mean, or NaN for infinite values."""
    if not np.isfinite(values).all():
        return float("nan")
    return float(values.std(ddof=1) / np.sqrt(len(values)))
