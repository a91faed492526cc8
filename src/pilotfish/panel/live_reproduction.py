"""Reproduction of a skill while its objects are moved: one computation per situation."""

from collections.abc import Sequence
from dataclasses import dataclass

from pilotfish.demonstrations import Frame
from pilotfish.errors import SkillError
from pilotfish.models import AdaptedSkill, Skill, adapt
from pilotfish.planning import Reproduction, mean_demonstration_length, motion_notes, reproduce_adapted
from pilotfish.validation import require_type, shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class LiveReproduction:
    """Skill and motion in one situation.

    Attributes:
        adapted: Adapted skill; None if the frames do not fit together.
        reproduction: Motion; None if it cannot be planned.
        problem: Why the motion is missing; empty if it is not.
    """

    adapted: AdaptedSkill | None
    reproduction: Reproduction | None
    problem: str


def compute_reproduction(skill: Skill, frames: Sequence[Frame]) -> LiveReproduction:
    """Adapt a skill to frames and plan its motion.

    Args:
        skill: Learned skill.
        frames: Frame of each object of the skill.

    Returns:
        Adapted skill and motion. A skill that cannot be adapted or planned gives the reason instead.

    Raises:
        InvalidInput: If an argument has another type.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    require_type(frames, "frames", Sequence, "give a list of frames, say a demonstration's .frames")
    adapted = None
    try:
        adapted = adapt(skill, frames)
        reproduction = reproduce_adapted(adapted, horizon=mean_demonstration_length(skill))
    except SkillError as error:
        return LiveReproduction(adapted, None, str(error))
    return LiveReproduction(adapted, reproduction, "")


def reproduction_notes(skill: Skill, live: LiveReproduction, frames: Sequence[Frame]) -> tuple[str, ...]:
    """Compare a motion with the demonstrations, which takes as long as to compute it.

    Args:
        skill: Learned skill.
        live: Its motion.
        frames: Frames with which it was computed.

    Returns:
        Notes of `planning.motion_notes`; empty without a motion.

    Raises:
        InvalidInput: If the skill or the motion has another type.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    require_type(live, "live", LiveReproduction, "compute_reproduction returns it")
    return motion_notes(skill, live.reproduction, frames) if live.reproduction else ()
