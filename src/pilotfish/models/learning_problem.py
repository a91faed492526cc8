"""What every fit of one call of `learn` shares, and its result."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from pilotfish.demonstrations import Demonstration, Views, resample, views
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models.demonstration_summary import DemonstrationSummary
from pilotfish.models.em import Convergence, EMSettings, FitDynamics, MStep, maximise_likelihood
from pilotfish.models.endpoints import fit_endpoints
from pilotfish.models.partitions import DemonstrationGroup, Partitions, first_demonstration, group_views
from pilotfish.models.skill import HiddenModel, Provenance, Skill
from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr

MAX_SAMPLE = 500  # demonstrations with which initialisations are compared


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A learned skill, and how the fit went.

    Attributes:
        skill: The skill.
        markov_skill: The Markov skill that a semi-Markov fit begins with; otherwise the same as `skill`.
        convergence: How expectation-maximisation ended; see `log_likelihoods`.
        active_bounds: A sentence for each bound that decided the fit, with its remedy.
    """

    skill: Skill
    markov_skill: Skill
    convergence: Convergence
    active_bounds: tuple[str, ...] = ()

    @property
    def log_likelihoods(self) -> Float[Array, " I"]:
        """Return the log-likelihood after every iteration of expectation-maximisation [nats].

        Without a given initialisation, it is that of demonstrations resampled to about 100 rows; that of all
        rows is `skill.provenance.log_likelihood`.
        """
        return self.convergence.log_likelihoods


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """Demonstrations from which EM begins: all, or at most `MAX_SAMPLE` of a large set.

    Attributes:
        numbers: Their numbers in the set.
        demonstrations: The demonstrations.
        data: The demonstrations as every frame sees them.
    """

    numbers: tuple[int, ...]
    demonstrations: Sequence[Demonstration]
    data: Views


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class LearningProblem:
    """What every fit of one call of `learn` shares. Rows stay where the parts of `source` are."""

    source: Partitions[DemonstrationGroup]
    summary: DemonstrationSummary
    data: Partitions[Views]
    states: int
    has_time_order: bool
    structure: CovarianceStructure
    settings: EMSettings
    rng: np.random.Generator
    regularisation: Float[Array, " E"]

    def m_step(self, fit_dynamics: FitDynamics) -> MStep:
        """Return the M-step of these dynamics."""
        return partial(
            maximise_likelihood,
            structure=self.structure,
            regularisation=self.regularisation,
            fit_dynamics=fit_dynamics,
        )

    def resample(self, rows: int) -> "LearningProblem":
        """Return the problem with demonstrations of another number of rows, on average.

        Statistics and regularisation remain those of the given demonstrations.

        Raises:
            InvalidInput: If a demonstration cannot be interpolated.
        """
        lengths = self.summary.lengths
        ratio = rows / float(lengths.mean())
        period = self.summary.first.period / ratio  # rounded numbers of rows would give each its own
        source = self.source.transform(partial(_resample_group, ratio=ratio, period=period))
        new_lengths = np.concatenate(list(source.map(_lengths)))
        first = first_demonstration(source)
        data = source.transform(partial(group_views, first=first))
        summary = replace(self.summary, first=first, lengths=new_lengths)
        return replace(self, source=source, summary=summary, data=data)

    def sample(self, included: Sequence[int] = ()) -> Sample:
        """Return all demonstrations, or `MAX_SAMPLE` of a larger set at equal distances.

        Args:
            included: Numbers of demonstrations that a sample has in any case.
        """
        count = len(self.summary.lengths)
        numbers = list(range(count))
        if count > MAX_SAMPLE:
            chosen = np.linspace(0, count - 1, MAX_SAMPLE).round().astype(int).tolist()
            numbers = sorted({*chosen, *included})
        select = partial(_select, numbers=frozenset(numbers))
        demonstrations = [demo for group in self.source.map(select) for demo in group]
        return Sample(tuple(numbers), demonstrations, views(demonstrations, self.summary.first))

    def skill(self, model: HiddenModel, convergence: Convergence) -> Skill:
        """Add layout, period and frames of the demonstrations, and the provenance, to a model."""
        first = self.summary.first
        provenance = Provenance(
            demonstrations=self.summary.names,
            datapoints=int(self.summary.lengths.sum()),
            data=self.summary.digest,
            structure=self.structure.label,
            log_likelihood=float(convergence.log_likelihoods[-1]),
            iterations=convergence.iterations,
            converged=convergence.converged,
            library=library_version(),
        )
        return Skill(
            model.dynamics,
            model.means,
            model.covariances,
            first.layout,
            first.period,
            tuple(frame.name for frame in first.frames),
            provenance,
            self.regularisation,
            self.summary.statistics,
            fit_endpoints(self.data, self.regularisation),
        )


def _resample_group(group: DemonstrationGroup, ratio: float, period: float) -> DemonstrationGroup:
    return DemonstrationGroup(
        group.start,
        tuple(
            replace(resample(demo, max(2, round(ratio * len(demo.x)))), period=period)
            for demo in group.demonstrations
        ),
    )


def _lengths(group: DemonstrationGroup) -> Int[Array, " M"]:
    return np.array([len(demo.x) for demo in group.demonstrations], dtype=np.int64)


def _select(group: DemonstrationGroup, numbers: frozenset[int]) -> list[Demonstration]:
    return [demo for m, demo in enumerate(group.demonstrations, start=group.start) if m in numbers]


def library_version() -> str:
    """Return the name and version of this library for the provenance of a skill."""
    try:
        return f"pilotfish {version('pilotfish')}"
    except PackageNotFoundError:  # run from a source tree that was never installed
        return "pilotfish (not installed)"
