"""What every fit of one call of `learn` shares, and its result."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from pilotfish.demonstrations import Demonstration, Views, resample, views
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models.demonstration_statistics import DemonstrationStatistics
from pilotfish.models.em import Convergence, EMSettings, FitDynamics, MStep, maximise_likelihood
from pilotfish.models.endpoints import fit_endpoints
from pilotfish.models.skill import HiddenModel, Provenance, Skill
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr


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
class LearningProblem:
    """What every fit of one call of `learn` shares."""

    demonstrations: Sequence[Demonstration]
    data: Views
    states: int
    has_time_order: bool
    structure: CovarianceStructure
    settings: EMSettings
    rng: np.random.Generator
    demonstrated: DemonstrationStatistics
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
        ratio = rows / float(self.data.lengths.mean())
        period = self.demonstrations[0].period / ratio  # rounded numbers of rows would give each its own
        demonstrations = [
            replace(resample(demo, max(2, round(ratio * len(demo.x)))), period=period)
            for demo in self.demonstrations
        ]
        return replace(self, demonstrations=demonstrations, data=views(demonstrations))

    def skill(self, model: HiddenModel, convergence: Convergence) -> Skill:
        """Add layout, period and frames of the demonstrations, and the provenance, to a model."""
        first = self.demonstrations[0]
        provenance = Provenance(
            demonstrations=tuple(d.name for d in self.demonstrations),
            datapoints=sum(len(d.x) for d in self.demonstrations),
            data=_hash_demonstrations(self.demonstrations),
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
            self.demonstrated,
            fit_endpoints(self.data, self.regularisation),
        )


def _hash_demonstrations(demonstrations: Sequence[Demonstration]) -> str:
    """Return the SHA-256 of values, shapes, periods and frames of all demonstrations."""
    digest = hashlib.sha256()
    for demonstration in demonstrations:
        shape, period, parts = demonstration.x.shape, demonstration.period, demonstration.layout.parts
        digest.update(f"({shape!r}, {period!r}, Layout(parts={parts!r}))".encode())
        for array in (demonstration.x, *(a for frame in demonstration.frames for a in (frame.A, frame.b))):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def library_version() -> str:
    """Return the name and version of this library for the provenance of a skill."""
    try:
        return f"pilotfish {version('pilotfish')}"
    except PackageNotFoundError:  # run from a source tree that was never installed
        return "pilotfish (not installed)"
