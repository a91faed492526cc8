"""Errors of the demo at the grasp and at the release, in mm and degrees, with values to compare them with.

Grasp and release are the steps at which the demonstrated hand is nearest to the valve before and after the
turn. The motion need not pass them at the same time: its error is taken where it is nearest to the
demonstrated position.
"""

from collections.abc import Sequence

import numpy as np

from pilotfish.cli.demo.evaluation_tables import StructureEvaluation
from pilotfish.cli.demo.protocol import TRAINING_DEMONSTRATIONS
from pilotfish.cli.output.tables import Table
from pilotfish.demonstrations import Demonstration, Frame, Quantity
from pilotfish.geometry import angle
from pilotfish.models import Skill
from pilotfish.types import Array, Float

EVENTS = ("grasp", "release")  # in the order of the frames: before and after the turn
HEADER = ("at", "motion in new situations", "position [mm]", "orientation [deg]")
CAPTION = (
    "Errors at grasp and release in new situations. Good: within the learned deviation, far below the mean "
    "of the demonstrations; the best possible is the demonstrations' own spread"
)


def grasp_error_table(evaluation: StructureEvaluation) -> Table:
    """Return errors at grasp and release in the new situations, and what to compare them with.

    The rows are the reproduction, the learned deviation of the state at that time, the spread of the training
    demonstrations about their mean in the frame of the event, and the mean of the training demonstrations,
    shifted to start and end at the poses of the test demonstration.

    Args:
        evaluation: Reproductions that start at the first point of each demonstration.
    """
    demos, n = evaluation.demonstrations, TRAINING_DEMONSTRATIONS
    motions = [reproduction.motion.x for reproduction in evaluation.from_first_point[n:]]
    baseline = [mean_with_offsets(demos[:n], demo) for demo in demos[n:]]
    rows = []
    for p, event in enumerate(EVENTS):
        values = {
            f"reproduction, {evaluation.structure.label}": _mean_error(motions, demos[n:], p),
            "learned deviation there": learned_deviation(evaluation.fit.skill, demos[:n], p),
            "spread of the demonstrations": demonstrated_spread(demos[:n], p),
            "mean of the demonstrations with offsets": _mean_error(baseline, demos[n:], p),
        }
        rows += [
            (event, name, f"{1000.0 * distance:.0f}", f"{np.degrees(rotation):.1f}")
            for name, (distance, rotation) in values.items()
        ]
    return Table(HEADER, tuple(rows), CAPTION, right_aligned=True)


def event_step(demonstration: Demonstration, frame: int) -> int:
    """Return the step at which the hand is nearest to the origin of a frame."""
    position, _ = _pose_columns(demonstration)
    origin = _static_frame(demonstration, frame).b[position]
    return int(np.linalg.norm(demonstration.x[:, position] - origin, axis=1).argmin())


def error_at(x: Float[Array, "T D"], demonstration: Demonstration, frame: int) -> tuple[float, float]:
    """Return the distance [m] at which a motion passes the demonstrated event, and the angle there [rad]."""
    position, orientation = _pose_columns(demonstration)
    target = demonstration.x[event_step(demonstration, frame)]
    distances = np.linalg.norm(x[:, position] - target[position], axis=1)
    nearest = int(distances.argmin())
    return float(distances[nearest]), float(angle(x[nearest, orientation], target[orientation]))


def learned_deviation(
    skill: Skill, demonstrations: Sequence[Demonstration], frame: int
) -> tuple[float, float]:
    """Return the deviation [m, rad] of the state whose mean is nearest to the demonstrated event.

    A quaternion deviates by half of the angle.
    """
    position, orientation = _pose_columns(demonstrations[0])
    events = [_to_frame(d, frame)[event_step(d, frame)] for d in demonstrations]
    state = int(
        np.linalg.norm(skill.means[frame][:, position] - np.mean(events, axis=0)[position], axis=1).argmin()
    )
    variances = np.diagonal(skill.covariances[frame].dense[state])
    return float(np.sqrt(variances[position].sum())), 2.0 * float(np.sqrt(variances[orientation].sum()))


def demonstrated_spread(demonstrations: Sequence[Demonstration], frame: int) -> tuple[float, float]:
    """Return the root mean square deviation [m, rad] of the demonstrated events in the frame."""
    position, orientation = _pose_columns(demonstrations[0])
    events = np.array([_to_frame(d, frame)[event_step(d, frame)] for d in demonstrations])
    mean = events.mean(axis=0)
    distances = np.linalg.norm(events[:, position] - mean[position], axis=1)
    angles = np.array([angle(event[orientation], mean[orientation]) for event in events])
    return float(np.sqrt(np.mean(distances**2))), float(np.sqrt(np.mean(angles**2)))


def mean_with_offsets(
    demonstrations: Sequence[Demonstration], situation: Demonstration
) -> Float[Array, "T D"]:
    """Return the mean of demonstrations in the world, shifted to start and end where another one does.

    The shift changes linearly over time; quaternions are shifted like the other columns, and only their
    direction matters.
    """
    steps = np.linspace(0.0, 1.0, len(situation.x))
    _, orientation = _pose_columns(situation)
    resampled = []
    for demo in demonstrations:
        times = np.linspace(0.0, 1.0, len(demo.x))
        x = np.column_stack([np.interp(steps, times, column) for column in demo.x.T])
        x[:, orientation] *= np.copysign(1.0, x[0, orientation] @ situation.x[0, orientation])  # q and -q
        resampled.append(x)
    mean = np.mean(resampled, axis=0)
    start, end = situation.x[0] - mean[0], situation.x[-1] - mean[-1]
    return np.asarray(mean + (1.0 - steps)[:, None] * start + steps[:, None] * end)


def _static_frame(demonstration: Demonstration, frame: int) -> Frame:
    static = [each for each in demonstration.frames if isinstance(each, Frame)]
    return static[frame]


def _to_frame(demonstration: Demonstration, frame: int) -> Float[Array, "T D"]:
    """Return the demonstration in the columns of a frame."""
    given = _static_frame(demonstration, frame)
    return np.linalg.solve(given.A, (demonstration.x - given.b).T).T


def _pose_columns(demonstration: Demonstration) -> tuple[slice, slice]:
    """Return the columns of position and quaternion."""
    layout = demonstration.layout
    found = {
        part.quantity: columns
        for part, columns in zip(layout.parts, layout.slices, strict=True)
        if part.derivative == 0
    }
    return found[Quantity.POSITION], found[Quantity.QUATERNION]


def _mean_error(
    motions: Sequence[Float[Array, "T D"]], demonstrations: Sequence[Demonstration], frame: int
) -> tuple[float, float]:
    errors = [error_at(x, demo, frame) for x, demo in zip(motions, demonstrations, strict=True)]
    distance, rotation = np.mean(errors, axis=0).tolist()
    return distance, rotation
