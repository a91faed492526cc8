"""Model selection by reproduction: compare candidates by the motions that they make in new situations.

Every candidate is learned without some demonstrations (a fold), and reproduced in the situation of each of
them, from its start, over its number of steps, at default costs. A coordinate part of the columns, such as
the position, has three errors there:

    mean distance     of rows at the same time: what a tracker of the motion sees
    warped distance   of rows that dynamic time warping pairs: the path, whatever the timing
    end error         distance of the last rows: where an object is left

Each is divided by the scale of the part (`models/demonstration_statistics.py`), so that units do not matter;
orientations are compared by angles. The score of a held-out demonstration is the sum of the three, averaged
over parts. One error alone rewards the wrong model: the mean distance of people's repetitions is mostly
timing, the warped distance ignores a late arrival, and an end can be right after a wrong path.

Choice. The default of `learn` is always a candidate. It is kept unless another one is significantly better:
by a one-sided t-test of the differences, paired by demonstration, at 5 % for all candidates together
(Bonferroni). Of those, the one of the lowest mean score is chosen. Candidates on the same few demonstrations
differ by chance, and the lowest of many scores is as often worse as better than the default on the next
demonstration; so is a gain of one standard error (`reproductions/select_splits.py`).
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, Quantity
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.gaussians.structures import Diagonal, Full, SemiTied
from pilotfish.geometry import angle
from pilotfish.models import (
    Candidate,
    EMSettings,
    Skill,
    adapt,
    default_states,
    relevance,
    require_selection,
)
from pilotfish.planning.costs import default_control_cost
from pilotfish.planning.evaluation import warped_mean
from pilotfish.planning.reproduction import reproduce_adapted
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

DEFAULT_CANDIDATE = Candidate()  # the configuration of `learn` and `reproduce` without arguments
DEFAULT_SETTINGS = EMSettings()
STATE_COUNTS, MIN_ROWS = (15, 20, 40), 2  # of `default_candidates`; steps of a demonstration for each state
ROWS_PER_COLUMN = 3  # of each state, for full covariances
SIGNIFICANCE = 0.05  # probability of replacing a default that is as good as every candidate
MAX_FOLDS = 5  # fits of a candidate
MAX_WARPED_ROWS = 200  # longer motions are warped at 200 rows of equal distance in time
MEASURES = ("mean distance", "warped distance", "end error")


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ReproductionScore:
    """Result of one candidate.

    Attributes:
        candidate: The candidate.
        states: Number of states that it asks for.
        values: Score of each held-out demonstration or situation; lower is better.
        measures: What the score consists of, by name.
    """

    candidate: Candidate
    states: int
    values: Float[Array, " M"]
    measures: dict[str, Float[Array, " M"]]

    @property
    def mean(self) -> float:
        """Mean of the score."""
        return float(self.values.mean())

    @property
    def standard_error(self) -> float:
        """Standard error of that mean."""
        return _standard_error(self.values)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ReproductionSelection:
    """Scores of all candidates; the first candidate is the default.

    Attributes:
        scores: Results of the candidates that could be learned and reproduced.
        failures: The other candidates, each with the reason.
        fits: Number of calls of `learn`.
        executions: Number of executions in physics.
    """

    scores: tuple[ReproductionScore, ...]
    failures: tuple[tuple[Candidate, str], ...]
    fits: int
    executions: int = 0

    @property
    def best(self) -> ReproductionScore:
        """The default, unless another candidate is significantly better; of several the lowest mean.

        Without a score of the default, this is the score of the lowest mean.

        Raises:
            InvalidInput: If every candidate failed.
        """
        default = self.default
        if default is None or not self.scores:
            return self.lowest
        better = [score for score in self.scores if self._is_significantly_better(score)]
        return min(better, key=lambda score: score.mean, default=default)

    def _is_significantly_better(self, score: ReproductionScore) -> bool:
        """Return whether a score is lower than that of the default, by a paired one-sided t-test.

        The level of the test is divided by the number of candidates that are compared with the default.
        """
        from scipy.special import stdtrit  # quantile of Student's t; a slow import

        degrees = len(score.values) - 1
        if score is self.default or degrees < 1:
            return False
        gain, error = self.gain(score)
        return gain > error * float(stdtrit(degrees, 1.0 - SIGNIFICANCE / (len(self.scores) - 1)))

    def gain(self, score: ReproductionScore) -> tuple[float, float]:
        """Return by how much a score is lower than that of the default, and the standard error of this.

        Args:
            score: One of the scores.

        Raises:
            InvalidInput: If the default failed.
        """
        if self.default is None:
            raise InvalidInput("the default has no score, expected one; see failures")
        gains = self.default.values - score.values
        return float(gains.mean()), _standard_error(gains)

    @property
    def lowest(self) -> ReproductionScore:
        """Score of the lowest mean, which may be low by chance.

        Raises:
            InvalidInput: If every candidate failed.
        """
        if not self.scores:
            reasons = {reason for _, reason in self.failures}
            raise InvalidInput(f"no candidate could be reproduced: {'; '.join(sorted(reasons))}")
        return min(self.scores, key=lambda score: score.mean)

    @property
    def default(self) -> ReproductionScore | None:
        """Score of the default; None if it failed."""
        return next((s for s in self.scores if s.candidate == DEFAULT_CANDIDATE), None)

    @property
    def edge(self) -> str | None:
        """Whether the choice has the "largest" or "smallest" number of states tried.

        None if the default is kept, or all candidates have one number of states.
        """
        best = self.best
        tried = [s.states for s in self.scores] + [c.states for c, _ in self.failures if c.states]
        if best.candidate == DEFAULT_CANDIDATE or min(tried) == max(tried):
            return None
        return {max(tried): "largest", min(tried): "smallest"}.get(best.states)


def default_candidates(demonstrations: Sequence[Demonstration]) -> list[Candidate]:
    """Return the candidates that `pilotfish select` compares: the default, and variations of it.

    They differ in the number of states and the covariance structure, and one weights frames by relevance.
    Full covariances are tried where every state has three rows per column, semi-tied ones, which share
    their directions, at up to the default number of states.

    Args:
        demonstrations: At least two.
    """
    most = default_states(demonstrations)
    rows, shortest = sum(len(d.x) for d in demonstrations), min(len(d.x) for d in demonstrations)
    counts = [count for count in STATE_COUNTS if count < most or most < count <= shortest // MIN_ROWS]
    width = demonstrations[0].layout.tangent.width
    few = [count for count in counts if count < most]
    supported = [count for count in few if rows >= ROWS_PER_COLUMN * width * count]
    weighted = [Candidate(frames="relevance")] if len(demonstrations[0].frames) > 1 else []
    return [
        DEFAULT_CANDIDATE,
        *weighted,
        *(Candidate(count, Diagonal()) for count in counts),
        *(Candidate(count, SemiTied()) for count in (*few, most)),
        *(Candidate(count, Full()) for count in supported),
    ]


def select_by_reproduction(
    demonstrations: Sequence[Demonstration],
    candidates: Sequence[Candidate],
    *,
    rng: np.random.Generator,
    settings: EMSettings = DEFAULT_SETTINGS,
    executor: Executor | None = None,
    callback: Callable[[Candidate], None] | None = None,
) -> ReproductionSelection:
    """Score candidates, and the default of `learn`, by reproductions of held-out demonstrations.

    The head of this file describes score and choice. Each demonstration is held out in turn, or each of five
    groups of them if there are more than five. All candidates use the same seeds, so that the score of one
    does not depend on the others, on their order, or on the executor.

    Args:
        demonstrations: At least two, of coordinates and their derivatives, with frames that do not move.
        candidates: Models to compare; the default is added.
        rng: Source of the seeds.
        settings: Settings of expectation-maximisation.
        executor: Runs the fits, such as a `concurrent.futures.ProcessPoolExecutor`; None runs them here.
        callback: Called with the candidate after every fit.

    Returns:
        Scores and failures. The cost is at most five fits for each candidate.

    Raises:
        InvalidInput: If there are fewer than two demonstrations or no candidates.

    Example:
        >>> demonstrations = pf.io.synthetic_valve(np.random.default_rng(0))[:3]
        >>> candidates = [pf.models.Candidate(states) for states in (4, 6)]
        >>> selection = pf.planning.select_by_reproduction(
        ...     demonstrations, candidates, rng=np.random.default_rng(0)
        ... )
        >>> selection.fits
        9
    """
    require_selection(demonstrations, candidates)
    every_candidate = (DEFAULT_CANDIDATE, *(c for c in candidates if c != DEFAULT_CANDIDATE))
    groups = [range(n, len(demonstrations), MAX_FOLDS) for n in range(min(MAX_FOLDS, len(demonstrations)))]
    seeds = rng.integers(2**63, size=len(groups)).tolist()
    folds = [
        _Fold(
            candidate,
            tuple(d for m, d in enumerate(demonstrations) if m not in group),
            tuple(demonstrations[m] for m in group),
            seed,
            settings,
        )
        for candidate in every_candidate
        for group, seed in zip(groups, seeds, strict=True)
    ]
    results = []
    for fold, result in zip(folds, (executor.map if executor else map)(_score_fold, folds), strict=True):
        results.append(result)
        if callback:
            callback(fold.candidate)
    order = np.argsort([m for group in groups for m in group])
    return _collect(every_candidate, results, order, default_states(demonstrations))


@dataclass(frozen=True, slots=True, eq=False)
class _Fold:
    """Fit of a candidate without some demonstrations."""

    candidate: Candidate
    training: tuple[Demonstration, ...]
    held_out: tuple[Demonstration, ...]
    seed: int
    settings: EMSettings


def _collect(
    candidates: Sequence[Candidate],
    results: Sequence[Float[Array, "_ 4"] | str],
    order: Array,
    default_count: int,
) -> ReproductionSelection:
    """Put the results of all folds together."""
    scores, failures = [], []
    count = len(results) // len(candidates)
    for n, candidate in enumerate(candidates):
        own = results[n * count : (n + 1) * count]
        if reasons := [result for result in own if isinstance(result, str)]:
            failures.append((candidate, reasons[0]))
            continue
        rows = np.concatenate([result for result in own if not isinstance(result, str)])[order]
        measures = {name: rows[:, i] for i, name in enumerate(MEASURES)}
        if np.isfinite(rows[:, -1]).all():
            measures["angle [deg]"] = np.degrees(rows[:, -1])
        values = rows[:, : len(MEASURES)].sum(axis=1)
        scores.append(ReproductionScore(candidate, candidate.states or default_count, values, measures))
    return ReproductionSelection(tuple(scores), tuple(failures), len(results))


def _score_fold(fold: _Fold) -> Float[Array, "N 4"] | str:
    """Return the errors of each held-out demonstration, or why the candidate failed."""
    rng = np.random.default_rng(fold.seed)
    try:
        return held_out_errors(fold.candidate, fold.training, fold.held_out, rng=rng, settings=fold.settings)
    except SkillError as error:
        return str(error)


def held_out_errors(
    candidate: Candidate,
    training: Sequence[Demonstration],
    held_out: Sequence[Demonstration],
    *,
    rng: np.random.Generator,
    settings: EMSettings = DEFAULT_SETTINGS,
) -> Float[Array, "N 4"]:
    """Learn from some demonstrations, and compare reproductions with others.

    Args:
        candidate: How to learn and to reproduce.
        training: Demonstrations to learn from.
        held_out: Demonstrations to reproduce, each in its situation, from its start, over its length.
        rng: Source of randomness of the fit.
        settings: Settings of expectation-maximisation.

    Returns:
        A row of `relative_errors` for each held-out demonstration.

    Raises:
        SkillError: If the skill cannot be learned or reproduced.
    """
    skill = candidate.learn(training, rng=rng, settings=settings).skill
    weights = relevance(skill, training).values if candidate.frames == "relevance" else None
    return np.stack([_reproduction_errors(skill, weights, demo, candidate) for demo in held_out])


def _reproduction_errors(
    skill: Skill, weights: Float[Array, "P K"] | None, demonstration: Demonstration, candidate: Candidate
) -> Float[Array, " 4"]:
    """Return the errors of the reproduction of a demonstration that was held out."""
    adapted = adapt(skill, demonstration.frames, relevance=weights)
    factor = candidate.control_cost_factor
    R = None if factor == 1.0 else factor * default_control_cost(adapted)
    start, steps = demonstration.x[0], len(demonstration.x)
    motion = reproduce_adapted(adapted, start, horizon=steps, control_cost=R).motion
    assert skill.demonstrated is not None  # `learn` states them
    return relative_errors(motion, demonstration, skill.demonstrated.scales)


def relative_errors(
    motion: Motion, demonstration: Demonstration, scales: Float[Array, " E"]
) -> Float[Array, " 4"]:
    """Compute mean distance, warped distance and end error, relative to scales, and the mean angle [rad].

    Args:
        motion: Reproduced motion.
        demonstration: Demonstration with the same number of steps and columns.
        scales: Scale of each tangent column.

    Returns:
        The three errors, each the mean over coordinate parts, and the mean angle; NaN without orientations.
    """
    layout, T = demonstration.layout, len(demonstration.x)
    thinned = np.linspace(0, T - 1, min(T, MAX_WARPED_ROWS)).round().astype(int)
    errors, angles = [], []
    for part, columns, tangent in zip(layout.parts, layout.slices, layout.tangent.slices, strict=True):
        if part.derivative:
            continue
        x, y, scale = motion.x[:, columns], demonstration.x[:, columns], scales[tangent.start]
        if part.quantity in (Quantity.QUATERNION, Quantity.ORIENTATION):
            distances, apart = angle(x, y), angle(x[thinned, None], y[None, thinned])
            angles.append(distances.mean())
            scale *= 2.0 if part.quantity is Quantity.QUATERNION else 1.0  # chords are half the angle
        else:
            distances = np.linalg.norm(x - y, axis=1)
            apart = np.linalg.norm(x[thinned, None] - y[None, thinned], axis=2)
        errors.append(np.array([distances.mean(), warped_mean(apart), distances[-1]]) / scale)
    return np.append(np.mean(errors, axis=0), np.mean(angles) if angles else np.nan)


def _standard_error(values: Float[Array, " M"]) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else 0.0
