"""Skills: learned models of any dynamics, number of frames and covariance structure."""

from dataclasses import dataclass

from pilotfish import kernels
from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import GaussianMixture, precision_cholesky
from pilotfish.gaussians.structures import Covariances
from pilotfish.models.demonstration_statistics import DemonstrationStatistics
from pilotfish.models.semi_markov import Dynamics
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

MAX_STATES = 1000


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class HiddenModel:
    """States with a Gaussian in every frame, as expectation-maximisation estimates them.

    Attributes:
        dynamics: Mixture weights, Markov chain or semi-Markov chain.
        means: Mean of each state in each frame.
        covariances: Covariances of all states, for each frame.
    """

    dynamics: Dynamics
    means: Float[Array, "P K D"]
    covariances: tuple[Covariances, ...]


@shorten_repr
@dataclass(frozen=True, slots=True)
class Provenance:
    """Origin of a skill.

    Attributes:
        demonstrations: Names of the demonstrations.
        datapoints: Number of datapoints.
        data: SHA-256 of the demonstrations and their frames; empty for a stream.
        structure: Name of the covariance structure.
        log_likelihood: Log-likelihood of the demonstrations [nats]; NaN for a stream.
        iterations: Number of iterations of expectation-maximisation.
        converged: Whether it converged.
        library: Version of pilotfish.
        note: Text of the user.
    """

    demonstrations: tuple[str, ...]
    datapoints: int
    data: str
    structure: str
    log_likelihood: float
    iterations: int
    converged: bool
    library: str
    note: str = ""


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Endpoints:
    """Start and end of the demonstrations, as Gaussians with diagonal covariances, from `fit_endpoints`.

    Attributes:
        means: Mean of the first and of the last datapoints in each frame.
        variances: Variance of each tangent column.
    """

    means: Float[Array, "P 2 D"]
    variances: Float[Array, "P 2 E"]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Skill:
    """Learned skill: K states in P frames, and the dynamics between them.

    With orientations on S^3 the means hold unit quaternions, and the covariances are those of deviations:
    rotation vectors [rad] in body axes, with three columns for four.

    Attributes:
        dynamics: Mixture weights (TP-GMM), Markov chain (TP-HMM) or semi-Markov chain (TP-HSMM).
        means: Mean of state k in frame p.
        covariances: Covariances of all states, for each frame.
        layout: Columns.
        period: Time of one step [s].
        frame_names: Name of each frame.
        provenance: Origin of the skill.
        regularisation: Variance that was added to each tangent column of every covariance; None if there was
            none, or if it is unknown.
        demonstrated: Scales and ranges of the demonstrations; None for a skill of a stream.
        endpoints: Start and end of the demonstrations; None for a skill of a stream without scales or
            demonstrations.
    """

    dynamics: Dynamics
    means: Float[Array, "P K D"]
    covariances: tuple[Covariances, ...]
    layout: Layout
    period: float
    frame_names: tuple[str, ...]
    provenance: Provenance
    regularisation: Float[Array, " E"] | None = None
    demonstrated: DemonstrationStatistics | None = None
    endpoints: Endpoints | None = None

    @property
    def states(self) -> int:
        """Number of states K."""
        return int(self.means.shape[1])

    @property
    def width(self) -> int:
        """Number of columns D."""
        return int(self.means.shape[2])


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class AdaptedSkill:
    """Skill adapted to present frames: one Gaussian per state, in the world.

    Attributes:
        dynamics: Dynamics of the skill.
        means: Mean of each state.
        covariances: Covariance of the deviations of each state; E is D less one for each orientation on S^3.
        layout: Columns.
        period: Time of one step [s].
        demonstrated: Scales and ranges of the demonstrations; None if they are unknown.
        endpoints: Start and end of the demonstrations in the world, as two states; None if they are unknown.
    """

    dynamics: Dynamics
    means: Float[Array, "K D"]
    covariances: Float[Array, "K E E"]
    layout: Layout
    period: float
    demonstrated: DemonstrationStatistics | None = None
    endpoints: "AdaptedSkill | None" = None

    @property
    def states(self) -> int:
        """Number of states K."""
        return int(self.means.shape[0])

    def as_mixture(self) -> GaussianMixture:
        """Return the adapted states of a mixture skill as a mixture.

        Raises:
            InvalidInput: If the skill has a time order, in which case weights change over time, or
                orientations on S^3.
        """
        if self.dynamics.has_time_order:
            raise InvalidInput(
                f"the skill has {self.dynamics.name} dynamics, expected a mixture with fixed weights; learn "
                'it with dynamics="mixture", or use models.filtered_regression'
            )
        if self.layout.orientation_starts:
            raise InvalidInput(
                "the skill has orientations on S^3, which a GaussianMixture cannot have; use "
                "models.filtered_regression(model, inputs, x)"
            )
        return GaussianMixture(self.dynamics.initial, self.means, self.covariances)

    def log_state_likelihoods(self, x: Float[Array, "T D"]) -> Float[Array, "T K"]:
        """Compute the log-density of points in the world in every state.

        Args:
            x: One point per row, in the layout of the skill.
        """
        W = precision_cholesky(self.covariances, "the adapted covariance of state")
        return kernels.log_emissions(
            x[None], kernels.Emissions(self.means[None], W[None], self.layout.orientation_starts)
        )
