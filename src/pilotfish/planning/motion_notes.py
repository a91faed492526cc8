"""Notes about a motion: what differs from the demonstrations of its skill, and what may help.

Each note compares one quantity with the demonstrations (`models/demonstrated_ranges.py`):

    frames      the situation is farther from those of the demonstrations than they are from each other
    start       the robot does not begin where the demonstrations began
    horizon     the motion is much shorter or longer than the demonstrations
    states      the motion passes a state at a distance, although the state was learned precisely
    end         the motion does not end where the demonstrations ended
    size, speed, acceleration      they are not those of the demonstrations

The limits are wide: a motion in a situation like those of the demonstrations, at defaults, has no note.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.demonstrations import Frame, Layout, MovingFrame, Part, Quantity
from pilotfish.models import (
    AdaptedSkill,
    DemonstrationStatistics,
    Skill,
    coordinate_parts,
    frame_angle,
    measure_motion,
)
from pilotfish.planning.costs import scales
from pilotfish.planning.far_starts import far_starts
from pilotfish.planning.reproduction import Reproduction
from pilotfish.types import Array, Float

MAX_STATE_DEVIATIONS = 4.0  # standard deviations of a state at which the motion may pass it
MAX_END_DEVIATIONS = 6.0  # of start and end, each estimated from one row per demonstration
PRECISE = 0.15  # of the scale: the motion may cut a corner at a state of larger deviation
MIN_GAP = 0.05  # of the scale: a state or an end that is missed by less is not reported
MIN_START_GAP = 0.2  # of the scale
EARLY = 0.25  # of the steps, in which a motion may still be on its way from its start
MIN_ANGLE = np.radians(15.0)  # of an orientation that is reported
MAX_EXTRA_ANGLE = np.radians(90.0)  # of a frame, beyond the angles of the demonstrations
SIZES = (0.8, 1.25)  # of the smallest and of the largest size
MIN_STEP = 1e-3  # of the scale: a speed or an acceleration that moves less in a period is not reported
MAX_SPEED_RATIO, MAX_ACCELERATION_RATIO = 2.0, 3.0  # to the largest of the demonstrations
HORIZONS = (0.5, 2.0)  # of the shortest and of the longest demonstration

NameArgument = Callable[[str], str]
"""Function from the name of a Python argument to what the user knows it by, such as an option."""


@dataclass(frozen=True, slots=True)
class _PartOfMotion:
    """Part of coordinates with what the notes need of it; distances are in its unit, or in radians."""

    index: int  # among the parts of coordinates
    part: Part
    columns: slice
    tangent: slice
    scale: float

    @property
    def turns(self) -> bool:
        return self.part.quantity in (Quantity.QUATERNION, Quantity.ORIENTATION)

    def distances(self, layout: Layout, x: Float[Array, "T D"], y: Float[Array, " D"]) -> Float[Array, " T"]:
        gaps = layout.distances(self.columns, x, y)
        return np.asarray(np.radians(gaps)) if self.turns else gaps

    def deviations_away(
        self, layout: Layout, x: Float[Array, "T D"], y: Float[Array, " D"], covariance: Float[Array, "E E"]
    ) -> Float[Array, " T"]:
        """Return distances in standard deviations: those of an angle are the largest, in any direction."""
        block = covariance[self.tangent, self.tangent]
        if self.turns:
            unit = 2.0 if self.part.quantity is Quantity.QUATERNION else 1.0  # |dq| is half an angle
            return np.asarray(self.distances(layout, x, y) / (unit * np.sqrt(np.linalg.eigvalsh(block)[-1])))
        gaps = x[:, self.columns] - y[self.columns]
        return np.asarray(np.sqrt(np.einsum("ti,it->t", gaps, np.linalg.solve(block, gaps.T))))

    def deviation(self, covariance: Float[Array, "E E"]) -> float:
        """Return the root mean square of the standard deviations of the columns."""
        unit = 2.0 if self.part.quantity is Quantity.QUATERNION else 1.0
        return float(unit * np.sqrt(np.mean(np.diag(covariance)[self.tangent])))

    def smallest_gap(self, fraction: float) -> float:
        """Return a fraction of the scale, and at least 15 degrees of an orientation."""
        return max(fraction * self.scale, MIN_ANGLE if self.turns else 0.0)

    def format(self, value: float, rate: str = "") -> str:
        """Return a distance with its unit, or a rate of it."""
        if self.turns:
            return f"{np.degrees(value):.3g} deg{rate}"
        if self.part.unit == "m" and not rate and value < 1.0:
            return f"{1e3 * value:.3g} mm"
        return f"{value:.3g} {self.part.unit}{rate}"


def motion_notes(
    skill: Skill,
    reproduction: Reproduction,
    frames: Sequence[Frame | MovingFrame],
    *,
    name_argument: NameArgument = str,
) -> tuple[str, ...]:
    """Compare a motion and its situation with the demonstrations of the skill.

    Args:
        skill: Learned skill; without statistics of its demonstrations, only a far start is noted.
        reproduction: Motion of the skill, from `reproduce`.
        frames: Frames with which it was computed.
        name_argument: Names the arguments of `reproduce` for the reader, such as options of a command.

    Returns:
        One sentence for each difference, with its remedy; empty if the motion is like the demonstrations.

    Example:
        >>> pf.planning.motion_notes(skill, pf.reproduce(skill, frames), frames)  # doctest: +SKIP
        ()
    """
    demonstrated, far = skill.demonstrated, far_starts(reproduction.adapted, reproduction.motion.x[0])
    if demonstrated is None:
        return tuple(far.values())
    parts = _parts(reproduction.adapted, demonstrated)
    near = [part for part in parts if part.part.name not in far]
    return (
        *_frame_notes(skill, demonstrated, frames, parts, name_argument),
        *far.values(),
        *_start_notes(reproduction, demonstrated, near, name_argument),
        *_horizon_notes(reproduction, demonstrated, name_argument),
        *_state_notes(skill, reproduction, parts, name_argument),
        *_end_notes(reproduction, parts, name_argument),
        *_size_notes(reproduction, demonstrated, parts, name_argument),
        *_rate_notes(reproduction, demonstrated, parts, name_argument),
    )


def _parts(adapted: AdaptedSkill, demonstrated: DemonstrationStatistics) -> list[_PartOfMotion]:
    """Return the parts of coordinates that do not switch."""
    layout, all_scales = adapted.layout, scales(adapted)
    pairs = zip(coordinate_parts(layout), coordinate_parts(layout.tangent), strict=True)
    parts = []
    for index, ((part, columns), (_, tangent)) in enumerate(pairs):
        if not set(layout.names[columns]) & set(demonstrated.switches):
            factor = 2.0 if part.quantity is Quantity.QUATERNION else 1.0
            parts.append(_PartOfMotion(index, part, columns, tangent, factor * float(all_scales[tangent][0])))
    return parts


def _frame_notes(
    skill: Skill,
    demonstrated: DemonstrationStatistics,
    frames: Sequence[Frame | MovingFrame],
    parts: Sequence[_PartOfMotion],
    name_argument: NameArgument,
) -> Iterator[str]:
    """Compare origins and orientations of the frames with those of the demonstrations."""
    positions = [part for part in parts if part.part.quantity is Quantity.POSITION]
    if not positions:
        return
    position, ranges, given = positions[0], demonstrated.frames, {frame.name: frame for frame in frames}
    check = f"check {name_argument('frames')}"
    for p, name in enumerate(skill.frame_names):
        b = given[name].at(0).b[position.columns]
        lowest, highest = ranges.lowest[p, position.columns], ranges.highest[p, position.columns]
        gap = float(np.linalg.norm(np.maximum(np.maximum(lowest - b, b - highest), 0.0)))
        extent = float(np.linalg.norm(highest - lowest))
        if gap > extent + position.scale:
            yield (
                f"frame {name!r} is {position.format(gap)} from where it was in the demonstrations, which "
                f"cover {position.format(extent)}: {check}, and their unit"
            )
        angle = frame_angle(given[name], ranges.orientations[p], skill.layout)
        if angle > ranges.angles[p] + MAX_EXTRA_ANGLE:
            yield (
                f"frame {name!r} is rotated by {np.degrees(angle):.0f} deg from the demonstrations, where it "
                f"was rotated by at most {np.degrees(ranges.angles[p]):.0f} deg: {check}; quaternions are "
                "w x y z"
            )


def _start_notes(
    reproduction: Reproduction,
    demonstrated: DemonstrationStatistics,
    parts: Sequence[_PartOfMotion],
    name_argument: NameArgument,
) -> Iterator[str]:
    """Compare the start with the first rows of the demonstrations, in the frames and in the world."""
    if (ends := reproduction.adapted.endpoints) is None:
        return
    ranges, start = demonstrated.motion, reproduction.motion.x[:1]
    for part, gap, deviation in _missed(reproduction, ends, 0, parts, MIN_START_GAP):
        from_first = float(part.distances(reproduction.adapted.layout, start, ranges.start)[0])
        if from_first > 2.0 * ranges.start_distances[part.index] + part.smallest_gap(MIN_START_GAP):
            yield (
                f"the start is {part.format(gap)} from where the demonstrations began in {part.part.name} "
                f"(they vary by {part.format(deviation)}): the way from there was not demonstrated; check "
                f"{name_argument('start')}, or demonstrate it"
            )


def _end_notes(
    reproduction: Reproduction, parts: Sequence[_PartOfMotion], name_argument: NameArgument
) -> Iterator[str]:
    """Compare the last row with the last rows of the demonstrations."""
    if (ends := reproduction.adapted.endpoints) is None:
        return
    for part, gap, deviation in _missed(reproduction, ends, 1, parts, MIN_GAP):
        yield (
            f"the motion ends {part.format(gap)} from where the demonstrations ended in {part.part.name} "
            f"(they vary by {part.format(deviation)}): {_remedy(name_argument)}"
        )


def _missed(
    reproduction: Reproduction,
    ends: AdaptedSkill,
    n: int,
    parts: Sequence[_PartOfMotion],
    min_gap: float,
) -> Iterator[tuple[_PartOfMotion, float, float]]:
    """Return the parts in which the first or last row is far from end point n, with gap and deviation."""
    x, layout = reproduction.motion.x[[0, -1]][[n]], reproduction.adapted.layout
    for part in parts:
        gap = float(part.distances(layout, x, ends.means[n])[0])
        away = float(part.deviations_away(layout, x, ends.means[n], ends.covariances[n])[0])
        if away > MAX_END_DEVIATIONS and gap > part.smallest_gap(min_gap):
            yield part, gap, part.deviation(ends.covariances[n])


def _horizon_notes(
    reproduction: Reproduction, demonstrated: DemonstrationStatistics, name_argument: NameArgument
) -> Iterator[str]:
    """Compare the number of steps with those of the demonstrations."""
    steps, ranges = len(reproduction.motion.x), demonstrated.motion
    if not HORIZONS[0] * ranges.shortest <= steps <= HORIZONS[1] * ranges.longest:
        lengths = f"{ranges.shortest}"
        if ranges.longest > ranges.shortest:
            lengths += f" to {ranges.longest}"
        speed = "faster" if steps < ranges.shortest else "slower"
        yield (
            f"the motion has {steps} steps, the demonstrations {lengths}: the movement is much {speed} than "
            f"demonstrated; change {name_argument('horizon')} if this is not intended"
        )


def _state_notes(
    skill: Skill,
    reproduction: Reproduction,
    parts: Sequence[_PartOfMotion],
    name_argument: NameArgument,
) -> Iterator[str]:
    """Compare the distance at which the motion passes each state with the state's deviation.

    The place of a state is the target in the middle of its steps, which via-points may have moved.
    """
    adapted, x, targets = reproduction.adapted, reproduction.motion.x, reproduction.targets
    visited = np.unique(reproduction.states)
    middles = [
        steps[len(steps) // 2] for k in visited if len(steps := np.flatnonzero(reproduction.states == k))
    ]
    early = EARLY * len(x)
    for part in parts:
        missed, offset = [], float(part.distances(adapted.layout, x[:1], targets[0])[0])
        for k, t in zip(visited, middles, strict=True):
            gap = float(part.distances(adapted.layout, x, targets[t]).min())
            away = float(part.deviations_away(adapted.layout, x, targets[t], adapted.covariances[k]).min())
            is_precise = gap <= PRECISE * part.scale * away
            if t < early and gap <= offset:  # the way from a start that differs
                continue
            if is_precise and away > MAX_STATE_DEVIATIONS and gap > part.smallest_gap(MIN_GAP):
                missed.append((away, int(k), gap))
        if missed:
            _, k, gap = max(missed)
            deviation, name = min(
                (part.deviation(covariances.dense[k]), name)
                for covariances, name in zip(skill.covariances, skill.frame_names, strict=True)
            )
            others = f", and {len(missed) - 1} other states at a distance" if len(missed) > 1 else ""
            yield (
                f"state {k} was learned to {part.format(deviation)} in {part.part.name} in frame {name!r}, "
                f"but the motion passes it at {part.format(gap)}{others}: {_remedy(name_argument)}"
            )


def _size_notes(
    reproduction: Reproduction,
    demonstrated: DemonstrationStatistics,
    parts: Sequence[_PartOfMotion],
    name_argument: NameArgument,
) -> Iterator[str]:
    """Compare the size with that of the demonstrations and, as situations differ, with that of the plan."""
    motion, layout, ranges = reproduction.motion, reproduction.adapted.layout, demonstrated.motion
    sizes = measure_motion(motion.x, layout, motion.period)[0]
    planned = np.vstack([motion.x[:1], reproduction.targets])  # from the same start
    planned_sizes = measure_motion(planned, layout, motion.period)[0]
    for part in parts:
        n = part.index
        size, planned_size, smallest, largest = (
            float(values[n]) for values in (sizes, planned_sizes, ranges.smallest_sizes, ranges.largest_sizes)
        )
        is_small = size < SIZES[0] * min(smallest, planned_size)
        if not part.turns and (is_small or size > SIZES[1] * max(largest, planned_size)):
            remedy = _remedy(name_argument) if is_small else f"check {name_argument('start')}"
            yield (
                f"the motion goes {part.format(size)} from its start in {part.part.name}, the demonstrations "
                f"{part.format(smallest)} to {part.format(largest)}: {remedy}"
            )


def _rate_notes(
    reproduction: Reproduction,
    demonstrated: DemonstrationStatistics,
    parts: Sequence[_PartOfMotion],
    name_argument: NameArgument,
) -> Iterator[str]:
    """Compare speed and acceleration with those of the demonstrations."""
    motion, ranges = reproduction.motion, demonstrated.motion
    _, speeds, accelerations = measure_motion(motion.x, reproduction.adapted.layout, motion.period)
    for part in parts:
        n = part.index
        for kind, values, limits, ratio, rate in (
            ("speed", speeds, ranges.speeds, MAX_SPEED_RATIO, "/s"),
            ("acceleration", accelerations, ranges.accelerations, MAX_ACCELERATION_RATIO, "/s²"),
        ):
            if kind == "acceleration" and part.turns:  # small turns of precise states begin abruptly
                continue
            is_large = float(values[n]) * motion.period ** len(rate[1:]) > MIN_STEP * part.scale
            if is_large and values[n] > ratio * limits[n]:
                yield (
                    f"the largest {kind} is {part.format(values[n], rate)} in {part.part.name}, that of the "
                    f"demonstrations {part.format(limits[n], rate)}: check {name_argument('start')} and "
                    f"{name_argument('frames')}, or give a longer {name_argument('horizon')}"
                )


def _remedy(name_argument: NameArgument) -> str:
    return (
        f"lower {name_argument('control_cost')} or {name_argument('covariance_regularisation')}, or give a "
        f"longer {name_argument('horizon')}"
    )
