"""Scales and penalties of an online learner, estimated from demonstrations or the first rows of a stream.

Both estimates need a state for each datapoint: the most probable states of a batch skill
(`estimate_penalties`), or k-means clusters without a skill (`estimate_settings`).

Robustness. Recordings contain wild rows: a tracker that loses its marker, a spike of a sensor. They may be a
few per cent of the rows, and arbitrarily far away. Every statistic is therefore one that such rows hardly
change: centres of states are medians, rows far from their state are left out before variances are computed,
and penalties are multiples of medians and quantiles.

Invariance. Every statistic has the unit of a squared column, so that the same rows in other units give the
same scaled datapoints, and the same clusters, up to rounding.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pilotfish.demonstrations import Demonstration, Layout, views
from pilotfish.errors import InvalidInput
from pilotfish.models.online.settings import (
    MIN_SCALE,
    SOSC,
    Maintenance,
    validated_scales,
)
from pilotfish.models.sequences import log_emissions, validated_views
from pilotfish.models.skill import MAX_STATES, Skill
from pilotfish.types import Array, Bool, Float, Int
from pilotfish.validation import require_count, require_type

# Of the squared distances of datapoints to the centres of their states:
WILD_QUANTILE, WILD_FACTOR = 0.97, 10.0  # rows beyond this multiple of the quantile are left out
CLUSTER_QUANTILE = 0.9  # lambda is this quantile,
COST_QUANTILE, COST_FACTOR = 0.95, 2.0  # and at least this multiple of the quantile outside the subspaces
BANDWIDTH_FACTOR = 16.0  # b_m is this multiple of the median in one frame
TRANSITION_PENALTY_RATIO = 0.03  # lambda_2 / lambda and lambda_3 / lambda
EXPLAINED_VARIANCE = 0.9  # by subspaces, where states are those of a batch skill,
EXPLAINED_FROM_NOTHING = 0.7  # and where clusters grow from single datapoints
MERGE_SHARE = 0.5  # merge distance from nothing, as a share of the square root of lambda
MIN_RELATIVE_SPREAD = 1e-9  # of a part that is not constant, as a share of its largest value
MIN_ROWS_PER_STATE, KMEANS_ITERATIONS, KMEANS_RESTARTS = 10, 50, 10

ALL_DIRECTIONS = Maintenance(extra_directions=32)  # of up to 32 columns: the skill has exact covariances

LabelledViews = tuple[Float[Array, "P N D"], Int[Array, " M"], Int[Array, " N"]]  # x, lengths, states
GivenScales = Sequence[float] | bool


@dataclass(frozen=True, slots=True)
class _StateStatistics:
    """Statistics of scaled datapoints within their states, without wild rows."""

    means: Float[Array, "P K D"]
    variances: Float[Array, "P K D"]  # eigenvalues of the covariances, largest first
    directions: Float[Array, "P K D D"]  # their eigenvectors, in columns
    errors: Float[Array, "P N D"]  # of the datapoints that are not wild, from the mean of their state
    states: Int[Array, " N"]  # of these datapoints


def estimate_penalties(
    skill: Skill,
    demonstrations: Sequence[Demonstration],
    *,
    explained_variance: float = EXPLAINED_VARIANCE,
    maintenance: Maintenance = ALL_DIRECTIONS,
    scales: GivenScales = True,
) -> SOSC:
    """Estimate scales and penalties of SOSC under which clusters resemble the states of a batch skill.

    Datapoints have the most probable state of the skill. Rows whose squared distance to the median of all
    rows, or of their state, is more than ten times the 97 % quantile are left out. Of
    the others, divided by the scales:

    - lambda: the 90 % quantile of the squared distances to the state, added over frames; at least twice the
      95 % quantile of the squared distances to the subspaces of the state.
    - lambda_1: variance threshold above which directions of all states and frames explain the given share.
    - sigma^2: mean variance of the other directions.
    - b_m: sixteen times the median squared distance to the state in one frame.
    - lambda_2, lambda_3: 3 % of lambda.

    The factors were chosen on the streams of reproductions/online_*.py and segmentation.py.

    Args:
        skill: Batch fit.
        demonstrations: Demonstrations that it was learned from.
        explained_variance: Share of all variance that subspaces explain, between 0 and 1.
        maintenance: Maintenance of the clusters. If it has no merge distance, half the least distance between
            the means of two states is used, so that these are not merged.
        scales: True: those of `estimate_scales`. False: columns are not scaled. Numbers: the scale of
            each column.

    Returns:
        Settings of a SOSC learner, with scales.

    Raises:
        InvalidInput: If the skill and the demonstrations do not belong together, or have no variance.

    Source:
        Tanwani 2018, section 5.6, names this as future work; the estimates are ours.
    """
    _require_share(explained_variance)
    x, _, states = label_datapoints(skill, demonstrations)
    kept = ~_wild_rows(x, skill.layout)
    x, states = x[:, kept], states[kept]
    chosen = _resolve_scales(x, skill.layout, scales)
    means = skill.means if chosen is None else skill.means / np.array(chosen)
    settings = _estimate_settings(x, states, chosen, explained_variance, maintenance)
    return replace(settings, maintenance=_set_merge_distance(means, maintenance))


def estimate_settings(
    demonstrations: Sequence[Demonstration],
    *,
    states: int,
    rng: np.random.Generator,
    explained_variance: float = EXPLAINED_FROM_NOTHING,
    maintenance: Maintenance = ALL_DIRECTIONS,
    scales: GivenScales = True,
) -> SOSC:
    """Estimate scales and penalties of SOSC for a stream that starts from nothing.

    As `estimate_penalties`, with k-means clusters in place of the states of a skill. The first rows of a live
    stream are enough: the scales then do not change.

    Args:
        demonstrations: One or more recordings of the kind that is streamed, or the first rows of the stream.
        states: Approximate number of states of these recordings. With fewer datapoints than ten per state,
            fewer are used.
        rng: Source of the initial centres of k-means.
        explained_variance: As in `estimate_penalties`.
        maintenance: Maintenance of the clusters. If it has no merge distance, half the square root of lambda
            is used.
        scales: As in `estimate_penalties`.

    Returns:
        Settings of a SOSC learner, with scales.

    Raises:
        InvalidInput: If the demonstrations disagree, or have no variance.

    Example:
        >>> import numpy as np
        >>> from pilotfish import demonstration, online
        >>> from pilotfish.demonstrations import position_layout
        >>> rng = np.random.default_rng(0)
        >>> x = np.repeat([[0.0], [5.0]], 50, axis=0) + rng.normal(size=(100, 1))
        >>> first = demonstration(x, 0.1, position_layout(1))
        >>> settings = online.estimate_settings([first], states=2, rng=rng)
        >>> model = online.online_model(settings, first.layout, first.period)
        >>> online.observe_demonstration(model, first)[0].clusters
        2

    Source:
        The estimates are ours.
    """
    _require_share(explained_variance)
    require_count(states, "states", MAX_STATES, 1)
    require_type(rng, "rng", np.random.Generator, "np.random.default_rng(seed) makes one of a seed")
    x = views(demonstrations).x
    layout = demonstrations[0].layout
    require_flat(layout, "the demonstrations have")
    x = x[:, ~_wild_rows(x, layout)]
    labels = _cluster_rows(x, layout, states, rng)
    chosen = _resolve_scales(x, layout, scales)
    settings = _estimate_settings(x, labels, chosen, explained_variance, maintenance)
    if maintenance.merge_distance is None:
        distance = MERGE_SHARE * float(np.sqrt(settings.cluster))
        settings = replace(settings, maintenance=replace(maintenance, merge_distance=distance))
    return settings


def estimate_scales(demonstrations: Sequence[Demonstration]) -> tuple[float, ...]:
    """Estimate the scale of each column: the deviation of its part of the layout over all datapoints.

    Deviations are those in the frames, averaged over them. Rows that are far from all others are left out.
    The columns of one part share a scale. A part that is constant has the scale 1.

    Args:
        demonstrations: One or more recordings, or the first rows of a stream.

    Returns:
        Scales for the settings of a learner [unit of each column].

    Raises:
        InvalidInput: If the demonstrations disagree, or have orientations on S^3.

    Example:
        >>> import numpy as np
        >>> from pilotfish import demonstration, online
        >>> from pilotfish.demonstrations import position_layout
        >>> first = demonstration([[0.0], [2.0]], 0.1, position_layout(1))
        >>> online.estimate_scales([first])
        (1.0,)
    """
    x = views(demonstrations).x
    require_flat(demonstrations[0].layout, "the demonstrations have")
    scales = _resolve_scales(x, demonstrations[0].layout, True)
    assert scales is not None, "scales are estimated"
    return scales


def label_datapoints(skill: Skill, demonstrations: Sequence[Demonstration]) -> LabelledViews:
    """Return the datapoints in all frames, the lengths of the demonstrations, and the most probable states.

    Rows that are far from all others say nothing about the states.

    Args:
        skill: Batch fit.
        demonstrations: Demonstrations that it was learned from.

    Raises:
        InvalidInput: If the skill and the demonstrations do not belong together.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    require_flat(skill.layout, "the skill has")
    data = validated_views(skill, demonstrations)
    densities = log_emissions(skill, data)
    densities[_wild_rows(data.x, skill.layout)] = 0.0
    parts = np.split(densities, np.cumsum(data.lengths)[:-1])
    return data.x, data.lengths, np.concatenate([skill.dynamics.viterbi(part) for part in parts])


def require_flat(layout: Layout, subject: str) -> None:
    """Raise InvalidInput if a layout has orientations on S^3.

    Args:
        layout: Columns.
        subject: What has them; the message begins with it.
    """
    if layout.orientation_starts:
        raise InvalidInput(
            f"{subject} orientations on S^3, expected quaternions as four numbers; use demonstrations "
            "without on_sphere"
        )


def _require_share(explained_variance: float) -> None:
    if not 0.0 < explained_variance < 1.0:
        raise InvalidInput(
            f"explained_variance is {explained_variance}, expected a share between 0 and 1, say 0.9"
        )


def _resolve_scales(
    x: Float[Array, "P N D"], layout: Layout, scales: GivenScales
) -> tuple[float, ...] | None:
    if scales is False:
        return None
    if scales is not True:
        given = validated_scales(scales)
        if len(given) != layout.width:
            raise InvalidInput(f"scales has {len(given)} numbers, expected {layout.width}, one per column")
        return given
    squares = (x - np.median(x, axis=1, keepdims=True)) ** 2
    chosen = np.ones(layout.width)
    for columns in layout.slices:
        kept = ~_beyond_quantile(squares[..., columns].sum(axis=(0, 2)))
        part = x[:, kept, columns]
        scale = float(np.sqrt(part.var(axis=1).mean()))
        is_constant = scale <= MIN_RELATIVE_SPREAD * float(np.abs(part).max())
        chosen[columns] = 1.0 if is_constant or scale < MIN_SCALE else scale
    return tuple(chosen.tolist())


def _beyond_quantile(squares: Float[Array, " N"]) -> Bool[Array, " N"]:
    """Return which squared distances are wild; where most rows are equal, those of the others count."""
    limit = np.quantile(squares, WILD_QUANTILE)
    if limit == 0.0 and (squares > 0.0).any():
        limit = np.quantile(squares[squares > 0.0], WILD_QUANTILE)
    return np.asarray(squares > WILD_FACTOR * limit)


def _wild_rows(x: Float[Array, "P N D"], layout: Layout) -> Bool[Array, " N"]:
    """Return which rows are far from all others, in the columns of any part."""
    squares = (x - np.median(x, axis=1, keepdims=True)) ** 2
    wild = [_beyond_quantile(squares[..., columns].sum(axis=(0, 2))) for columns in layout.slices]
    return np.asarray(np.any(wild, axis=0))


def _cluster_rows(
    x: Float[Array, "P N D"], layout: Layout, states: int, rng: np.random.Generator
) -> Int[Array, " N"]:
    """Return k-means clusters of the rows, in scaled columns."""
    joint = (x / np.array(_resolve_scales(x, layout, True))).transpose(1, 0, 2).reshape(x.shape[1], -1)
    from scipy.cluster.vq import kmeans2  # not at the top: importing scipy doubles the import time

    count = min(states, max(1, len(joint) // MIN_ROWS_PER_STATE), len(np.unique(joint, axis=0)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of clusters that became empty; they are left out
        fits = [
            kmeans2(joint, count, minit="++", iter=KMEANS_ITERATIONS, rng=rng) for _ in range(KMEANS_RESTARTS)
        ]
    labels = min(fits, key=lambda fit: float(np.sum((joint - fit[0][fit[1]]) ** 2)))[1]
    return np.asarray(np.unique(labels, return_inverse=True)[1], dtype=np.int64)


def _state_medians(x: Float[Array, "P N D"], states: Int[Array, " N"]) -> Float[Array, "P K D"]:
    medians = np.zeros((x.shape[0], int(states.max()) + 1, x.shape[2]))
    for k in np.unique(states):
        medians[:, k] = np.median(x[:, states == k], axis=1)
    return medians


def _estimate_settings(
    x: Float[Array, "P N D"],
    states: Int[Array, " N"],
    scales: tuple[float, ...] | None,
    explained_variance: float,
    maintenance: Maintenance,
) -> SOSC:
    statistics = _state_statistics(x if scales is None else x / np.array(scales), states)
    dimension, noise = _subspace_thresholds(statistics, explained_variance)
    squares = np.einsum("pnd,pnd->pn", statistics.errors, statistics.errors)
    bandwidth = BANDWIDTH_FACTOR * float(np.median(squares))
    if not bandwidth > 0.0:
        raise InvalidInput(
            "all datapoints of every state are equal, expected states with some variance; give the penalties "
            "and scales instead"
        )
    projection_weights = 1.0 - np.expm1(-squares / bandwidth) ** 2
    costs = (squares - projection_weights * _squared_projections(statistics, dimension)).sum(axis=0)  # (N,)
    largest = COST_FACTOR * float(np.quantile(costs, COST_QUANTILE))
    cluster = max(float(np.quantile(squares.sum(axis=0), CLUSTER_QUANTILE)), largest, noise)
    return SOSC(
        cluster=cluster,
        dimension=dimension,
        noise=noise,
        bandwidth=bandwidth,
        transition=TRANSITION_PENALTY_RATIO * cluster,
        new_transition=TRANSITION_PENALTY_RATIO * cluster,
        maintenance=maintenance,
        scales=scales,
    )


def _state_statistics(x: Float[Array, "P N D"], states: Int[Array, " N"]) -> _StateStatistics:
    errors = x - _state_medians(x, states)[:, states]
    kept = ~_beyond_quantile(np.einsum("pnd,pnd->n", errors, errors))
    x, states = x[:, kept], states[kept]
    P, _, D = x.shape
    K = int(states.max()) + 1
    means, covariances = np.zeros((P, K, D)), np.zeros((P, K, D, D))
    for k in np.unique(states):
        rows = x[:, states == k]
        means[:, k] = rows.mean(axis=1)
        rows = rows - means[:, k, None]
        covariances[:, k] = rows.swapaxes(1, 2) @ rows / rows.shape[1]
    values, U = np.linalg.eigh(covariances)
    values = np.maximum(values[..., ::-1], 0.0)
    return _StateStatistics(means, values, U[..., ::-1], x - means[:, states], states)


def _subspace_thresholds(statistics: _StateStatistics, explained_variance: float) -> tuple[float, float]:
    """Return lambda_1, between the variances that explain the share and the others, and sigma^2."""
    P, K, D = statistics.variances.shape
    counts = np.bincount(statistics.states, minlength=K)
    shares = np.broadcast_to((counts / counts.sum())[:, None], (P, K, D))
    order = np.argsort(statistics.variances, axis=None)[::-1]
    values, weights = statistics.variances.ravel()[order], shares.ravel()[order]
    values, weights = values[weights > 0.0], weights[weights > 0.0]
    explained = np.cumsum(values * weights)
    n = min(int(np.searchsorted(explained, explained_variance * explained[-1])) + 1, len(values) - 1)
    tiny = np.finfo(float).tiny
    if n == 0:  # one direction
        return max(2.0 * float(values[0]), tiny), max(float(values[0]), tiny)
    dimension = float(np.sqrt(values[n - 1] * max(values[n], tiny)))
    rest = weights[n:].sum()
    noise = float((explained[-1] - explained[n - 1]) / rest)
    return max(dimension, tiny), max(noise, float(values[-1]), tiny)


def _squared_projections(statistics: _StateStatistics, dimension: float) -> Float[Array, "P N"]:
    """Return the squared length of each error inside the subspace of its state."""
    inside = np.empty(statistics.errors.shape[:2])
    for p, errors in enumerate(statistics.errors):
        projections = np.einsum("ndi,nd->ni", statistics.directions[p][statistics.states], errors)
        signal = statistics.variances[p] > dimension
        signal[:, -1] = False  # of D directions at most D - 1
        inside[p] = (projections**2 * signal[statistics.states]).sum(axis=1)
    return inside


def _set_merge_distance(means: Float[Array, "P K D"], maintenance: Maintenance) -> Maintenance:
    K = means.shape[1]
    if maintenance.merge_distance is not None or K == 1:
        return maintenance
    joint = means.transpose(1, 0, 2).reshape(K, -1)
    squares = np.sum((joint[:, None] - joint) ** 2, axis=2)
    least = float(np.min(squares[~np.eye(K, dtype=bool)]))
    return replace(maintenance, merge_distance=0.5 * float(np.sqrt(least)))
