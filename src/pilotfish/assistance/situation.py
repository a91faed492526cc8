"""A skill in the scene observed and in the actual scene, adapted again only when a frame changes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pilotfish.assistance.assistant import AssistedSkill
from pilotfish.assistance.carried import carried_situation
from pilotfish.assistance.coordinates import coordinate_frames
from pilotfish.assistance.literal import LiteralSituation, literal_situation
from pilotfish.assistance.operator_noise import OperatorNoise
from pilotfish.demonstrations import Frame
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.kernels import CarriedModel
from pilotfish.validation import require_type, shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """A skill adapted to the frames observed and to the actual frames.

    Attributes:
        observed: Frames that the operator sees, of the coordinates.
        actual: Frames of the actual objects, of the coordinates.
        carried: The skill in both.
        literal: The joint skill in the actual frames; None for the carried variant.
        is_current: Whether the last frames could be used.
        given: Frames as they were given, usable or not, to notice at little cost that nothing has changed;
            empty if they were stale.
    """

    observed: tuple[Frame, ...]
    actual: tuple[Frame, ...]
    carried: CarriedModel
    literal: LiteralSituation | None
    is_current: bool
    given: tuple[Frame, ...]


def find_situation(
    skill: AssistedSkill, observed: Sequence[Frame], actual: Sequence[Frame], noise: OperatorNoise
) -> Situation:
    """Adapt a skill to both sets of frames.

    Args:
        skill: Prepared skill.
        observed: Frames that the operator sees; those of other skills are left out.
        actual: Frames of the actual objects.
        noise: Imprecision of the operator.

    Raises:
        InvalidInput: If a frame is missing or cannot be used.
        NotPositiveDefinite: If a covariance is singular in these frames.
    """
    observed_frames, actual_frames = (_own_frames(skill, frames) for frames in (observed, actual))
    return Situation(
        observed_frames,
        actual_frames,
        carried_situation(skill.skill, observed_frames, actual_frames, noise.deviations(skill.skill.layout)),
        literal_situation(skill.joint, actual_frames) if skill.joint else None,
        is_current=True,
        given=(*observed, *actual),
    )


def update_situation(
    situation: Situation,
    skill: AssistedSkill,
    observed: Sequence[Frame] | None,
    actual: Sequence[Frame] | None,
    noise: OperatorNoise,
) -> Situation:
    """Return the situation of the present frames; the last one, not current, if they cannot be used.

    Args:
        situation: Situation of the step before.
        skill: Prepared skill, the same as before.
        observed: Frames that the operator sees; None if they are stale.
        actual: Frames of the actual objects; None if they are stale.
        noise: Imprecision of the operator.

    Raises:
        InvalidInput: If they are something else.
    """
    if observed is None or actual is None:
        return replace(situation, is_current=False, given=())
    try:
        given = (*observed, *actual)
    except TypeError:
        raise InvalidInput(
            "frames have no items, expected a list of frames, say a demonstration's .frames"
        ) from None
    if situation.given and _is_same_object(given, situation.given):
        return situation  # also if they could not be used: adapting again would fail again
    try:
        if _same_frames(situation.observed, _own_frames(skill, observed)) and _same_frames(
            situation.actual, _own_frames(skill, actual)
        ):
            return replace(situation, is_current=True, given=given)
        return find_situation(skill, observed, actual, noise)
    except SkillError:
        return replace(situation, is_current=False, given=given)


def _own_frames(skill: AssistedSkill, frames: Sequence[Frame]) -> tuple[Frame, ...]:
    """Return the frames of a skill, in its order, for its coordinates."""
    require_type(frames, "frames", Sequence, "give a list of frames, say a demonstration's .frames")
    for frame in frames:
        require_type(frame, "a frame", Frame, "of a moving frame give frame.at(t), its value at one step")
    by_name = {frame.name: frame for frame in frames}
    names = skill.skill.frame_names
    if missing := [name for name in names if name not in by_name]:
        raise InvalidInput(
            f"frame {missing[0]!r} is missing from {sorted(by_name)}, expected each of {list(names)}"
        )
    return coordinate_frames([by_name[name] for name in names], skill.layout)


def _is_same_object(now: tuple[object, ...], before: tuple[object, ...]) -> bool:
    return len(now) == len(before) and all(p is q for p, q in zip(now, before, strict=True))


def _same_frames(before: tuple[Frame, ...], now: tuple[Frame, ...]) -> bool:
    return all(
        np.array_equal(p.A, q.A) and np.array_equal(p.b, q.b) for p, q in zip(before, now, strict=True)
    )
