"""What is learned: one value for every dynamics, number of frames and covariance structure."""

from dataclasses import dataclass

from pilotfish.demonstrations import Layout
from pilotfish.gaussians.structures import Covariances
from pilotfish.models.semi_markov import Dynamics
from pilotfish.types import Array, Float

MAX_STATES = 1000
MAX_SKILL_NUMBERS = 2**26  # in the dense covariances of all states in all frames: 512 MiB


@dataclass(frozen=True, slots=True, eq=False)
class HiddenModel:
    """States with a Gaussian in every frame: what expectation-maximisation improves."""

    dynamics: Dynamics
    means: Float[Array, "P K D"]
    covariances: tuple[Covariances, ...]


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where a skill comes from, for whoever finds its file.

    data is the SHA-256 of the demonstrations and their frames, structure names the covariance structure.
    """

    demonstrations: tuple[str, ...]
    datapoints: int
    data: str
    structure: str
    regularisation: float
    log_likelihood: float
    iterations: int
    converged: bool
    library: str
    note: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Skill:
    """A learned movement, seen from P frames at once: K states, and how they follow one another.

    means[p, k] and covariances[p].dense[k] describe state k as an observer at frame p sees it. Where the
    layout has orientations, means hold unit quaternions and covariances are those of deviations: rotation
    vectors [rad] in the axes of the turned body, three columns for four.
    period is the time of one step [s]; frame_names says which object each frame belongs to.
    """

    dynamics: Dynamics
    means: Float[Array, "P K D"]
    covariances: tuple[Covariances, ...]
    layout: Layout
    period: float
    frame_names: tuple[str, ...]
    provenance: Provenance

    @property
    def states(self) -> int:
        return int(self.means.shape[1])

    @property
    def width(self) -> int:
        return int(self.means.shape[2])


@dataclass(frozen=True, slots=True, eq=False)
class AdaptedSkill:
    """A skill where the objects stand now: one Gaussian for each state, in the world.

    Covariances are of deviations: E = D less one for each orientation of the layout (see Skill).
    """

    dynamics: Dynamics
    means: Float[Array, "K D"]
    covariances: Float[Array, "K E E"]
    layout: Layout
    period: float

    @property
    def states(self) -> int:
        return int(self.means.shape[0])
