"""Penalties of the four online learners, and the maintenance of their clusters.

Each learner is a special case of the next: DP-GMM (spheres), DP-MPPCA (subspaces), HDP-HSMM (spheres with
transitions and durations), SOSC (subspaces with transitions and durations). To add a learner, add a class and
its line in `LEARNERS`: the command line and the stream file derive their names from that table.

Scales. Columns of a stream have different units, but a learner adds their squared distances and has one noise
variance. Settings therefore hold a scale for each column: the learner sees columns divided by their scales,
and penalties are in squared scales. `estimate_penalties` and `estimate_settings` choose scales and penalties.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import isfinite, sqrt
from typing import Any, ClassVar

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.models.skill import MAX_STATES
from pilotfish.validation import MAX_MAGNITUDE, numeric_array, require_count, require_type, shorten_repr


@dataclass(frozen=True, slots=True)
class Maintenance:
    """Weights, number and merging of the clusters of an online learner.

    The weight w of a cluster is what its past counts against the next datapoint, whose share is 1 / (w + 1).
    By default it is the number of datapoints (5.15), for streams of one distribution. With `discount` it
    decays exponentially (5.16), for streams that change. With `constant_weight` every datapoint has the same
    share.

    Attributes:
        discount: Factor between 0 and 1 on all weights with every datapoint; the cluster of the datapoint
            gains 1. A cluster remembers about 1 / (1 - discount) datapoints. None: no decay.
        forget_below: A cluster whose weight falls below this value is removed, except the current one. It
            needs `discount`; 0 removes none (thesis). At 0.3, a cluster of n datapoints that receives none
            is removed after about log(n / 0.3) / (1 - discount) steps.
        constant_weight: Weight of every cluster at all times [datapoints]; excludes `discount`.
        merge_distance: Clusters whose means are closer than this are merged; squared distances add over
            frames. None: the square root of the cluster penalty. 0 merges none.
        extra_directions: Directions stored beyond the dimension of a subspace, by which its growth is
            detected. With as many as columns, covariances are exact.
        max_clusters: Largest number of clusters; the lightest (the oldest of equals) is removed for a new
            one.
        batch: Mini-batch size: number of datapoints that are assigned before subspaces are updated.
    """

    MAX_EXTRA_DIRECTIONS: ClassVar[int] = 10_000
    MAX_BATCH: ClassVar[int] = 100_000

    discount: float | None = None
    forget_below: float = 0.0
    constant_weight: float | None = None
    merge_distance: float | None = None
    extra_directions: int = 1
    max_clusters: int = 256
    batch: int = 1

    def __post_init__(self) -> None:
        for name in ("discount", "constant_weight", "merge_distance"):
            if getattr(self, name) is not None:
                require_type(getattr(self, name), name, (int, float), "give a number or None")
        require_type(self.forget_below, "forget_below", (int, float), "give a number")
        self._validate_weighting()
        if self.merge_distance is not None and not 0.0 <= self.merge_distance <= MAX_MAGNITUDE:
            raise InvalidInput(f"merge_distance is {self.merge_distance}, expected 0 or more, or None")
        require_count(self.extra_directions, "extra_directions", self.MAX_EXTRA_DIRECTIONS)
        require_count(self.max_clusters, "max_clusters", MAX_STATES, 1)
        require_count(self.batch, "batch", self.MAX_BATCH, 1)

    def _validate_weighting(self) -> None:
        if self.discount is not None and not 0.0 < self.discount < 1.0:
            raise InvalidInput(f"discount is {self.discount}, expected a number between 0 and 1, say 0.995")
        if not 0.0 <= self.forget_below < 1.0:
            raise InvalidInput(
                f"forget_below is {self.forget_below}, expected 0 or more and less than 1, the weight of a "
                "new cluster"
            )
        if self.forget_below and self.discount is None:
            raise InvalidInput(
                f"forget_below is {self.forget_below} without a discount, but only weights that decay fall; "
                "give discount, say 0.995"
            )
        if self.constant_weight is None:
            return
        if not 0.0 < self.constant_weight <= MAX_MAGNITUDE:
            raise InvalidInput(f"constant_weight is {self.constant_weight}, expected a positive number")
        if self.discount is not None:
            raise InvalidInput(
                f"discount is {self.discount} and constant_weight {self.constant_weight}, expected at most "
                "one of them; leave out the other"
            )

    def initial_weight(self, points: float) -> float:
        """Return the weight of a cluster that was learned from datapoints before the stream.

        Args:
            points: Number of datapoints.
        """
        if self.constant_weight is not None:
            return float(self.constant_weight)
        return points if self.discount is None else min(points, 1.0 / (1.0 - self.discount))

    def kernel_weighting(self) -> tuple[kernels.Weighting, float]:
        """Return the kind of weights, and the discount or the constant weight."""
        if self.discount is not None:
            return kernels.Weighting.EXPONENTIAL_DECAY, float(self.discount)
        if self.constant_weight is not None:
            return kernels.Weighting.CONSTANT, float(self.constant_weight)
        return kernels.Weighting.COUNT, 0.0


DEFAULT_MAINTENANCE = Maintenance()
Scales = tuple[float, ...]
MIN_SCALE, MAX_SCALE = 1e-100, 1e100  # scaled datapoints stay finite


@shorten_repr
@dataclass(frozen=True, slots=True)
class DPGMM:
    """Online Dirichlet process mixture of spheres under small-variance asymptotics (DP-means).

    Attributes:
        cluster: Penalty lambda of a new cluster: a datapoint whose squared distance to every mean is at least
            this starts one [squared scales].
        noise: Variance sigma^2 of every column in the skill.
        maintenance: Weights, number and merging of the clusters.
        scales: Scale of each column [unit of the column]. None: columns are not scaled.

    Source:
        Kulis & Jordan 2012, Revisiting k-means; Tanwani 2018, equations 5.7-5.9.
    """

    name: ClassVar[str] = "dp-gmm"
    has_subspaces: ClassVar[bool] = False
    has_dynamics: ClassVar[bool] = False

    cluster: float
    noise: float
    maintenance: Maintenance = DEFAULT_MAINTENANCE
    scales: Scales | None = None

    def __post_init__(self) -> None:
        _validate_settings(self)

    @property
    def label(self) -> str:
        """Name and penalties, for tables."""
        return f"DP-GMM({self.cluster:g})"


@shorten_repr
@dataclass(frozen=True, slots=True)
class DPMPPCA:
    """Online Dirichlet process mixture of probabilistic principal component analysers.

    Attributes:
        cluster: Penalty lambda of a new cluster, compared with squared distances to subspaces.
        dimension: Penalty lambda_1 of a dimension of a subspace: a direction must explain more variance.
        noise: Variance sigma^2 in every column outside the subspace, in the skill.
        bandwidth: Squared distance b_m from the mean at which rho, the influence of the subspace, is 1 / e
            (5.13).
        maintenance: Weights, number and merging of the clusters.
        scales: Scale of each column [unit of the column]. None: columns are not scaled.

    Source:
        Tanwani 2018, equations 5.12-5.25, as specification 2 corrects them.
    """

    name: ClassVar[str] = "dp-mppca"
    has_subspaces: ClassVar[bool] = True
    has_dynamics: ClassVar[bool] = False

    cluster: float
    dimension: float
    noise: float
    bandwidth: float
    maintenance: Maintenance = DEFAULT_MAINTENANCE
    scales: Scales | None = None

    def __post_init__(self) -> None:
        _validate_settings(self)

    @property
    def label(self) -> str:
        """Name and penalties, for tables."""
        return f"DP-MPPCA({self.cluster:g}, {self.dimension:g})"


@shorten_repr
@dataclass(frozen=True, slots=True)
class HDPHSMM:
    """Online hierarchical Dirichlet process hidden semi-Markov model of spheres.

    Attributes:
        cluster: Penalty lambda of a new state.
        noise: Variance sigma^2 of every column in the skill.
        transition: Penalty lambda_2 of a transition, per nat of its negative log-probability.
        new_transition: Penalty lambda_3 of a transition that has not occurred before.
        maintenance: Weights, number and merging of the clusters.
        scales: Scale of each column [unit of the column]. None: columns are not scaled.

    Source:
        Roychowdhury et al. 2013; Tanwani 2018, equations 5.26-5.35 with d = 0 (footnote 5).
    """

    name: ClassVar[str] = "hdp-hsmm"
    has_subspaces: ClassVar[bool] = False
    has_dynamics: ClassVar[bool] = True

    cluster: float
    noise: float
    transition: float
    new_transition: float
    maintenance: Maintenance = DEFAULT_MAINTENANCE
    scales: Scales | None = None

    def __post_init__(self) -> None:
        _validate_settings(self)

    @property
    def label(self) -> str:
        """Name and penalties, for tables."""
        return f"HDP-HSMM({self.cluster:g}, {self.transition:g}, {self.new_transition:g})"


@shorten_repr
@dataclass(frozen=True, slots=True)
class SOSC:
    """Scalable online sequence clustering: subspaces with transitions and durations.

    With transition and new_transition 0 it assigns datapoints as DPMPPCA does, and still learns transitions
    and durations.

    Attributes:
        cluster: Penalty lambda of a new cluster, as in `DPMPPCA`.
        dimension: Penalty lambda_1 of a dimension of a subspace.
        noise: Variance sigma^2 in every column outside the subspace, in the skill.
        bandwidth: Squared distance b_m from the mean at which the influence of the subspace is 1 / e.
        transition: Penalty lambda_2 of a transition, as in `HDPHSMM`.
        new_transition: Penalty lambda_3 of a transition that has not occurred before.
        maintenance: Weights, number and merging of the clusters.
        scales: Scale of each column [unit of the column]. None: columns are not scaled.

    Source:
        Tanwani 2018, algorithm 5, as specification 2 corrects it.
    """

    name: ClassVar[str] = "sosc"
    has_subspaces: ClassVar[bool] = True
    has_dynamics: ClassVar[bool] = True

    cluster: float
    dimension: float
    noise: float
    bandwidth: float
    transition: float = 0.0
    new_transition: float = 0.0
    maintenance: Maintenance = DEFAULT_MAINTENANCE
    scales: Scales | None = None

    def __post_init__(self) -> None:
        _validate_settings(self)

    @property
    def label(self) -> str:
        """Name and penalties, for tables."""
        return f"SOSC({self.cluster:g}, {self.dimension:g}, {self.transition:g}, {self.new_transition:g})"


OnlineSettings = DPGMM | DPMPPCA | HDPHSMM | SOSC
LEARNERS: dict[str, type[OnlineSettings]] = {
    learner.name: learner for learner in (DPGMM, DPMPPCA, HDPHSMM, SOSC)
}


def penalty_names(learner: OnlineSettings | type[OnlineSettings]) -> list[str]:
    """Return the names of the penalties of a learner.

    Args:
        learner: Settings, or their class.
    """
    return [f.name for f in fields(learner) if f.name not in ("maintenance", "scales")]


def penalties(settings: OnlineSettings) -> dict[str, float]:
    """Return the penalties of a learner by name."""
    return {name: float(getattr(settings, name)) for name in penalty_names(settings)}


def validated_scales(scales: Sequence[float]) -> Scales:
    """Return scales as floats.

    Args:
        scales: Scale of each column.

    Raises:
        InvalidInput: If they are not positive numbers.
    """
    require_type(scales, "scales", (tuple, list, np.ndarray), "give one number per column, or None")
    values = tuple(map(float, numeric_array(scales, "scales").ravel()))
    for column, value in enumerate(values):
        if not (isfinite(value) and MIN_SCALE <= value <= MAX_SCALE):
            raise InvalidInput(
                f"scales[{column}] is {value}, expected a number from {MIN_SCALE:g} to {MAX_SCALE:g}; "
                "1 leaves a column as it is"
            )
    return values


def kernel_parameters(settings: OnlineSettings, width: int) -> kernels.StreamParameters:
    """Return the settings as the kernel reads them for a number of columns; spheres have dimension 0."""
    spherical = {"dimension": 0.0, "bandwidth": 1.0}
    values = spherical | {"transition": 0.0, "new_transition": 0.0} | penalties(settings)
    del values["noise"]
    maintenance, extends = settings.maintenance, settings.has_subspaces
    weighting, weight = maintenance.kernel_weighting()
    distance = maintenance.merge_distance
    return kernels.StreamParameters(
        **values,
        merge_distance=float(sqrt(settings.cluster) if distance is None else distance),
        weighting=int(weighting),
        weight=weight,
        forget_below=float(maintenance.forget_below),
        extra_directions=min(maintenance.extra_directions, width) if extends else 0,
        max_dimension=width - 1 if extends else 0,
        max_clusters=maintenance.max_clusters,
        batch=maintenance.batch,
    )


def _validate_settings(settings: Any) -> None:
    for name in penalty_names(settings):
        value = getattr(settings, name)
        require_type(value, name, (int, float), "give a number")
        positive = name not in ("transition", "new_transition")
        if not value <= MAX_MAGNITUDE or value < 0 or (positive and value == 0):
            expected = "more than 0" if positive else "0 or more"
            raise InvalidInput(f"{name} is {value}, expected {expected}, in squared scales of the columns")
    require_type(
        settings.maintenance, "maintenance", Maintenance, "give an instance, say Maintenance(batch=50)"
    )
    if settings.scales is not None:
        object.__setattr__(settings, "scales", validated_scales(settings.scales))
