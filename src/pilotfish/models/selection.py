"""How large a model should be: candidates compared on demonstrations that they did not learn from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models.em import EMSettings
from pilotfish.models.freedom import degrees_of_freedom
from pilotfish.models.initialisation import Initialisation
from pilotfish.models.learn import DEFAULT_INITIALISATION, DEFAULT_SETTINGS, learn
from pilotfish.models.semi_markov import DurationModel, SemiMarkovChain
from pilotfish.models.sequences import log_likelihood
from pilotfish.models.skill import Skill
from pilotfish.types import Array, Float

COUNTED = "counted"  # durations counted along Viterbi paths


@dataclass(frozen=True, slots=True)
class Candidate:
    """Arguments of `learn` that are compared by `select`.

    Attributes:
        states: Number of states.
        structure: Covariance structure.
        dynamics: "semi-markov", "markov" or "mixture".
        durations: How durations of a semi-Markov skill are fitted; by default they are counted.
        initialisation: Initial statistics of expectation-maximisation.
    """

    states: int
    structure: CovarianceStructure
    dynamics: str = SemiMarkovChain.name
    durations: DurationModel | None = None
    initialisation: Initialisation = DEFAULT_INITIALISATION

    @property
    def dynamics_label(self) -> str:
        """Return the name of the duration distribution, "counted", "markov" or "mixture"."""
        if self.dynamics != SemiMarkovChain.name:
            return self.dynamics
        return self.durations.distribution.name if self.durations else COUNTED

    @property
    def label(self) -> str:
        """Return states, structure and dynamics in a few words."""
        return f"{self.states} states, {self.structure.label}, {self.dynamics_label}"


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """How a candidate did.

    states          that were learned; collapsed ones are dropped by learning
    parameters      free numbers of the model that all demonstrations give
    log_likelihood  of all demonstrations under it [nats]
    bic             -2 log-likelihood + parameters log(datapoints); low is good
    held_out        log-likelihood per datapoint [nats] of each demonstration under the model of the others
    """

    candidate: Candidate
    states: int
    parameters: int
    log_likelihood: float
    bic: float
    held_out: Float[Array, " M"]

    @property
    def mean(self) -> float:
        return float(self.held_out.mean())

    @property
    def standard_error(self) -> float:
        """Of the mean over demonstrations."""
        return _standard_error(self.held_out)


@dataclass(frozen=True, slots=True)
class FailedCandidate:
    """A candidate that could not be learned, and why."""

    candidate: Candidate
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """Candidates in the order given: those that could be scored, and those that could not."""

    scores: tuple[Score, ...]
    failures: tuple[FailedCandidate, ...]

    @property
    def best(self) -> Score:
        """The fewest parameters among those that explain held-out demonstrations about as well as any.

        About as well: the mean over demonstrations of what is lost against the highest score is at most its
        standard error, demonstration by demonstration.
        Raises: InvalidInput, when every candidate failed.
        Source: the one-standard-error rule, Breiman et al. 1984, on paired differences.
        """
        reference = self.highest_held_out
        losses = [reference.held_out - score.held_out for score in self.scores]
        eligible = [
            score
            for score, loss in zip(self.scores, losses, strict=True)
            if score is reference or (np.isfinite(loss).all() and loss.mean() <= _standard_error(loss))
        ]
        return min(eligible, key=lambda score: (score.parameters, -score.mean))

    @property
    def highest_held_out(self) -> Score:
        """The highest held-out log-likelihood.    Raises: InvalidInput, when every candidate failed."""
        if not self.scores:
            reasons = {failure.reason for failure in self.failures}
            raise InvalidInput(f"no candidate could be learned: {'; '.join(sorted(reasons))}")
        return max(self.scores, key=lambda score: score.mean)

    @property
    def lowest_bic(self) -> Score:
        """The lowest Bayesian information criterion.    Raises: InvalidInput, when every candidate failed."""
        _ = self.highest_held_out
        return min(self.scores, key=lambda score: score.bic)


def select(
    demonstrations: Sequence[Demonstration],
    candidates: Sequence[Candidate],
    *,
    rng: np.random.Generator,
    settings: EMSettings = DEFAULT_SETTINGS,
    callback: Callable[[Score | FailedCandidate], None] | None = None,
) -> Selection:
    """Every candidate learned from all demonstrations, and again without each of them in turn.

    All candidates begin with the same seeds, so that the score of one does not depend on the others. One that
    collapses or asks for more than the data has is a failure, not an error; watch hears of each as it ends.
    Log-likelihoods multiply the densities of all frames, so scores compare only between candidates that see
    the same frames, columns and units.
    Cost: one fit more than there are demonstrations, for each candidate.
    Raises: InvalidInput, when there are fewer than two demonstrations or no candidates.
    """
    if len(demonstrations) < 2:
        raise InvalidInput(
            f"{len(demonstrations)} demonstration was given, expected at least two: one is held out in turn"
        )
    if not candidates:
        raise InvalidInput("there are no candidates, expected at least one")
    seeds = rng.integers(2**63, size=len(demonstrations) + 1)
    scores: list[Score] = []
    failures: list[FailedCandidate] = []
    for candidate in candidates:
        result = _score_candidate(candidate, demonstrations, seeds.tolist(), settings)
        if isinstance(result, Score):
            scores.append(result)
        else:
            failures.append(result)
        if callback:
            callback(result)
    return Selection(tuple(scores), tuple(failures))


def bic(log_likelihood: float, parameters: int, datapoints: int) -> float:
    """-2 log-likelihood + parameters log(datapoints): low is good.

    Rows of one demonstration follow each other closely and tell less than as many independent ones, so the
    criterion is milder with large models than it should be.    Source: Schwarz 1978.
    """
    return -2.0 * log_likelihood + parameters * float(np.log(datapoints))


def _score_candidate(
    candidate: Candidate, demonstrations: Sequence[Demonstration], seeds: Sequence[int], settings: EMSettings
) -> Score | FailedCandidate:
    def learn_skill(training: Sequence[Demonstration], seed: int) -> Skill:
        return learn(
            training,
            states=candidate.states,
            rng=np.random.default_rng(seed),
            dynamics=candidate.dynamics,
            durations=candidate.durations,
            structure=candidate.structure,
            initialisation=candidate.initialisation,
            settings=settings,
        ).skill

    try:
        skill = learn_skill(demonstrations, seeds[-1])
        held_out = [
            float(
                log_likelihood(
                    learn_skill([*demonstrations[:m], *demonstrations[m + 1 :]], seed),
                    [held_out_demonstration],
                )[0]
            )
            / len(held_out_demonstration.x)
            for m, (held_out_demonstration, seed) in enumerate(zip(demonstrations, seeds, strict=False))
        ]
        training = float(log_likelihood(skill, demonstrations).sum())
    except (InvalidInput, NotPositiveDefinite) as error:
        return FailedCandidate(candidate, str(error))
    count = degrees_of_freedom(skill, candidate.structure, candidate.durations)
    points = sum(len(d.x) for d in demonstrations)
    return Score(candidate, skill.states, count, training, bic(training, count, points), np.array(held_out))


def _standard_error(values: Float[Array, " M"]) -> float:
    """Of the mean; infinite values have none."""
    if not np.isfinite(values).all():
        return float("nan")
    return float(values.std(ddof=1) / np.sqrt(len(values)))
