"""Bounds that decide a fit. They are not errors: they are found after the fit and reported.

A maximum duration binds where a noticeable share of the expected segments of a state has that length: longer
segments would have been likelier. A regularisation binds where it is nearly the whole variance: the spread
of the demonstrations is then below it, and the deviations of the skill are those of the regularisation.
"""

from collections.abc import Iterator

import numpy as np

from pilotfish.gaussians.structures import Full
from pilotfish.models.demonstrated_ranges import coordinate_parts
from pilotfish.models.durations import Segments
from pilotfish.models.skill import Skill
from pilotfish.validation import short_list

MIN_SEGMENT_SHARE = 0.05  # of the segments of a state that have the maximum duration
MIN_REGULARISATION_SHARE = 0.9  # of a variance
MIN_ROWS_PER_COLUMN = 3.0  # of a state with a full covariance


def duration_bounds(segments: Segments, max_duration: int) -> tuple[str, ...]:
    """Return a sentence if segments reach the maximum duration.

    Args:
        segments: Expected segments of the fit.
        max_duration: Longest segment that was allowed [steps].
    """
    counts = segments.uncensored + segments.right_censored + segments.left_censored + segments.doubly_censored
    shares = counts[max_duration - 1 :].sum(axis=0) / np.maximum(counts.sum(axis=0), 1e-300)
    if not (reached := np.flatnonzero(shares > MIN_SEGMENT_SHARE)).size:
        return ()
    states = f"state{'s' if len(reached) > 1 else ''} {short_list(reached.tolist())}"
    note = (
        f"max_duration is {max_duration} steps, which up to {shares.max():.0%} of the segments of {states} "
        "reach: the demonstrations stay longer in one place; raise max_duration, or leave it out"
    )
    return (note,)


def regularisation_bounds(skill: Skill) -> tuple[str, ...]:
    """Return a sentence for each frame in which the regularisation is the variance of half of the states.

    A state counts if it is so for at least half of the columns of coordinates that vary and do not switch.

    Args:
        skill: Skill that was learned with a given regularisation.
    """
    added, columns = skill.regularisation, _varying_columns(skill)
    if added is None or not added.any() or not columns:
        return ()
    notes = []
    for name, covariances in zip(skill.frame_names, skill.covariances, strict=True):
        variances = np.diagonal(covariances.dense, axis1=1, axis2=2)[:, columns]
        at_floor = (added[columns] >= MIN_REGULARISATION_SHARE * variances).mean(axis=1) >= 0.5
        if at_floor.mean() >= 0.5:
            notes.append(
                f"regularisation is {added[columns].max():.3g}, which is the variance of {at_floor.sum()} of "
                f"{len(at_floor)} states in frame {name!r}: the demonstrations agree better than that; lower "
                "regularisation, or leave it out"
            )
    return tuple(notes)


def structure_notes(skill: Skill) -> tuple[str, ...]:
    """Return a sentence if there are few datapoints per state for full covariances.

    Args:
        skill: Learned skill.
    """
    source, columns = skill.provenance, skill.layout.tangent.width
    rows = source.datapoints / skill.states
    if source.structure != Full().label or rows >= MIN_ROWS_PER_COLUMN * columns:
        return ()
    note = (
        f"a state has {rows:.3g} datapoints for full covariances of {columns} columns, expected at least "
        f"{MIN_ROWS_PER_COLUMN * columns:.0f}: take diagonal covariances, fewer states, or more "
        "demonstrations"
    )
    return (note,)


def _varying_columns(skill: Skill) -> list[int]:
    """Return the tangent columns of coordinates that vary in the demonstrations and do not switch."""
    return list(_iterate_columns(skill)) if skill.demonstrated else []


def _iterate_columns(skill: Skill) -> Iterator[int]:
    demonstrated, layout = skill.demonstrated, skill.layout
    assert demonstrated is not None
    pairs = zip(coordinate_parts(layout), coordinate_parts(layout.tangent), strict=True)
    for (_, columns), (_, tangent) in pairs:
        varies = (demonstrated.highest > demonstrated.lowest)[columns].any()
        if varies and not set(layout.names[columns]) & set(demonstrated.switches):
            yield from range(tangent.start, tangent.stop)
