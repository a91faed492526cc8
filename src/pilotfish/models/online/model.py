"""State of an online learner with its settings: an immutable value that can be used after every datapoint."""

from dataclasses import dataclass, replace

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import (
    Layout,
)
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Moments
from pilotfish.models.online.settings import LEARNERS, OnlineSettings, kernel_parameters
from pilotfish.types import Array, Float, Int
from pilotfish.validation import require_name, require_period, require_type, short_list, shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class OnlineModel:
    """K clusters in P frames, and the transitions and durations between them.

    Clusters are in the order of their creation. `state` holds further arrays by name: variances, distances
    and bases of the subspaces, segments and their durations.

    Attributes:
        settings: Learner and penalties.
        layout: Columns of a datapoint.
        period: Time between datapoints [s].
        frame_names: Name of each frame.
        parameters: The settings in the form of the kernel.
        state: Everything that was learned, as named arrays, in columns divided by their scales.
        scales: Scales of the settings, the same in each frame; None where columns are not scaled. An
            array of the shape of a datapoint divides six times as fast as a row.
        ends: Moments of the first and of the last datapoints of whole demonstrations, as two components for
            each frame, in the units of the columns; empty before the first demonstration.
    """

    settings: OnlineSettings
    layout: Layout
    period: float
    frame_names: tuple[str, ...]
    parameters: kernels.StreamParameters
    state: kernels.StreamState
    scales: Float[Array, "P D"] | None = None
    ends: tuple[Moments, ...] = ()

    @property
    def clusters(self) -> int:
        """Number of clusters K."""
        return self.state.clusters

    @property
    def datapoints(self) -> int:
        """Number of datapoints observed, including those of removed clusters."""
        return int(self.state.datapoints)

    @property
    def current_cluster(self) -> int:
        """Index of the cluster of the last datapoint; -1 where a demonstration begins."""
        return int(self.state.current_cluster)

    @property
    def cluster_ids(self) -> Int[Array, " K"]:
        """Identifiers of the clusters in the order of creation; none is used twice."""
        return np.asarray(self.state.cluster_ids.astype(np.int64))

    @property
    def weights(self) -> Float[Array, " K"]:
        """Weight w of the past of each cluster relative to its next datapoint."""
        return np.asarray(self.state.weights)

    @property
    def priors(self) -> Float[Array, " K"]:
        """Mixture weights pi (5.8): the share of the datapoints of each cluster, without removed clusters."""
        return np.asarray(self.state.points / self.state.points.sum())

    @property
    def means(self) -> Float[Array, "K P D"]:
        """Mean of each cluster in each frame, in the units of the columns."""
        return self.state.means if self.scales is None else np.asarray(self.state.means * self.scales)

    @property
    def dimensions(self) -> Int[Array, "K P"]:
        """Dimension d of each subspace."""
        return self.state.dimensions.astype(np.int64)

    @property
    def demonstrations(self) -> int:
        """Number of demonstrations begun, without those whose first cluster was removed."""
        return int(self.state.demonstration_starts.sum())

    @property
    def transition_counts(self) -> Float[Array, "K K"]:
        """Number of times a datapoint in cluster j followed one in cluster i, i = j included (5.29)."""
        return self.state.transition_counts


def online_model(
    settings: OnlineSettings, layout: Layout, period: float, frame_names: tuple[str, ...] = ("world",)
) -> OnlineModel:
    """Create a model before its first datapoint.

    Args:
        settings: Learner, penalties and scales, for example `SOSC(...)` or those of `estimate_settings`.
        layout: Columns of a datapoint. Quaternions are four numbers; orientations on S^3 are not supported.
        period: Time between datapoints [s].
        frame_names: Name of each frame, all different.

    Returns:
        A model without clusters.

    Raises:
        InvalidInput: If an argument is invalid, or the layout has orientations on S^3.
    """
    require_type(settings, "settings", tuple(LEARNERS.values()), "give SOSC(cluster=..., dimension=..., ...)")
    require_type(layout, "layout", Layout, "position_layout(3) makes one")
    if layout.orientation_starts:
        raise InvalidInput(
            "the layout has orientations on S^3, expected quaternions as four numbers; give demonstrations "
            "as recorded, without on_sphere"
        )
    require_period(period, "period")
    require_type(frame_names, "frame_names", (tuple, list), 'give a tuple of names, say ("world",)')
    names = tuple(require_name(name, "the name of a frame") for name in frame_names)
    if not names or len(set(names)) != len(names):
        raise InvalidInput(
            f"frame_names is {short_list(names)}, expected at least one name and no duplicates"
        )
    if settings.scales is not None and len(settings.scales) != layout.width:
        raise InvalidInput(
            f"settings have {len(settings.scales)} scales, expected {layout.width}, one for each column"
        )
    state = kernels.StreamState.empty(len(names), layout.width)
    parameters = kernel_parameters(settings, layout.width)
    scales = None if settings.scales is None else np.tile(settings.scales, (len(names), 1))
    return OnlineModel(settings, layout, float(period), names, parameters, state, scales)


def count_ends(model: OnlineModel, x: Float[Array, "P T D"]) -> OnlineModel:
    """Add the first and the last datapoint of a demonstration to the moments of the ends.

    Args:
        model: Model.
        x: The demonstration in every frame.
    """
    ends = [Moments.from_data(view[[0, -1]], np.eye(2)) for view in x]
    if model.ends:
        ends = [before + new for before, new in zip(model.ends, ends, strict=True)]
    return replace(model, ends=tuple(ends))


def begin_demonstration(model: OnlineModel) -> OnlineModel:
    """Return the model in a state where the next datapoint begins a demonstration.

    No transition leads to that datapoint. The segment of the last datapoint is right-censored: it does not
    count as completed.

    Args:
        model: Model after any datapoint.
    """
    state, k = model.state, model.current_cluster
    if k < 0:
        return model
    censored, means = state.censored.copy(), state.mean_censored_durations.copy()
    censored[k] += 1.0
    means[k] += (state.steps_in_cluster - means[k]) / censored[k]
    after = state.with_changes(
        current_cluster=-1,
        steps_in_cluster=0,
        previous_cluster=-1,
        previous_steps=0,
        censored=censored,
        mean_censored_durations=means,
    )
    return replace(model, state=after)
