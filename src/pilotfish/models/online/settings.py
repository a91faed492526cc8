"""The four online learners by their penalties, each a special case of the next, and how the past is kept.

A squared distance is in squared units of the columns, and so is every penalty that it is weighed against.
"""

from dataclasses import dataclass
from math import sqrt

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.models.skill import MAX_STATES
from pilotfish.validation import MAX_MAGNITUDE, require_count, require_type

MAX_EXTRA_DIRECTIONS, MAX_BATCH_SIZE = 10_000, 100_000


@dataclass(frozen=True, slots=True)
class DatapointCount:
    """A cluster weighs as much as it has datapoints: for streams of one distribution (5.15)."""


@dataclass(frozen=True, slots=True)
class ExponentialDecay:
    """Eligibility traces: with every datapoint all weights shrink by the discount, the visited one gains 1.

    For streams that change: a cluster remembers about 1 / (1 - discount) datapoints (5.16).
    A cluster whose weight falls below forget_below, unless it is the current one, is forgotten. At 0, the
    thesis' way, none is; at 0.3 so are clusters that a passing change left behind and nothing visits again,
    those of n datapoints after about log(n / forget_below) / (1 - discount) steps.
    """

    discount: float = 0.995
    forget_below: float = 0.0

    def __post_init__(self) -> None:
        for name in ("discount", "forget_below"):
            require_type(getattr(self, name), name, (int, float), "give a number")
        if not 0.0 < self.discount < 1.0:
            raise InvalidInput(f"discount is {self.discount}, expected a number between 0 and 1, say 0.995")
        if not 0.0 <= self.forget_below < 1.0:
            raise InvalidInput(
                f"forget_below is {self.forget_below}, expected 0 or more and less than 1, the weight of "
                "a new cluster"
            )


@dataclass(frozen=True, slots=True)
class ConstantWeight:
    """Every cluster weighs the same for ever: each datapoint is a step of 1 / (weight + 1)."""

    weight: float

    def __post_init__(self) -> None:
        require_type(self.weight, "weight", (int, float), "give a number")
        if not 0.0 < self.weight <= MAX_MAGNITUDE:
            raise InvalidInput(f"weight is {self.weight}, expected a positive number")


Weighting = DatapointCount | ExponentialDecay | ConstantWeight
DEFAULT_WEIGHTING = DatapointCount()


@dataclass(frozen=True, slots=True)
class Maintenance:
    """How the past is kept.

    weighting       what a cluster's past weighs against a datapoint
    merge_distance  clusters whose means come closer become one; None is the square root of the cluster
                    penalty, 0 merges none. Of several frames, distances are squared and added
    spare           directions that a subspace remembers beyond its dimension, so as to know when it should
                    grow; with as many as columns nothing is truncated, and covariances are exact
    most_clusters   there are never more: the lightest (of equals the oldest) is forgotten for a new one
    batch           so many datapoints are assigned before any of them changes a subspace
    """

    weighting: Weighting = DEFAULT_WEIGHTING
    merge_distance: float | None = None
    extra_directions: int = 1
    max_clusters: int = 256
    batch: int = 1

    def __post_init__(self) -> None:
        require_type(
            self.weighting,
            "weighting",
            (DatapointCount, ExponentialDecay, ConstantWeight),
            "give an instance, say Count()",
        )
        if self.merge_distance is not None:
            require_type(self.merge_distance, "merge_distance", (int, float), "give a number or None")
        if self.merge_distance is not None and not 0.0 <= self.merge_distance <= MAX_MAGNITUDE:
            raise InvalidInput(f"merge_distance is {self.merge_distance}, expected 0 or more, or None")
        require_count(self.extra_directions, "extra_directions", MAX_EXTRA_DIRECTIONS)
        require_count(self.max_clusters, "max_clusters", MAX_STATES, 1)
        require_count(self.batch, "batch", MAX_BATCH_SIZE, 1)


DEFAULT_MAINTENANCE = Maintenance()


@dataclass(frozen=True, slots=True)
class DPGMM:
    """Dirichlet process mixture of spheres under small variance asymptotics, online (DP-means).

    cluster  penalty lambda of one more cluster: a datapoint whose squared distance to every mean is not less
             begins one
    noise    variance sigma^2 in every column, of the model that is read out
    Source: Kulis & Jordan 2012; Tanwani 2018, equations 5.7-5.9.
    """

    cluster: float
    noise: float
    maintenance: Maintenance = DEFAULT_MAINTENANCE

    def __post_init__(self) -> None:
        _validate_penalties(self, ("cluster", "noise"), ())

    @property
    def label(self) -> str:
        return f"DP-GMM({self.cluster:g})"


@dataclass(frozen=True, slots=True)
class DPMPPCA:
    """Dirichlet process mixture of probabilistic principal component analysers, online.

    cluster    penalty lambda of one more cluster, against squared distances to subspaces
    dimension  penalty lambda_1 of one more dimension of a subspace: it must explain more variance than this
    noise      variance sigma^2 in every column beside the subspace, of the model that is read out
    bandwidth  b_m, the squared distance from a mean at which its subspace has faded to 1 / e: rho (5.13)
    Source: Tanwani 2018, equations 5.12-5.25, as specification 2 corrects them.
    """

    cluster: float
    dimension: float
    noise: float
    bandwidth: float
    maintenance: Maintenance = DEFAULT_MAINTENANCE

    def __post_init__(self) -> None:
        _validate_penalties(self, ("cluster", "dimension", "noise", "bandwidth"), ())

    @property
    def label(self) -> str:
        return f"DP-MPPCA({self.cluster:g}, {self.dimension:g})"


@dataclass(frozen=True, slots=True)
class HDPHSMM:
    """Hierarchical Dirichlet process hidden semi-Markov model of spheres, online.

    cluster         penalty lambda of one more state
    noise           variance sigma^2 in every column, of the model that is read out
    transition      penalty lambda_2 of a transition, for each nat of its surprise
    new_transition  penalty lambda_3 of a transition never taken before
    Source: Roychowdhury et al. 2013; Tanwani 2018, equations 5.26-5.35 with d = 0 (footnote 5).
    """

    cluster: float
    noise: float
    transition: float
    new_transition: float
    maintenance: Maintenance = DEFAULT_MAINTENANCE

    def __post_init__(self) -> None:
        _validate_penalties(self, ("cluster", "noise"), ("transition", "new_transition"))

    @property
    def label(self) -> str:
        return f"HDP-HSMM({self.cluster:g}, {self.transition:g}, {self.new_transition:g})"


@dataclass(frozen=True, slots=True)
class SOSC:
    """Scalable online sequence clustering: states that are subspaces, in an order, with durations.

    Penalties are those of DPMPPCA and of HDPHSMM together; with transition and new_transition 0 it clusters
    as DPMPPCA does, and learns transitions and durations beside.
    Source: Tanwani 2018, algorithm 5, as specification 2 corrects it.
    """

    cluster: float
    dimension: float
    noise: float
    bandwidth: float
    transition: float = 0.0
    new_transition: float = 0.0
    maintenance: Maintenance = DEFAULT_MAINTENANCE

    def __post_init__(self) -> None:
        _validate_penalties(
            self, ("cluster", "dimension", "noise", "bandwidth"), ("transition", "new_transition")
        )

    @property
    def label(self) -> str:
        return f"SOSC({self.cluster:g}, {self.dimension:g}, {self.transition:g}, {self.new_transition:g})"


OnlineSettings = DPGMM | DPMPPCA | HDPHSMM | SOSC


def kernel_parameters(settings: OnlineSettings, width: int) -> kernels.StreamParameters:
    """The settings as the kernel reads them, for so many columns. Spheres are subspaces of no dimension."""
    is_spherical = isinstance(settings, DPGMM | HDPHSMM)
    maintenance, weighting = settings.maintenance, settings.maintenance.weighting
    kind, weight, forget_below = _weighting(weighting)
    apart = maintenance.merge_distance
    return kernels.StreamParameters(
        cluster=float(settings.cluster),
        dimension=0.0 if isinstance(settings, DPGMM | HDPHSMM) else float(settings.dimension),
        transition=float(settings.transition) if isinstance(settings, HDPHSMM | SOSC) else 0.0,
        new_transition=float(settings.new_transition) if isinstance(settings, HDPHSMM | SOSC) else 0.0,
        bandwidth=1.0 if isinstance(settings, DPGMM | HDPHSMM) else float(settings.bandwidth),
        merge_distance=float(sqrt(settings.cluster) if apart is None else apart),
        weighting=kind,
        weight=weight,
        forget_below=forget_below,
        extra_directions=0 if is_spherical else min(maintenance.extra_directions, width),
        max_dimension=0 if is_spherical else width - 1,
        clusters=maintenance.max_clusters,
        batch=maintenance.batch,
    )


def _weighting(weighting: Weighting) -> tuple[int, float, float]:
    match weighting:
        case ExponentialDecay(discount, forget_below):
            return int(kernels.Weighting.EXPONENTIAL_DECAY), float(discount), float(forget_below)
        case ConstantWeight(weight):
            return int(kernels.Weighting.CONSTANT), float(weight), 0.0
        case _:
            return int(kernels.Weighting.COUNT), 0.0, 0.0


def _validate_penalties(settings: object, positive: tuple[str, ...], nonnegative: tuple[str, ...]) -> None:
    for name in (*positive, *nonnegative):
        value = getattr(settings, name)
        require_type(value, name, (int, float), "give a number")
        least = "more than 0" if name in positive else "0 or more"
        if not value <= MAX_MAGNITUDE or value < 0 or (name in positive and value == 0):
            raise InvalidInput(f"{name} is {value}, expected {least}, in squared units of the columns")
    require_type(settings.maintenance, "maintenance", Maintenance, "give an instance, say Upkeep(batch=50)")  # type: ignore[attr-defined]
