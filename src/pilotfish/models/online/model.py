"""A model that grows with a stream: a plain value, whole at every moment."""

from dataclasses import dataclass

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import (
    Layout,
)
from pilotfish.errors import InvalidInput
from pilotfish.models.online.settings import DPGMM, DPMPPCA, HDPHSMM, SOSC, OnlineSettings, kernel_parameters
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_name, require_period, require_type, short_list

Column, Head = kernels.ClusterColumn, kernels.StreamCounter


@dataclass(frozen=True, slots=True, eq=False)
class OnlineModel:
    """K clusters, each seen from P frames, and how they have followed one another.

    period is the time of one step [s]; state holds all that was learned, rules what decides (see kernels).
    Arrays are views of it, K first, in the order of clusters' birth.
    """

    settings: OnlineSettings
    layout: Layout
    period: float
    frame_names: tuple[str, ...]
    parameters: kernels.StreamParameters
    state: kernels.StreamState

    @property
    def clusters(self) -> int:
        return len(self.state.clusters)

    @property
    def datapoints(self) -> int:
        """How many were observed, those of clusters that are no more included."""
        return int(self.state.head[Head.POINTS])

    @property
    def current_cluster(self) -> int:
        """The place of the last datapoint's cluster among the K; -1 where a demonstration begins."""
        return int(self.state.head[Head.CURRENT])

    @property
    def cluster_ids(self) -> Int[Array, " K"]:
        """Clusters are numbered by birth, and no number is used twice."""
        return self.state.clusters[:, Column.CLUSTER_ID].astype(np.int64)

    @property
    def weights(self) -> Float[Array, " K"]:
        """What each cluster's past weighs against its next datapoint, w."""
        return self.state.clusters[:, Column.WEIGHT]

    @property
    def priors(self) -> Float[Array, " K"]:
        """Pi (5.8): the share of datapoints that each took, of those that are not forgotten."""
        points = self.state.clusters[:, Column.POINTS]
        return np.asarray(points / points.sum())

    @property
    def means(self) -> Float[Array, "K P D"]:
        return self.state.means

    @property
    def dimensions(self) -> Int[Array, "K P"]:
        """d, the dimension of each subspace."""
        return self.state.dimensions.astype(np.int64)

    @property
    def variances(self) -> Float[Array, "K P C"]:
        """Along each remembered direction, the largest first; zero beyond those that there are."""
        return self.state.variances

    @property
    def distances(self) -> Float[Array, "K P _"]:
        """Mean squared distances to the subspaces of the first 0 ... C directions (5.22)."""
        return self.state.distances

    @property
    def bases(self) -> Float[Array, "K P D C"]:
        """Remembered directions, orthonormal columns; zero beyond those that there are."""
        return self.state.bases

    @property
    def transition_counts(self) -> Float[Array, "K K"]:
        """How many datapoints in j came right after one in i, i = j included (5.29)."""
        return self.state.transition_counts

    @property
    def demonstrations(self) -> int:
        """How many were begun, those that began in clusters that are no more left out."""
        return int(self.state.clusters[:, Column.DEMONSTRATION_STARTS].sum())


def online_model(
    settings: OnlineSettings, layout: Layout, period: float, frame_names: tuple[str, ...] = ("world",)
) -> OnlineModel:
    """A model before its first datapoint.

    layout says what the columns are, period [s] is the time between datapoints.
    Raises: InvalidInput, when these cannot be, or when an orientation of the layout is on its sphere: a
    stream learns quaternions as four numbers.
    """
    require_type(
        settings, "settings", (DPGMM, DPMPPCA, HDPHSMM, SOSC), "say SOSC(cluster=..., dimension=..., ...)"
    )
    require_type(layout, "layout", Layout, "position_layout(3) makes one")
    if layout.orientation_starts:
        raise InvalidInput(
            "the layout has orientations on their sphere, and streams learn quaternions as four numbers; "
            "give demonstrations as they are recorded, without on_sphere"
        )
    require_period(period, "period")
    require_type(frame_names, "frame_names", (tuple, list), 'give names in a tuple, say ("world",)')
    names = tuple(require_name(name, "the name of a frame") for name in frame_names)
    if not names or len(set(names)) != len(names):
        raise InvalidInput(
            f"the frames are named {short_list(names)}, expected at least one, with different names"
        )
    state = kernels.empty_stream(len(names), layout.width)
    return OnlineModel(
        settings, layout, float(period), names, kernel_parameters(settings, layout.width), state
    )
