"""Initialisation of an online model from a batch fit of a few demonstrations.

The fit gives the states; the stream then continues from them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration
from pilotfish.models.online.estimation import LabelledViews, label_datapoints
from pilotfish.models.online.model import OnlineModel, count_ends, online_model
from pilotfish.models.online.settings import OnlineSettings
from pilotfish.models.sequences import state_segments
from pilotfish.models.skill import Skill
from pilotfish.types import Array, Float

Arrays = dict[str, Float[Array, "..."]]


def from_batch_fit(
    skill: Skill, demonstrations: Sequence[Demonstration], settings: OnlineSettings
) -> OnlineModel:
    """Create an online model from a batch fit and its demonstrations.

    Each state becomes a cluster with its means and covariances. Datapoints, transitions and segments are
    those of the most probable state sequences; the last segment of each demonstration is right-censored.
    Weights are the numbers of datapoints, limited to 1 / (1 - discount) under exponential decay. A state
    that no sequence contains is left out.

    Args:
        skill: Batch fit.
        demonstrations: Demonstrations that it was learned from.
        settings: Learner, penalties and scales, for example those of `estimate_penalties`.

    Returns:
        A model ready for the next datapoint.

    Raises:
        InvalidInput: If the skill and the demonstrations do not belong together.
    """
    data = label_datapoints(skill, demonstrations)
    model = online_model(settings, skill.layout, skill.period, skill.frame_names)
    parameters, states = model.parameters, data[2]
    capacity = min(parameters.max_dimension + parameters.extra_directions, skill.width)
    arrays = kernels.zero_arrays(skill.states, len(skill.frame_names), skill.width, capacity)
    points = np.bincount(states, minlength=skill.states).astype(np.float64)
    arrays["points"] = points
    arrays["weights"] = np.array([settings.maintenance.initial_weight(n) for n in points.tolist()])
    _count_transitions_and_segments(arrays, data)
    scales = np.ones(skill.width) if model.scales is None else model.scales[0]
    for p, covariances in enumerate(skill.covariances):
        for k, covariance in enumerate(covariances.dense / np.outer(scales, scales)):
            _fill_subspace(arrays, (k, p), skill.means[p, k] / scales, covariance, parameters)
    counts = arrays.pop("transition_counts")
    kept = points > 0.0
    arrays = {name: values[kept] for name, values in arrays.items()}
    arrays |= {"transition_counts": counts[kept][:, kept], "cluster_ids": np.arange(kept.sum(), dtype=float)}
    counters = model.state.to_counters() | {"next_cluster_id": int(kept.sum()), "datapoints": len(states)}
    model = replace(model, state=kernels.StreamState.from_arrays(arrays, counters))
    for x in np.split(data[0], np.cumsum(data[1])[:-1], axis=1):
        model = count_ends(model, x)
    return model


def _count_transitions_and_segments(arrays: Arrays, data: LabelledViews) -> None:
    _, lengths, labels = data
    for states in np.split(labels, np.cumsum(lengths)[:-1]):
        np.add.at(arrays["transition_counts"], (states[:-1], states[1:]), 1.0)
        segment_states, durations = (values.tolist() for values in state_segments(states))
        arrays["demonstration_starts"][segment_states[0]] += 1.0
        for k, steps in zip(segment_states[:-1], durations[:-1], strict=True):
            deviation = _update_mean(arrays["segments"], arrays["mean_durations"], k, steps)
            arrays["squared_deviations"][k] += deviation * (steps - arrays["mean_durations"][k])
        _update_mean(arrays["censored"], arrays["mean_censored_durations"], segment_states[-1], durations[-1])


def _update_mean(counts: Float[Array, " K"], means: Float[Array, " K"], k: int, value: int) -> float:
    """Add a value to the running mean of k; return its deviation from the mean before (Welford)."""
    counts[k] += 1.0
    deviation = float(value - means[k])
    means[k] += deviation / counts[k]
    return deviation


def _fill_subspace(
    arrays: Arrays,
    index: tuple[int, int],
    mean: Float[Array, " D"],
    covariance: Float[Array, "D D"],
    parameters: kernels.StreamParameters,
) -> None:
    """Store the leading directions of a covariance; those of variance above lambda_1 are the subspace."""
    values, U = np.linalg.eigh(covariance)
    values, U = np.maximum(values[::-1], 0.0), U[:, ::-1]
    d = min(int(np.sum(values > parameters.dimension)), parameters.max_dimension)
    r = min(d + parameters.extra_directions, len(mean))
    arrays["dimensions"][index], arrays["ranks"][index] = d, r
    arrays["means"][index], arrays["variances"][index][:r] = mean, values[:r]
    arrays["bases"][index][:, :r] = U[:, :r]
    outside = values.sum() - np.concatenate([[0.0], np.cumsum(values[:r])])
    arrays["distances"][index][: r + 1] = np.maximum(outside, 0.0)
